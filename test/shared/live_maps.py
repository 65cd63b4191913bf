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

"""Live maps for tests."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from rt_robot_os.motion.grid_map import Cells
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.grid_map import UNKNOWN
from rt_robot_os.motion.poses import composed
from rt_robot_os.topics import Bus
from rt_robot_os.topics import Publisher

Floats = npt.NDArray[np.float64]


def map_topic(bus: Bus, name: str = 'map') -> Publisher:
    """Declare a topic of maps."""
    bus.declare(name, 'nav_msgs/msg/OccupancyGrid', {'header.frame_id': 'map'}, depth=2,
                tail=200_000)
    return bus.publisher(name)


def put_grid(publisher: Publisher, grid: GridMap, cells: Cells | None = None,
             at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Any:
    """
    Fill in the message; it is published by whoever asks.

    :param cells: in place of those of the map.
    :param at: where the map has moved to.
    """
    message = publisher.msg
    x, y, yaw = composed(at, grid.origin)
    message.info.height, message.info.width = grid.cells.shape
    message.info.resolution = grid.resolution_m
    message.info.origin.position = x, y, 0.0
    message.info.origin.orientation = 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)
    publisher.fill(memoryview(grid.cells if cells is None else cells))
    return message


class Seen:
    """A true map, cut by what a scanner has seen of it."""

    def __init__(self, grid: GridMap) -> None:
        self.grid = grid
        self.cells = np.full_like(grid.cells, UNKNOWN)

    def look(self, x: float, y: float, bearings: Floats, ranges: Floats) -> None:
        """Uncover what rays pass and meet."""
        step = 0.4 * self.grid.resolution_m
        along = np.arange(0.0, float(ranges.max()) + step, step)
        rays, steps = np.nonzero(along <= ranges[:, None] + step)
        rows, columns, inside = self.grid.indices(
            x + along[steps] * np.cos(bearings[rays]), y + along[steps] * np.sin(bearings[rays]))
        rows, columns = rows[inside], columns[inside]
        self.cells[rows, columns] = self.grid.cells[rows, columns]

    def part(self, edge: int = 20) -> GridMap:
        """Return what is known, and little more: it grows to all sides."""
        known = np.argwhere(self.cells != UNKNOWN)
        low = known.min(axis=0) // edge * edge
        high = np.minimum(-(-(known.max(axis=0) + 1) // edge) * edge, self.cells.shape)
        cells = self.cells[low[0]:high[0], low[1]:high[1]].copy()
        resolution, (x, y, yaw) = self.grid.resolution_m, self.grid.origin
        return GridMap(cells, resolution, (x + low[1] * resolution, y + low[0] * resolution, yaw))
