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
Let a module above the guard run away while the robot drives at a wall.

    scripts/attacks/runaway_module.py                      # all four boards, three ways
    scripts/attacks/runaway_module.py --boards kobuki --how loop

At priority 70 the module computes without end (``loop``, without a budget), swallows each abort of
its budget (``swallow``), or makes one long native call (``native``). The watchdog, the budget or
the supervision by the node ends that. The exit code is 1 when the robot touched the wall or did
not come to rest, or when the core did not answer again within ``BACK_S``.
"""

from __future__ import annotations

import argparse
import sys
import time

from report import boards
from report import parser
from report import Report
from robot import Robot
from robot import stopping
from robot import wait

from rt_robot_os.base.errors import LinkError
from rt_robot_os.link.client import LinkClient

COLUMNS = ('board', 'how', 'at_m_s', 'on_s', 'on_m', 'left_m', 'contacts', 'back_s', 'restarted')
#: The core answers again: 2 s of the watchdog, or 3 s until the node misses its sign of life, and
#: the start of the next core on a busy machine.
BACK_S = 30.0
_WAYS = ('loop', 'swallow', 'native')


def attack(report: Report, board: str, how: str, arguments: argparse.Namespace) -> None:
    """Run one robot, and report it."""
    budget = {'budget_us': 20000.0, 'on_budget': 'abort'} if how == 'swallow' else {}
    section = {'type': 'runaway:Runaway', 'rate_hz': 10.0, 'priority': 70, 'how': how, **budget}
    with Robot(board, start_free_m=2.0, whole=arguments.whole, node=True,
               realtime=arguments.realtime, modules=('runaway',),
               changes={'runaway': section}) as robot:
        robot.drive(0.5)
        robot.until(lambda now: now.free_m <= arguments.free, 'the place of the attack', 60.0)
        before, pid = robot.now, robot.core_pid
        begun_ns = time.monotonic_ns()
        (robot.folder / 'run_away').touch()
        problem = ''
        wait(lambda: not (robot.folder / 'run_away').exists(), 'the module to run away')
        robot.drive(None)
        back_pid = 0

        def answers() -> bool:
            nonlocal back_pid
            try:
                client = LinkClient(robot.socket, 'attack again')
                try:
                    back_pid = int(client.core['pid'])
                    return bool(client.statistics().devices)
                finally:
                    client.close()
            except (LinkError, OSError):
                return False

        try:
            wait(answers, 'a core that answers', lambda: robot.log('core')[-500:], BACK_S)
        except RuntimeError as error:
            problem = str(error).splitlines()[0]
        back_s = (time.monotonic_ns() - begun_ns) / 1e9
        try:
            robot.until_rest()
        except RuntimeError as error:
            problem = str(error).splitlines()[0]
        track = robot.since(begun_ns)
        on_s, on_m = stopping(track)
        if track[-1].contacts:
            problem = 'CONTACT'
        report.add(problem, board=board, how=how, at_m_s=before.ahead_m_s, on_s=on_s, on_m=on_m,
                   left_m=track[-1].free_m, contacts=track[-1].contacts, back_s=back_s,
                   restarted=int(back_pid != pid))


def main() -> int:
    """Run all, and return the exit code."""
    made = parser(__doc__.split('\n\n')[0])
    made.add_argument('--how', default=','.join(_WAYS), help='loop, swallow, native')
    made.add_argument('--free', type=float, default=0.8, help='at the attack, in m')
    arguments = made.parse_args()
    report = Report(COLUMNS)
    for board in boards(arguments):
        for how in arguments.how.split(','):
            attack(report, board, how, arguments)
    return report.end(arguments.out)


if __name__ == '__main__':
    sys.exit(main())
