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


"""Modules for the tests of ports in a core."""

from __future__ import annotations

from rt_robot_os.modules import Input
from rt_robot_os.modules import Module
from rt_robot_os.modules import Output


class Mapper(Module):
    """Publish a map that grows by a cell with each step."""

    grid = Output('map', 'nav_msgs/msg/OccupancyGrid', {'header.frame_id': 'map'}, depth=4,
                  tail=5000)

    def step(self) -> None:
        cells = list(range(self.grid.published + 1))
        message = self.grid.msg
        message.info.width, message.info.height = len(cells), 1
        message.data = cells
        self.grid.publish()


class LargeMapper(Mapper):
    """Publish maps so large that publishing gives the buffer away."""

    grid = Output('map', 'nav_msgs/msg/OccupancyGrid', {'header.frame_id': 'map'}, depth=4,
                  tail=500_000)


class TwoInputs(Module):
    """Read one topic as two things."""

    pose = Input('pose', message='geometry_msgs/msg/Pose')
    same = Input('pose', message='geometry_msgs/msg/Twist')

    def step(self) -> None:
        """Do nothing."""


class Control(Module):
    """Answer each report of the wheels with a command."""

    speed = Input('wheels/speed', wake=True)
    command = Output('cmd_vel', 'geometry_msgs/msg/Twist')

    def step(self) -> None:
        self.command.publish()


class Mounted(Module):
    """Need to know where the scanner is before it runs."""

    def configure(self) -> None:
        """Find it."""
        self.found = self.mountings['laser_link']

    def step(self) -> None:
        """Do nothing."""
