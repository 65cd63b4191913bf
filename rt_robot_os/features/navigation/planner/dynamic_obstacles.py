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

"""Dynamic obstacles: what scanners see and the map does not have, as cells, for a while."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
import math
from typing import Any
from typing import Final

import numpy as np

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.navigation.collision_guard.sensors import Scanner
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.motion.poses import composed
from rt_robot_os.motion.terrain import Terrain
from rt_robot_os.motion.unmapped_points import unmapped_points
from rt_robot_os.motion.zones import Circle
from rt_robot_os.topics.subscription import Subscription

Patch = tuple[int, int]

_MOST: Final = 600
# Larger than the sway of a standing person, and than the noise of a scanner.
_PATCH_M: Final = 0.3
_GONE_NS: Final = NS_PER_S


class DynamicObstacles:
    """
    Cells in which scanners saw obstacles that are not on the map.

    :param scanners: the input of each, and its mounting.
    :param settings: of the planner: ``map_tolerance_m`` (points this near to walls of the map are
        part of them), ``obstacle_range_m`` (largest distance from a scanner),
        ``obstacle_memory_s`` (how long an obstacle is stored after it was seen last).

    People who walk are elsewhere soon, and no reason for another path: :meth:`standing` returns
    what has been in its place for a while.

    :ivar terrain: of the map; None before the first: then there are no obstacles.
    """

    def __init__(self, scanners: Sequence[tuple[Subscription, Mounting]],
                 settings: Mapping[str, Any]) -> None:
        self.terrain: Terrain | None = None
        outline = Circle(max(settings['robot_radius_m'], 1e-3))
        self._scanners = [Scanner(read, place, outline, settings['scan_minimum_m'])
                          for read, place in scanners]
        self._tolerance_m: float = settings['map_tolerance_m']
        self._range_m: float = settings['obstacle_range_m']
        self._memory_ns = round(settings['obstacle_memory_s'] * NS_PER_S)
        self._until_ns: dict[int, int] = {}
        # For each patch of the floor: since when it is occupied, and when that was seen last.
        self._since_ns: dict[Patch, tuple[int, int]] = {}

    def __len__(self) -> int:
        return len(self._until_ns)

    def set_terrain(self, terrain: Terrain | None, moved: Pose = (0.0, 0.0, 0.0)) -> None:
        """
        Continue with another map, on which cells have other numbers, or do not exist.

        :param moved: movement of the map; stored obstacles move along.
        """
        before, found = self.terrain, self._until_ns
        self.terrain, self._until_ns = terrain, {}
        if before is None or terrain is None:
            return
        for cell, until_ns in found.items():
            there = terrain.cell(*composed(moved, (*before.place(cell), 0.0))[:2])
            if there >= 0 and not terrain.solid[there]:
                self._until_ns[there] = until_ns
        self._since_ns = {_patch_at(*composed(moved, (x * _PATCH_M, y * _PATCH_M, 0.0))[:2]): seen
                          for (x, y), seen in self._since_ns.items()}

    def standing(self, now_ns: int, least_ns: int) -> list[int]:
        """Return the cells that have been occupied for a time at least."""
        terrain = self.terrain
        if terrain is None:
            return []
        patches = {patch for patch, (since_ns, _) in self._since_ns.items()
                   if now_ns - since_ns >= least_ns}
        return [cell for cell in self._until_ns if _patch(terrain, cell) in patches]

    def update(self, pose: Pose, now_ns: int) -> None:
        """Add what the scanners see from a pose, and drop what is too old."""
        found = self._until_ns
        for cell in [cell for cell, until_ns in found.items() if until_ns <= now_ns]:
            del found[cell]
        since = self._since_ns
        for patch in [patch for patch, (_, seen_ns) in since.items()
                      if now_ns - seen_ns > self._memory_ns]:
            del since[patch]
        terrain = self.terrain
        if terrain is None:
            return
        x0, y0, yaw = pose
        cosine, sine = math.cos(yaw), math.sin(yaw)
        for scanner in self._scanners:
            if not scanner.update(now_ns, self._range_m, 0.0, 0.0):
                continue
            self._clear(terrain, scanner, x0, y0, cosine, sine)
            x, y = unmapped_points(terrain, pose, scanner.x, scanner.y, self._tolerance_m)
            for cell in np.unique(terrain.cells(x, y)).tolist():
                found.pop(cell, None)  # the newest are last
                found[cell] = now_ns + self._memory_ns
                patch = _patch(terrain, cell)
                since_ns, seen_ns = since.get(patch, (now_ns, now_ns))
                since[patch] = since_ns if now_ns - seen_ns < _GONE_NS else now_ns, now_ns
        while len(found) > _MOST:
            del found[next(iter(found))]

    def _clear(self, terrain: Terrain, scanner: Scanner, x0: float, y0: float, cosine: float,
               sine: float) -> None:
        """Drop cells that a scanner sees through: the obstacle has moved on."""
        found = self._until_ns
        if not found:
            return
        cells = list(found)
        places = np.array([terrain.place(cell) for cell in cells])
        dx, dy = places[:, 0] - x0, places[:, 1] - y0
        seen = scanner.sees_beyond(cosine * dx + sine * dy, cosine * dy - sine * dx,
                                   2 * terrain.grid.resolution_m)
        for index in np.flatnonzero(seen).tolist():
            del found[cells[index]]

    def blocks(self, way: Sequence[tuple[float, float]], within_m: float, now_ns: int,
               least_ns: int) -> bool:
        """Return whether an obstacle has been near one of some points for a time at least."""
        terrain, cells = self.terrain, self.standing(now_ns, least_ns)
        if terrain is None or not cells or not way:
            return False
        places = np.array([terrain.place(cell) for cell in cells])
        return any(bool((np.hypot(places[:, 0] - x, places[:, 1] - y) < within_m).any())
                   for x, y in way)


def _patch(terrain: Terrain, cell: int) -> Patch:
    return _patch_at(*terrain.place(cell))


def _patch_at(x: float, y: float) -> Patch:
    return math.floor(x / _PATCH_M), math.floor(y / _PATCH_M)
