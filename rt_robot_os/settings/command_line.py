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

"""The common part of the command lines of programs that read a robot's configuration."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
import shlex
from typing import Final
from typing import TYPE_CHECKING

from rt_robot_os.base import programs
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.programs import BAD_USE
from rt_robot_os.settings.problems import nearest
from rt_robot_os.settings.ros_args import ROS_FLAGS
from rt_robot_os.settings.ros_args import split

if TYPE_CHECKING:
    from rt_robot_os.settings.model import RobotSettings

ROS_ARGS_HELP: Final = """
FILE is a parameter file, as --params-file names it; later files win.
ROS 2 arguments follow --ros-args, as for any node:
  --params-file FILE        the robot; may be repeated, later files win
  -p NAME:=VALUE            one parameter, such as imu.rate_hz:=100.0 or gps.enabled:=false
  -r __node:=NAME           another name; -r __ns:=/NAMESPACE, -r FROM:=TO
  --log-level LEVEL         debug, info, warn, error or fatal
"""
_YAML: Final = ('.yaml', '.yml')


def add_simulate(parser: argparse.ArgumentParser) -> None:
    """Add the option ``--simulate``."""
    parser.add_argument(
        '--simulate', action='store_true', help='simulate all devices, whatever their ports: '
        'those of the shipped robot, or of --params-file')


def parse_own(parser: argparse.ArgumentParser, argv: Sequence[str]) -> argparse.Namespace:
    """
    Parse the arguments outside of ``--ros-args ... --``.

    An unknown argument ends the program with code 2, and a suggestion of the correct command line.

    :param argv: without the program's name.
    :return: with ``files``, the parameter files without a flag.
    """
    ros, own = split(argv)
    arguments, rest = parser.parse_known_args(own)
    arguments.files = tuple(Path(word) for word in rest if _is_file(word))
    if len(arguments.files) < len(rest):
        programs.warn(parser.prog, _refusal(parser, list(rest), list(own), ros))
        parser.exit(BAD_USE)
    return arguments


def _is_file(word: str) -> bool:
    return word.endswith(_YAML) and not word.startswith('-')


def _refusal(parser: argparse.ArgumentParser, rest: list[str], own: list[str],
             ros: Sequence[str]) -> str:
    kept = list(own)
    moved: list[str] = []
    waiting = list(rest)
    while waiting:
        word = waiting.pop(0)
        flag, equals, value = word.partition('=') if word.startswith('--') else (word, '', '')
        if flag in ROS_FLAGS:
            moved.append(flag)
            kept.remove(word)
            if ROS_FLAGS[flag] and equals:
                moved.append(value)
            elif ROS_FLAGS[flag] and waiting:
                moved.append(waiting[0])
                kept.remove(waiting.pop(0))
        elif ':=' in word and not word.startswith('-'):
            moved += ['-p', word]
            kept.remove(word)
        elif not _is_file(word):
            return _unknown(parser, word)
    line = shlex.join([parser.prog, *kept, '--ros-args', *moved, *ros])
    return f'ROS 2 arguments must follow --ros-args. Write: {line}'


def _unknown(parser: argparse.ArgumentParser, word: str) -> str:
    options = [option for action in parser._actions for option in action.option_strings]
    guess = nearest(word.partition('=')[0], [*options, *ROS_FLAGS]) if word[:1] == '-' else None
    if guess is None and Path(word).is_file():
        return (f'{word!r} is not understood: is it a parameter file? '
                f'{shlex.join([parser.prog, "--ros-args", "--params-file", word])}')
    hint = f'did you mean {guess}? ' if guess else ''
    return f'{word!r} is not understood: {hint}see {parser.prog} --help'


def tell(program: str, error: Exception) -> None:
    """Print to standard error why nothing was started, one line per problem."""
    problems = error.problems if isinstance(error, ConfigError) else ()
    if not problems:
        programs.warn(program, error)
        return
    count = len(problems)
    programs.warn(program, f'{count} problem{"s" if count > 1 else ""} in the configuration, '
                  'nothing was started:', problems)


def told_simulated(settings: RobotSettings) -> str:
    """Return which devices are simulated, and how to use real ones if this was not requested."""
    from rt_robot_os.link.core_statistics import SHIPPED_IN_USE
    text = f'simulated: {", ".join(settings.simulated)}'
    if settings.simulation_asked:
        return text
    return (f'WARNING: {text}; no sensor is real: {SHIPPED_IN_USE}. For your robot give its file, '
            'my_robot.yaml (with ros2 launch: params_file:=my_robot.yaml). For this one give '
            '--simulate')
