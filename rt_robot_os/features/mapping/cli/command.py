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

"""The command line of the program `mapping`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.programs import BAD_USE
from rt_robot_os.base.programs import OK
from rt_robot_os.base.programs import warn
from rt_robot_os.link.robots import add_robot_option
from rt_robot_os.settings.command_line import parse_own
from rt_robot_os.settings.ros_args import parse_ros_args

_NAME = 'mapping'
_EPILOG = """Its settings are in a parameter file, in the section /**/mapping.
Exit code: 0 done or ended by a signal, 1 it cannot run, 2 wrong settings or a file that cannot be
used. Settings, topics, commands, and what a report holds: docs/mapping.md."""


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=_NAME, allow_abbrev=False, epilog=_EPILOG,
        description='Make a map next to a running robot and localise the robot on it. Or make a '
        'map of a log of laser scans as fast as possible; or compare the poses of a report '
        'with known relations.',
        usage='mapping [--robot NAME] [FILE ...] [--ros-args -p NAME:=VALUE ...]\n'
        '       mapping --bag FILE [options]\n'
        '       mapping --compare REPORT --relations FILE')
    add_robot_option(parser)
    parser.set_defaults(robot=None)  # the robot of its own namespace
    what = parser.add_mutually_exclusive_group()
    what.add_argument('--bag', metavar='FILE', type=Path,
                      help='a recording of record, a bag of ROS 2 (file or folder), a CSV with '
                      'ranges, or a log of CARMEN')
    what.add_argument('--compare', metavar='REPORT', type=Path,
                      help='an earlier report; needs --relations')
    parser.add_argument('--report', metavar='FILE', type=Path,
                        help='write poses, counters and errors as JSON')
    parser.add_argument('--map', metavar='FILE', type=Path, dest='map_file',
                        help='write the map: a .yaml, and a .pgm next to it')
    parser.add_argument('--picture', metavar='FILE', type=Path,
                        help='draw the map and the path (needs matplotlib)')
    parser.add_argument('--relations', metavar='FILE', type=Path,
                        help='a CSV of i,j,dx,dy,dyaw: report the errors of the poses')
    parser.add_argument('--cell', metavar='M', type=float, default=0.05,
                        help='edge of a cell of the map in m (default: %(default)s)')
    parser.add_argument('--range-max', metavar='M', type=float,
                        help='ignore ranges from here on (default: 20, and the maximum range '
                        'of a laser that reports it instead of no echo, see docs/mapping.md)')
    parser.add_argument('--scan-topic', metavar='TOPIC',
                        help='topic of scans of a bag (default: /scan, or the only one)')
    parser.add_argument('--odom-topic', metavar='TOPIC',
                        help='topic of odometry of a bag (default: /odom, the only one, or /tf)')
    parser.add_argument('--laser', metavar='X,Y,YAW',
                        help='mounting of the laser of a bag, in m and degrees (default: that in '
                        'the bag); with ,upside-down if it hangs')
    parser.add_argument('--session', metavar='N', type=int,
                        help='session of a recording during which the core was restarted '
                        '(default: the first)')
    return parser


def run(argv: Sequence[str]) -> int:
    """
    Make a map, or compare.

    :param argv: without the program's name.
    :return: the exit code.
    :raises RtRobotError: it cannot run.
    """
    try:
        ros = parse_ros_args(argv, _NAME)
        arguments = parse_own(_parser(), argv)
        if arguments.bag is None and arguments.compare is None:
            from rt_robot_os.features.mapping.cli.live_command import run_live
            return run_live(arguments, ros)
        if arguments.files:
            raise ConfigError([f'{arguments.files[0]}: settings are for mapping next to a robot: '
                               'they are not used with --bag or --compare'])
        from rt_robot_os.features.mapping.cli.offline import compared
        from rt_robot_os.features.mapping.cli.offline import map_log
        if arguments.compare is not None:
            if arguments.relations is None:
                raise ConfigError(['--compare needs --relations FILE'])
            compared(arguments.compare, arguments.relations)
        else:
            map_log(arguments)
    except ConfigError as error:
        warn(_NAME, error.problems[0], error.problems[1:])
        return BAD_USE
    return OK
