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
A motor board and its wheels, for measurements: what was on its wire when, and when they stood.

It writes a line for each order that differs from the last, ``order T_NS LEFT_M_S RIGHT_M_S``, and
one for each change of its wheels, ``moves T_NS`` and ``rests T_NS``; times are CLOCK_MONOTONIC.

    ./scripts/bench drive_board LINK LOG
"""

from __future__ import annotations

import math
from pathlib import Path
import select
import sys
import time

from rt_robot_os.devices.roboclaw.simulated_unit import SimulatedUnit
from rt_robot_os.devices.roboclaw.wire import FIRST_ADDRESS
from rt_robot_os.sim.pty_port import PtyPort
from rt_robot_os.sim.world.drive_base import DriveBase

RADIUS_M = 0.075
SEPARATION_M = 0.34
TICKS = 4096.0
# Slower than this a wheel stands: three hundredths of the fastest that one drives from afar.
REST_M_S = 0.01
_STEP_S = 0.001
_RAD = math.tau / TICKS


def main(link: str, log: str) -> None:
    """Be the board until killed."""
    port = PtyPort(link)
    port.plug()
    unit = SimulatedUnit(FIRST_ADDRESS, 'USB Roboclaw 2x15a v4.2.4', False)
    base = DriveBase(wheel_radius_m=RADIUS_M, wheel_separation_m=SEPARATION_M)
    last = (0, 0)
    moves = False
    with Path(log).open('a', buffering=1) as lines:
        while True:
            select.select([port.fileno()], [], [], _STEP_S)
            now_ns = time.monotonic_ns()
            data = port.read()
            if data:
                angles = base.wheel_angles
                unit.counts = (round(angles[0] / _RAD), round(angles[1] / _RAD))
                answers = unit.handle_command(data, now_ns)
                if answers:
                    port.write(answers)
            unit.watch(now_ns)
            told = (unit.drive.first, unit.drive.second) if unit.drive.closed else (0, 0)
            if told != last:
                last = told
                left, right = (each * _RAD * RADIUS_M for each in told)
                lines.write(f'order {now_ns} {left:.5f} {right:.5f}\n')
            base.set_wheel_speeds(told[0] * _RAD, told[1] * _RAD)
            base.advance(now_ns)
            is_moving = max(map(abs, base.wheel_speeds)) * RADIUS_M >= REST_M_S
            if is_moving != moves:
                moves = is_moving
                lines.write(f'{"moves" if moves else "rests"} {now_ns}\n')


if __name__ == '__main__':
    main(sys.argv[1], sys.argv[2])
