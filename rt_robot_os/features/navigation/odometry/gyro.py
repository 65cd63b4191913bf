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

"""The turn of a robot about the vertical, from an inertial sensor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
import math
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.motion.angles import roll_pitch_yaw_of
from rt_robot_os.motion.gyro_turn import GyroTurn
from rt_robot_os.motion.mounting import in_base
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.motion.quaternion import conjugate
from rt_robot_os.motion.quaternion import multiply
from rt_robot_os.motion.quaternion import rotate
from rt_robot_os.topics import Subscription

# An acceleration outside of these is not gravity, in m/s^2.
_GRAVITY_LEAST: Final = 5.0
_GRAVITY_MOST: Final = 20.0
# Smallest and largest number of samples of the mean.
_WEIGHED_LEAST: Final = 100
_WEIGHED_MOST: Final = 1000


class VerticalGyro:
    """
    Read ``sensor_msgs/msg/Imu`` up to a moment; safe in the real-time loop.

    :param imu: the samples.
    :param mountings: of the frames of devices; a missing one is assumed to be aligned with the
        robot.
    :param gap_s: longest pause to integrate over.
    :param attitude: read the orientation of the samples as well.
    :ivar covered: there was a sample near the last requested time.
    :ivar uncovered: requests without a sample near their time.
    :ivar without_rate: samples that are marked as having no angular velocity.
    :ivar heading_rad: of the robot, from the last orientation, predicted to the requested time;
        NaN without.
    :ivar heading_variance: as published by the sensor.
    :ivar pitch_rad: of the robot, nose down positive; NaN without.
    """

    def __init__(self, imu: Subscription, mountings: Mapping[str, Mounting], gap_s: float,
                 attitude: bool = False) -> None:
        self.turn = GyroTurn(gap_s)
        self.uncovered = self.without_rate = 0
        self.covered = False
        self.heading_rad = self.pitch_rad = math.nan
        self.heading_variance = 0.0
        self._sensor_heading_rad = math.nan
        self._rate = 0.0
        self._gravity = (0.0, 0.0, 0.0)
        self._weighed = 0
        self._imu = imu
        mounted = in_base(mountings, imu.msg.header.frame_id)
        # The vertical component of each axis of the sensor.
        self._up = rotate(conjugate(mounted.quaternion()), (0.0, 0.0, 1.0))
        self._unpack = imu.topic.layout.packer('angular_velocity').unpack
        self._unpack_acceleration = imu.topic.layout.packer('linear_acceleration').unpack
        self._acceleration_covariance = imu.msg.linear_acceleration_covariance
        self._rate_covariance = imu.msg.angular_velocity_covariance
        self._attitude = attitude
        self._from_base = conjugate(mounted.quaternion())
        self._unpack_attitude = imu.topic.layout.packer('orientation').unpack
        self._attitude_covariance = imu.msg.orientation_covariance

    def until(self, stamp_ns: int) -> float:
        """
        Return the turn of the robot since the time of the last call, in rad.

        :return: NaN when samples are missing.
        """
        turn, imu = self.turn, self._imu
        # One sample beyond the moment, to interpolate; the rest waits for the next call.
        while turn.stamp_ns < stamp_ns and imu.take():
            self._add(imu)
        angle = turn.until(stamp_ns)
        self.covered = angle == angle
        if not self.covered:
            self.uncovered += 1
            # Another clock, or far behind: continue with the newest.
            if imu.latest():
                self._add(imu)
        if self._attitude:
            ahead_s = (stamp_ns - turn.stamp_ns) / NS_PER_S
            self.heading_rad = self._sensor_heading_rad + (
                self._rate * ahead_s if self.covered else math.nan)
        return angle

    def _add(self, imu: Subscription) -> None:
        if self._rate_covariance[0] == -1.0:
            self.without_rate += 1
            return
        x, y, z = self._unpack(imu.buffer)
        a, b, c = self._up
        rate = a * x + b * y + c * z
        if self.turn.add(imu.stamp_ns, rate if math.isfinite(rate) else math.nan):
            self._rate = rate
            self._weigh(imu)
            if self._attitude:
                self._read_attitude(imu)

    @property
    def gravity_off_rad(self) -> float:
        """
        Return the angle between the mean acceleration and the vertical of the mounting.

        0 until enough samples have an acceleration.
        """
        length = math.hypot(*self._gravity)
        if self._weighed < _WEIGHED_LEAST or not length:
            return 0.0
        cosine = sum(a * b for a, b in zip(self._gravity, self._up)) / length
        return math.acos(max(-1.0, min(1.0, cosine)))

    def _weigh(self, imu: Subscription) -> None:
        """Add an acceleration to the mean, unless the sensor has none."""
        x, y, z = self._unpack_acceleration(imu.buffer)
        if (self._acceleration_covariance[0] == -1.0
                or not _GRAVITY_LEAST < math.hypot(x, y, z) < _GRAVITY_MOST):
            return
        self._weighed += 1
        share = 1.0 / min(self._weighed, _WEIGHED_MOST)
        a, b, c = self._gravity
        self._gravity = a + (x - a) * share, b + (y - b) * share, c + (z - c) * share

    def _read_attitude(self, imu: Subscription) -> None:
        sensor = self._unpack_attitude(imu.buffer)
        length = math.hypot(*sensor)
        if self._attitude_covariance[0] == -1.0 or not 0.5 < length < 2.0:
            self._sensor_heading_rad = self.pitch_rad = math.nan
            return
        x, y, z, w = sensor
        robot = multiply((x / length, y / length, z / length, w / length), self._from_base)
        _, self.pitch_rad, self._sensor_heading_rad = roll_pitch_yaw_of(*robot)
        self.heading_variance = float(self._attitude_covariance[8])

    def statistics(self) -> Mapping[str, Any]:
        """Return the counters."""
        return {**{f'gyro_{name}': value for name, value in asdict(self.turn.counters).items()},
                'gyro_gravity_off_deg': math.degrees(self.gravity_off_rad),
                'gyro_uncovered': self.uncovered, 'gyro_without_rate': self.without_rate}
