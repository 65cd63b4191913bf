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

"""Localisation on a recording: the module itself, on topics, as fast as it can be computed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field
import math
from typing import Any
from typing import Final

from benchmarks.localization.recording import Line
from benchmarks.localization.recording import RecordingError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.navigation.localization import Localization
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.motion.angles import yaw_of
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.topics import Bus
from rt_robot_os.topics import Publisher

_POSE: Final = 'geometry_msgs/msg/PoseWithCovarianceStamped'
# The kernel's clock has not begun at 0.
_BEGIN_NS: Final = NS_PER_S
# Of a magnetometer near motors and in buildings.
_HEADING_STDDEV_RAD: Final = 0.05


@dataclass
class Drive:
    """
    What came of a recording.

    :ivar time_s: of each pose, since the first line.
    :ivar poses: of the filter.
    :ivar odometry: wheel odometry alone, from the same start.
    :ivar fixes: measured poses.
    :ivar truth: where the robot was, by time; empty when the recording does not say.
    :ivar statistics: of the module at the end.
    """

    time_s: list[float] = field(default_factory=list)
    poses: list[Pose] = field(default_factory=list)
    odometry: list[Pose] = field(default_factory=list)
    fixes: list[Pose] = field(default_factory=list)
    truth: list[tuple[float, Pose]] = field(default_factory=list)
    statistics: dict[str, Any] = field(default_factory=dict)

    def errors(self) -> tuple[list[float], list[float]]:
        """Return the errors where the truth is known, in m and rad."""
        away: list[float] = []
        turned: list[float] = []
        index = 0
        for time_s, truth in self.truth:
            while index + 1 < len(self.time_s) and self.time_s[index + 1] <= time_s:
                index += 1
            if index < len(self.time_s) and abs(self.time_s[index] - time_s) < 0.1:
                pose = self.poses[index]
                away.append(math.hypot(pose[0] - truth[0], pose[1] - truth[1]))
                turned.append(abs(math.remainder(pose[2] - truth[2], math.tau)))
        return away, turned


def settings_for(lines: Sequence[Line]) -> dict[str, Any]:
    """Choose the settings by what a recording has."""
    kinds = {line.kind for line in lines}
    heading = any(line.kind == 'imu' and any(line.values[:4]) for line in lines)
    first = next(line.values for line in lines if line.kind == 'odom')
    return {
        'use_gyro': 'imu' in kinds, 'use_imu_heading': heading,
        'imu_heading_stddev_rad': _HEADING_STDDEV_RAD,
        'fix_topic': 'fix' if 'fix' in kinds else '', 'initial_pose_known': 'fix' not in kinds,
        'initial_heading_rad': yaw_of(0.0, 0.0, first[2], first[3]), 'initial_stddev_m': 0.0,
        'initial_stddev_rad': math.pi if heading else 0.0, 'speed_max_m_s': 20.0}


def replay(lines: Sequence[Line], imu: Mounting = Mounting()) -> Drive:
    """
    Run the module on a recording.

    :param imu: how its inertial sensor is mounted on the robot.
    :raises TopicError: the messages of ROS 2 are not installed.
    """
    return _Replay(lines, imu).run()


class _Replay:
    def __init__(self, lines: Sequence[Line], imu: Mounting) -> None:
        self.lines = lines
        self.begin_s = min(line.time_s for line in lines)
        self.drive = Drive()
        self.kernel = Kernel(VirtualClock())
        bus = Bus(self.kernel)

        def topic(name: str, message: str, frame: str, **fixed: str) -> Publisher:
            bus.declare(name, message, {'header.frame_id': frame, **fixed})
            return bus.publisher(name)

        self.odom = topic('odom', 'nav_msgs/msg/Odometry', 'odom', child_frame_id='base_link')
        self.imu = topic('imu/data', 'sensor_msgs/msg/Imu', 'imu_link')
        self.fix = topic('fix', _POSE, 'map')
        defaults = {each.name: each.default for each in Localization.fields()}
        self.module = Localization('localization', {**defaults, **settings_for(lines)})
        self.module.mountings = {'imu_link': imu}
        self.module.declare(bus, 0.0)
        self.module.bind(bus, self.kernel.add_task('localization', self.module.job, priority=40))
        self.kernel.add_async_task('player', self.play, priority=90)
        self.pose = bus.subscribe('pose', 'reader', task=self.kernel.add_task(
            'reader', self.read, priority=30))

    def run(self) -> Drive:
        self.module.configure()
        self.module.activate()
        self.kernel.run(self.stamp_of(max(self.lines, key=lambda line: line.time_s)) + NS_PER_S)
        if self.kernel.failures:
            raise RecordingError(f'the module failed: {self.kernel.failures[-1]}')
        self.drive.statistics = dict(self.module.statistics())
        return self.drive

    def stamp_of(self, line: Line) -> int:
        return _BEGIN_NS + round((line.time_s - self.begin_s) * NS_PER_S)

    async def play(self) -> None:
        """Publish each line at its time; one that is late at once, with its stamp."""
        handlers = {'odom': self._odom, 'imu': self._imu, 'fix': self._fix, 'truth': self._truth}
        for line in self.lines:
            stamp_ns = self.stamp_of(line)
            ahead_ns = stamp_ns - self.kernel.now_ns()
            if ahead_ns > 0:
                await self.kernel.sleep(ahead_ns)
            handlers[line.kind](stamp_ns, line.values)

    def read(self) -> None:
        """Note what the module publishes."""
        drive = self.drive
        while self.pose.take():
            position, q = self.pose.msg.pose.pose.position, self.pose.msg.pose.pose.orientation
            drive.time_s.append((self.pose.stamp_ns - _BEGIN_NS) / NS_PER_S)
            drive.poses.append((position.x, position.y, yaw_of(q.x, q.y, q.z, q.w)))

    def _odom(self, stamp_ns: int, values: tuple[float, ...]) -> None:
        x, y, qz, qw, vx, vy, wz, var_vx, var_wz = values
        message = self.odom.msg
        message.pose.pose.position = x, y, 0.0
        message.pose.pose.orientation = 0.0, 0.0, qz, qw
        message.twist.twist.linear = vx, vy, 0.0
        message.twist.twist.angular = 0.0, 0.0, wz
        message.twist.covariance[[0, 35]] = var_vx, var_wz
        self.odom.publish(stamp_ns)
        self.drive.odometry.append((x, y, yaw_of(0.0, 0.0, qz, qw)))

    def _imu(self, stamp_ns: int, values: tuple[float, ...]) -> None:
        message = self.imu.msg
        message.orientation = values[:4]
        message.orientation_covariance[0] = 0.0 if any(values[:4]) else -1.0
        message.angular_velocity = values[4:7]
        message.linear_acceleration = values[7:]
        self.imu.publish(stamp_ns)

    def _fix(self, stamp_ns: int, values: tuple[float, ...]) -> None:
        x, y, yaw, *variances = values
        message = self.fix.msg
        message.pose.pose.position = x, y, 0.0
        message.pose.pose.orientation = 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)
        message.pose.covariance[[0, 7, 35]] = variances
        self.fix.publish(stamp_ns)
        self.drive.fixes.append((x, y, yaw))

    def _truth(self, stamp_ns: int, values: tuple[float, ...]) -> None:
        x, y, yaw = values
        self.drive.truth.append(((stamp_ns - _BEGIN_NS) / NS_PER_S, (x, y, yaw)))
