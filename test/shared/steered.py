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

"""A robot on the virtual clock: the module trajectory drives it, a noisy localiser sees it."""

from __future__ import annotations

from dataclasses import dataclass
import math
import random
from typing import Any

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.navigation.trajectory import Trajectory
from rt_robot_os.motion.angles import wrapped
from rt_robot_os.motion.differential import moved
from rt_robot_os.motion.differential import Pose
from rt_robot_os.testing.module_bench import ModuleBench

STEP_S = 0.01
LAG_S = 0.1
FIX_EVERY = 10
MAP = {'header.frame_id': 'map'}
ODOM = {'header.frame_id': 'odom', 'child_frame_id': 'base_link'}


@dataclass
class World:
    """
    How the robot and its sensors are.

    :ivar slip: part of the way of both wheels that is lost; odometry does not notice.
    :ivar noise: standard deviations of a measured pose, in m and rad.
    :ivar late_s: how old a measured pose is when it comes.
    """

    start: Pose = (0.0, 0.0, 0.0)
    slip: float = 0.0
    noise: tuple[float, float] = (0.0, 0.0)
    late_s: float = 0.05
    seed: int = 1


class Bench(ModuleBench):
    """The module, and the robot that it steers."""

    def __init__(self, world: World = World(), rate_hz: float = 50.0, **settings: Any) -> None:
        super().__init__()
        self.world = world
        self.random = random.Random(world.seed)
        self.robot = world.start
        self.wheels: Pose = (0.0, 0.0, 0.0)
        self.velocity = (0.0, 0.0)
        self.distance_m = 0.0
        self.steps = 0
        self.located: Pose | None = None
        self.map_silent = self.odom_silent = self.held = self.frozen = False
        self.variance = 1e-4
        self.shift: Pose = (0.0, 0.0, 0.0)
        self.track: list[tuple[float, Pose]] = []
        self.commanded: tuple[float, float] = (0.0, 0.0)
        twist = 'geometry_msgs/msg/Twist'
        self.pose = self.topic('pose', 'geometry_msgs/msg/PoseWithCovarianceStamped', MAP,
                               rate_hz=50.0)
        self.odom = self.topic('odom', 'nav_msgs/msg/Odometry', ODOM, rate_hz=50.0)
        self.goal = self.topic('goal_pose', 'geometry_msgs/msg/PoseStamped', MAP)
        self.bus.declare('plan', 'std_msgs/msg/Float64MultiArray',
                         {'layout.dim': [], 'layout.data_offset': 0}, tail=3000)
        self.plan = self.bus.publisher('plan')
        self.cancel = self.topic('cancel', 'std_msgs/msg/Bool')
        self.estop = self.topic('estop', 'std_msgs/msg/Bool')
        self.release = self.topic('release', 'std_msgs/msg/Bool')
        self.faults = self.topic('motor_faults', 'std_msgs/msg/UInt32')
        self.module = self.add(Trajectory, 'trajectory', rate_hz=rate_hz, plan_topic='plan',
                               cancel_topic='cancel', estop_topic='estop',
                               motor_faults_topic='motor_faults', **settings)
        self.bus.declare('cmd_vel_trajectory', twist, {}, depth=16, rate_hz=rate_hz)
        self.commands = self.bus.subscribe('cmd_vel_trajectory', 'plant')
        self.all_commands: list[tuple[float, float]] = []
        self.states = self.watch('trajectory/state')
        self.errors = self.watch('trajectory/error')
        self.told: list[str] = []
        self.kernel.add_task('plant', self._plant, priority=90, rate_hz=1 / STEP_S)

    # ---- what a test does --------------------------------------------------------------------

    def drive_to(self, x: float, y: float, yaw: float) -> None:
        self.goal.msg.pose.position = x, y, 0.0
        self.goal.msg.pose.orientation = 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)
        self.goal.publish()

    def follow(self, *poses: Pose) -> None:
        self.plan.msg.data = [each for pose in poses for each in pose]
        self.plan.publish()

    def stop(self) -> None:
        self.cancel.msg.data = True
        self.cancel.publish()

    def emergency(self, pressed: bool = True) -> None:
        self.estop.msg.data = pressed
        self.estop.publish()

    def let_go(self) -> None:
        self.release.msg.data = True
        self.release.publish()

    def tell_faults(self, bits: int) -> None:
        self.faults.msg.data = bits
        self.faults.publish()

    @property
    def state(self) -> str:
        return self.told[-1] if self.told else ''

    @property
    def changes(self) -> list[str]:
        """Return the states one after the other, each once."""
        return [b for a, b in zip(['', *self.told], self.told) if a != b]

    # ---- the robot ---------------------------------------------------------------------------

    def _plant(self) -> None:
        while self.commands.take():
            message = self.commands.msg
            self.commanded = float(message.linear.x), float(message.angular.z)
            self.all_commands.append(self.commanded)
        while self.states.take():
            self.told.append(self.states.msg.data)
        share = 1 - math.exp(-STEP_S / LAG_S)
        linear, angular = self.velocity = (0.0, 0.0) if self.held else (
            self.velocity[0] + (self.commanded[0] - self.velocity[0]) * share,
            self.velocity[1] + (self.commanded[1] - self.velocity[1]) * share)
        self.wheels = moved(self.wheels, linear * STEP_S, angular * STEP_S)
        kept = 1 - self.world.slip
        self.robot = moved(self.robot, linear * STEP_S * kept, angular * STEP_S * kept)
        self.distance_m += abs(linear) * STEP_S * kept
        if self.located is not None:
            self.located = moved(self.located, linear * STEP_S, angular * STEP_S)
        self.track.append((self.kernel.now_ns() / NS_PER_S, self.robot))
        self.steps += 1
        if self.steps % FIX_EVERY == 0:
            self._locate()
        if self.steps % 2 == 0:
            self._publish()

    def _locate(self) -> None:
        """Correct the pose with a measured one that is late, as a steady filter would."""
        back = min(len(self.track), 1 + round(self.world.late_s / STEP_S))
        then, gauss = self.track[-back][1], self.random.gauss
        noise, turn = self.world.noise
        seen = (then[0] + gauss(0, noise), then[1] + gauss(0, noise), then[2] + gauss(0, turn))
        if self.located is None:
            self.located = seen
        carried = moved(seen, self.velocity[0] * self.world.late_s,
                        self.velocity[1] * self.world.late_s)
        gain = 0.15 if noise else 1.0
        x, y, yaw = self.located
        self.located = (x + gain * (carried[0] - x), y + gain * (carried[1] - y),
                        yaw + gain * wrapped(carried[2] - yaw))

    def _publish(self) -> None:
        stamp_ns = 1 if self.frozen else self.kernel.now_ns()
        if not self.odom_silent:
            message = self.odom.msg
            x, y, yaw = self.wheels
            message.pose.pose.position = x, y, 0.0
            message.pose.pose.orientation = 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)
            message.twist.twist.linear = self.velocity[0], 0.0, 0.0
            message.twist.twist.angular = 0.0, 0.0, self.velocity[1]
            self.odom.publish(self.kernel.now_ns())
        if self.located is not None and not self.map_silent:
            pose = self.pose.msg
            x, y, yaw = (a + b for a, b in zip(self.located, self.shift))
            pose.pose.pose.position = x, y, 0.0
            pose.pose.pose.orientation = 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)
            for index in (0, 7, 35):
                pose.pose.covariance[index] = self.variance
            self.pose.publish(stamp_ns)
