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
A path on a map from one pose to another, or the reason why there is none; made in small pieces.

From a start too near to a wall the robot leaves on a straight line, and a goal where it cannot
stand is moved to the nearest place where it can, within limits.
"""

from __future__ import annotations

from collections.abc import Collection
from collections.abc import Generator
from dataclasses import dataclass
import math
from typing import Final

import numpy as np

from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.grid_search import GridSearch
from rt_robot_os.motion.path_smoothing import rounded
from rt_robot_os.motion.path_smoothing import shortened
from rt_robot_os.motion.terrain import Cells
from rt_robot_os.motion.terrain import Terrain

# A smaller distance counts as not moved.
_SAME_M: Final = 1e-9


class RouteError(ValueError):
    """There is no path; the text says why."""


@dataclass(frozen=True)
class Route:
    """
    A path.

    :ivar poses: x, y in m and yaw in rad, the last one with the yaw of the goal.
    :ivar length_m: from first to last.
    :ivar moved_m: how far the goal was moved to where the robot can stand.
    """

    poses: tuple[Pose, ...]
    length_m: float
    moved_m: float


class RoutePlanner:
    """
    Plan paths on one terrain, one after the other.

    :param goal_tolerance_m: how far a goal may be moved.
    :param start_tolerance_m: how far the robot may be from where it may drive.
    :param most: poses of a path at most.
    :param goal_room_m: distance from walls to the middle of the robot at a goal, if there is a
        place with so much within the tolerance.
    :param own_m: radius of the robot: the ground under it is free, unless it is occupied.
    :param is_growing: the map is made while the robot drives: ground off the map is unseen.
    """

    def __init__(self, terrain: Terrain, goal_tolerance_m: float, start_tolerance_m: float,
                 most: int, goal_room_m: float = 0.0, *, own_m: float = 0.0,
                 is_growing: bool = False) -> None:
        self.terrain = terrain
        self.search = GridSearch(terrain)
        self.goal_tolerance_m = goal_tolerance_m
        self.start_tolerance_m = start_tolerance_m
        self._most = most
        self._goal_room_m = goal_room_m
        self._own_m = own_m
        self._is_growing = is_growing

    def plan(self, start: Pose, goal: Pose, obstacles: Collection[int]
             ) -> Generator[None, None, Route]:
        """
        Plan; it yields after each bounded piece of work.

        :param obstacles: occupied cells that are not on the map.
        :raises RouteError: there is no path.
        """
        terrain = self.terrain
        for _ in terrain.stamp(obstacles, start[:2], self._own_m):
            yield
        from_cell = self._leave(start)
        yield
        to_cell = self._arrive(goal)
        yield
        cells: list[int] = []
        for cells in self.search.way(from_cell, to_cell):
            yield
        if not cells:
            raise RouteError('no way to the goal is wide enough'
                             + (' beside what stands there now' if obstacles else ''))
        points = [terrain.place(cell) for cell in cells]
        begin, end = start[:2], goal[:2]
        leaving = terrain.cell(*begin) != from_cell
        if not leaving:
            points.insert(0, begin)
        moved_m = 0.0
        if terrain.cell(*end) == to_cell:
            points.append(end)
        else:
            moved_m = math.dist(points[-1], end)
        kept = points
        for kept in shortened(terrain, points):
            yield
        # Each corner may add a pose; there are few compared with the poses between them.
        spacing_m = max(2 * terrain.grid.resolution_m,
                        _length(kept) / max(1, self._most - len(kept) - 2))
        way = np.empty((0, 2))
        for way in rounded(terrain, kept, spacing_m):
            yield
        found = [(float(x), float(y)) for x, y in way]
        if leaving and math.dist(begin, found[0]) > _SAME_M:
            found.insert(0, begin)
        return Route(_turned(found, goal[2]), _length(found), moved_m)

    def _leave(self, start: Pose) -> int:
        """
        Return the cell in which the path begins.

        :raises RouteError: the robot is off the map, or stuck.
        """
        terrain = self.terrain
        here = terrain.cell(start[0], start[1])
        if here < 0:
            raise RouteError(f'the robot is off the map, at {start[0]:.2f}, {start[1]:.2f}')
        if math.isfinite(terrain.cost[here]):
            return here
        near = terrain.around(here, self.start_tolerance_m)
        for cell in near[np.isfinite(terrain.cost[near])].tolist():
            if self._is_beside(here, terrain.line(start[:2], terrain.place(cell))):
                return int(cell)
        raise RouteError(f'the robot, at {start[0]:.2f}, {start[1]:.2f}, is too near to something '
                         f'to go anywhere: no free ground within {self.start_tolerance_m:g} m')

    def _arrive(self, goal: Pose) -> int:
        """
        Return the cell in which the path ends.

        :raises RouteError: the robot can stand nowhere near.
        """
        terrain, (x, y, _) = self.terrain, goal
        grid = terrain.grid
        here = terrain.cell(x, y)
        where = f'the goal {x:.2f}, {y:.2f}'
        if here < 0:
            x0, y0, x1, y1 = grid.bounds
            inside = min(max(x, x0), x1), min(max(y, y0), y1)
            if not math.dist(inside, (x, y)) <= self.goal_tolerance_m:
                unseen = 'lies in ground that nobody has seen yet, ' if self._is_growing else 'is '
                raise RouteError(f'{where} {unseen}off the map, which goes from {x0:g}, {y0:g} to '
                                 f'{x1:g}, {y1:g}')
            here = self._nearest_on_map(inside)
        is_free = math.isfinite(terrain.cost[here])
        near = terrain.around(here, self.goal_tolerance_m)
        near = near[np.isfinite(terrain.cost[near])]
        roomy = near[terrain.has_room(near, self._goal_room_m)]
        seen_from = (x, y) if terrain.cell(x, y) >= 0 else terrain.place(here)
        for cell in [*roomy.tolist(), *([here] if is_free else near.tolist())]:
            place = (x, y) if cell == here else terrain.place(cell)
            if math.dist(place, (x, y)) <= self.goal_tolerance_m and self._is_beside(
                    here, terrain.line(seen_from, place)):
                return int(cell)
        if terrain.is_unseen(here):
            what = 'lies in ground that nobody has seen yet'
        else:
            what = 'is in something' if terrain.solid[here] else 'is too near to something'
        raise RouteError(f'{where} {what}, and the robot can stand nowhere within '
                         f'{self.goal_tolerance_m:g} m of it')

    def _is_beside(self, here: int, line: Cells) -> bool:
        """Return whether a line passes no wall, unless it begins within one."""
        terrain = self.terrain
        if terrain.is_unseen(here):
            return not terrain.is_wall(line).any()
        return bool(terrain.solid[here]) or not terrain.solid[line].any()

    def _nearest_on_map(self, place: tuple[float, float]) -> int:
        """Return the cell at the edge of the map that is nearest to a place on its bounds."""
        terrain = self.terrain
        step_m = terrain.grid.resolution_m / 2
        for dx in (0.0, step_m, -step_m):
            for dy in (0.0, step_m, -step_m):
                cell = terrain.cell(place[0] + dx, place[1] + dy)
                if cell >= 0:
                    return cell
        raise RouteError(f'the goal {place[0]:.2f}, {place[1]:.2f} is off the map')


def _length(points: list[tuple[float, float]]) -> float:
    return sum(math.dist(a, b) for a, b in zip(points, points[1:]))


def _turned(points: list[tuple[float, float]], last_yaw: float) -> tuple[Pose, ...]:
    """Turn each pose to the next one, and the last as the goal is."""
    found = [(a[0], a[1], math.atan2(b[1] - a[1], b[0] - a[0]))
             for a, b in zip(points, points[1:])]
    return (*found, (*points[-1], last_yaw))
