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
Blind the laser of a robot before a wall: it has to stand before it touches the wall.

    scripts/attacks/blind_sectors.py                       # all four boards
    scripts/attacks/blind_sectors.py --boards kobuki --free 0.45 --speeds 0.8 --shares 0.7

The robot has its laser only: sonar and infrared sensors do not help. Its scans pass through this
program, which takes a share of the rays away, NaN or 0: those ahead, from the start or on the way,
or other ones in each scan. The exit code is 1 when a robot touched the wall, when it was blinded
and there is no warning, or when one that sees everything does not drive, or is limited by what it
cannot see.
"""

from __future__ import annotations

import argparse
from contextlib import suppress
import math
import sys
import threading
from typing import Any

import numpy as np
from report import boards
from report import parser
from report import Report
from robot import Robot
from robot import wait

from rt_robot_os.base.errors import LinkError
from rt_robot_os.link import LinkClient

COLUMNS = ('board', 'how', 'value', 'share', 'asked_m_s', 'free_m', 'fastest_m_s', 'left_m',
           'contacts', 'impact_m_s', 'said')
_RAYS = 682
_VALUES = {'nan': math.nan, 'zero': 0.0}
_RUN_S = 3.0
# On the way: the robot is blinded when so much more is free.
_AWAY_M = 1.5
# A robot that sees everything drives, with so much free; how fast is up to its board.
_OPEN_M = 3.0
_MOVES_M_S = 0.15
_CHANGES = {'laser': {'topic': 'scan_raw'}, 'collision_guard': {'range_topics': []}}


class Spoiler:
    """
    Pass scans on, some rays of which are lost.

    :ivar share: of the rays that is lost.
    """

    def __init__(self, robot: Robot, how: str, value: float) -> None:
        self.share = 0.0
        self.passed = 0
        self._how = how
        self._value = value
        self._random = np.random.default_rng(1)
        self._off = np.abs(np.arange(_RAYS) - _RAYS / 2) / (_RAYS / 2)
        self._client = LinkClient(robot.socket, 'spoiler')
        self._channel = self._client.advertise('scan')
        self._client.sample_handlers[self._client.topics['scan_raw'].channel] = self._pass_on
        self._client.mirror('scan_raw')
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._ended.is_set():
            with suppress(LinkError):
                self._client.pump(0.05)

    def _pass_on(self, stamp_ns: int, _: int, cdr: memoryview) -> None:
        data = bytearray(cdr)
        # The last fields are the ranges and the length of intensities, 0.
        ranges = np.frombuffer(data, np.float32, _RAYS, len(data) - 4 - 4 * _RAYS)
        lost = (self._random.random(_RAYS) < self.share if self._how == 'scattered'
                else self._off < self.share)
        ranges[lost] = self._value
        self._client.publish(self._channel, bytes(data), stamp_ns)
        self.passed += 1

    def end(self) -> None:
        """Pass nothing on any more."""
        self._ended.set()
        self._thread.join(5.0)
        self._client.close()


class BlindRobot(Robot):
    """A robot whose scans come from a program."""

    def __init__(self, board: str, **further: Any) -> None:
        super().__init__(board, changes=_CHANGES, **further)
        parameters = self._parameters
        parameters['topics'].append('spoiled')
        parameters['spoiled'] = {
            'topic': 'scan', 'message': 'sensor_msgs/msg/LaserScan', 'rate_hz': 10.0,
            'fixed': {'header.frame_id': 'laser_link', 'ranges': _RAYS, 'intensities': 0}}


def attack(report: Report, board: str, how: str, value: str, share: float, speed_m_s: float,
           free_m: float, arguments: argparse.Namespace) -> None:
    """Run one robot, and report it."""
    start_free_m = free_m + (_AWAY_M if how == 'on the way' else 0.0)
    with BlindRobot(board, start_free_m=start_free_m, whole=arguments.whole, node=arguments.node,
                    realtime=arguments.realtime) as robot:
        spoiler = Spoiler(robot, how, _VALUES[value])
        if how != 'on the way':
            spoiler.share = share
        try:
            passed = spoiler.passed
            wait(lambda: spoiler.passed > passed + 2, 'scans')
            begun_ns = robot.now.at_ns
            robot.drive(speed_m_s)
            if how == 'on the way':
                robot.until(lambda now: now.free_m <= free_m, 'the place of the attack', 60.0)
                spoiler.share = share
                begun_ns = robot.now.at_ns
            robot.until(lambda now: now.at_ns > begun_ns + _RUN_S / 2 * 1e9, 'the middle', 60.0)
            limited_by = _guard(robot)['limited_by']
            robot.until(lambda now: now.at_ns > begun_ns + _RUN_S * 1e9, 'the end', 60.0)
            said = _guard(robot)['warning']
        finally:
            robot.drive(None)
            spoiler.end()
        track = robot.since(begun_ns)
        last, fastest = track[-1], max(each.ahead_m_s for each in track)
        problem = ''
        if last.contacts:
            problem = 'CONTACT'
        elif share and not said:
            problem = 'no warning'
        elif not share and ('readings' in limited_by or fastest < _MOVES_M_S):
            problem = 'slow'
        report.add(problem, board=board, how=how, value=value, share=share, asked_m_s=speed_m_s,
                   free_m=free_m, fastest_m_s=fastest, left_m=last.free_m, contacts=last.contacts,
                   impact_m_s=last.impact_m_s, said=said or limited_by)


def _guard(robot: Robot) -> dict[str, Any]:
    """Return the statistics of the guard."""
    return next(dict(each['values']) for each in robot.client.statistics().modules
                if each['name'] == 'collision_guard')


def main() -> int:
    """Run all, and return the exit code."""
    made = parser(__doc__.split('\n\n')[0])
    made.add_argument('--speeds', default='0.8', help='asked for, in m/s')
    made.add_argument('--free', default='0.45', help='at the attack, in m')
    made.add_argument('--shares', default='0.5,0.7,0.85,0.95,1', help='of the rays, from 0 to 1')
    made.add_argument('--values', default='nan,zero', help='in place of the rays')
    made.add_argument('--how', default='ahead,on the way,scattered', help='which rays, and when')
    arguments = made.parse_args()
    if wrong := [each for each in arguments.shares.split(',') if not 0.0 <= float(each) <= 1.0]:
        made.error(f'--shares {",".join(wrong)}: give shares from 0 to 1, such as 0.5')
    report = Report(COLUMNS)
    for board in boards(arguments):
        for speed in map(float, arguments.speeds.split(',')):
            attack(report, board, 'ahead', 'nan', 0.0, speed, _OPEN_M, arguments)
        for how in arguments.how.split(','):
            for value in arguments.values.split(','):
                for share in map(float, arguments.shares.split(',')):
                    for speed in map(float, arguments.speeds.split(',')):
                        for free in map(float, arguments.free.split(',')):
                            attack(report, board, how, value, share, speed, free, arguments)
    return report.end(arguments.out)


if __name__ == '__main__':
    sys.exit(main())
