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

"""The command line of the program `alarms`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import getpass
import json

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.programs import BAD_USE
from rt_robot_os.base.programs import FAILED
from rt_robot_os.base.programs import OK
from rt_robot_os.base.programs import warn
from rt_robot_os.base.safe_text import safe_line
from rt_robot_os.features.alarms.cli.client import open_alarms
from rt_robot_os.features.alarms.cli.client import send_command
from rt_robot_os.features.alarms.cli.table import alarm_rows
from rt_robot_os.features.alarms.cli.table import notes_of
from rt_robot_os.features.alarms.cli.table import table
from rt_robot_os.features.alarms.cli.watching import watch
from rt_robot_os.link.client import connect
from rt_robot_os.link.robots import add_robot_option
from rt_robot_os.linux.paths import socket_path

_NAME = 'alarms'
_ORDERS = {
    'acknowledge': 'acknowledge an alarm: notifications stop',
    'resolve': 'end an alarm',
    'cancel': 'end a suspected alarm that was wrong',
    'confirm': 'raise a suspected alarm',
    'escalate': 'notify the next step immediately',
}


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=_NAME, allow_abbrev=False, description='The alarms of a robot that runs: which are '
        'open, what happens to them, and to answer them. No medical device.')
    commands = parser.add_subparsers(dest='command', required=True, metavar='COMMAND')
    one = _add(commands, 'list', _list, 'show the open alarms, the worst first')
    one = _add(commands, 'watch', _watch, 'follow the events of alarms, until Ctrl-C')
    for verb, what in _ORDERS.items():
        one = _add(commands, verb, _order, what)
        target = 'its number or its subject' + (
            '; all: every alarm' if verb == 'acknowledge' else '')
        one.add_argument('alarm', metavar='ID', help=target)
        one.add_argument('why', nargs='*', metavar='WHY', help='a word about it')
        _add_who(one)
    one = _add(commands, 'test', _test, 'open a test alarm, to see which channels are notified')
    one.add_argument('level', nargs='?', default='technical',
                     choices=('technical', 'warning', 'urgent', 'critical'))
    _add_who(one)
    one = _add(commands, 'journal', _journal, 'show the content of the journal of alarms',
               robot=False)
    one.add_argument('file', nargs='?', default='', metavar='FOLDER',
                     help='its folder or a file of it (default: alarms in $ROS_HOME or ~/.ros)')
    one = _add(commands, 'rehearse', _rehearse, 'have thousands of emergencies happen, in '
               'virtual time and without a robot, while everything that can fail does',
               robot=False)
    one.add_argument('--alarms', type=int, default=10_000, metavar='N')
    one.add_argument('--seed', type=int, default=1, metavar='N')
    one.add_argument('--scene', type=int, default=0, metavar='N',
                     help='begin with this one, to look at it again')
    one = _add(commands, 'silence', _silence, "mute the robot's voice for a while")
    one.add_argument('seconds', nargs='?', type=float, default=60.0, metavar='SECONDS')
    _add_who(one)
    return parser


def _add(commands: argparse._SubParsersAction[argparse.ArgumentParser], name: str,
         run_it: object, what: str, robot: bool = True) -> argparse.ArgumentParser:
    one = commands.add_parser(name, help=what, description=what[0].upper() + what[1:] + '.',
                              allow_abbrev=False)
    if robot:
        add_robot_option(one)
    one.add_argument('--json', action='store_true', help='print JSON')
    one.set_defaults(run=run_it)
    return one


def _add_who(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('--by', metavar='NAME', default='',
                        help='who says so, as it will be written down (default: your user name)')
    parser.add_argument('--timeout', type=float, default=5.0, metavar='S',
                        help='how long to wait for the answer (default: %(default)g)')


def run(argv: Sequence[str]) -> int:
    """
    Run one command.

    :param argv: without the program's name.
    :return: the exit code.
    :raises RtRobotError: it failed.
    """
    parser = _parser()
    arguments, rest = parser.parse_known_args(argv)
    # Words behind an option: `acknowledge 7 --by mary we are there`.
    if rest and (not hasattr(arguments, 'why') or any(word.startswith('-') for word in rest)):
        parser.error(f'unrecognized arguments: {" ".join(rest)}')
    if rest:
        arguments.why += rest
    try:
        return int(arguments.run(arguments))
    except ConfigError as error:
        warn(_NAME, error.problems[0], error.problems[1:])
        return BAD_USE


def _list(arguments: argparse.Namespace) -> int:
    with connect(arguments.robot, _NAME) as client:
        found = open_alarms(client)
    rows = alarm_rows(found)
    if arguments.json:
        print(json.dumps({'alarms': rows, 'notes': notes_of(found)}, indent=1))
        return OK
    print(*(table(rows) if rows else ['no alarm is open']), sep='\n')
    for note in notes_of(found) if rows else ():
        print(note)
    return OK


def _watch(arguments: argparse.Namespace) -> int:
    with connect(arguments.robot, _NAME):
        pass  # a missing robot is an error at the first time; later it is waited for
    watch(socket_path(arguments.robot), arguments.json)
    return OK


def _order(arguments: argparse.Namespace) -> int:
    return _ask(arguments, arguments.command, arguments.alarm, ' '.join(arguments.why))


def _test(arguments: argparse.Namespace) -> int:
    return _ask(arguments, 'test', arguments.level)


def _silence(arguments: argparse.Namespace) -> int:
    return _ask(arguments, 'silence', f'{arguments.seconds:g}')


def _journal(arguments: argparse.Namespace) -> int:
    from rt_robot_os.features.alarms.cli import history  # takes long to import

    found = history.find(arguments.file)
    if arguments.json:
        print(json.dumps(history.as_dict(found), indent=1))
    else:
        print(*history.lines(found), sep='\n')
    return OK


def _rehearse(arguments: argparse.Namespace) -> int:
    from rt_robot_os.features.alarms.scenarios.rehearsal import rehearse

    if arguments.alarms < 1:
        raise ConfigError([f'--alarms {arguments.alarms}: must be at least 1'])
    result = rehearse(arguments.alarms, arguments.seed, arguments.scene)
    if arguments.json:
        print(json.dumps(result.as_dict(), indent=1))
    else:
        print(*result.lines(), sep='\n')
    return OK if result.passed else FAILED


def _ask(arguments: argparse.Namespace, verb: str, about: str, why: str = '') -> int:
    """Send a command, and print the answer."""
    command = ' '.join(f'{verb} {about} by {_who(arguments.by)} {why}'.split())
    with connect(arguments.robot, _NAME) as client:
        answer = send_command(client, command, arguments.timeout)
    if arguments.json:
        print(json.dumps(answer.to_dict()))
    elif answer.ok:
        print(safe_line(answer.text))
    else:
        warn(_NAME, safe_line(answer.text, 400))
    return OK if answer.ok else FAILED


def _who(name: str) -> str:
    """Return a name of one word."""
    try:
        found = name or getpass.getuser()
    except (KeyError, OSError, ImportError):  # a user without a name, as in some containers
        found = 'operator'
    return '_'.join(safe_line(found, 64).split()) or 'operator'
