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

"""A robot that drives on the virtual clock, with odometry and localization on it."""

from __future__ import annotations

import math
from typing import Any

from benchmarks.localization.plant import DT_S
from benchmarks.localization.plant import eight
from benchmarks.localization.plant import RADIUS_M
from benchmarks.localization.plant import Robot
from benchmarks.localization.plant import SEPARATION_M
from rt_robot_os.features.navigation.localization import Localization
from rt_robot_os.features.navigation.odometry import Odometry
from rt_robot_os.motion.angles import yaw_of
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.motion.poses import composed
from rt_robot_os.testing.module_bench import ModuleBench
from rt_robot_os.topics import Publisher

POSE = 'geometry_msgs/msg/PoseWithCovarianceStamped'
JOINTS = {'header.frame_id': 'base_link', 'name': ['left_wheel_joint', 'right_wheel_joint'],
          'position': 2, 'velocity': 2, 'effort': 0}
STDDEV_M, STDDEV_RAD = 0.01, math.radians(1.0)


class Bench(ModuleBench):
    """A robot that drives, with odometry and localisation on it."""

    def __init__(self, robot: Robot, frame: str = 'map', **settings: Any) -> None:
        super().__init__()
        self.robot = robot
        self.joints = self.topic('joint_states', 'sensor_msgs/msg/JointState', JOINTS)
        self.imu = self.topic('imu/data', 'sensor_msgs/msg/Imu', {'header.frame_id': 'imu_link'})
        self.marks = self.topic('stargazer/pose', POSE, {'header.frame_id': frame})
        self.told = self.topic('initialpose', POSE, {'header.frame_id': 'map'})
        self.slam = self.topic('slam/pose', POSE, {'header.frame_id': 'map'})
        self.loops = self.topic('slam/correction', POSE, {'header.frame_id': 'map'})
        self.add(Odometry, 'odometry', wheel_radius_m=RADIUS_M, wheel_separation_m=SEPARATION_M)
        self.module = self.add(Localization, initial_pose_topic='initialpose', **settings)
        self.pose = self.watch('pose')
        self.transform = self.watch('map_to_odom')
        self.odom = self.watch('odom')
        self.mark_every = 5
        self.with_imu = self.with_wheels = True
        self.attitude: tuple[float, float] | None = None
        self.delay_s = 0.0
        self.time_s = 0.0
        # Who says where the robot is, and how its map lies on the true one.
        self.source = self.marks
        self.map_at: Pose = (0.0, 0.0, 0.0)
        # How the map of a SLAM beside the marks lies on the true one.
        self.slam_at: Pose | None = None

    def mark(self, pose: Pose, stamp_ns: int = 0, to: Publisher | None = None,
             stddev_m: float = STDDEV_M) -> None:
        to = to or self.source
        to.msg.pose.pose.position = pose[0], pose[1], 0.0
        to.msg.pose.pose.orientation = 0.0, 0.0, math.sin(pose[2] / 2), math.cos(pose[2] / 2)
        to.msg.pose.covariance[[0, 7, 35]] = stddev_m ** 2, stddev_m ** 2, STDDEV_RAD ** 2
        to.publish(stamp_ns)

    def drive(self, seconds: float, marks: bool = True) -> None:
        """Go on driving, and look at landmarks."""
        steps = round(seconds / DT_S)
        for index in range(steps):
            def go(index: int = index) -> None:
                self.robot.step()
                if self.with_wheels:
                    self.joints.msg.position[:] = self.robot.angles
                    self.joints.publish()
                if self.with_imu:
                    self.inertial()
                if marks and index % self.mark_every == 0:
                    seen, stamp_ns = self.robot.seen(STDDEV_M, STDDEV_RAD), self.kernel.now_ns()
                    self.later.append((index + round(self.delay_s / DT_S),
                                       composed(self.map_at, seen), stamp_ns))
                if self.slam_at is not None and index % self.mark_every == 3:
                    self.mark(composed(self.slam_at, self.robot.pose), to=self.slam)
                while self.later and self.later[0][0] <= index:
                    self.mark(*self.later.pop(0)[1:])

            self.at((index + 1) * DT_S, go)
        self.later: list[tuple[int, Pose, int]] = []
        self.run(seconds + DT_S / 2)

    def inertial(self) -> None:
        """Publish what the inertial sensor says; with an orientation when there is one."""
        message = self.imu.msg
        message.angular_velocity = 0.0, 0.0, self.robot.gyro()
        message.orientation_covariance[0] = -1.0
        if self.attitude is not None:
            offset, pitch = self.attitude
            message.orientation = Mounting(
                rotation_rad=(0.0, pitch, self.robot.pose[2] + offset)).quaternion()
            message.orientation_covariance[0] = 1e-4
        self.imu.publish()

    def newest(self) -> Pose:
        while self.pose.take():
            pass
        assert self.pose.seq >= 0
        return pose_of(self.pose.msg)

    @property
    def found(self) -> dict[str, Any]:
        return dict(self.module.statistics())

    @property
    def warning(self) -> str:
        return str(self.found['warning'])


def pose_of(message: Any) -> Pose:
    position, q = message.pose.pose.position, message.pose.pose.orientation
    return position.x, position.y, yaw_of(q.x, q.y, q.z, q.w)


def far_robot(**changes: Any) -> Robot:
    return Robot(eight, pose=(3.44, 1.0, 2.0), right_error=0.01, gyro_bias=0.02,
                 gyro_stddev=0.005, **changes)
