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

"""Drive a square by odometry: the distance of its end from its start is the odometry's error."""

from __future__ import annotations

import math
from typing import Any

from rt_robot_os.base.schema import Field
from rt_robot_os.modules import Input
from rt_robot_os.modules import Module
from rt_robot_os.modules import Output
from rt_robot_os.motion.angles import wrapped
from rt_robot_os.motion.angles import yaw_of

SIDES = 4


class Square(Module):
    """Four sides, and after each a quarter of a turn to the left, or to the right."""

    SETTINGS = (
        Field('side_m', float, 1.0, 'Length of a side', 'm', 0.1, 10.0, live=True),
        Field('speed_m_s', float, 0.2, 'Speed ahead', 'm/s', 0.02, 1.0),
        Field('turn_rad_s', float, 0.8, 'Speed of a turn', 'rad/s', 0.1, 3.0),
        Field('to_the_right', bool, False, 'Clockwise', live=True),
    )
    begin = Input('square/begin', message='std_msgs/msg/Bool', newest=True)
    odom = Input('odom', message='nav_msgs/msg/Odometry', newest=True)
    command = Output('cmd_vel_agent', 'geometry_msgs/msg/Twist')

    def __init__(self, name: str, settings: Any) -> None:
        super().__init__(name, settings)
        self._leg = 2 * SIDES  # sides have even numbers, turns odd ones
        self._x = self._y = self._yaw = 0.0

    def step(self) -> None:
        """Continue the current side or turn."""
        if not self.odom.take():
            return  # no new odometry: the mux stops a source that times out
        x, y, yaw = self._pose()
        if self.begin.take():
            self._leg = 0 if self.begin.msg.data else 2 * SIDES
            self._x, self._y, self._yaw = x, y, yaw
            self._move(0.0, 0.0)
        if self._leg == 2 * SIDES:
            return
        sense = -1.0 if self.settings['to_the_right'] else 1.0
        side, turn = self._leg // 2, self._leg % 2
        heading = self._yaw + sense * (side + turn) * math.pi / 2
        if turn:
            left = sense * wrapped(heading - yaw)
            arrived, speed, rate = left < 0.02, 0.0, sense * min(
                self.settings['turn_rad_s'], 0.05 + 1.5 * left)
        else:
            left = self.settings['side_m'] - self._along(x, y, heading)
            arrived, speed, rate = left < 0.005, min(
                self.settings['speed_m_s'], 0.03 + left), 1.5 * wrapped(heading - yaw)
        if arrived:
            self._next(x, y)
        else:
            self._move(speed, rate)

    def _pose(self) -> tuple[float, float, float]:
        pose = self.odom.msg.pose.pose
        turn = pose.orientation
        return pose.position.x, pose.position.y, yaw_of(turn.x, turn.y, turn.z, turn.w)

    def _along(self, x: float, y: float, heading: float) -> float:
        """Return the travelled distance on this side."""
        return (x - self._x) * math.cos(heading) + (y - self._y) * math.sin(heading)

    def _next(self, x: float, y: float) -> None:
        self._leg += 1
        self._x, self._y = x, y
        if self._leg == 2 * SIDES:
            self._move(0.0, 0.0)
            self.log.info('done: measure its distance from the start')

    def _move(self, speed_m_s: float, rate_rad_s: float) -> None:
        self.command.msg.linear.x, self.command.msg.angular.z = speed_m_s, rate_rad_s
        self.command.publish()
