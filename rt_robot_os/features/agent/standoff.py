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

"""Where the robot stands next to a person: near enough to see, far enough not to hinder."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Final

from rt_robot_os.motion.clearing import Clearing
from rt_robot_os.motion.differential import Pose

Point = tuple[float, float]

_DIRECTIONS: Final = 16
# A person in a bed is inside an occupied area: at most this far from its edge.
_FURNITURE_M: Final = 1.0
# Larger distances, as multiples, where there is no room at the wanted one.
_FARTHER: Final = (1.5, 2.0)
_APART_M: Final = 0.5


class StandoffPlanner:
    """
    Plans standoff poses; safe in the real-time loop, some hundreds of microseconds.

    :param standoff_m: the wanted distance.
    :param spread_m: tolerance of that distance.
    :ivar clearing: the present map; None: everything is free.
    """

    def __init__(self, clearing: Clearing | None, standoff_m: float, spread_m: float) -> None:
        self.clearing = clearing
        self.standoff_m = standoff_m
        self.spread_m = spread_m

    def places(self, place: Point, robot: Point, most: int) -> list[Pose]:
        """
        Return poses next to a location that face it, in the order to try them.

        Poses with a free line to the location come first, so that none is behind a wall; of these
        the nearest to the robot. Neighbours of an earlier pose are left out: where one is blocked,
        they are too.

        :param place: the location, in m.
        :param robot: where the robot is, in m.
        :param most: number of poses.
        """
        standoff_m, spread_m = self.standoff_m, self.spread_m
        near = self._around(place, robot, (standoff_m, standoff_m + spread_m,
                                           standoff_m - spread_m))
        found = self._chosen(near, place, most, hidden=False)
        if found:
            return found
        far = self._around(place, robot, [share * standoff_m for share in _FARTHER])
        found = self._chosen(far, place, most, hidden=False)
        return found or self._chosen([*near, *far], place, most, hidden=True)

    def _around(self, place: Point, robot: Point, radii_m: Sequence[float]) -> list[Pose]:
        """Return all poses at some distances from a location, the nearest to the robot first."""
        found = []
        towards = math.atan2(robot[1] - place[1], robot[0] - place[0])
        for radius_m in radii_m:
            penalty_m = 2.0 * abs(radius_m - self.standoff_m)
            for number in range(_DIRECTIONS):
                angle = towards + math.tau * number / _DIRECTIONS
                x = place[0] + radius_m * math.cos(angle)
                y = place[1] + radius_m * math.sin(angle)
                found.append((math.dist((x, y), robot) + penalty_m,
                              (x, y, math.remainder(angle + math.pi, math.tau))))
        return [pose for _, pose in sorted(found)]

    def _chosen(self, poses: Sequence[Pose], place: Point, most: int, *, hidden: bool
                ) -> list[Pose]:
        """Return the first poses that are free and apart; checks no more than necessary."""
        found: list[Pose] = []
        for pose in poses:
            x, y, _ = pose
            if len(found) == most:
                break
            if all(math.dist((x, y), other[:2]) >= _APART_M for other in found) and (
                    self._is_free(x, y) and (hidden or not self._is_hidden(x, y, place))):
                found.append(pose)
        return found

    def sees(self, robot: Point, place: Point) -> bool:
        """Return whether no wall of the map is between a robot and a location."""
        return not self._is_hidden(*robot, place)

    def _is_free(self, x: float, y: float) -> bool:
        return self.clearing is None or self.clearing.is_free(x, y)

    def _is_hidden(self, x: float, y: float, place: Point) -> bool:
        """Return whether an obstacle is between, except the furniture that a person lies on."""
        if self.clearing is None:
            return False
        grid = self.clearing.grid
        length_m = math.dist((x, y), place)
        steps = max(1, int(length_m / grid.resolution_m))
        dx, dy = (x - place[0]) / steps, (y - place[1]) / steps
        on_furniture = grid.occupied(*place)
        for number in range(1, steps + 1):
            if not grid.occupied(place[0] + number * dx, place[1] + number * dy):
                on_furniture = False
            elif not on_furniture or length_m * number / steps > _FURNITURE_M:
                return True
        return False
