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

"""What stands in the way of a robot and is not on its map, as cells, for a while."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Final

import numpy as np

from rt_robot_os.modules.collision_guard.sensors import Scanner
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.terrain import Terrain

_MOST: Final = 600


class Strangers:
    """
    Cells in which scanners saw what the map has not.

    :param tolerance_m: what is so near to what the map has is that.
    :param range_m: how far from a scanner it is believed.
    :param memory_ns: how long it is remembered after it was seen last.
    """

    def __init__(self, terrain: Terrain, scanners: Sequence[Scanner], tolerance_m: float,
                 range_m: float, memory_ns: int) -> None:
        self._terrain = terrain
        self._scanners = scanners
        self._tolerance_m = tolerance_m
        self._range_m = range_m
        self._memory_ns = memory_ns
        self._until_ns: dict[int, int] = {}

    def __len__(self) -> int:
        return len(self._until_ns)

    def cells(self) -> list[int]:
        """Return where something stands."""
        return list(self._until_ns)

    def look(self, pose: Pose, now_ns: int) -> None:
        """Take what the scanners see from a pose, and forget what is too old."""
        found = self._until_ns
        for cell in [cell for cell, until_ns in found.items() if until_ns <= now_ns]:
            del found[cell]
        x0, y0, yaw = pose
        cosine, sine = math.cos(yaw), math.sin(yaw)
        for scanner in self._scanners:
            if not scanner.take(now_ns, self._range_m, 0.0, 0.0) or not scanner.x.size:
                continue
            x = x0 + cosine * scanner.x - sine * scanner.y
            y = y0 + sine * scanner.x + cosine * scanner.y
            strange = ~self._terrain.beside_wall(x, y, self._tolerance_m)
            for cell in np.unique(self._terrain.cells(x[strange], y[strange])).tolist():
                found.pop(cell, None)  # the newest are last
                found[cell] = now_ns + self._memory_ns
        while len(found) > _MOST:
            del found[next(iter(found))]

    def is_on(self, way: Sequence[tuple[float, float]], within_m: float) -> bool:
        """Return whether something is so near to one of some points."""
        if not self._until_ns or not way:
            return False
        places = np.array([self._terrain.place(cell) for cell in self._until_ns])
        return any(bool((np.hypot(places[:, 0] - x, places[:, 1] - y) < within_m).any())
                   for x, y in way)
