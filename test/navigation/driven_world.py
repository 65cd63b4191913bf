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

"""The whole chain on the virtual clock: wheels, odometry, localisation, trajectory."""

from __future__ import annotations

import math
import random
from typing import Any

from rt_robot_os.features.navigation.localization import Localization
from rt_robot_os.features.navigation.odometry import Odometry
from rt_robot_os.features.navigation.trajectory import Trajectory
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.differential import wheel_speeds
from rt_robot_os.sim.world.drive_base import DriveBase
from rt_robot_os.sim.world_settings import WorldSettings
from rt_robot_os.testing.module_bench import ModuleBench

RADIUS_M = 0.05
SEPARATION_M = 0.3
TICK_RAD = math.tau / 4096
MAP = {'header.frame_id': 'map'}
JOINTS = {'header.frame_id': 'base_link', 'name': ['left_wheel_joint', 'right_wheel_joint'],
          'position': 2, 'velocity': 2, 'effort': 0}
POSITION_M, HEADING_RAD = 0.01, math.radians(1)
LATE_NS = 80_000_000


class Chain(ModuleBench):
    """
    A robot of the simulated world with encoders and a StarGazer, from pose to wheels.

    :ivar base: the robot; its pose is the truth.
    :ivar track: time in s and true pose, every 20 ms.
    :ivar distance_m: that it went.
    """

    def __init__(self, start: Pose, rate_hz: float, slip: float = 0.0, seed: int = 1,
                 **settings: Any) -> None:
        super().__init__()
        self.base = DriveBase(WorldSettings(start=start, slip=slip, slip_noise=0.01, seed=seed),
                              wheel_radius_m=RADIUS_M, wheel_separation_m=SEPARATION_M)
        self.random = random.Random(seed)
        self.track: list[tuple[float, Pose]] = []
        self.commands: list[tuple[float, float]] = []
        self.told: list[str] = []
        self.distance_m = 0.0
        self._late: list[tuple[int, Pose]] = []
        self.joints = self.topic('joint_states', 'sensor_msgs/msg/JointState', JOINTS,
                                 rate_hz=50.0)
        self.fix = self.topic('stargazer/pose', 'geometry_msgs/msg/PoseWithCovarianceStamped',
                              MAP, rate_hz=10.0)
        self.goal = self.topic('goal_pose', 'geometry_msgs/msg/PoseStamped', MAP)
        self.bus.declare('plan', 'std_msgs/msg/Float64MultiArray',
                         {'layout.dim': [], 'layout.data_offset': 0}, tail=3000)
        self.plan = self.bus.publisher('plan')
        self.add(Odometry, 'odometry', priority=60, wheel_radius_m=RADIUS_M,
                 wheel_separation_m=SEPARATION_M)
        self.add(Localization, 'localization', priority=58)
        self.module = self.add(Trajectory, 'trajectory', rate_hz=rate_hz, priority=55,
                               plan_topic='plan', motor_lag_s=0.06, **settings)
        self.command = self.watch('cmd_vel_trajectory')
        self.state = self.watch('trajectory/state')
        self.kernel.add_task('world', self._world, priority=80, rate_hz=50.0)
        self.kernel.add_task('board', self._board, priority=50, rate_hz=100.0)

    def drive_to(self, x: float, y: float, yaw: float) -> None:
        self.goal.msg.pose.position = x, y, 0.0
        self.goal.msg.pose.orientation = 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)
        self.goal.publish()

    def follow(self, poses: list[Pose]) -> None:
        self.plan.msg.data = [each for pose in poses for each in pose]
        self.plan.publish()

    def _board(self) -> None:
        while self.state.take():
            self.told.append(self.state.msg.data)
        while self.command.take():
            message = self.command.msg
            linear, angular = float(message.linear.x), float(message.angular.z)
            self.commands.append((linear, angular))
            left, right = wheel_speeds(linear, angular, SEPARATION_M)
            self.base.advance(self.kernel.now_ns())
            self.base.set_wheel_speeds(left / RADIUS_M, right / RADIUS_M)

    def _world(self) -> None:
        now_ns = self.kernel.now_ns()
        before = self.base.pose
        self.base.advance(now_ns)
        pose = self.base.pose
        self.distance_m += math.hypot(pose[0] - before[0], pose[1] - before[1])
        self.track.append((now_ns / 1e9, pose))
        if len(self.track) % 5 == 0:
            self._late.append((now_ns, pose))
        if self._late and now_ns >= self._late[0][0] + LATE_NS:
            self._fix(*self._late.pop(0))
        self.joints.msg.position[:] = [
            math.floor(angle / TICK_RAD) * TICK_RAD for angle in self.base.wheel_angles]
        self.joints.publish(now_ns)

    def _fix(self, stamp_ns: int, pose: Pose) -> None:
        message, gauss = self.fix.msg.pose, self.random.gauss
        yaw = pose[2] + gauss(0.0, HEADING_RAD)
        message.pose.position = (pose[0] + gauss(0.0, POSITION_M),
                                 pose[1] + gauss(0.0, POSITION_M), 0.0)
        message.pose.orientation = 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)
        for index, stddev in ((0, POSITION_M), (7, POSITION_M), (35, HEADING_RAD)):
            message.covariance[index] = stddev ** 2
        self.fix.publish(stamp_ns)
