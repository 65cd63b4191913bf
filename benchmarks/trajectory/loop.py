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
The control loop of the experiment: one cycle, which any system may call, and what it notes.

It is the same object for a task, a thread and a timer, and it knows its period but not when it is
called: as loops are written, it takes for granted that it is called on time.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field
import math
import time
from typing import Any
from typing import Final

from benchmarks.trajectory.robot import Robot
import numpy as np

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.motion.controllers import make_controller
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.follower import Follower
from rt_robot_os.motion.follower import Phase
from rt_robot_os.motion.follower_tuning import FollowerTuning
from rt_robot_os.motion.velocity_limits import VelocityLimits

# Marks are looked at for so long before the robot drives; after its last command it comes to rest.
_LOOK_NS: Final = NS_PER_S
_REST_NS: Final = NS_PER_S
_POSE_STEP_NS: Final = 10 * NS_PER_MS


@dataclass(frozen=True)
class Drive:
    """
    What is driven, and how.

    :ivar start: where the robot stands.
    :ivar poses: the way; a single one is a goal.
    :ivar period_ns: of the loop.
    :ivar law: that controls.
    :ivar gains: of the law; of those that are missing its own.
    """

    start: Pose
    poses: Sequence[Pose]
    period_ns: int
    limits: VelocityLimits
    tuning: FollowerTuning
    law: str = 'kanayama'
    gains: Mapping[str, float] = field(default_factory=dict)


class Trace:
    """Numbers in rows, in memory that is there beforehand; further ones are left out."""

    def __init__(self, columns: Sequence[str], room: int) -> None:
        self.columns = columns
        self.count = 0
        self._values = array('d', bytes(8 * room * len(columns)))
        self._room = room

    def note(self, *row: float) -> None:
        """Note a row."""
        if self.count < self._room:
            at = self.count * len(row)
            for i, value in enumerate(row):
                self._values[at + i] = value
            self.count += 1

    def taken(self) -> dict[str, Any]:
        """Return each column by its name."""
        width = len(self.columns)
        rows = np.array(self._values[:self.count * width]).reshape(-1, width)
        return {name: rows[:, i] for i, name in enumerate(self.columns)}


class ControlLoop:
    """
    The loop.

    :ivar over: the robot has arrived, or has given up.
    :ivar cycles: time in s, pose of the robot, and the time in ns that the control took.
    """

    def __init__(self, drive: Drive, robot: Robot, room: int = 20_000,
                 clock_ns: Callable[[], int] = time.monotonic_ns) -> None:
        """
        Make the loop; nothing moves yet.

        :param clock_ns: in whose time the robot drives.
        """
        self.over = False
        self.cycles = Trace(('time_s', 'x_m', 'y_m', 'heading_rad', 'linear_m_s',
                             'angular_rad_s', 'control_ns'), room)
        self._drive = drive
        self._robot = robot
        self._follower = Follower(make_controller(drive.law, drive.gains), drive.limits,
                                  drive.tuning)
        self._period_s = drive.period_ns / NS_PER_S
        self._now_ns = clock_ns
        self._begin_ns = self._stopped_ns = 0
        self._moves = False

    def prepare(self, now_ns: int) -> None:
        """Let the robot look at the marks, and plan its way: the second before a moment."""
        robot, drive = self._robot, self._drive
        robot.advance(now_ns - _LOOK_NS)
        pose = robot.pose(now_ns)
        self._follower.go(drive.poses, pose)

    def cycle(self) -> None:
        """Measure, control, command; called once a period."""
        if self.over:
            return
        begin_ns = self._now_ns()
        if not self._begin_ns:
            self._begin_ns = begin_ns
        robot = self._robot
        pose = robot.pose(begin_ns, robot.lag_s)
        true = robot.base.pose
        control_ns = time.perf_counter_ns()
        command = self._follower.step(pose, self._period_s, robot.velocity)
        control_ns = time.perf_counter_ns() - control_ns
        now_ns = self._now_ns()
        if command is None or self._follower.phase is Phase.REST:
            command = (0.0, 0.0)
            self.over = True
        moves = command != (0.0, 0.0)
        if self._moves and not moves:
            self._stopped_ns = now_ns
        self._moves = moves
        robot.command(now_ns, *command)
        self.cycles.note((begin_ns - self._begin_ns) / NS_PER_S, *true, *command, control_ns)

    def figures(self, now_ns: int) -> Mapping[str, float]:
        """
        Let the robot come to rest, and say where and when that was.

        :param now_ns: the end of the run.
        """
        robot, drive = self._robot, self._drive
        if not self.over:  # the time is over
            self._stopped_ns = now_ns
            robot.command(now_ns, 0.0, 0.0)
        robot.advance(now_ns + _REST_NS)
        x, y, heading = robot.base.pose
        start, goal = drive.start, drive.poses[-1]
        way = math.atan2(goal[1] - start[1], goal[0] - start[0])
        return {
            'arrived': float(self.over and self._follower.state == 'done'),
            'time_ms': (self._stopped_ns - self._begin_ns) / NS_PER_MS,
            'distance_m': (x - start[0]) * math.cos(way) + (y - start[1]) * math.sin(way),
            'aside_m': (y - start[1]) * math.cos(way) - (x - start[0]) * math.sin(way),
            'travelled_m': robot.travelled_m, 'heading_rad': heading,
            'end_x_m': x, 'end_y_m': y}

    @property
    def state(self) -> str:
        """Return what the follower says."""
        return self._follower.state
