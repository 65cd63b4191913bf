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
A growing map on top of a base map: unknown cells have the value of the base map.

Both are in the same frame. The growing one may have another resolution and rotation.
"""

from __future__ import annotations

from collections.abc import Generator
import math
from typing import Final

import numpy as np

from rt_robot_os.motion.grid_map import Cells
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.grid_map import Origin
from rt_robot_os.motion.grid_map import UNKNOWN
from rt_robot_os.motion.map_message import MOST_CELLS

# Cells that are looked up in one native call: some 0.2 ms.
_PIECE: Final = 1 << 12
# The grids may be offset by this part of a cell without an additional cell.
_SLACK: Final = 1e-6


class BaseMap:
    """
    The base map.

    :param grid: the map.
    """

    def __init__(self, grid: GridMap) -> None:
        self._grid = grid
        # The base map in the cells of the last map above it, with the lattice and origin of that.
        self._cells: Cells | None = None
        self._lattice: tuple[object, ...] = ()

    def filled(self, above: GridMap) -> Generator[None, None, GridMap]:
        """
        Return a map with the known cells of another one, and for the rest those of this one.

        It yields after each bounded piece of work. If both together are too large for a map, the
        result is the other one alone.
        """
        left, low, columns, rows = self._extent(above)
        if rows * columns > MOST_CELLS:
            return above
        origin = (*above.point(left * above.resolution_m, low * above.resolution_m),
                  above.origin[2])
        lattice = (above.resolution_m, above.origin, left, low, rows, columns)
        if lattice != self._lattice or self._cells is None:
            self._cells = yield from self._resampled(origin, above.resolution_m, rows, columns)
            self._lattice = lattice
        cells = self._cells.copy()
        yield
        most = max(1, (_PIECE << 4) // above.columns)
        for begin in range(0, above.rows, most):
            seen = above.cells[begin:begin + most]
            first = begin - low
            part = cells[first:first + len(seen), -left:above.columns - left]
            part[:] = np.where(seen == UNKNOWN, part, seen)
            yield
        return GridMap.owning(cells, above.resolution_m, origin)

    def _extent(self, above: GridMap) -> tuple[int, int, int, int]:
        """Return first column and row, and the size, of both maps in cells of the other one."""
        x0, y0, x1, y1 = self._grid.bounds
        ends = [above.along(x, y) for x in (x0, x1) for y in (y0, y1)]
        across = [along / above.resolution_m for along, _ in ends]
        up = [away / above.resolution_m for _, away in ends]
        left, low = (min(0, math.floor(min(each) + _SLACK)) for each in (across, up))
        right = max(above.columns, math.ceil(max(across) - _SLACK))
        high = max(above.rows, math.ceil(max(up) - _SLACK))
        return left, low, right - left, high - low

    def _resampled(self, origin: Origin, resolution_m: float, rows: int, columns: int
                   ) -> Generator[None, None, Cells]:
        """Return the map in other cells, each with the value at its middle."""
        cells = np.empty(rows * columns, np.int8)
        x0, y0, yaw = origin
        cosine, sine = math.cos(yaw), math.sin(yaw)
        for begin in range(0, cells.size, _PIECE):
            row, column = np.divmod(np.arange(begin, min(begin + _PIECE, cells.size)), columns)
            along, across = (column + 0.5) * resolution_m, (row + 0.5) * resolution_m
            cells[begin:begin + _PIECE] = self._grid.values(
                x0 + cosine * along - sine * across, y0 + sine * along + cosine * across)
            yield
        return cells.reshape(rows, columns)
