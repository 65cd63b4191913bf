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


"""A module that drives the wheels for a while and then forgets them, again and again."""

from __future__ import annotations

import math

from rt_robot_os.modules import Module
from rt_robot_os.modules import Output


class Drive(Module):
    """Command another speed with each step, and none in every other half second."""

    command = Output('cmd_vel', 'geometry_msgs/msg/Twist')
    steps = 0

    def step(self) -> None:
        self.steps += 1
        if self.steps % 50 < 25:
            self.command.msg.linear.x = math.sin(self.steps)
            self.command.publish()
