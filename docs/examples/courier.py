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
The modules of the courier, the robot of docs/choosing_priorities.md, as far as timing goes.

What they compute is left out: each spins for about as long as its real counterpart would take.
"""

from __future__ import annotations

from rt_robot_os.modules import Input
from rt_robot_os.modules import Module
from rt_robot_os.modules import Output


class Heading(Module):
    """Fuse the IMU into a heading, with each of its samples."""

    imu = Input('imu/data', wake=True)
    heading = Output('heading', 'std_msgs/msg/Float64')

    def step(self) -> None:
        """Take what came."""
        while self.imu.take():
            self.heading.msg.data = self.imu.msg.angular_velocity.z
            self.heading.publish(self.imu.stamp_ns)


class Drive(Module):
    """Steer along the path; reads the costs of the map."""

    heading = Input('heading')
    command = Input('cmd_vel_safe')
    wheels = Output('wheels', 'geometry_msgs/msg/Twist')

    def step(self) -> None:
        """Send the wheels what the path asks for."""
        if self.command.latest():
            self.wheels.msg.linear = self.command.msg.linear
        self.wheels.publish()


class Avoid(Module):
    """Put obstacles into the map."""

    heading = Input('heading')

    def step(self) -> None:
        """Take the newest heading for granted."""
        self.heading.latest()


class Planner(Module):
    """Look for a path through the map."""

    heading = Input('heading')
    path = Output('path', 'std_msgs/msg/Float64')

    def step(self) -> None:
        """Plan from where it stands."""
        if self.heading.latest():
            self.path.msg.data = self.heading.msg.data
            self.path.publish()
