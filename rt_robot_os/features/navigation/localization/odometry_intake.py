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

"""Turn odometry into steps for the filter: the motion from one sample to the next."""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.navigation.odometry.gyro import VerticalGyro
from rt_robot_os.motion.angles import yaw_of
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.pose_history import OdometryStep
from rt_robot_os.motion.poses import arc_between
from rt_robot_os.topics import Subscription

# Jitter of a pose in addition to the fastest speed.
_SLACK_M: Final = 0.05
# How fast a robot may move, or be pushed, without odometry.
_UNKNOWN_M_S: Final = 0.5
_UNKNOWN_RAD_S: Final = 1.0
_PERIOD_MOST_NS: Final = 2 * NS_PER_S
_STANDING_M_S: Final = 5e-4
_STANDING_RAD_S: Final = 1e-3
_STANDING_S: Final = 0.5
# Used if odometry has no covariance: 1 cm and 1 degree after 1 m, and after 1 s.
_VARIANCE_M: Final = 1e-4
_VARIANCE_RAD: Final = 3e-4
# A larger variance of a step, in m^2 and rad^2, is invalid.
_VARIANCE_MOST: Final = 1e4


@dataclass(frozen=True)
class StepTuning:
    """
    Error model of odometry and gyroscope.

    :ivar speed_max_m_s: faster motion is rejected.
    :ivar gyro_noise_rad: standard deviation of the gyroscope's turn after 1 s.
    :ivar gyro_scale_rad: after a turn of 1 rad.
    :ivar drift_walk: standard deviation of the drift's change after 1 s, or 1 m.
    :ivar heading_stddev_rad: least of a measured heading.
    :ivar heading_offset_rad: from the heading of the sensor to that on the map.
    """

    speed_max_m_s: float
    gyro_noise_rad: float
    gyro_scale_rad: float
    drift_walk: float
    heading_stddev_rad: float
    heading_offset_rad: float


@dataclass
class StepCounters:
    """
    Counters of samples of odometry.

    :ivar steps: used.
    :ivar not_finite: dropped: a number is missing or infinite.
    :ivar backwards: dropped: older than the one before, or as old: its clock stands still.
    :ivar restarts: its stamps restarted, earlier by more than a second.
    :ivar jumps: its pose jumped: the robot is assumed to stand, with a larger covariance.
    """

    steps: int = 0
    not_finite: int = 0
    backwards: int = 0
    restarts: int = 0
    jumps: int = 0


class OdometryIntake:
    """
    Make steps of ``nav_msgs/msg/Odometry``; safe in the real-time loop.

    :param gyro: replaces the turn of odometry; None: that is used unmodified.
    :param by_gyro: use its turn; else only its heading.
    :ivar pose: of odometry, of the last step.
    :ivar period_ns: between its last two samples.
    :ivar restarted: with the last step its stamps restarted.
    """

    def __init__(self, odom: Subscription, frames: tuple[str, str], tuning: StepTuning,
                 gyro: VerticalGyro | None, by_gyro: bool) -> None:
        given = odom.msg.header.frame_id, odom.msg.child_frame_id
        if given != frames:
            raise ConfigError([f'odom is of the frames {given[0]!r} -> {given[1]!r}, but '
                               f'odom_frame_id and base_frame_id are {frames[0]!r} and '
                               f'{frames[1]!r}: set them to that'])
        self.counters = StepCounters()
        self.pose: Pose = (0.0, 0.0, 0.0)
        self.restarted = False
        self.period_ns = 0
        self._odom = odom
        self._tuning = tuning
        self._gyro = gyro
        self._by_gyro = by_gyro
        layout = odom.topic.layout
        self._unpack = layout.packer('pose.pose').unpack
        self._twist_covariance = odom.msg.twist.covariance
        self._stamp_ns = 0
        self._standing_s = 0.0
        self._silent_ns = 0

    def next(self) -> OdometryStep | None:  # noqa: A003
        """Return the step up to the next usable sample."""
        odom = self._odom
        while odom.take():
            x, y, _, *orientation = self._unpack(odom.buffer)
            heading = yaw_of(*orientation)
            length = math.hypot(*orientation)
            if not (math.isfinite(x) and math.isfinite(y) and 0.5 < length < 2.0):
                self.counters.not_finite += 1
                continue
            dt_ns = odom.stamp_ns - self._stamp_ns
            self.restarted = bool(self._stamp_ns) and dt_ns <= -NS_PER_S
            if dt_ns <= 0 and not self.restarted:
                self.counters.backwards += 1
                continue
            before, self.pose = self.pose, (x, y, heading)
            first = not self._stamp_ns
            self._stamp_ns = odom.stamp_ns
            self.counters.steps += 1
            self.period_ns = 0 if first or self.restarted else min(dt_ns, _PERIOD_MOST_NS)
            if self._silent_ns and not self.restarted:
                # Measured poses have moved the estimate meanwhile: this motion is known already.
                return self.without(odom.stamp_ns, back=True)
            if self.restarted or first:
                self.counters.restarts += self.restarted
                if self._gyro is not None:
                    self._gyro.until(odom.stamp_ns)
                return OdometryStep(odom.stamp_ns)
            return self._step(before, dt_ns / NS_PER_S)
        return None

    def without(self, stamp_ns: int, back: bool = False) -> OdometryStep:
        """
        Return the step of a time without odometry: only the turn, if there is a gyroscope.

        :param stamp_ns: end of that time.
        :param back: odometry is back at that time.
        """
        begin_ns = self._silent_ns or self._stamp_ns
        self._silent_ns = 0 if back else stamp_ns
        dt_s = max(0, stamp_ns - begin_ns) / NS_PER_S if begin_ns else 0.0
        step = OdometryStep(stamp_ns, distance_variance=(_UNKNOWN_M_S * dt_s) ** 2,
                            turn_variance=(_UNKNOWN_RAD_S * dt_s) ** 2)
        if self._gyro is not None:
            self._turn_by(self._gyro, step, dt_s or 1.0, False)
        return step

    def _step(self, before: Pose, dt_s: float) -> OdometryStep:
        tuning, gyro = self._tuning, self._gyro
        distance, turn = arc_between(before, self.pose)
        covariance = self._twist_covariance
        step = OdometryStep(self._stamp_ns, distance, turn, distance,
                            float(covariance[0]) * dt_s * dt_s,
                            float(covariance[35]) * dt_s * dt_s,
                            float(covariance[5]) * dt_s * dt_s,
                            tuning.drift_walk ** 2 * abs(distance))
        if not (0.0 < step.distance_variance < _VARIANCE_MOST
                and 0.0 < step.turn_variance < _VARIANCE_MOST
                and step.covariance ** 2 <= step.distance_variance * step.turn_variance):
            amount = abs(distance) + 0.01 * dt_s
            step.distance_variance = _VARIANCE_M * amount
            step.turn_variance = _VARIANCE_RAD * amount
            step.covariance = 0.0
        gone_m = math.hypot(self.pose[0] - before[0], self.pose[1] - before[1])
        if gone_m > tuning.speed_max_m_s * dt_s + _SLACK_M:
            self.counters.jumps += 1
            step.distance_m = step.turn_rad = step.lever = step.covariance = 0.0
            # It may have moved on at any speed.
            step.distance_variance = (tuning.speed_max_m_s * dt_s) ** 2 / 3
            step.turn_variance = max(step.turn_variance, dt_s * dt_s)
        if gyro is not None:
            self._turn_by(gyro, step, dt_s, abs(turn) < _STANDING_RAD_S * dt_s
                          and gone_m < _STANDING_M_S * dt_s)
        return step

    def _turn_by(self, gyro: VerticalGyro, step: OdometryStep, dt_s: float, stands: bool) -> None:
        """Replace the turn of odometry by that of the inertial sensor."""
        tuning = self._tuning
        turned = gyro.until(step.stamp_ns)
        self._standing_s = self._standing_s + dt_s if stands else 0.0
        if gyro.pitch_rad == gyro.pitch_rad:
            # On a slope the wheels travel further than the robot on the map.
            step.distance_m *= math.cos(gyro.pitch_rad)
        if gyro.heading_rad == gyro.heading_rad:
            step.heading_rad = gyro.heading_rad + tuning.heading_offset_rad
            step.heading_variance = max(gyro.heading_variance, tuning.heading_stddev_rad ** 2)
        if not self._by_gyro:
            return
        if turned != turned:
            step.lever = step.drift_variance = 0.0  # the turn of odometry has no bias of a gyro
            return
        step.turn_rad, step.lever, step.covariance = turned, dt_s, 0.0
        step.turn_variance = (tuning.gyro_noise_rad ** 2 * dt_s
                              + tuning.gyro_scale_rad ** 2 * abs(turned))
        step.drift_variance = tuning.drift_walk ** 2 * dt_s
        if self._standing_s >= _STANDING_S:
            step.drift = turned / dt_s
            step.drift_measured_variance = tuning.gyro_noise_rad ** 2 / dt_s + 1e-6
