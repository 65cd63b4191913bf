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

"""The pose of the robot for the controller, and whether it is good enough to drive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Any

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.motion.angles import yaw_of
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.pose_prediction import PosePrediction
from rt_robot_os.motion.reference_path import is_pose
from rt_robot_os.topics.subscription import Subscription

# A pose has seven numbers; then come those of a covariance of six by six, of which x, y and yaw
# have their variances here.
_POSE = 7
_X_X, _Y_Y, _YAW_YAW = _POSE, _POSE + 7, _POSE + 35


@dataclass
class PoseInputCounters:
    """Counters of samples, used and refused as not finite."""

    poses: int = 0
    poses_refused: int = 0
    odometry: int = 0
    odometry_refused: int = 0


class SampleAge:
    """
    The age of the last sample of a topic: of its stamp, or of its arrival if that is older.

    Samples of a source whose clock stands still become old; one whose clock runs ahead counts from
    its arrival.
    """

    def __init__(self) -> None:
        self._since_ns = -1

    def update(self, stamp_ns: int, now_ns: int) -> None:
        """Record a sample."""
        self._since_ns = min(stamp_ns, now_ns)

    def age_s(self, now_ns: int) -> float:
        """Return the age of the last one; infinite before the first."""
        return (now_ns - self._since_ns) / NS_PER_S if self._since_ns >= 0 else math.inf


class PoseInput:
    """
    Poses and odometry, and the predicted pose.

    :ivar prediction: of the present pose.
    :ivar position_stddev_m: of the last pose; so is the next.
    """

    def __init__(self, pose: Subscription, odom: Subscription) -> None:
        self._pose, self._odom = pose, odom
        self._unpack_pose = pose.topic.layout.packer('pose.pose', 'pose.covariance').unpack
        self._unpack_odom = odom.topic.layout.packer(
            'pose.pose', 'twist.twist.linear.x', 'twist.twist.angular.z').unpack
        self.prediction = PosePrediction()
        self.counters = PoseInputCounters()
        self.pose_source, self.odom_source = SampleAge(), SampleAge()
        self.position_stddev_m = self.heading_stddev_rad = math.inf

    def receive(self, now_ns: int) -> None:
        """Receive new samples; safe in the real-time loop."""
        prediction, odom, pose = self.prediction, self._odom, self._pose
        while odom.take():
            *numbers, linear, angular = self._unpack_odom(odom.buffer)
            found = planar_of(numbers)
            if found is None or not (math.isfinite(linear) and math.isfinite(angular)):
                self.counters.odometry_refused += 1
                continue
            self.counters.odometry += 1
            self.odom_source.update(odom.stamp_ns, now_ns)
            prediction.add_odometry(odom.stamp_ns, found, (linear, angular))
        if pose.latest():
            self._localised(now_ns)

    def _localised(self, now_ns: int) -> None:
        pose = self._pose
        numbers = self._unpack_pose(pose.buffer)
        found = planar_of(numbers[:_POSE])
        position, heading = numbers[_X_X] + numbers[_Y_Y], numbers[_YAW_YAW]
        # A negative variance means unknown.
        if found is None or not (position >= 0.0 and heading >= 0.0):
            self.counters.poses_refused += 1
            return
        self.counters.poses += 1
        self.position_stddev_m, self.heading_stddev_rad = math.sqrt(position), math.sqrt(heading)
        self.pose_source.update(pose.stamp_ns, now_ns)
        self.prediction.add_pose(pose.stamp_ns, found)

    def problem(self, now_ns: int, timeout_s: float, position_most_m: float,
                heading_most_rad: float) -> str:
        """Return why the robot must not drive; empty when it may."""
        for source, noun in ((self.odom_source, 'odometry'), (self.pose_source, 'pose')):
            age_s = source.age_s(now_ns)
            if age_s > timeout_s:
                return f'no {noun} yet' if math.isinf(age_s) else (
                    f'{noun} is {age_s:.1f} s old, at most {timeout_s:g}')
        if self.position_stddev_m > position_most_m:
            return (f'position is known to {self.position_stddev_m:.2f} m only, at most '
                    f'{position_most_m:g}')
        if self.heading_stddev_rad > heading_most_rad:
            return (f'heading is known to {math.degrees(self.heading_stddev_rad):.0f} deg only, '
                    f'at most {math.degrees(heading_most_rad):.0f}')
        return '' if self.prediction.known else 'no pose since odometry began anew'


def planar(pose: Any) -> Pose | None:
    """Return x, y and heading of a ``geometry_msgs/msg/Pose``; None when it is invalid."""
    return planar_of((*map(float, pose.position), *map(float, pose.orientation)))


def planar_of(numbers: Sequence[float]) -> Pose | None:
    """
    Return x, y and heading of a pose; None when it is invalid.

    :param numbers: of a ``geometry_msgs/msg/Pose``: the position, then the quaternion.
    """
    x, y, _, a, b, c, d = numbers
    # A rotation has the length 1; otherwise it was not filled in, or is not a number.
    if not 0.5 < a * a + b * b + c * c + d * d < 2.0:
        return None
    found = x, y, yaw_of(a, b, c, d)
    return found if is_pose(found) else None
