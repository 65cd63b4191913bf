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
Freeze the core, the node or both while commands come: what waited must not move the robot.

    scripts/attacks/stale_commands.py                    # all four boards, ways and times
    scripts/attacks/stale_commands.py --boards odrive --who node --freezes 1.5

Commands come at 20 Hz on ``/cmd_vel`` of ROS 2, the process gets SIGSTOP, the sender goes on for
0.3 s and ends, and the process gets SIGCONT some time after the stop. The robot must not be driven
later than 1.0 s after the last command. A board whose core stands still goes on until a time-out
of its own firmware ends it: with a frozen core it has until 0.5 s after SIGCONT, when the core has
told it to stop. Driven is what keeps three quarters of the speed that it had, or becomes faster
again; what then coasts is shown as ``moved_until_s``. The exit code is 1 when a robot was driven
later, or did not come to rest.
"""

from __future__ import annotations

import argparse
from contextlib import suppress
import math
import os
import signal
import subprocess
import sys
import time

from report import boards
from report import parser
from report import Report
from robot import Robot
from robot import Truth

COLUMNS = ('board', 'who', 'freeze_s', 'at_m_s', 'driven_until_s', 'limit_s', 'moved_until_s',
           'again_m_s')
# A board that goes on for long when its core falls silent is driven no faster.
SPEED_M_S, SLOW_M_S = 0.4, {'arduino_bridge': 0.2}
LIMIT_S = 1.0
WOKEN_S = 0.5
SENDS_ON_S = 0.3
WATCHED_S = 4.0
# Part of its speed that a robot keeps while it is driven, and by how much it gets faster then.
DRIVEN = 0.75
FASTER_M_S = 0.02
NS = 1_000_000_000
SENDER = """
import sys, threading, time
import rclpy
from geometry_msgs.msg import Twist
rclpy.init()
node = rclpy.create_node('attacker')
publisher = node.create_publisher(Twist, '/cmd_vel', 1)
ended = threading.Event()
threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
command = Twist()
command.linear.x = float(sys.argv[1])
while not ended.wait(0.05):
    last_ns = time.monotonic_ns()
    publisher.publish(command)
print(last_ns, flush=True)
"""


class RosSender:
    """Commands at 20 Hz by DDS, from a process of its own."""

    def __init__(self, robot: Robot, speed_m_s: float) -> None:
        self._process = subprocess.Popen(
            [sys.executable, '-c', SENDER, str(speed_m_s)], stdin=subprocess.PIPE,
            stdout=subprocess.PIPE, env=robot.environment)

    def end(self) -> int:
        """End it; return when its last command was sent, on CLOCK_MONOTONIC in ns."""
        told, _ = self._process.communicate(timeout=20.0)
        return int(told)


def attack(report: Report, board: str, who: str, freeze_s: float,
           arguments: argparse.Namespace) -> None:
    """Run one robot, and report it."""
    with Robot(board, start_free_m=5.0, whole=arguments.whole, node=True,
               realtime=arguments.realtime) as robot:
        speed_m_s = SLOW_M_S.get(board, SPEED_M_S)
        sender = RosSender(robot, speed_m_s)
        robot.until(lambda now: now.ahead_m_s > 0.8 * speed_m_s, 'the speed')
        pids = _pids(robot, who)
        frozen_ns, at_m_s = time.monotonic_ns(), robot.now.ahead_m_s
        try:
            for pid in pids:
                os.kill(pid, signal.SIGSTOP)
            time.sleep(SENDS_ON_S)
            last_ns = sender.end()
            time.sleep(max(0.0, freeze_s - (time.monotonic_ns() - frozen_ns) / NS))
        finally:
            woken_ns = time.monotonic_ns()
            for pid in pids:
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGCONT)
        end_ns = max(woken_ns, last_ns) + round(WATCHED_S * NS)
        robot.until(lambda now: now.at_ns > end_ns, 'the end')
        limit_ns = last_ns + round(LIMIT_S * NS)
        if who != 'node':
            limit_ns = max(limit_ns, woken_ns + round(WOKEN_S * NS))
        track = robot.since(frozen_ns)
        driven = [each.at_ns for each in track if abs(each.ahead_m_s) > DRIVEN * at_m_s]
        moving = [each.at_ns for each in track if each.is_moving]
        again_m_s = faster(track)
        problem = ('DRIVEN LATER' if driven and driven[-1] > limit_ns else
                   'DRIVEN AGAIN' if again_m_s > FASTER_M_S else
                   'NEVER STOOD' if track[-1].is_moving else '')
        report.add(problem, board=board, who=who, freeze_s=(woken_ns - frozen_ns) / NS,
                   at_m_s=at_m_s, driven_until_s=(driven[-1] - last_ns) / NS if driven else 0.0,
                   limit_s=(limit_ns - last_ns) / NS,
                   moved_until_s=(moving[-1] - last_ns) / NS if moving else 0.0,
                   again_m_s=again_m_s)


def faster(track: list[Truth]) -> float:
    """Return by how much a robot became faster again after half of its speed was gone."""
    speeds = [abs(each.ahead_m_s) for each in track]
    fell = next((number for number, speed in enumerate(speeds) if speed < speeds[0] / 2), None)
    least, most = math.inf, 0.0
    for speed in speeds[fell:] if fell is not None else ():
        least = min(least, speed)
        most = max(most, speed - least)
    return most


def _pids(robot: Robot, who: str) -> list[int]:
    """Return the processes to freeze; the node is the parent of its core."""
    core = robot.core_pid
    with open(f'/proc/{core}/stat', encoding='ascii', errors='replace') as status:
        node = int(status.read().rpartition(')')[2].split()[1])
    return {'core': [core], 'node': [node], 'both': [node, core]}[who]


def main() -> int:
    """Run all, and return the exit code."""
    made = parser(__doc__.split('\n\n')[0])
    made.add_argument('--who', default='core,node,both', help='gets SIGSTOP')
    made.add_argument('--freezes', default='0.6,1.5,3.0', help='from SIGSTOP to SIGCONT, in s')
    arguments = made.parse_args()
    # None but these processes is to hear the commands.
    os.environ.setdefault('ROS_DOMAIN_ID', str(1 + os.getpid() % 100))
    report = Report(COLUMNS)
    for board in boards(arguments):
        for who in arguments.who.split(','):
            for freeze_s in map(float, arguments.freezes.split(',')):
                attack(report, board, who, freeze_s, arguments)
    return report.end(arguments.out)


if __name__ == '__main__':
    sys.exit(main())
