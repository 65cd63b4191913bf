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
A robot that does exactly what it is told, and what its sensors say of it, with known errors.

It has no dynamics on purpose: what is measured with it is an estimate, not a drive.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from dataclasses import field
import math
import random

from rt_robot_os.motion.differential import moved
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.differential import wheel_speeds

DT_S = 0.02
RADIUS_M = 0.05
SEPARATION_M = 0.30
# Of a motor that turns: 2 pi over the ticks of a revolution.
TICK_RAD = math.tau / 4096


@dataclass
class Robot:
    """
    A robot that does what it is told.

    :ivar drive: speed in m/s and turning rate in rad/s, by time.
    :ivar left_error: part by which the left wheel is larger than it is said to be.
    :ivar right_error: the same of the right one.
    :ivar wheel_noise_m: standard deviation of a wheel's travel after 1 m.
    :ivar gyro_bias: in rad/s.
    :ivar gyro_stddev: of a sample, in rad/s.
    """

    drive: Callable[[float], tuple[float, float]]
    pose: Pose = (0.0, 0.0, 0.0)
    left_error: float = 0.0
    right_error: float = 0.0
    wheel_noise_m: float = 0.0
    gyro_bias: float = 0.0
    gyro_stddev: float = 0.0
    seed: int = 1
    time_s: float = 0.0
    left_rad: float = 0.0
    right_rad: float = 0.0
    rate_rad_s: float = 0.0
    _random: random.Random = field(init=False)

    def __post_init__(self) -> None:
        self._random = random.Random(self.seed)

    def step(self, dt_s: float = DT_S) -> None:
        """Drive on for a step."""
        speed, rate = self.drive(self.time_s + dt_s / 2)
        self.time_s += dt_s
        left, right = wheel_speeds(speed, rate, SEPARATION_M)
        self.left_rad += self._rolled(left * dt_s) / (RADIUS_M * (1 + self.left_error))
        self.right_rad += self._rolled(right * dt_s) / (RADIUS_M * (1 + self.right_error))
        self.pose = moved(self.pose, speed * dt_s, rate * dt_s)
        # A gyroscope says how fast it turns now, not how fast in the mean of the step.
        self.rate_rad_s = self.drive(self.time_s)[1]

    def _rolled(self, way_m: float) -> float:
        """Return what a wheel turns on the ground for a way, in m."""
        if not self.wheel_noise_m:
            return way_m
        return way_m + self._random.gauss(0.0, self.wheel_noise_m * math.sqrt(abs(way_m)))

    @property
    def angles(self) -> tuple[float, float]:
        """Return the angles of the wheels in whole ticks."""
        return (math.floor(self.left_rad / TICK_RAD) * TICK_RAD,
                math.floor(self.right_rad / TICK_RAD) * TICK_RAD)

    def gyro(self) -> float:
        """Read the gyroscope, in rad/s."""
        return self.rate_rad_s + self.gyro_bias + self._random.gauss(0.0, self.gyro_stddev)

    def seen(self, stddev_m: float, stddev_rad: float) -> Pose:
        """Look at a landmark: the pose with noise."""
        x, y, heading = self.pose
        return (x + self._random.gauss(0.0, stddev_m), y + self._random.gauss(0.0, stddev_m),
                math.remainder(heading + self._random.gauss(0.0, stddev_rad), math.tau))

    def chance(self, part: float) -> bool:
        """Draw lots."""
        return self._random.random() < part

    def misled(self) -> Pose:
        """Look at a landmark that is another one, anywhere or near by."""
        if self.chance(0.5):
            return (self._random.uniform(-5.0, 5.0), self._random.uniform(-5.0, 5.0),
                    self._random.uniform(-math.pi, math.pi))
        x, y, heading = self.pose
        return (x + self._random.uniform(-0.3, 0.3), y + self._random.uniform(-0.3, 0.3),
                math.remainder(heading + self._random.uniform(-0.3, 0.3), math.tau))


def off(one: Pose, other: Pose) -> float:
    """Return the distance of two poses in m."""
    return math.hypot(one[0] - other[0], one[1] - other[1])


def turned(one: Pose, other: Pose) -> float:
    """Return the angle between the headings of two poses in rad."""
    return abs(math.remainder(one[2] - other[2], math.tau))


# Speed and rate of the eight, and how long it takes to reach them; a lobe is a whole turn.
_SPEED_M_S, _RATE_RAD_S, _RAMP_S, _REST_S = 0.3, 0.5, 0.5, 2.0
_LOBE_S = math.tau / _RATE_RAD_S + _RAMP_S


def eight(time_s: float) -> tuple[float, float]:
    """Stand for two seconds, then drive an eight at 0.3 m/s."""
    driven_s = time_s - _REST_S
    if driven_s <= 0.0:
        return 0.0, 0.0
    lobe, into_s = divmod(driven_s, _LOBE_S)
    rate = _RATE_RAD_S * min(1.0, into_s / _RAMP_S, (_LOBE_S - into_s) / _RAMP_S)
    return _SPEED_M_S * min(1.0, driven_s / _RAMP_S), rate if lobe % 2 == 0 else -rate
