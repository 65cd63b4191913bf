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

"""`monitor database`: show version and size, back up, check, and erase a person."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
import json
from pathlib import Path
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.programs import FAILED
from rt_robot_os.base.programs import OK
from rt_robot_os.monitor.media_store import MediaStore
from rt_robot_os.monitor.security.commands.opening import add_command
from rt_robot_os.monitor.security.commands.opening import console
from rt_robot_os.monitor.security.commands.opening import opened
from rt_robot_os.monitor.security.commands.opening import settings_of
from rt_robot_os.monitor.store.engine import open_engine
from rt_robot_os.monitor.store.engine import read_url
from rt_robot_os.monitor.store.migrate import downgrade
from rt_robot_os.monitor.store.migrate import HEAD
from rt_robot_os.monitor.store.migrate import upgrade
from rt_robot_os.monitor.store.migrate import version
from rt_robot_os.monitor.store.migrate import versions
from rt_robot_os.monitor.store.person_name import key_of
from rt_robot_os.monitor.store.store import Store
from rt_robot_os.monitor.store.upkeep import backup
from rt_robot_os.monitor.store.upkeep import check
from rt_robot_os.monitor.store.upkeep import status
from sqlalchemy import Engine

_DATABASE: Final = 'monitor.db'


def add_to(commands: Any) -> None:
    """Add its parser."""
    parser = commands.add_parser('database', help='the database of records', allow_abbrev=False)
    words = parser.add_subparsers(dest='word', required=True, metavar='COMMAND')
    one = add_command(words, 'status', _status, 'show version, size and rows, in JSON')
    one = add_command(words, 'check', _check, 'check for damage; exit code 1 when there is any')
    one = add_command(words, 'backup', _backup, 'make a copy while it is in use')
    one.add_argument('file', type=Path, help='a file that does not exist yet')
    one = add_command(words, 'upgrade', _upgrade, 'upgrade it to a version; the server does this '
                      'when it starts')
    one.add_argument('version', nargs='?', default=HEAD, help='default: the newest')
    one = add_command(words, 'downgrade', _downgrade, 'downgrade it to a version; data that it '
                      'cannot store is deleted')
    one.add_argument('version', help='such as 0001; base deletes everything')
    one.add_argument('--yes', action='store_true', help='do it')
    one = add_command(words, 'erase', _erase, 'erase a person: observations, alarms about them '
                      'with their files, their name elsewhere; not in the audit nor in backups')
    one.add_argument('person', help='in any spelling; case is ignored')
    one.add_argument('--yes', action='store_true', help='do it')
    one.add_argument('--with-account', action='store_true', help='also the account of the user '
                     'with this name')
    one = add_command(words, 'aside', _aside, 'show invalid records, as lines of JSON')
    one.add_argument('--limit', type=int, default=100)


def _url(arguments: argparse.Namespace) -> str:
    settings = settings_of(arguments)
    return settings.database or str(settings.where / _DATABASE)


@contextmanager
def _store(arguments: argparse.Namespace) -> Iterator[Store]:
    """Open a database without upgrading it."""
    with _engine(arguments) as engine:
        found = version(engine)
        if found != versions()[-1]:
            raise ConfigError([f'its version is {found or "none"}, that of this release '
                               f'{versions()[-1]}: monitor database upgrade'])
        yield Store(engine)


@contextmanager
def _engine(arguments: argparse.Namespace) -> Iterator[Engine]:
    url = read_url(_url(arguments))
    path = Path(url.database or '')
    if url.get_backend_name() == 'sqlite' and not path.exists():
        raise ConfigError([f'there is no database {path}: choose one with --folder or --database'])
    engine = open_engine(url)
    try:
        yield engine
    finally:
        engine.dispose()


def _status(arguments: argparse.Namespace) -> int:
    with _engine(arguments) as engine:
        print(json.dumps({**status(Store(engine)), 'newest_version': versions()[-1]}, indent=1))
    return OK


def _check(arguments: argparse.Namespace) -> int:
    with _store(arguments) as store:
        problems = check(store)
    print(*(problems or ['no damage found']), sep='\n')
    return FAILED if problems else OK


def _backup(arguments: argparse.Namespace) -> int:
    with _store(arguments) as store:
        backup(store, arguments.file)
    print(f'{arguments.file}: {arguments.file.stat().st_size} bytes')
    return OK


def _upgrade(arguments: argparse.Namespace) -> int:
    with _engine(arguments) as engine:
        print(upgrade(engine, arguments.version))
    return OK


def _downgrade(arguments: argparse.Namespace) -> int:
    if not arguments.yes:
        raise ConfigError([f'version {arguments.version} cannot store newer data: that data '
                           'is deleted. Make a backup, then repeat with --yes'])
    with _engine(arguments) as engine:
        print(downgrade(engine, arguments.version) or 'empty')
    return OK


def _erase(arguments: argparse.Namespace) -> int:
    if not arguments.yes:
        raise ConfigError([f'{arguments.person} is erased permanently: repeat with --yes'])
    settings = settings_of(arguments)
    with _store(arguments) as store, opened(arguments) as accounts:
        erased = store.erase(arguments.person, arguments.with_account)
        media = MediaStore(settings.where / 'media', settings.media_mb, settings.media_days)
        gone = sum(media.forget(robot, sha256) for robot, sha256 in erased.files)
        # The audit proves the erasure to those who know the name, without storing the name.
        accounts.audit.note(console(), 'person.erase', accounts.audit.pseudonym(
            key_of(arguments.person)), **erased.rows)
    print(json.dumps({**asdict(erased), 'files_deleted': gone}, indent=1))
    return OK if any(erased.rows.values()) or erased.changed else FAILED


def _aside(arguments: argparse.Namespace) -> int:
    with _store(arguments) as store:
        for each in store.unknown(arguments.limit):
            print(json.dumps(each))
    return OK
