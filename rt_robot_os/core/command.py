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

"""
The program `core`: the real-time process.

The node `robot` starts it as its child, with checked settings on standard input. When started by
hand it reads parameter files itself, and a node with ``core.spawn: false`` attaches to it.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from rt_robot_os.base.programs import importing
from rt_robot_os.base.programs import OK
from rt_robot_os.linux.process import die_with_parent
from rt_robot_os.settings.command_line import add_simulate
from rt_robot_os.settings.command_line import parse_own


def run(argv: Sequence[str]) -> int:
    """
    Run the core until it is stopped.

    :param argv: without the program's name.
    :return: the exit code: 2 when it cannot start with this configuration, 3 when a job had to be
        aborted at the stop.
    """
    arguments = _arguments(argv)
    if arguments.parent is not None and not die_with_parent(arguments.parent):
        return OK
    with importing():
        from rt_robot_os.core.running import run_core
    return run_core(arguments, argv)


def _arguments(argv: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog='core', description='Run the real-time core of a robot by itself; '
        'a robot node with core.spawn: false attaches to it.',
        usage='core [options] [FILE ...] [--ros-args -p NAME:=VALUE ...]',
        allow_abbrev=False)
    add_simulate(parser)
    parser.add_argument('--settings', metavar='FILE', help='checked settings as JSON, - for '
                        'standard input: how a node starts it')
    parser.add_argument('--socket', metavar='PATH', type=Path, help='where to listen')
    parser.add_argument('--parent', metavar='PID', type=int, help='end when this process does')
    parser.add_argument('--life', metavar='FD', type=int, default=-1,
                        help=argparse.SUPPRESS)  # of the liveness page that the node reads
    parser.add_argument('--ahead', action='store_true',
                        help=argparse.SUPPRESS)  # see rt_robot_os.core.preload
    parser.add_argument('--ready', metavar='FD', type=int, default=-1,
                        help=argparse.SUPPRESS)  # closed when clients can connect
    parser.add_argument('--duration', metavar='S', type=float, help='end after this long')
    return parse_own(parser, argv)
