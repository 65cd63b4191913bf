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

"""Where a robot stands beside somebody: near enough to see, far enough not to hinder."""

from __future__ import annotations

import math
from typing import Final

from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.terrain import Terrain

Point = tuple[float, float]

_DIRECTIONS: Final = 16
# Who lies in a bed lies in what the map has as occupied.
_FURNITURE_M: Final = 0.7
# Where there is no room at the distance that is wanted: further away.
_FARTHER: Final = (1.5, 2.0)


class Beside:
    """
    Choose places to stand at; safe in the real-time loop, some hundreds of microseconds.

    :param terrain: the ground that the map has; None without a map: all of it is free.
    :param standoff_m: the distance that is wanted.
    :param spread_m: how far from that a place may be before it counts as farther away.
    """

    def __init__(self, terrain: Terrain | None, standoff_m: float, spread_m: float) -> None:
        self._terrain = terrain
        self.standoff_m = standoff_m
        self.spread_m = spread_m

    def places(self, place: Point, robot: Point) -> list[Pose]:
        """
        Return poses beside a place that look at it, the one to try first in front.

        Those from which there is nothing but free ground towards the place come first, so that
        none is on the other side of a wall; of these the nearest to the robot.

        :param place: where somebody is, in m.
        :param robot: where the robot is, in m.
        """
        near, standoff_m, spread_m = [], self.standoff_m, self.spread_m
        for radius_m in (standoff_m, standoff_m + spread_m, standoff_m - spread_m):
            near += self._ring(place, robot, radius_m, abs(radius_m - standoff_m))
        if any(not hidden for hidden, _, _ in near):
            return self._ordered(near)
        for share in _FARTHER:
            near += self._ring(place, robot, share * standoff_m, share * standoff_m)
        return self._ordered(near)

    def sees(self, robot: Point, place: Point) -> bool:
        """Return whether no wall of the map is between a robot and a place."""
        return not self._is_hidden(*robot, place)

    @staticmethod
    def _ordered(found: list[tuple[bool, float, Pose]]) -> list[Pose]:
        return [pose for _, _, pose in sorted(found)]

    def _ring(self, place: Point, robot: Point, radius_m: float, penalty_m: float
              ) -> list[tuple[bool, float, Pose]]:
        """Return of each free place: whether a wall hides it, how dear it is, and the pose."""
        found = []
        towards = math.atan2(robot[1] - place[1], robot[0] - place[0])
        for number in range(_DIRECTIONS):
            angle = towards + math.tau * number / _DIRECTIONS
            x, y = place[0] + radius_m * math.cos(angle), place[1] + radius_m * math.sin(angle)
            if self._is_free(x, y):
                pose = x, y, math.remainder(angle + math.pi, math.tau)
                found.append((self._is_hidden(x, y, place),
                              math.dist((x, y), robot) + 2.0 * penalty_m, pose))
        return found

    def _is_free(self, x: float, y: float) -> bool:
        terrain = self._terrain
        if terrain is None:
            return True
        cell = terrain.cell(x, y)
        return cell >= 0 and math.isfinite(terrain.static.item(cell))

    def _is_hidden(self, x: float, y: float, place: Point) -> bool:
        if self._terrain is None:
            return False
        grid = self._terrain.grid
        length_m = math.dist((x, y), place) - _FURNITURE_M
        steps = max(1, int(length_m / grid.resolution_m))
        direction = math.atan2(place[1] - y, place[0] - x)
        for number in range(1, steps + 1):
            away = length_m * number / steps
            if away > 0.0 and grid.occupied(x + away * math.cos(direction),
                                            y + away * math.sin(direction)):
                return True
        return False
