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

"""The command line of the program for a turn on the spot."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from collections.abc import Iterator
from collections.abc import Sequence
import json
import math
from pathlib import Path
import sys

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.programs import BAD_USE
from rt_robot_os.base.programs import FAILED
from rt_robot_os.base.programs import OK
from rt_robot_os.linux.folders import read_file
from rt_robot_os.motion.angles import yaw_of
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.turning import fit_turn

# Seconds, nanoseconds and frame precede the pose in a message with a header.
_HEADER = 3
_POSE = 7


def run(argv: Sequence[str]) -> int:
    """Fit the turn of a file; returns 1 if it is inconclusive, 2 if the file contains no poses."""
    parser = argparse.ArgumentParser(
        prog='turn', description='Compute the mounting of the StarGazer on the robot, from a turn '
                                 'on the spot: record "ros2 topic echo --csv /stargazer/pose" '
                                 'meanwhile.')
    parser.add_argument('file', type=Path, help='the recorded file')
    parser.add_argument('--json', action='store_true', help='write JSON')
    arguments = parser.parse_args(argv)
    try:
        poses = list(poses_of(read_file(arguments.file).decode().splitlines()))
    except (OSError, UnicodeDecodeError, ConfigError) as error:
        print(f'turn: {arguments.file}: {error}', file=sys.stderr)
        return BAD_USE
    try:
        fit = fit_turn(poses)
    except ValueError as error:
        print(f'turn: {arguments.file}: {error}', file=sys.stderr)
        return FAILED
    ahead, left = fit.offset_m
    if arguments.json:
        print(json.dumps({'poses': len(poses), 'ahead_m': ahead, 'left_m': left,
                          'rms_m': fit.rms_m, 'turn_rad': fit.turn_rad}))
        return OK
    print(f'{len(poses)} poses over {math.degrees(fit.turn_rad):.0f} degrees, {fit.rms_m:.3f} m '
          f'RMS from a circle.\nAdd {ahead:+.3f} and {left:+.3f} to the first two numbers of '
          'mounting_m.')
    return OK


def poses_of(lines: Iterable[str]) -> Iterator[Pose]:
    """
    Read the lines of ``ros2 topic echo --csv`` of a PoseWithCovarianceStamped.

    :raises ConfigError: a line is not a pose.
    """
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        try:
            x, y, _, *q = (float(each) for each in line.split(',')[_HEADER:_HEADER + _POSE])
            yield x, y, yaw_of(*q)
        except (ValueError, TypeError) as error:
            raise ConfigError([f'line {number} is not a pose: record it with ros2 topic echo --csv'
                               ]) from error
