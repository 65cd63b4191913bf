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
Samples of an inertial sensor as a filter needs them: finite, in order, with the time between.

The time comes from the stamps. A duplicate is dropped, so is a sample from before the last one. A
gap that is too long to integrate over, and stamps that jump back by as much, begin a new stretch.
"""

from __future__ import annotations

from dataclasses import asdict
from dataclasses import dataclass
from typing import Any
from typing import Final

import numpy.typing as npt

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.motion.quaternion import Vector
from rt_robot_os.topics import Subscription

# No sensor measures beyond these (rad/s, m/s^2); infinity and NaN are beyond them, too.
_RATE_MOST: Final = 350.0
_ACCELERATION_MOST: Final = 5000.0
# In any unit: only an impossible value is beyond it.
_FIELD_MOST: Final = 1e6
_FIELD_LEAST: Final = 1e-12


@dataclass
class ImuCounters:
    """
    Counters of samples, by what became of them.

    :ivar samples: handed to the filter.
    :ivar not_finite: dropped: a number is missing, infinite or impossible.
    :ivar without_rate: dropped: the sensor says that it has no angular velocity.
    :ivar without_acceleration: used, but the sensor says that it has no acceleration.
    :ivar duplicates: dropped: of the same stamp as the one before.
    :ivar backwards: dropped: older than the one before.
    :ivar gaps: stretches that ended because the next sample was too late, or stamped too early.
    :ivar fields: magnetic fields handed to the filter.
    :ivar fields_not_finite: dropped.
    :ivar fields_late: dropped: too far from the sample they came with.
    """

    samples: int = 0
    not_finite: int = 0
    without_rate: int = 0
    without_acceleration: int = 0
    duplicates: int = 0
    backwards: int = 0
    gaps: int = 0
    fields: int = 0
    fields_not_finite: int = 0
    fields_late: int = 0

    def as_dict(self) -> dict[str, int]:
        """Return the counters by name."""
        return asdict(self)


class ImuIntake:
    """
    Take samples from the topics of an inertial sensor.

    :param imu: of ``sensor_msgs/msg/Imu``.
    :param mag: of ``sensor_msgs/msg/MagneticField``; None without.
    :param first_dt_s: taken for the time before the first sample of a stretch.
    :param gap_s: the longest time to integrate over.
    :ivar rate: rad/s.
    :ivar acceleration: m/s^2; None when the sensor has none.
    :ivar field: the newest that is not newer than the sample; None when there is none.
    :ivar dt_s: since the sample before.
    :ivar gap_s: time between two stretches, when this sample begins one; else 0.
    """

    def __init__(self, imu: Subscription, mag: Subscription | None, first_dt_s: float,
                 gap_s: float) -> None:
        self.counters = ImuCounters()
        self.rate: Vector = (0.0, 0.0, 0.0)
        self.acceleration: Vector | None = None
        self.field: Vector | None = None
        self.dt_s = first_dt_s
        self.gap_s = 0.0
        self._imu, self._mag = imu, mag
        self._first_dt_s = first_dt_s
        self._gap_ns = round(gap_s * NS_PER_S)
        self._stamp_ns = 0
        self._field_waits = False
        self._unpack = imu.topic.layout.packer('angular_velocity', 'linear_acceleration').unpack
        if mag is not None:
            self._unpack_field = mag.topic.layout.packer('magnetic_field').unpack
        self._rate_covariance: npt.NDArray[Any] = imu.msg.angular_velocity_covariance
        self._acceleration_covariance: npt.NDArray[Any] = imu.msg.linear_acceleration_covariance

    def next_sample(self) -> bool:
        """
        Read the next usable sample; safe in the real-time loop.

        :return: whether there was one.
        """
        while self._imu.take():
            if self._read() and self._advance():
                self.field = None if self._mag is None else self._next_field(self._mag)
                self.counters.samples += 1
                return True
        return False

    def _read(self) -> bool:
        """Read the numbers and return whether they can be used."""
        a, b, c, x, y, z = self._unpack(self._imu.buffer)
        most, force = _RATE_MOST, _ACCELERATION_MOST
        if not (-most < a < most and -most < b < most and -most < c < most
                and -force < x < force and -force < y < force and -force < z < force):
            self.counters.not_finite += 1
            return False
        if self._rate_covariance[0] == -1.0:
            self.counters.without_rate += 1
            return False
        self.rate = a, b, c
        if self._acceleration_covariance[0] == -1.0:
            self.counters.without_acceleration += 1
            self.acceleration = None
        else:
            self.acceleration = x, y, z
        return True

    def _advance(self) -> bool:
        """Compute the time since the last sample and return whether this one is in order."""
        stamp_ns = self._imu.stamp_ns
        dt_ns = stamp_ns - self._stamp_ns
        self.gap_s = 0.0
        if 0 < dt_ns <= self._gap_ns:
            self.dt_s = dt_ns / NS_PER_S
        elif not self._stamp_ns or abs(dt_ns) > self._gap_ns:
            self.dt_s = self._first_dt_s
            if self._stamp_ns:
                self.counters.gaps += 1
                self.gap_s = abs(dt_ns) / NS_PER_S
        else:
            if dt_ns:
                self.counters.backwards += 1
            else:
                self.counters.duplicates += 1
            return False
        self._stamp_ns = stamp_ns
        return True

    def _next_field(self, mag: Subscription) -> Vector | None:
        """Find the newest field up to this sample; one from after it waits for the next."""
        newest: Vector | None = None
        while self._field_waits or mag.take():
            ahead_ns = mag.stamp_ns - self._stamp_ns
            if 0 < ahead_ns <= self._gap_ns:
                self._field_waits = True
                break
            self._field_waits = False
            if -self._gap_ns <= ahead_ns <= 0:
                newest = self._field_of(mag) or newest
            else:
                self.counters.fields_late += 1
        if newest is not None:
            self.counters.fields += 1
        return newest

    def _field_of(self, mag: Subscription) -> Vector | None:
        x, y, z = self._unpack_field(mag.buffer)
        most = _FIELD_MOST
        # A field of zero has no direction.
        if (-most < x < most and -most < y < most and -most < z < most
                and x * x + y * y + z * z > _FIELD_LEAST ** 2):
            return x, y, z
        self.counters.fields_not_finite += 1
        return None
