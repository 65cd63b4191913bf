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
The cost of each place of a map (a costmap), for path search.

Obstacles are inflated by the radius of a round robot, so that it is planned as a point; ground
near walls has a higher cost. For growing maps a terrain is computed tile by tile, in pieces that
can be preempted, and unchanged tiles are copied from the previous terrain.
"""

from __future__ import annotations

from collections.abc import Generator
from collections.abc import Iterable
from collections.abc import Iterator
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.motion.distances import distances_within
from rt_robot_os.motion.distances import halo_of
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.grid_map import UNKNOWN

Costs = npt.NDArray[np.float32]
Cells = npt.NDArray[np.intp]
Values = npt.NDArray[np.int8]

# Additional cost right next to forbidden ground.
_DEAR: Final = 4.0
# Cells copied or filled in one native call: some 10 us, in which nothing can preempt.
PIECE: Final = 1 << 15
# Margin, as a wall ends somewhere in its cell, and the robot is somewhere in its own.
_CELL_SHARE: Final = 0.75
_OCCUPIED: Final = 50
# Beyond the edges of the map.
_OUTSIDE: Final = -2
# Edge of a tile, in cells.
_TILE: Final = 128
_WIDEST_TILE: Final = 512
# Largest offset, in cells, at which two maps have the same cell grid.
_SAME_CELL: Final = 0.01


class Terrain:
    """
    The costs of all cells of a map, in rows one behind the other, with a forbidden border.

    A cell is named by one number. The cost is that of driving the length of a cell there: 1 on
    free ground, more near walls, infinite where the centre of the robot cannot be.

    :param grid: the map.
    :param radius_m: that must stay free round the robot.
    :param prefer_m: preferred distance from its centre to walls; also the longest one of
        :meth:`has_room`.
    :param unknown: whether unknown ground may be driven over.
    :ivar cost: including stamped obstacles.
    :ivar solid: whether a cell is occupied, or unknown and not allowed.
    :ivar width: cells in a row, with the border.
    :ivar computed: tiles that could not be copied from the previous terrain.
    """

    def __init__(self, grid: GridMap, radius_m: float, prefer_m: float, unknown: bool) -> None:
        self._prepare(grid, radius_m, prefer_m, unknown)
        for _ in self._fill(None):
            pass

    # ---- making ------------------------------------------------------------------------------

    @classmethod
    def in_pieces(cls, grid: GridMap, radius_m: float, prefer_m: float, unknown: bool,
                  before: Terrain | None = None) -> Generator[None, None, Terrain]:
        """
        Make one; it yields after each bounded piece of work.

        :param before: of the previous map: unchanged tiles are copied.
        :return: the terrain; ``before`` itself when there is no difference.
        """
        made = cls.__new__(cls)
        made._prepare(grid, radius_m, prefer_m, unknown)
        yield from made._fill(before)
        is_same = before is not None and not made.computed and (
            made._shift_to(before) == (0, 0) and made.static.size == before.static.size
            and made.width == before.width)
        return before if before is not None and is_same else made

    def _prepare(self, grid: GridMap, radius_m: float, prefer_m: float, unknown: bool) -> None:
        self.grid = grid
        self.radius_m = radius_m
        self.computed = 0
        self._unknown = unknown
        resolution = grid.resolution_m
        self._forbidden_m = forbidden_m(radius_m, resolution)
        self._stamp = disc(self._forbidden_m / resolution)
        self._border = border = int(self._forbidden_m / resolution) + 2
        self.width = grid.columns + 2 * border
        self._reach_m = max(prefer_m, self._forbidden_m + resolution)
        size = (grid.rows + 2 * border) * self.width
        self.solid: npt.NDArray[np.bool_] = np.empty(size, np.bool_)
        self.static: Costs = np.empty(size, np.float32)
        self.cost: Costs = np.empty(size, np.float32)
        self._wall_m: Costs = np.empty(size, np.float32)

    def _fill(self, before: Terrain | None) -> Iterator[None]:
        shift = self._shift_to(before) if before is not None else None
        tile = min(max(_TILE, self._halo), _WIDEST_TILE)
        rows = self.grid.rows + 2 * self._border
        for row in range(0, rows, tile):
            for column in range(0, self.width, tile):
                area = row, column, min(tile, rows - row), min(tile, self.width - column)
                if before is None or shift is None or not self._take_over(before, shift, area):
                    yield from self._compute(area)
                yield

    @property
    def _halo(self) -> int:
        return halo_of(self._reach_m / self.grid.resolution_m)

    def _shift_to(self, before: Terrain) -> tuple[int, int] | None:
        """Return where the first cell is on the previous map; None when the grids differ."""
        grid, other = self.grid, before.grid
        if (grid.resolution_m, grid.origin[2], self.radius_m, self._reach_m, self._unknown) != (
                other.resolution_m, other.origin[2], before.radius_m, before._reach_m,
                before._unknown):
            return None
        columns, rows = (each / grid.resolution_m for each in other.along(*grid.origin[:2]))
        shift = round(rows), round(columns)
        if abs(rows - shift[0]) > _SAME_CELL or abs(columns - shift[1]) > _SAME_CELL:
            return None
        return shift

    def _values(self, row: int, column: int, rows: int, columns: int) -> Values:
        """Return the values of an area, its first cell counted from that of the map."""
        cells = self.grid.cells
        r0, r1 = max(row, 0), min(row + rows, self.grid.rows)
        c0, c1 = max(column, 0), min(column + columns, self.grid.columns)
        if (r1 - r0, c1 - c0) == (rows, columns):
            return cells[r0:r1, c0:c1]
        found = np.full((rows, columns), _OUTSIDE, np.int8)
        if r0 < r1 and c0 < c1:
            found[r0 - row:r1 - row, c0 - column:c1 - column] = cells[r0:r1, c0:c1]
        return found

    def _around_area(self, area: tuple[int, int, int, int]) -> tuple[int, int, int, int]:
        row, column, rows, columns = area
        halo, out = self._halo, self._halo + self._border
        return row - out, column - out, rows + 2 * halo, columns + 2 * halo

    def _take_over(self, before: Terrain, shift: tuple[int, int],
                   area: tuple[int, int, int, int]) -> bool:
        """Copy a tile of the previous terrain, if it and its surroundings are unchanged."""
        row, column, rows, columns = area
        up, across, high, wide = self._around_area(area)
        there, beside = row + shift[0], column + shift[1]
        if there < 0 or beside < 0 or beside + columns > before.width or (
                there + rows > before.static.size // before.width):
            return False
        if not np.array_equal(self._values(up, across, high, wide), before._values(
                up + shift[0], across + shift[1], high, wide)):
            return False
        for mine, theirs in ((self.static, before.static), (self.cost, before.static),
                             (self._wall_m, before._wall_m), (self.solid, before.solid)):
            mine.reshape(-1, self.width)[row:row + rows, column:column + columns] = (
                theirs.reshape(-1, before.width)[there:there + rows, beside:beside + columns])
        return True

    def _compute(self, area: tuple[int, int, int, int]) -> Iterator[None]:
        self.computed += 1
        row, column, rows, columns = area
        values = self._values(*self._around_area(area))
        halo, resolution, reach_m = self._halo, self.grid.resolution_m, self._reach_m
        cells = yield from distances_within(values >= _OCCUPIED, reach_m / resolution)
        yield
        distance = np.minimum(cells * np.float32(resolution), np.float32(reach_m))
        near = np.clip((reach_m - distance) / (reach_m - self._forbidden_m), 0.0, 1.0)
        cost = (1.0 + (_DEAR - 1.0) * near * near).astype(np.float32)
        yield
        inner = values[halo:halo + rows, halo:halo + columns]
        solid = (inner >= _OCCUPIED) | (inner == _OUTSIDE)
        if not self._unknown:
            solid |= inner == UNKNOWN
        cost[(distance < self._forbidden_m) | solid] = math.inf
        for whole, tile in ((self.static, cost), (self.cost, cost), (self._wall_m, distance)):
            whole.reshape(-1, self.width)[row:row + rows, column:column + columns] = tile
        self.solid.reshape(-1, self.width)[row:row + rows, column:column + columns] = solid

    # ---- cells and places --------------------------------------------------------------------

    def cell(self, x: float, y: float) -> int:
        """Return the cell at a place; -1 off the map, or for NaN."""
        found = self.grid.cell(x, y)
        if found is None:
            return -1
        return (found[0] + self._border) * self.width + found[1] + self._border

    def place(self, cell: int) -> tuple[float, float]:
        """Return the middle of a cell in m."""
        row, column = divmod(cell, self.width)
        return self.grid.centre(row - self._border, column - self._border)

    def cells(self, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64]) -> Cells:
        """Return the cells at many places; for places off the map one of the border."""
        rows, columns, inside = self.grid.indices(x, y)
        return np.where(inside, (rows + self._border) * self.width + columns + self._border, 0)

    def line(self, start: tuple[float, float], end: tuple[float, float]) -> Cells:
        """Return cells along a line: of five points for the length of a cell."""
        length_m = math.hypot(end[0] - start[0], end[1] - start[1])
        count = 2 + int(length_m / (0.2 * self.grid.resolution_m))
        part = np.linspace(0.0, 1.0, count)
        return self.cells(start[0] + part * (end[0] - start[0]),
                          start[1] + part * (end[1] - start[1]))

    def around(self, cell: int, radius_m: float) -> Cells:
        """Return the cells round one, the nearest first, without those beyond the border."""
        reach = int(radius_m / self.grid.resolution_m)
        up, across = disc(reach + 0.5)
        order = np.argsort(up * up + across * across, kind='stable')
        up, across = up[order], across[order]
        row, column = divmod(cell, self.width)
        keep = ((row + up >= 0) & (row + up < self.static.size // self.width)
                & (column + across >= 0) & (column + across < self.width))
        return cell + up[keep] * self.width + across[keep]

    def has_room(self, cells: Cells, room_m: float) -> npt.NDArray[np.bool_]:
        """Return which cells have centres at least this far from occupied cells."""
        least_m = min(room_m + 0.49 * self.grid.resolution_m, self._reach_m)
        return np.asarray(self._wall_m[cells] >= least_m)

    def is_wall(self, cells: Cells) -> npt.NDArray[np.bool_]:
        """Return which cells are occupied on the map."""
        return np.asarray(self._wall_m[cells] <= 0.0)

    def is_unseen(self, cell: int) -> bool:
        """Return whether a cell of the map is unknown."""
        row, column = divmod(cell, self.width)
        row, column = row - self._border, column - self._border
        return 0 <= row < self.grid.rows and 0 <= column < self.grid.columns and (
            self.grid.cells.item(row, column) == UNKNOWN)

    def has_ground(self, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64],
                   room_m: float) -> npt.NDArray[np.bool_]:
        """Return at which places the robot may be with this much room."""
        cells = self.cells(x, y)
        least_m = room_m + _CELL_SHARE * self.grid.resolution_m
        return np.asarray((self._wall_m[cells] >= least_m) & ~self.solid[cells])

    def beside_wall(self, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64],
                    within_m: float) -> npt.NDArray[np.bool_]:
        """Return which places are this near to occupied cells, or off the map."""
        cells = self.cells(x, y)
        return np.asarray((self._wall_m[cells] <= within_m) | self.solid[cells])

    # ---- what is not on the map --------------------------------------------------------------

    def stamp(self, obstacles: Iterable[int], here: tuple[float, float] = (math.nan, math.nan),
              own_m: float = 0.0) -> Iterator[None]:
        """
        Forbid what the map forbids and the surroundings of obstacles, piece by piece.

        :param obstacles: occupied cells that are not on the map.
        :param here: position of the robot.
        :param own_m: its radius: the ground under it is free, though it may be unseen.
        """
        for begin in range(0, self.static.size, PIECE):
            self.cost[begin:begin + PIECE] = self.static[begin:begin + PIECE]
            yield
        if own_m > 0.0 and (cell := self.cell(*here)) >= 0:
            own = [each for each in self.around(cell, own_m).tolist() if self.is_unseen(each)
                   and self._wall_m[each] >= self._forbidden_m]
            self.cost[own] = _DEAR
            yield
        up, across = self._stamp
        offsets = up * self.width + across
        for cell in obstacles:
            self.cost[cell + offsets] = math.inf
            yield


def forbidden_m(radius_m: float, resolution_m: float) -> float:
    """Return the smallest distance of the robot's centre from the centre of an occupied cell."""
    # At least the neighbours of occupied cells are forbidden: else a diagonal slips through.
    return max(radius_m + _CELL_SHARE * resolution_m, 1.01 * resolution_m)


def disc(radius: float) -> tuple[Cells, Cells]:
    """Return the rows and columns of all cells nearer than a radius, seen from one."""
    reach = int(radius)
    span = np.arange(-reach, reach + 1)
    up, across = np.meshgrid(span, span, indexing='ij')
    inside = up * up + across * across < radius * radius
    return up[inside], across[inside]
