# Copyright 2026 The rt_robot_os authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Shared by the commands: the location of the database, and opening its accounts."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
import getpass
from pathlib import Path
import sys
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.needs import require
from rt_robot_os.base.requirements import EXTRAS
from rt_robot_os.linux.folders import ros_home
from rt_robot_os.monitor.security.accounts import Accounts
from rt_robot_os.monitor.security.audit import Somebody
from rt_robot_os.monitor.security.users import AccountError
from rt_robot_os.monitor.settings import load
from rt_robot_os.monitor.settings import MonitorSettings
from rt_robot_os.monitor.store.store import Store

_DATABASE: Final = 'monitor.db'


def add_where(parser: argparse.ArgumentParser) -> None:
    """Add the options that select a monitor."""
    parser.add_argument('--folder', metavar='DIR', help='folder of the monitor (default: '
                        '~/.ros/monitor)')
    parser.add_argument('--database', metavar='URL', help='database (default: SQLite in FOLDER)')
    parser.add_argument('--params-file', action='append', default=[], metavar='FILE',
                        help='parameter file with a section /**/monitor that sets both')


def settings_of(arguments: argparse.Namespace) -> MonitorSettings:
    """
    Return the settings of the selected monitor.

    :raises ConfigError: they are not valid.
    """
    options = {name: value for name in ('folder', 'database')
               if (value := getattr(arguments, name, None)) is not None}
    return load([Path(each) for each in arguments.params_file], {}, options, ros_home())


@contextmanager
def opened(arguments: argparse.Namespace) -> Iterator[Accounts]:
    """
    Open the accounts.

    :raises ConfigError: the requested action is not possible.
    :raises RtRobotError: the database cannot be opened.
    """
    settings = settings_of(arguments)
    require('the monitor', *EXTRAS['monitor'])
    store = Store.open(settings.database or str(settings.where / _DATABASE))
    try:
        accounts = Accounts.open(store.engine, settings.where)
        try:
            yield accounts
        except AccountError as error:
            raise ConfigError([str(error)]) from None
        finally:
            accounts.close()
    finally:
        store.close()


def console() -> Somebody:
    """Return the actor for the audit: the user of this machine."""
    try:
        name = getpass.getuser()
    except (KeyError, OSError, ImportError):
        name = 'unknown'
    return Somebody(name, 'console')


def read_password(prompt: str) -> str:
    """
    Prompt for a new password twice; without a terminal read the first line of standard input.

    :raises ConfigError: the two differ, or there is none.
    """
    if not sys.stdin.isatty():
        found = sys.stdin.readline().rstrip('\r\n')
    else:
        found = getpass.getpass(f'{prompt}: ')
        if getpass.getpass('once more: ') != found:
            raise ConfigError(['the two differ: nothing was changed'])
    if not found:
        raise ConfigError(['no password: type one, or pipe it in'])
    return found


def add_command(commands: Any, name: str, run: object, what: str) -> argparse.ArgumentParser:
    """Add a command to a list of them."""
    one: argparse.ArgumentParser = commands.add_parser(
        name, help=what, description=what[0].upper() + what[1:] + '.', allow_abbrev=False)
    add_where(one)
    one.set_defaults(run=run)
    return one
