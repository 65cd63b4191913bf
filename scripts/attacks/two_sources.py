#!/usr/bin/env python3
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
Let an operator and ROS steer at once, to opposite sides: the robot must not turn to and fro.

    scripts/attacks/two_sources.py                       # all four boards
    scripts/attacks/two_sources.py --boards kobuki --operator-hz 3

The operator commands +0.8 rad/s on ``cmd_vel_teleop`` at 5 Hz, which is slower than the time-out
of that source; ROS commands -0.8 rad/s on ``cmd_vel`` at 20 Hz. The exit code is 1 when the robot
turns against the operator before the hold of the last command ends, or never turns.
"""

from __future__ import annotations

import argparse
import sys
import time

from report import boards
from report import parser
from report import Report
from robot import Robot
from robot import Sender

COLUMNS = ('board', 'operator_hz', 'seconds', 'reversals', 'against_rad_s', 'over_to_ros_s')
RATE_RAD_S = 0.8
HOLD_S = 1.0
# Below it the robot does not turn to a side.
TURNS_RAD_S = 0.05


def attack(report: Report, board: str, arguments: argparse.Namespace) -> None:
    """Run one robot, and report it."""
    changes = {'velocity_mux': {'source_holds_s': [HOLD_S] * 4}} if arguments.holds else {}
    with Robot(board, whole=arguments.whole, node=arguments.node, realtime=arguments.realtime,
               changes=changes) as robot:
        operator = Sender(robot.socket, 'cmd_vel_teleop', 0.0, RATE_RAD_S, arguments.operator_hz)
        robot.until(lambda now: now.turning_rad_s > TURNS_RAD_S, 'the operator to have it')
        begun_ns = time.monotonic_ns()
        robot.drive(0.0, -RATE_RAD_S)
        robot.until(lambda now: now.at_ns - begun_ns > arguments.seconds * 1e9, 'the end')
        operator.end()
        over_ns = operator.last_ns
        track = [each for each in robot.since(begun_ns) if each.at_ns <= over_ns]
        sides = [each.turning_rad_s > 0.0 for each in track
                 if abs(each.turning_rad_s) > TURNS_RAD_S]
        reversals = sum(one != other for one, other in zip(sides, sides[1:]))
        against = max(0.0, *(-each.turning_rad_s for each in track))
        robot.until(lambda now: now.turning_rad_s < -TURNS_RAD_S, 'ROS to have it')
        taken_s = min(each.at_ns for each in robot.since(over_ns)
                      if each.turning_rad_s < -TURNS_RAD_S) - over_ns
        problem = 'REVERSED' if reversals or against > TURNS_RAD_S else (
            'NEVER TURNED' if True not in sides else
            'NOT HELD' if taken_s < HOLD_S * 1e9 else '')
        report.add(problem, board=board, operator_hz=arguments.operator_hz,
                   seconds=arguments.seconds, reversals=reversals, against_rad_s=against,
                   over_to_ros_s=taken_s / 1e9)


def main() -> int:
    """Run all, and return the exit code."""
    made = parser(__doc__.split('\n\n')[0])
    made.add_argument('--operator-hz', type=float, default=5.0, help='commands of the operator')
    made.add_argument('--seconds', type=float, default=5.0, help='of both together')
    made.add_argument('--as-shipped', dest='holds', action='store_false',
                      help='leave the holds of the configuration as they are')
    arguments = made.parse_args()
    report = Report(COLUMNS)
    for board in boards(arguments):
        attack(report, board, arguments)
    return report.end(arguments.out)


if __name__ == '__main__':
    sys.exit(main())
