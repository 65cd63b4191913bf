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

"""`monitor user`: manage accounts of people without a browser."""

from __future__ import annotations

import argparse
import json
from typing import Any

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.programs import OK
from rt_robot_os.monitor.api.users import change_user
from rt_robot_os.monitor.api.users import differences
from rt_robot_os.monitor.security.accounts import Accounts
from rt_robot_os.monitor.security.accounts import link_of
from rt_robot_os.monitor.security.commands.opening import add_command
from rt_robot_os.monitor.security.commands.opening import console
from rt_robot_os.monitor.security.commands.opening import opened
from rt_robot_os.monitor.security.commands.opening import read_password
from rt_robot_os.monitor.security.passwords import check_rules
from rt_robot_os.monitor.security.roles import Role
from rt_robot_os.monitor.security.roles import role_of
from rt_robot_os.monitor.security.users import shown_people
from rt_robot_os.monitor.security.users import User

_ROLES = [role.value for role in Role]


def add_to(commands: Any) -> None:
    """Add its parser."""
    parser = commands.add_parser('user', help='accounts of people', allow_abbrev=False)
    words = parser.add_subparsers(dest='word', required=True, metavar='COMMAND')
    one = add_command(words, 'add', _add, 'add a user; asks for the password, or reads it from '
                      'standard input')
    one.add_argument('name')
    one.add_argument('--role', choices=_ROLES, default='viewer')
    one.add_argument('--people', nargs='*', default=[], metavar='PERSON',
                     help="people they may see; '*' is everybody")
    one.add_argument('--link', metavar='URL', help='no password: print a link, under this '
                     'address of the monitor, by which they choose one themselves')
    one = add_command(words, 'list', _list, 'show the users')
    one.add_argument('--json', action='store_true', help='print JSON')
    one = add_command(words, 'password', _password, 'set a password; ends all sessions')
    one.add_argument('name')
    one = add_command(words, 'link', _link, 'print a one-time link to choose a new password')
    one.add_argument('name')
    one.add_argument('url', metavar='URL', help='address of the monitor')
    one = add_command(words, 'role', _role, 'change a role; ends all sessions')
    one.add_argument('name')
    one.add_argument('role', choices=_ROLES)
    one = add_command(words, 'grant', _grant, 'set the people that a user may see')
    one.add_argument('name')
    one.add_argument('people', nargs='*', metavar='PERSON', help="'*' is everybody; none: no one")
    one = add_command(words, 'disable', _disable, 'disable a user; ends all sessions')
    one.add_argument('name')
    one = add_command(words, 'enable', _enable, 'enable a user again')
    one.add_argument('name')
    one = add_command(words, 'sessions', _sessions, 'show sessions, or end those of a user')
    one.add_argument('name', nargs='?')
    one.add_argument('--end', action='store_true', help='end them')
    one.add_argument('--json', action='store_true', help='print JSON')


def _add(arguments: argparse.Namespace) -> int:
    with opened(arguments) as accounts:
        password = ''
        if arguments.link is None:
            password = _new_password(accounts, arguments.name)
        user = accounts.users.add(arguments.name, role_of(arguments.role), arguments.people,
                                  console().name, password)
        accounts.audit.note(console(), 'user.add', user.name, role=user.role.value,
                            people=shown_people(user.people))
        print(f'{user.name} is {user.role.value} and may see '
              f'{", ".join(shown_people(user.people)) or "nobody"}')
        if arguments.link is not None:
            print(link_of(arguments.link, accounts.invitations.make(user.id)))
    return OK


def _list(arguments: argparse.Namespace) -> int:
    with opened(arguments) as accounts:
        users = [user.as_dict() for user in accounts.users.all()]
    if arguments.json:
        print(json.dumps(users, indent=1))
    elif not users:
        print('no users: the monitor prints a link for the first one when it starts')
    for user in users if not arguments.json else ():
        state = 'disabled' if user['disabled'] else 'invited' if not user['has_password'] else ''
        print(f"{user['name']:<24} {user['role']:<9} {', '.join(user['people']) or '-':<30} "
              f'{state}'.rstrip())
    return OK


def _password(arguments: argparse.Namespace) -> int:
    with opened(arguments) as accounts:
        user = _user(accounts, arguments.name)
        accounts.users.set_password(user.id, _new_password(accounts, user.name))
        accounts.invitations.withdraw(user.id)
        count = accounts.end_sessions(user=user.id)
        accounts.audit.note(console(), 'password.set', user.name, sessions=count)
        print(f'{user.name}: the password is set, {count} sessions ended')
    return OK


def _link(arguments: argparse.Namespace) -> int:
    with opened(arguments) as accounts:
        user = _user(accounts, arguments.name)
        if user.is_disabled:
            raise ConfigError([f'{user.name} is disabled: monitor user enable first'])
        print(link_of(arguments.url, accounts.invitations.make(user.id)))
        accounts.audit.note(console(), 'user.invite', user.name)
    return OK


def _role(arguments: argparse.Namespace) -> int:
    return _change(arguments, role=arguments.role)


def _grant(arguments: argparse.Namespace) -> int:
    return _change(arguments, people=arguments.people)


def _disable(arguments: argparse.Namespace) -> int:
    return _change(arguments, is_disabled=True)


def _enable(arguments: argparse.Namespace) -> int:
    return _change(arguments, is_disabled=False)


def _sessions(arguments: argparse.Namespace) -> int:
    with opened(arguments) as accounts:
        user = _user(accounts, arguments.name) if arguments.name else None
        if arguments.end:
            if user is None:
                raise ConfigError(["--end needs the user's name"])
            count = accounts.end_sessions(user=user.id)
            accounts.audit.note(console(), 'session.end_all', user.name, sessions=count)
            print(f'{count} sessions of {user.name} ended')
            return OK
        found = accounts.sessions.of(user.id if user is not None else None)
    if arguments.json:
        print(json.dumps(found, indent=1))
    for each in found if not arguments.json else ():
        print(f"{each['name']:<24} {each['address']:<24} {each['browser'][:60]}")
    return OK


def _change(arguments: argparse.Namespace, *, role: str | None = None,
            people: list[str] | None = None, is_disabled: bool | None = None) -> int:
    with opened(arguments) as accounts:
        before = _user(accounts, arguments.name)
        after = change_user(accounts, console().name, before, role, people, is_disabled)
        changes = differences(before, after)
        accounts.audit.note(console(), 'user.change', after.name, **changes)
        for name, (old, new) in changes.items():
            print(f'{after.name}: {name} was {old}, is {new}')
    return OK


def _user(accounts: Accounts, name: str) -> User:
    found = accounts.users.find(name)
    if found is None:
        raise ConfigError([f'no user {name[:64]!a}: monitor user list shows all users'])
    return found


def _new_password(accounts: Accounts, name: str) -> str:
    password = read_password(f'password of {name}')
    try:
        check_rules(password, name)
    except ValueError as error:
        raise ConfigError([str(error)]) from None
    return accounts.passwords.hash(password)
