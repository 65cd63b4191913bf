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

"""`monitor robot`: the robots that may connect, and their tokens."""

from __future__ import annotations

import argparse
from datetime import datetime
import json
import os
from pathlib import Path
from typing import Any

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import StartError
from rt_robot_os.base.programs import OK
from rt_robot_os.monitor.security.accounts import Accounts
from rt_robot_os.monitor.security.commands.opening import add_command
from rt_robot_os.monitor.security.commands.opening import console
from rt_robot_os.monitor.security.commands.opening import opened


def add_to(commands: Any) -> None:
    """Add its parser."""
    parser = commands.add_parser('robot', help='robots that may connect', allow_abbrev=False)
    words = parser.add_subparsers(dest='word', required=True, metavar='COMMAND')
    one = add_command(words, 'add', _add, 'add a robot; prints its token, which is not stored')
    one.add_argument('name')
    one.add_argument('--token-file', type=Path, metavar='FILE', help='write the token there, '
                     'for its owner alone, rather than print it')
    one.add_argument('--people', nargs='*', metavar='PERSON', help='its residents; without '
                     'this, those of its hello wait for confirmation')
    one = add_command(words, 'people', _people, 'show or confirm who lives with which robot')
    one.add_argument('name', nargs='?', help='a robot; without it all are shown')
    one.add_argument('people', nargs='*', metavar='PERSON', help='its residents; they '
                     'replace those confirmed before')
    one.add_argument('--nobody', action='store_true', help='confirm that it has no residents')
    one = add_command(words, 'list', _list, 'show the robots')
    one.add_argument('--json', action='store_true', help='print JSON')
    one = add_command(words, 'revoke', _revoke, 'revoke the token of a robot; its connection ends')
    one.add_argument('name')


def _add(arguments: argparse.Namespace) -> int:
    file: Path | None = arguments.token_file
    with opened(arguments) as accounts:
        if file is not None and file.exists():
            raise StartError(f'{file} exists: nothing was done; remove it first')
        robot, token = accounts.robots.add(arguments.name)
        accounts.audit.note(console(), 'robot.add', robot.name)
        if arguments.people is not None:
            _confirm(accounts, robot.name, arguments.people)
        if file is None:
            print(token)
            return OK
        try:
            with open(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), 'w') as out:
                out.write(f'{token}\n')
        except OSError as error:
            accounts.robots.revoke(robot.id)
            raise StartError(f'{file}: {error.strerror}; nothing was done') from error
        print(f'{robot.name}: its token is in {file}')
    return OK


def _people(arguments: argparse.Namespace) -> int:
    with opened(arguments) as accounts:
        if arguments.people or arguments.nobody:
            if arguments.people and arguments.nobody:
                raise ConfigError(['--nobody and names of people: give only one of them'])
            _confirm(accounts, arguments.name, arguments.people)
        robots = [each for each in accounts.robots.all()
                  if arguments.name in (None, each['id'], each['name'])]
        if arguments.name and not robots:
            raise ConfigError([f'there is no robot {arguments.name[:64]!a}: monitor robot list '
                               'shows them'])
        for each in accounts.residents.table(robots):
            people = each['people']
            known = 'not confirmed' if people is None else ', '.join(people) or 'nobody'
            more = sorted(set(each['suggested']) - set(people or ()))
            print(f"{each['name']:<24} {known}" + (
                f"; it also names {', '.join(more)}" if more else ''))
    return OK


def _confirm(accounts: Accounts, robot: str, people: list[str]) -> None:
    household = accounts.residents.confirm(robot, people, console().name)
    accounts.audit.note(console(), 'robot.residents', robot, people=sorted(household.people or ()))


def _list(arguments: argparse.Namespace) -> int:
    with opened(arguments) as accounts:
        robots = accounts.robots.all()
    if arguments.json:
        print(json.dumps(robots, indent=1))
    for each in robots if not arguments.json else ():
        since = datetime.fromtimestamp(each['created_ns'] / 1e9).strftime('%Y-%m-%d %H:%M')
        state = '' if each['revoked_ns'] is None else '  revoked'
        print(f"{each['name']:<24} {each['id']}  {since}{state}")
    return OK


def _revoke(arguments: argparse.Namespace) -> int:
    with opened(arguments) as accounts:
        name = accounts.revoke_robot(arguments.name)
        accounts.audit.note(console(), 'robot.revoke', name)
        print(f'{name} may not connect any more')
    return OK
