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

"""The terrain of the planner, updated in pieces when the map grows or changes."""

from __future__ import annotations

from collections.abc import Generator
from collections.abc import Mapping
from collections.abc import Sequence
import time
from typing import Any
from typing import Final

import numpy as np

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.features.mapping.live_map import LiveMap
from rt_robot_os.features.navigation.planner.planned_path import rest_of
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.route import RoutePlanner
from rt_robot_os.motion.terrain import Terrain

POSES_MAXIMUM: Final = 1000
# Share of the planned clearance that is enough to continue on a path: the edge of a wall varies
# by a cell while it is mapped.
_CLEARANCE_SHARE: Final = 0.5


class PlanningGround:
    """
    Map, terrain and route planner, which belong together.

    :param live: the source of maps.
    :param settings: of the planner.
    :ivar planner: None before the first map.
    :ivar unknown_is_free: the requested value; the terrain is updated accordingly.
    """

    def __init__(self, live: LiveMap, settings: Mapping[str, Any]) -> None:
        self.map = live
        self.planner: RoutePlanner | None = None
        self.unknown_is_free: bool = settings['unknown_is_free']
        self._settings = settings
        self._radius_m = settings['robot_radius_m'] + settings['clearance_m']
        self._open_m = settings['robot_radius_m'] + _CLEARANCE_SHARE * settings['clearance_m']
        self._room_m: float = settings['robot_radius_m'] + settings['goal_clearance_m']
        self._is_with_unknown = self.unknown_is_free
        self._work: Generator[None, None, Terrain | None] | None = None
        self._spent_ns = 0
        self._took_ms = 0.0
        self._computed = self._renewed = 0
        if live.grid is not None:
            self._use(Terrain(live.grid, self._radius_m, self._prefer_m(live.grid),
                              self._is_with_unknown))

    @property
    def terrain(self) -> Terrain | None:
        """Return the terrain; None before the first map."""
        return self.planner.terrain if self.planner is not None else None

    @property
    def is_behind(self) -> bool:
        """Return whether the terrain is outdated."""
        return self._work is not None or self.map.is_behind or (
            self.map.grid is not None and self._is_with_unknown != self.unknown_is_free)

    def advance(self, pieces: int) -> bool:
        """
        Do some pieces of the update to the newest map; safe in the real-time loop.

        :return: whether the terrain was replaced.
        """
        if self._work is None:
            self._work, self._spent_ns = self._made(), 0
        begin_ns = time.thread_time_ns()
        terrain = None
        try:
            for _ in range(pieces):
                next(self._work)
        except StopIteration as ended:
            self._work, terrain = None, ended.value
        self._spent_ns += time.thread_time_ns() - begin_ns
        if self._work is None:
            self._took_ms = self._spent_ns / NS_PER_MS
        if terrain is None or terrain is self.terrain:
            return False
        self._renewed += 1
        self._use(terrain)
        return True

    def blocked_at(self, way: Sequence[Pose], here: Pose) -> tuple[float, float] | None:
        """
        Return the first place where the map blocks the rest of a path; None when it is free.

        :param here: pose of the robot; its own place does not count.
        """
        terrain = self.terrain
        rest = np.array([pose[:2] for pose in rest_of(way, here)])
        if len(rest) < 2 or terrain is None:
            return None
        step = 0.5 * terrain.grid.resolution_m
        count = 2 + int(float(np.hypot(*np.diff(rest, axis=0).T).max()) / step)
        part = np.linspace(0.0, 1.0, count)[:, None]
        x, y = (rest[:-1, axis] + part * (rest[1:, axis] - rest[:-1, axis]) for axis in (0, 1))
        beside = np.hypot(x - here[0], y - here[1]) <= self._radius_m
        closed = np.argwhere(~(beside | terrain.has_ground(x, y, self._open_m)).T)
        if not len(closed):
            return None
        piece, along = closed[0]
        return float(x[along, piece]), float(y[along, piece])

    def warning(self) -> str:
        """Return the problem with the maps of the topic; empty without one."""
        return self.map.warning()

    def statistics(self) -> Mapping[str, Any]:
        """Return the size of the map, the counters, and the duration of the update."""
        return {**self.map.statistics(), 'map_changes': self._renewed,
                'map_tiles_computed': self._computed, 'map_took_ms': self._took_ms}

    # ---- update ------------------------------------------------------------------------------

    def _made(self) -> Generator[None, None, Terrain | None]:
        wanted = self.unknown_is_free
        grid = yield from self.map.read_newest()
        if grid is None:
            grid = self.map.grid
            if grid is None or wanted == self._is_with_unknown:
                return None
        made = yield from Terrain.in_pieces(grid, self._radius_m, self._prefer_m(grid), wanted,
                                            self.terrain)
        self._is_with_unknown = wanted
        self._computed = made.computed
        return made

    def _prefer_m(self, grid: GridMap) -> float:
        wanted_m: float = self._settings['prefer_m']
        return max(wanted_m, self._room_m + grid.resolution_m)

    def _use(self, terrain: Terrain) -> None:
        s = self._settings
        self.planner = RoutePlanner(terrain, s['goal_tolerance_m'], s['start_tolerance_m'],
                                    POSES_MAXIMUM, self._room_m, own_m=s['robot_radius_m'],
                                    is_growing=self.map.is_live)
