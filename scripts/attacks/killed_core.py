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
Kill or freeze the core of a robot that drives at a wall: it has to stand before it touches it.

    scripts/attacks/killed_core.py                       # all four boards
    scripts/attacks/killed_core.py --boards arduino_bridge --free 0.6 --speeds 0.5

The robot is asked for a speed, as by ROS on ``cmd_vel``. As soon as so much is free before it,
its core gets SIGKILL or SIGSTOP; its hardware goes on. The exit code is 1 when a robot touched
the wall, or never stood.
"""

from __future__ import annotations

import argparse
import sys

from report import boards
from report import parser
from report import Report
from robot import Robot
from robot import stopping

COLUMNS = ('board', 'how', 'asked_m_s', 'free_m', 'at_m_s', 'on_s', 'on_m', 'left_m', 'contacts',
           'impact_m_s')


def attack(report: Report, board: str, how: str, speed_m_s: float, free_m: float,
           arguments: argparse.Namespace) -> None:
    """Run one robot, and report it."""
    start_free_m = max(2.0, free_m + 1.2)
    with Robot(board, start_free_m=start_free_m, whole=arguments.whole, node=arguments.node,
               realtime=arguments.realtime) as robot:
        robot.drive(speed_m_s)
        robot.until(lambda now: now.free_m <= free_m, 'the place of the attack', 60.0)
        begun_ns = robot.kill_core() if how == 'kill' else robot.stop_core()
        before = robot.now
        robot.drive(None)
        problem = ''
        try:
            robot.until_rest()
        except RuntimeError as error:
            problem = str(error).splitlines()[0]
        track = robot.since(begun_ns)
        on_s, on_m = stopping(track)
        last = track[-1]
        if last.contacts:
            problem = 'CONTACT'
        report.add(problem, board=board, how=how, asked_m_s=speed_m_s, free_m=free_m,
                   at_m_s=before.ahead_m_s, on_s=on_s, on_m=on_m, left_m=last.free_m,
                   contacts=last.contacts, impact_m_s=last.impact_m_s)


def main() -> int:
    """Run all, and return the exit code."""
    made = parser(__doc__.split('\n\n')[0])
    made.add_argument('--speeds', default='0.4,0.6', help='asked for, in m/s')
    made.add_argument('--free', default='0.45,0.8', help='at the attack, in m')
    made.add_argument('--how', default='kill,stop', help='SIGKILL, SIGSTOP')
    arguments = made.parse_args()
    report = Report(COLUMNS)
    for board in boards(arguments):
        for how in arguments.how.split(','):
            for speed in map(float, arguments.speeds.split(',')):
                for free in map(float, arguments.free.split(',')):
                    attack(report, board, how, speed, free, arguments)
    return report.end(arguments.out)


if __name__ == '__main__':
    sys.exit(main())
