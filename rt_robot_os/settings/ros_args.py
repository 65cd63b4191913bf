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


"""Parse the part of a ROS 2 command line that the settings need; rclpy parses the rest."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any
from typing import Final

from rt_robot_os.settings.names import full_name
from rt_robot_os.settings.names import is_token
from rt_robot_os.settings.names import LONGEST_NODE
from rt_robot_os.settings.names import namespace_problem
from rt_robot_os.settings.names import TOKEN_RULE
from rt_robot_os.settings.problems import nearest
from rt_robot_os.settings.problems import Problems
from rt_robot_os.settings.tree import COMMAND_LINE
from rt_robot_os.settings.tree import Leaf
from rt_robot_os.settings.tree import Origin
from rt_robot_os.settings.yaml_text import parse
from rt_robot_os.settings.yaml_text import YamlProblem

_ORIGIN = Origin(COMMAND_LINE)
# The arguments of ROS 2 after --ros-args, and whether a value follows.
ROS_FLAGS: Final = MappingProxyType({
    **dict.fromkeys(('-p', '--param', '--params-file', '-r', '--remap', '-e', '--enclave',
                     '--log-level', '--log-config-file', '--log-file-name'), True),
    **{f'--{what}-{logs}-logs': False for what in ('enable', 'disable')
       for logs in ('rosout', 'stdout', 'external-lib')}})
_LEVELS: Final = ('debug', 'info', 'warn', 'error', 'fatal')


@dataclass(frozen=True, slots=True)
class RosArguments:
    """
    The ROS part of a command line, and the rest.

    :ivar params_files: in the order given.
    :ivar overrides: the ``-p`` arguments for this node, by dotted name.
    :ivar rest: the arguments outside of ``--ros-args ... --``.
    """

    params_files: tuple[Path, ...]
    overrides: Mapping[str, Any]
    node_name: str
    namespace: str
    rest: tuple[str, ...]


def parse_ros_args(argv: Sequence[str], node: str = 'robot') -> RosArguments:
    """
    Parse ``--ros-args --params-file F -p name:=value -r __node:=x -r __ns:=/y --``.

    Remappings of topics and log options are left to rclpy, which gets the same command line.

    :param argv: without the program's name.
    :param node: the node's name unless remapped.
    :raises ConfigError: with one line for each argument that is not valid.
    """
    problems = Problems()
    ours, rest = split(argv)
    files, parameters, remaps = _sort(ours, problems)
    name, namespace = _node_of(remaps, node, problems)
    overrides: dict[str, Any] = {}
    for text in parameters:
        _override(text, name, namespace, overrides, problems)
    problems.raise_any()
    return RosArguments(tuple(files), MappingProxyType(overrides), name, namespace, rest)


def split(argv: Sequence[str]) -> tuple[list[str], tuple[str, ...]]:
    """Separate the arguments in ``--ros-args ... --`` from the others."""
    ours: list[str] = []
    rest: list[str] = []
    inside = False
    for argument in argv:
        if argument == '--ros-args':
            inside = True
        elif inside and argument == '--':
            inside = False
        else:
            (ours if inside else rest).append(argument)
    return ours, tuple(rest)


def _sort(
    arguments: Sequence[str], problems: Problems,
) -> tuple[list[Path], list[str], list[str]]:
    files: list[Path] = []
    parameters: list[str] = []
    remaps: list[str] = []
    waiting = iter(arguments)
    for flag in waiting:
        if flag not in ROS_FLAGS:
            _unknown(flag, problems)
            continue
        if not ROS_FLAGS[flag]:
            continue
        value = next(waiting, None)
        if value is None:
            problems.add(_ORIGIN, f'{flag} is the last argument: its value is missing')
        elif flag == '--params-file':
            files.append(Path(value))
        elif flag in ('-p', '--param'):
            parameters.append(value)
        elif flag in ('-r', '--remap'):
            remaps.append(value)
            _check_remap(value, problems)
        elif flag == '--log-level':
            _check_level(value, problems)
    return files, parameters, remaps


def _unknown(word: str, problems: Problems) -> None:
    if word.endswith(('.yaml', '.yml')) and not word.startswith('-'):
        hint = f'write --params-file {word}'
    elif ':=' in word:
        hint = f'write -p {word} for a parameter, -r {word} for another name'
    else:
        guess = nearest(word, ROS_FLAGS)
        hint = (f'did you mean {guess}?' if guess
                else "the program's own arguments must come before --ros-args")
    problems.add(_ORIGIN, f'{word}: is not an argument of ROS 2: {hint}')


def _check_remap(rule: str, problems: Problems) -> None:
    match, separator, replacement = rule.partition(':=')
    if not separator or not match or not replacement:
        problems.add(_ORIGIN, f'-r {rule}: must be FROM:=TO, such as imu/data:=/head/imu or '
                     '__node:=arm')


def _check_level(text: str, problems: Problems) -> None:
    level = text.rpartition(':=')[2]
    if level.lower() not in _LEVELS:
        problems.value(_ORIGIN, '--log-level', level, f'must be one of {", ".join(_LEVELS)}')


def _node_of(remaps: Sequence[str], node: str, problems: Problems) -> tuple[str, str]:
    """Apply the remappings of the node's own name; the first one wins, as in rcl."""
    name, namespace = '', ''
    for rule in remaps:
        what, separator, value = rule.partition(':=')
        for_node, _, what = what.rpartition(':')
        if not separator or for_node not in ('', node):
            continue
        if what in ('__node', '__name') and not name:
            name = value
            if not is_token(value):
                problems.value(_ORIGIN, f'-r {what}', value, f'must be {TOKEN_RULE}')
            elif len(value) > LONGEST_NODE:
                problems.value(_ORIGIN, f'-r {what}', value,
                               f'must be at most {LONGEST_NODE} characters')
        elif what == '__ns' and not namespace:
            namespace = value
            wrong = namespace_problem(value)
            if wrong:
                problems.value(_ORIGIN, '-r __ns', value, wrong)
    return name or node, namespace or '/'


def _override(
    rule: str, node: str, namespace: str, overrides: dict[str, Any], problems: Problems,
) -> None:
    what, separator, text = rule.partition(':=')
    for_node, _, name = what.rpartition(':')
    if not separator or not name:
        problems.add(_ORIGIN, f'-p {rule}: must be name:=value, such as imu.rate_hz:=100.0')
        return
    if for_node not in ('', node, full_name(namespace, node)):
        return
    try:
        leaf = parse(text, COMMAND_LINE)
    except YamlProblem as problem:
        problems.add(_ORIGIN, f'{name}: {problem}')
        return
    if leaf is None or (isinstance(leaf, Leaf) and leaf.value is None):
        problems.add(_ORIGIN, f"{name} has no value: write {name}:='\"\"' for an empty string")
    elif not isinstance(leaf, Leaf):
        problems.add(_ORIGIN, f'{name} must be one value or a list: give the keys of a section '
                     f'one by one, {name}.key:=value')
    elif leaf.fault:
        problems.value(_ORIGIN, name, leaf.value, leaf.fault)
    else:
        overrides[name] = leaf.value
