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

"""People who walk through the world on ways of their own."""

from __future__ import annotations

import math
from typing import Final

from rt_robot_os.sim.world.scene import Way

PERSON_RADIUS_M: Final = 0.22
PERSON_HEIGHT_M: Final = 1.75

# So much room people leave to the robot, and so long they wait for it before they turn round: the
# robot waits for them as well.
_ROOM_M: Final = 0.1
_PATIENCE_S: Final = 1.5


class Person:
    """
    Somebody on a way; when the robot stands in it they wait, then turn round and walk back.

    :ivar name: theirs.
    :ivar x: where they are, in m.
    :ivar y: where they are, in m.
    :ivar heading: where they look, in rad.
    :ivar stands: somebody has told them to stand.
    """

    radius_m = PERSON_RADIUS_M
    height_m = PERSON_HEIGHT_M

    def __init__(self, way: Way) -> None:
        """Put them at the first point of their way."""
        self.name = way.name
        self._way = way
        self.x, self.y = way.points[0]
        self.stands = False
        self._waited_s = 0.0
        self._direction = 1
        self._next = 1 % len(way.points)
        ahead_x, ahead_y = way.points[self._next]
        self.heading = math.atan2(ahead_y - self.y, ahead_x - self.x)

    def stand(self, x: float, y: float) -> None:
        """Step to a place at once and stay there."""
        self.x, self.y = x, y
        self.stands = True

    def walk(self) -> None:
        """Go on from where they are to the next point of their way."""
        self.stands = False

    def step(self, time_s: float, robot_x: float, robot_y: float, robot_radius_m: float) -> None:
        """Walk for a time, unless the robot is in the way."""
        left = 0.0 if self.stands else self._way.speed_m_s * time_s
        room = robot_radius_m + self.radius_m + _ROOM_M
        for _ in self._way.points:  # points may lie on one another
            x, y = self._way.points[self._next]
            dx, dy = x - self.x, y - self.y
            distance = math.hypot(dx, dy)
            if left <= 0.0:
                return
            part = min(left / distance, 1.0) if distance else 1.0
            new_x, new_y = self.x + part * dx, self.y + part * dy
            before = math.hypot(self.x - robot_x, self.y - robot_y)
            if math.hypot(new_x - robot_x, new_y - robot_y) < min(room, before):
                self._wait(time_s)
                return
            self._waited_s = 0.0
            if distance:
                self.heading = math.atan2(dy, dx)
            self.x, self.y = new_x, new_y
            if part < 1.0:
                return
            left -= distance
            self._go_on()

    def _wait(self, time_s: float) -> None:
        self._waited_s += time_s
        if self._waited_s > _PATIENCE_S:
            self._waited_s = 0.0
            self._direction = -self._direction
            self._go_on()

    def _go_on(self) -> None:
        self._next = (self._next + self._direction) % len(self._way.points)
