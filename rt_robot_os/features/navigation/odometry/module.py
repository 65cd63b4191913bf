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
The motion of the robot since its start: ``nav_msgs/msg/Odometry`` and its transform.

Each sample of ``joint_states`` gives one of ``odom`` and ``odom_to_base``, with its stamp.
Implausible samples are dropped and counted; without samples nothing is published.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from dataclasses import replace
import math
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import REQUIRED
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.navigation.odometry.gyro import VerticalGyro
from rt_robot_os.features.navigation.odometry.planar import flatten
from rt_robot_os.features.navigation.odometry.planar import half_turn
from rt_robot_os.features.navigation.odometry.planar import set_covariance
from rt_robot_os.modules.base import Module
from rt_robot_os.motion.mounting import BASE_FRAME
from rt_robot_os.motion.wheel_odometry import WheelOdometry
from rt_robot_os.motion.wheel_odometry import WheelParameters
from rt_robot_os.topics.ports import Input
from rt_robot_os.topics.ports import Output

_GYRO_GAP_S: Final = 0.1
_SILENT_S: Final = 1.0
# A single bad sample is counted; this many in a row are reported.
_BAD_IN_ROW: Final = 3
# Variance of the sideways velocity, in (m/s)^2: wheels do not roll sideways.
_SIDEWAYS: Final = 1e-6


class Odometry(Module):
    """Integrate the motion of the wheels, with the turn of a gyroscope if there is one."""

    joint_states = Input('joint_states', message='sensor_msgs/msg/JointState', wake=True)
    imu = Input('imu/data', message='sensor_msgs/msg/Imu')
    odom = Output('odom', 'nav_msgs/msg/Odometry', follows='joint_states')
    odom_to_base = Output('odom_to_base', 'geometry_msgs/msg/TransformStamped',
                          follows='joint_states')

    SETTINGS = (
        Field('wheel_radius_m', float, REQUIRED, 'Radius of the wheels, as in the section of the '
              'motor board', 'm', 0.001, 10.0),
        Field('wheel_separation_m', float, REQUIRED, 'Distance of the points where the wheels '
              'touch the ground, as in the section of the motor board', 'm', 0.01, 100.0),
        Field('left_wheel_radius_multiplier', float, 1.0, 'By calibration: the radius of '
              'the left wheel as a multiple of wheel_radius_m', '', 0.5, 2.0),
        Field('right_wheel_radius_multiplier', float, 1.0, 'The same of the right wheel', '',
              0.5, 2.0),
        Field('wheel_separation_multiplier', float, 1.0, 'The same of wheel_separation_m', '',
              0.5, 2.0),
        Field('left_joint', str, 'left_wheel_joint', 'Name of the left wheel in joint_states'),
        Field('right_joint', str, 'right_wheel_joint', 'Name of the right wheel in joint_states'),
        Field('use_gyro', bool, False, 'Use the turn of imu_topic; its bias is learned '
              'whenever the wheels stand for a second. Slipping wheels are detected then'),
        Field('odom_frame_id', str, 'odom', 'Frame of the pose'),
        Field('base_frame_id', str, BASE_FRAME, 'Frame of the robot'),
        Field('wheel_speed_max_m_s', float, 2.0, 'Fastest speed of a rim; a step that is faster '
              'is an error of the encoder', 'm/s', 0.01, 100.0),
        Field('wheel_noise_m', float, 0.005, 'Standard deviation of the travel of a wheel after '
              '1 m; it grows with the root of the way', 'm', 0.0, 1.0),
        Field('gyro_noise_rad', float, 0.001, 'Standard deviation of the turn of the gyroscope '
              'after 1 s; it grows with the root of the time', 'rad', 0.0, 1.0),
        Field('gyro_scale_rad', float, 0.005, 'Standard deviation of the turn of the gyroscope '
              'after a turn of 1 rad; it grows with the root of it', 'rad', 0.0, 1.0),
        Field('gyro_bias_max_rad_s', float, 0.1, 'Largest accepted bias', 'rad/s', 0.0001,
              0.5),
    )

    _gyro: VerticalGyro | None = None
    _wheels: WheelOdometry | None = None
    _arrived_ns = 0
    _travelled_m = 0.0
    _dropped_in_row = 0

    # ---- ports -------------------------------------------------------------------------------

    def connected(self, attribute: str) -> bool:
        """Do not subscribe to the inertial sensor when its gyroscope is not used."""
        return attribute != 'imu' or bool(self.settings['use_gyro'])

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return the outputs with the configured frames."""
        fixed = {'header.frame_id': self.settings['odom_frame_id'],
                 'child_frame_id': self.settings['base_frame_id']}
        return tuple(replace(p, fixed=fixed) for p in super().publications())

    # ---- life --------------------------------------------------------------------------------

    def configure(self) -> None:
        """
        Look up the wheels.

        :raises ConfigError: joint_states does not have them.
        """
        s = self.settings
        names = list(self.joint_states.msg.name)
        missing = [key for key in ('left_joint', 'right_joint') if s[key] not in names]
        if missing:
            raise ConfigError([
                f'{self.name}.{key} = {s[key]!r}: {self.topic_of("joint_states")} has no such '
                f'joint; it has {", ".join(names) or "none"}' for key in missing])
        self._left, self._right = names.index(s['left_joint']), names.index(s['right_joint'])
        self._unpack = self.joint_states.topic.layout.packer('position').unpack
        radius = s['wheel_radius_m']
        self._wheels = WheelOdometry(WheelParameters(
            radius * s['left_wheel_radius_multiplier'],
            radius * s['right_wheel_radius_multiplier'],
            s['wheel_separation_m'] * s['wheel_separation_multiplier'], s['wheel_speed_max_m_s'],
            s['wheel_noise_m'], s['gyro_noise_rad'], s['gyro_scale_rad'],
            s['gyro_bias_max_rad_s']))
        if s['use_gyro']:
            self._gyro = VerticalGyro(self.imu, self.mountings, _GYRO_GAP_S)
        message = self.odom.msg
        flatten(message.pose.covariance)
        flatten(message.twist.covariance)
        message.twist.covariance[7] = _SIDEWAYS

    def step(self) -> None:
        """Process all new samples and publish the pose of each."""
        wheels, joints, gyro = self._wheels, self.joint_states, self._gyro
        if wheels is None:
            return
        while joints.take():
            self._arrived_ns = joints.topic.kernel.now_ns()
            stamp_ns = joints.stamp_ns
            turned = math.nan
            if gyro is not None and stamp_ns > wheels.stamp_ns:
                turned = gyro.until(stamp_ns)
            positions = self._unpack(joints.buffer)
            if wheels.update(stamp_ns, positions[self._left], positions[self._right], turned):
                self._dropped_in_row = 0
                self._travelled_m += abs(wheels.distance_m)
                self._publish(wheels)
            else:
                self._dropped_in_row += 1

    def statistics(self) -> Mapping[str, Any]:
        """Return the counters of samples, and the pose of the robot."""
        wheels = self._wheels
        if wheels is None:
            return {}
        x, y, heading = wheels.pose
        covariance = wheels.covariance
        found: dict[str, Any] = {
            'warning': self._warning(wheels), **asdict(wheels.counters), 'x_m': x, 'y_m': y,
            'heading_deg': math.degrees(heading), 'travelled_m': self._travelled_m,
            'position_stddev_m': math.sqrt(max(0.0, covariance[0] + covariance[3])),
            'heading_stddev_deg': math.degrees(math.sqrt(max(0.0, covariance[5]))),
            'turn_from': 'gyro' if wheels.by_gyro else 'wheels'}
        if self._gyro is not None:
            found.update(self._gyro.statistics())
            found.update(gyro_bias_rad_s=wheels.bias.rad_s, gyro_bias_known=wheels.bias.known,
                         slipping=wheels.slipping)
        return found

    # ---- work --------------------------------------------------------------------------------

    def _publish(self, wheels: WheelOdometry) -> None:
        x, y, heading = wheels.pose
        z, w = half_turn(heading)
        stamp_ns, dt_s = wheels.stamp_ns, wheels.dt_s
        message = self.odom.msg
        message.pose.pose.position = x, y, 0.0
        message.pose.pose.orientation = 0.0, 0.0, z, w
        set_covariance(message.pose.covariance, wheels.covariance)
        if dt_s:
            message.twist.twist.linear = wheels.distance_m / dt_s, 0.0, 0.0
            message.twist.twist.angular = 0.0, 0.0, wheels.turn_rad / dt_s
            covariance, per = message.twist.covariance, 1 / (dt_s * dt_s)
            covariance[0] = wheels.distance_variance * per
            covariance[5] = covariance[30] = wheels.step_covariance * per
            covariance[35] = wheels.turn_variance * per
        self.odom.publish(stamp_ns)
        transform = self.odom_to_base.msg.transform
        transform.translation = x, y, 0.0
        transform.rotation = 0.0, 0.0, z, w
        self.odom_to_base.publish(stamp_ns)

    def _warning(self, wheels: WheelOdometry) -> str:
        topic = self.topic_of('joint_states')
        if not self._arrived_ns:
            return f'no samples yet on {topic}'
        silent_s = (self.joint_states.topic.kernel.now_ns() - self._arrived_ns) / NS_PER_S
        if silent_s > _SILENT_S:
            return f'{topic} has been silent for {silent_s:.1f} s'
        if self._dropped_in_row >= _BAD_IN_ROW:
            return (f'the last {self._dropped_in_row} samples of {topic} could not be used: the '
                    'clock of the source stands still or goes back, or positions are not finite')
        if wheels.in_row >= _BAD_IN_ROW:
            return (f'the last {wheels.in_row} steps of the wheels were faster than '
                    f'wheel_speed_max_m_s {self.settings["wheel_speed_max_m_s"]:g}: is that, or '
                    'wheel_radius_m, right?')
        if wheels.stuck:
            return (f'the {wheels.stuck} wheel reports no motion, but the gyroscope does: is its '
                    'encoder connected?')
        if wheels.slipping:
            return 'wheels and gyroscope disagree: a wheel slips'
        if self._gyro is not None and not self._gyro.covered:
            return (f'no samples of {self.topic_of("imu")} at the time of {topic}: the turn is '
                    'that of the wheels')
        return ''
