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


"""What an ideal inertial sensor says while it is turned, and how far an estimate is off."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from dataclasses import dataclass
import math
from typing import Optional

from rt_robot_os.base.units import STANDARD_GRAVITY_M_S2 as G
from rt_robot_os.features.navigation.attitude.base import AttitudeFilter
from rt_robot_os.motion.quaternion import conjugate
from rt_robot_os.motion.quaternion import from_rotation
from rt_robot_os.motion.quaternion import IDENTITY
from rt_robot_os.motion.quaternion import multiply
from rt_robot_os.motion.quaternion import Quaternion
from rt_robot_os.motion.quaternion import rotate
from rt_robot_os.motion.quaternion import Vector

# East, north, up, in tesla: central Europe.
EARTH = (0.0, 2.0e-5, -4.4e-5)
STILL = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Sample:
    """What the sensor says at the end of a step, and how it is turned then."""

    rate: Vector
    acceleration: Vector
    field: Optional[Vector]
    dt_s: float
    truth: Quaternion


def plus(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def seen(truth: Quaternion, world: Vector) -> Vector:
    """Give a vector of the world in the sensor's axes."""
    return rotate(conjugate(truth), world)


@dataclass
class Motion:
    """
    A sensor that is turned.

    :ivar turning: angular velocity in the sensor's axes, by time.
    :ivar moving: acceleration in the world's axes.
    :ivar field: magnetic field in the world's axes.
    :ivar bias: that the gyroscope adds.
    """

    truth: Quaternion = IDENTITY
    turning: Callable[[float], Vector] = lambda _: STILL
    moving: Callable[[float], Vector] = lambda _: STILL
    field: Callable[[float], Vector] = lambda _: EARTH
    bias: Vector = STILL
    time_s: float = 0.0

    def step(self, dt_s: float, with_field: bool = True) -> Sample:
        """Turn on, with the angular velocity of the middle of the step."""
        rate = self.turning(self.time_s + dt_s / 2)
        self.truth = multiply(self.truth, from_rotation(*(dt_s * r for r in rate)))
        self.time_s += dt_s
        force = plus(self.moving(self.time_s), (0.0, 0.0, G))
        return Sample(
            plus(rate, self.bias), seen(self.truth, force),
            seen(self.truth, self.field(self.time_s)) if with_field else None, dt_s, self.truth)

    def samples(self, seconds: float, rate_hz: float = 100.0,
                with_field: bool = True) -> Iterator[Sample]:
        for _ in range(round(seconds * rate_hz)):
            yield self.step(1 / rate_hz, with_field)


def feed(attitude: AttitudeFilter, sample: Sample) -> Quaternion:
    return attitude.update(sample.rate, sample.acceleration, sample.field, sample.dt_s)


def follow(attitude: AttitudeFilter, motion: Motion, seconds: float, *, rate_hz: float = 100.0,
           with_field: bool = True) -> Off:
    """Run a filter along a motion and give the largest errors on the way."""
    worst = Off(0.0, 0.0)
    for sample in motion.samples(seconds, rate_hz, with_field):
        now = off(feed(attitude, sample), sample.truth)
        worst = Off(max(worst.inclination, now.inclination), max(worst.heading, now.heading))
    return worst


@dataclass(frozen=True)
class Off:
    """Errors in degrees."""

    inclination: float
    heading: float


def off(estimate: Quaternion, truth: Quaternion) -> Off:
    x, y, z, w = multiply(estimate, conjugate(truth))
    return Off(math.degrees(2 * math.atan2(math.hypot(x, y), math.hypot(z, w))),
               abs(math.degrees(math.remainder(2 * math.atan2(z, w), 2 * math.pi))))


def angle(p: Quaternion, q: Quaternion) -> float:
    """Give the turn from one orientation to another in degrees."""
    x, y, z, w = multiply(p, conjugate(q))
    return math.degrees(2 * math.atan2(math.sqrt(x * x + y * y + z * z), abs(w)))


def length(q: Quaternion) -> float:
    return math.sqrt(sum(v * v for v in q))


def swing(time_s: float) -> Vector:
    """Turn to and fro about all axes, as a hand does."""
    return (0.9 * math.sin(2.1 * time_s), 0.7 * math.cos(1.3 * time_s),
            0.8 * math.sin(0.7 * time_s + 1.0))
