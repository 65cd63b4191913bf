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

"""What the program `parameters` does: read, change and save those of a running core."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rt_robot_os.base.errors import LinkError
from rt_robot_os.base.programs import OK
from rt_robot_os.link import LinkClient
from rt_robot_os.link.client import connect
from rt_robot_os.link.robots import add_robot_option
from rt_robot_os.settings.problems import did_you_mean
from rt_robot_os.settings.saved import describe_saved
from rt_robot_os.settings.saved import save
from rt_robot_os.settings.saved import saved_path
from rt_robot_os.settings.tree import Leaf
from rt_robot_os.settings.tree import show
from rt_robot_os.settings.yaml_text import parse
from rt_robot_os.settings.yaml_text import YamlProblem

Facts = dict[str, Any]


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='parameters', description='The parameters of a running core that may change: those '
        'of devices and modules. A node of that core takes over what is changed here.')
    add_robot_option(parser)
    commands = parser.add_subparsers(dest='command', required=True, metavar='COMMAND')
    commands.add_parser('list', help='show them all; * marks what was changed')
    one = commands.add_parser('get', help='print a value')
    one.add_argument('name', metavar='NAME', help='such as imu.rate_hz')
    one = commands.add_parser('set', help='change a value, from the next job on')
    one.add_argument('name', metavar='NAME', help='such as imu.rate_hz')
    one.add_argument('value', metavar='VALUE', help='as in YAML')
    one = commands.add_parser('save', help='write what was changed as a parameter file')
    one.add_argument('file', type=Path, nargs='?', metavar='FILE',
                     help="where to; without it the configuration's parameters_file, or NAME"
                     '.saved.yaml in $ROS_HOME or ~/.ros')
    return parser


def _found(parameters: dict[str, Facts], name: str) -> Facts:
    if name not in parameters:
        raise LinkError(f'{name}: no parameter that can be changed while the robot runs, '
                        f'{did_you_mean(name, parameters)}')
    return parameters[name]


def _list(client: LinkClient, arguments: argparse.Namespace) -> None:
    rows = []
    for each in client.parameters()[1].values():
        mark = ' ' if each['value'] == each['loaded'] else '*'
        value = f'{show(each["value"])} {each["unit"]}'.rstrip()
        rows.append((f'{mark} {each["name"]}', value, each['description'].rstrip('.')))
    widths = [max(map(len, column)) for column in list(zip(*rows))[:2]]
    for name, value, description in rows:
        print(f'{name:{widths[0]}}  {value:{widths[1]}}  {description}')
    if not rows:
        print('this robot has no parameter that may change')


def _get(client: LinkClient, arguments: argparse.Namespace) -> None:
    print(show(_found(client.parameters()[1], arguments.name)['value']))


def _set(client: LinkClient, arguments: argparse.Namespace) -> None:
    try:
        leaf = parse(arguments.value, 'the command line')
    except YamlProblem as problem:
        raise LinkError(f'{arguments.name}: {problem}') from problem
    if not isinstance(leaf, Leaf) or leaf.fault:
        raise LinkError(f'{arguments.name} = {arguments.value!r}: must be one value')
    before = _found(client.parameters()[1], arguments.name)['value']
    value = client.change(arguments.name, leaf.value)
    print(f'{arguments.name} = {show(value)}, was {show(before)}')


def _save(client: LinkClient, arguments: argparse.Namespace) -> None:
    of_all, parameters = client.parameters()
    path = arguments.file or saved_path(str(of_all['file']), arguments.robot)
    values = save(path, arguments.robot,
                  {name: each['loaded'] for name, each in parameters.items()},
                  {name: each['value'] for name, each in parameters.items()},
                  files=of_all['files'], complete=False)  # mirrors are the node's
    print(describe_saved(path, values))


_COMMANDS = {'list': _list, 'get': _get, 'set': _set, 'save': _save}


def run(argv: Sequence[str]) -> int:
    """
    Run one command.

    :param argv: without the program's name.
    :raises RtRobotError: it failed.
    """
    arguments = _parser().parse_args(argv)
    with connect(arguments.robot, 'parameters') as client:
        _COMMANDS[arguments.command](client, arguments)
    return OK
