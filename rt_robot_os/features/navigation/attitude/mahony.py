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
The filter that needs nothing installed: Mahony's, with five changes.

Mahony: integrate the gyroscope; turn the result, slowly, towards the up that the accelerometer
shows and the north that the magnetometer shows; what has to be turned again and again is the bias
of the gyroscope. Changed here:

1. Not the acceleration in the sensor's axes but its average in the world's turns the attitude, and
   it is not made a unit vector first. The mean acceleration of a robot that does not run away is
   gravity alone: vibration, jolts and turning cancel out in the mean of the vector, but not in the
   mean of its direction.
2. The magnetic field turns about the vertical only. Whatever it does, roll and pitch do not move.
3. What is not gravity and not the earth's field, by its length and dip, is rejected.
4. The first samples align immediately, and the gains then go down like those of a running mean.
5. At rest the bias is what the gyroscope says.

NumPy would be slower: three numbers are too few for it.
"""

from __future__ import annotations

import math
from typing import ClassVar
from typing import Final

from rt_robot_os.features.navigation.attitude.base import AttitudeFilter
from rt_robot_os.features.navigation.attitude.base import FilterTuning
from rt_robot_os.features.navigation.attitude.guards import FieldGuard
from rt_robot_os.features.navigation.attitude.guards import GravityGuard
from rt_robot_os.features.navigation.attitude.rest import RestDetector
from rt_robot_os.motion import quaternion
from rt_robot_os.motion.quaternion import Quaternion
from rt_robot_os.motion.quaternion import Vector

# The average and the turning are two delays in a row: with this part of the time constant for the
# first, a step is followed with an overshoot of 4 %, as by a Butterworth filter.
_AVERAGE_PART: Final = 0.5
# The gain of the bias in motion as a part of the square of the other gain; 1/4 would be the
# fastest without overshoot, but what is to be learned changes over minutes.
_BIAS_PART: Final = 0.016
_REST_BIAS_S: Final = 2.0
# Standard deviation of the bias, in rad/s: before it is known, learned in motion and at rest.
_STDDEV_START: Final = math.radians(0.5)
_STDDEV_MOTION: Final = math.radians(0.1)
_STDDEV_REST: Final = math.radians(0.03)
_STDDEV_S: Final = 200.0


class MahonyFilter(AttitudeFilter):
    """Mahony's complementary filter, changed as said above."""

    name: ClassVar[str] = 'mahony'

    def __init__(self, tuning: FilterTuning) -> None:
        super().__init__(tuning)
        self.bias_stddev = _STDDEV_START
        self._rest = RestDetector(tuning)
        self._guard = FieldGuard()
        self._gravity = GravityGuard()
        self._age_s = self._field_age_s = self._since_field_s = 0.0

    def update(self, rate: Vector, acceleration: Vector | None, field: Vector | None,
               dt_s: float) -> Quaternion:
        """Process a sample; see the base class."""
        self._since_field_s += dt_s
        if acceleration is None:
            self._turn(rate, dt_s)
        else:
            self.at_rest = self._rest.update(rate, acceleration, dt_s)
            self._learn_bias_stddev(dt_s)
            if self.at_rest and self.tuning.bias_at_rest:
                self._learn_at_rest(dt_s)
            self._turn(rate, dt_s)
            if self.aligned:
                self._level(acceleration, dt_s)
            else:
                self._align(acceleration)
        if field is not None and self.aligned:
            self._turn_north(field, rate, self._since_field_s)
            self._since_field_s = 0.0
        return self.attitude

    def restart(self) -> None:
        """Find up and north again; see the base class."""
        self.aligned = False
        self._age_s = self._field_age_s = self._since_field_s = 0.0
        self._rest.restart()

    def tune(self, tuning: FilterTuning) -> None:
        """Change the tuning."""
        self.tuning = tuning
        self._rest.tune(tuning)

    def _turn(self, rate: Vector, dt_s: float) -> None:
        """Integrate the angular velocity."""
        half_s = dt_s / 2
        bx, by, bz = self.bias
        a, b, c = (rate[0] - bx) * half_s, (rate[1] - by) * half_s, (rate[2] - bz) * half_s
        angle = math.sqrt(a * a + b * b + c * c)
        if angle > 1e-9:
            scale, d = math.sin(angle) / angle, math.cos(angle)
            a, b, c = a * scale, b * scale, c * scale
        else:
            d = 1.0
        x, y, z, w = self.attitude
        x, y, z, w = (w * a + x * d + y * c - z * b, w * b - x * c + y * d + z * a,
                      w * c + x * b - y * a + z * d, w * d - x * a - y * b - z * c)
        unit = 1 / math.sqrt(x * x + y * y + z * z + w * w)
        self.attitude = x * unit, y * unit, z * unit, w * unit

    def _align(self, acceleration: Vector) -> None:
        """Turn an acceleration upwards immediately, by the shortest rotation."""
        turn = quaternion.from_up(quaternion.rotate(self.attitude, acceleration))
        if turn is not None:
            self.attitude = quaternion.multiply(turn, self.attitude)
            self._gravity.restart()
            self.aligned = True

    def _level(self, acceleration: Vector, dt_s: float) -> None:
        """Average the acceleration and turn a little towards the up that it shows."""
        slow_s = self.tuning.inclination_time_s
        self._age_s = age_s = self._age_s + dt_s
        gravity = self._gravity
        self.acceleration_rejected = gravity.update(
            quaternion.rotate(self.attitude, acceleration),
            dt_s / min(age_s, slow_s * _AVERAGE_PART + dt_s), dt_s)
        if self.acceleration_rejected:
            return
        # About (p, q, 0) by the sine of the angle; upside down has no sine to go by.
        x, y, z = gravity.average
        p, q = y / gravity.length, -x / gravity.length
        if z < 0:
            p, q = _unit(p, q)
        if age_s > slow_s and self.tuning.bias_in_motion and not self.at_rest:
            self._learn_in_motion((p, q, 0.0), slow_s, dt_s)
        gain = dt_s / min(age_s, slow_s + dt_s)
        p, q = p * gain, q * gain
        gravity.average = x + q * z, y - p * z, z + p * y - q * x
        unit = 1 / math.sqrt(1 + (p * p + q * q) / 4)
        self.attitude = quaternion.multiply(
            (p / 2 * unit, q / 2 * unit, 0.0, unit), self.attitude)

    def _turn_north(self, field: Vector, rate: Vector, dt_s: float) -> None:
        """Turn a little about the vertical, towards the north that a magnetic field shows."""
        angle, dip, length = quaternion.heading_of_field(self.attitude, field)
        turning = math.sqrt(rate[0] * rate[0] + rate[1] * rate[1] + rate[2] * rate[2])
        trust = self._guard.judge(length, dip, turning, dt_s)
        if not self.tuning.field_rejection:
            trust = 1.0
        self.field_rejected = not trust
        if not trust:
            return
        slow_s = self.tuning.heading_time_s
        self.heading_known = True
        self._field_age_s = age_s = self._field_age_s + dt_s
        if age_s > slow_s and self.tuning.bias_in_motion and not self.at_rest:
            self._learn_in_motion((0.0, 0.0, -angle * trust), slow_s, dt_s)
        gain = dt_s * trust / min(age_s, slow_s + dt_s)
        self.attitude = quaternion.multiply(quaternion.about_up(-angle * gain), self.attitude)

    def _learn_in_motion(self, correction: Vector, slow_s: float, dt_s: float) -> None:
        """Subtract a part of a correction, about the world's axes in rad, from the bias."""
        x, y, z = quaternion.rotate(quaternion.conjugate(self.attitude), correction)
        self._learn(x, y, z, -_BIAS_PART * dt_s / (slow_s * slow_s))

    def _learn_at_rest(self, dt_s: float) -> None:
        (x, y, z), (bx, by, bz) = self._rest.rate, self.bias
        self._learn(x - bx, y - by, z - bz, dt_s / (_REST_BIAS_S + dt_s))

    def _learn(self, x: float, y: float, z: float, part: float) -> None:
        bx, by, bz = self.bias
        bx, by, bz = bx + part * x, by + part * y, bz + part * z
        most = self.tuning.bias_maximum_rad_s
        if not (-most <= bx <= most and -most <= by <= most and -most <= bz <= most):
            bx, by, bz = (max(-most, min(most, b)) for b in (bx, by, bz))
        self.bias = bx, by, bz

    def _learn_bias_stddev(self, dt_s: float) -> None:
        """Approach the standard deviation of the bias in this state."""
        tuning = self.tuning
        aim, slow_s = _STDDEV_START, _STDDEV_S
        if self.at_rest and tuning.bias_at_rest:
            aim, slow_s = _STDDEV_REST, _REST_BIAS_S
        elif tuning.bias_in_motion and self.heading_known and not self.field_rejected:
            aim = _STDDEV_MOTION
        self.bias_stddev += (aim - self.bias_stddev) * dt_s / (slow_s + dt_s)


def _unit(x: float, y: float) -> tuple[float, float]:
    """Make a vector of length 1, any when it has none."""
    length = math.sqrt(x * x + y * y)
    return (x / length, y / length) if length > 1e-6 else (1.0, 0.0)
