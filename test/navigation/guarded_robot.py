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

"""A robot among points, with a scanner, that does what comes out of its guard."""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import Any

import numpy as np

from rt_robot_os.features.navigation.collision_guard import CollisionGuard
from rt_robot_os.motion.differential import moved
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.motion.run_on import RunOn
from rt_robot_os.testing.module_bench import ModuleBench

TWIST, MS = 'geometry_msgs/msg/Twist', 1_000_000
RAYS = 720
ANGLES = -math.pi + 2 * math.pi / RAYS * np.arange(RAYS)


class Guarded:
    """A robot among points, with a scanner, that does what comes out of its guard."""

    def __init__(self, points: Any = (), scan_hz: float = 20.0, run_on: RunOn = RunOn(),
                 **changes: Any) -> None:
        self.bench = ModuleBench()
        self.bench.run_on = run_on
        self.bench.mountings['laser'] = changes.pop('mounted', Mounting((0.1, 0.0, 0.2)))
        self.limits = 0.02, 10.0
        self.bench.mountings['sonar'] = Mounting((0.2, 0.0, 0.1))
        self.command = self.bench.topic('cmd_vel_mux', TWIST)
        self.scan = self.bench.topic('scan', 'sensor_msgs/msg/LaserScan', {
            'header.frame_id': 'laser', 'ranges': RAYS, 'intensities': 0})
        self.range = self.bench.topic('sonar', 'sensor_msgs/msg/Range', {
            'header.frame_id': 'sonar'})
        self.bumper = self.bench.topic('bumper', 'std_msgs/msg/UInt8')
        for topic in changes.pop('topics', ()):
            self.bench.topic(topic, 'std_msgs/msg/Float64')
        self.guard = self.bench.add(CollisionGuard, 'guard', priority=60, **changes)
        self.reasons = self.bench.watch('stop_reason')
        self.spoil: Callable[[Any], None] = lambda ranges: None  # what is wrong with the scanner
        self.points = np.array(points, float).reshape(-1, 2)
        self.pose, self.velocity = (0.0, 0.0, 0.0), (0.0, 0.0)
        self.out: list[tuple[float, float, float]] = []
        self._since_ns = 0
        kernel = self.bench.kernel
        wheels = kernel.add_task('wheels', self.drive, priority=70)
        self._safe = self.bench.bus.subscribe('cmd_vel_safe', 'wheels', task=wheels)
        self.scan_task = kernel.add_task('scanner', self.see, priority=50, rate_hz=scan_hz)

    # ---- the robot ----

    def go_on(self) -> None:
        now_ns = self.bench.kernel.now_ns()
        step_s = (now_ns - self._since_ns) / 1e9
        self.pose = moved(self.pose, self.velocity[0] * step_s, self.velocity[1] * step_s)
        self._since_ns = now_ns

    def drive(self) -> None:
        while self._safe.take():
            self.go_on()
            self.velocity = self._safe.msg.linear.x, self._safe.msg.angular.z
            self.out.append((round(self._since_ns / 1e9, 3), *self.velocity))

    def seen(self) -> np.ndarray:
        """Return the points as the robot sees them."""
        x, y, yaw = self.pose
        d = self.points - (x, y)
        c, s = math.cos(yaw), math.sin(yaw)
        return np.stack((c * d[:, 0] + s * d[:, 1], c * d[:, 1] - s * d[:, 0]), axis=1)

    def see(self) -> None:
        self.go_on()
        ranges = np.full(RAYS, math.inf, np.float32)
        dx, dy = (self.seen() - (0.1, 0.0)).T
        ray = np.rint((np.arctan2(dy, dx) + math.pi) / (2 * math.pi / RAYS)).astype(int) % RAYS
        np.minimum.at(ranges, ray, np.hypot(dx, dy).astype(np.float32))
        self.spoil(ranges)
        self.show(ranges)

    def show(self, ranges: Any) -> None:
        msg = self.scan.msg
        msg.angle_min, msg.angle_increment = -math.pi, 2 * math.pi / RAYS
        msg.range_min, msg.range_max = self.limits
        msg.ranges[:] = ranges
        self.scan.publish()

    # ---- who steers ----

    def steer(self, v: float, w: float = 0.0, from_s: float = 0.06, until_s: float = 60.0) -> None:
        def do() -> None:
            if from_s <= self.bench.kernel.now_ns() / 1e9 < until_s:
                self.command.msg.linear.x, self.command.msg.angular.z = v, w
                self.command.publish()
        self.bench.kernel.add_task(f'steer {v} {w} {from_s}', do, priority=40, rate_hz=20.0,
                                   phase_ns=13 * MS)

    def ping(self, distance: float, minimum: float = 0.1, maximum: float = 3.0) -> None:
        msg = self.range.msg
        msg.min_range, msg.max_range, msg.field_of_view = minimum, maximum, 0.3
        msg.range = distance
        self.range.publish()

    def bump(self, bits: int) -> None:
        self.bumper.msg.data = bits
        self.bumper.publish()

    def told(self) -> list[str]:
        found = []
        while self.reasons.take():
            found.append(str(self.reasons.msg.data))
        return found
