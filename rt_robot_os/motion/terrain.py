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
Where on a map a robot may be, and how dear each place is: the ground of a search for a way.

A round robot is a point when everything in its way is grown by its radius; beyond that it is dear
to be near walls. Making it takes some tenths of a second for 1000 x 1000 cells and is done at the
start; what is added later is stamped, a few microseconds each.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Iterator
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.motion.grid_map import GridMap

Costs = npt.NDArray[np.float32]
Cells = npt.NDArray[np.intp]

# How much dearer than free ground it is right beside what is forbidden.
_DEAR: Final = 4.0
# Cells copied or filled in one native call: some 10 us, in which nothing can preempt.
PIECE: Final = 1 << 15
# A wall ends somewhere in its cell, and the robot is somewhere in its own.
_CELL_SHARE: Final = 0.75


class Terrain:
    """
    The costs of all cells of a map, in rows one behind the other, with a forbidden border.

    A cell is named by one number. The cost is that of driving the length of a cell there: 1 on
    free ground, more near walls, infinite where the centre of the robot cannot be.

    :param grid: the map.
    :param radius_m: that must stay free round the robot.
    :param prefer_m: distance from its centre to walls that it keeps where there is room; also the
        longest that :meth:`has_room` can tell of.
    :param unknown: whether what nobody knows may be driven over.
    :ivar cost: with what was stamped.
    :ivar solid: whether something stands in a cell, or nobody knows it and may not.
    :ivar width: cells in a row, with the border.
    """

    def __init__(self, grid: GridMap, radius_m: float, prefer_m: float, unknown: bool) -> None:
        self.grid = grid
        self.radius_m = radius_m
        resolution = grid.resolution_m
        # Neighbours of what is occupied are forbidden at the least: else a diagonal slips through.
        self._forbidden_m = max(radius_m + _CELL_SHARE * resolution, 1.01 * resolution)
        self._stamp = _disc(self._forbidden_m / resolution)
        self._border = border = int(self._forbidden_m / resolution) + 2
        self.width = grid.columns + 2 * border
        occupied = np.zeros((grid.rows + 2 * border, self.width), bool)
        inner = slice(border, -border), slice(border, -border)
        occupied[inner] = grid.occupied_mask()
        self._reach_m = reach_m = max(prefer_m, self._forbidden_m + resolution)
        distance = np.minimum(
            distances(occupied, reach_m / resolution) * np.float32(resolution), reach_m)
        near = np.clip((reach_m - distance) / (reach_m - self._forbidden_m), 0.0, 1.0)
        cost = (1.0 + (_DEAR - 1.0) * near * near).astype(np.float32)
        solid = np.ones_like(occupied)
        solid[inner] = occupied[inner] if unknown else (
            occupied[inner] | grid.unknown_mask())
        cost[(distance < self._forbidden_m) | solid] = math.inf
        self.solid: npt.NDArray[np.bool_] = solid.ravel()
        self.static: Costs = cost.ravel()
        self.cost: Costs = self.static.copy()
        self._wall_m: Costs = distance.ravel()

    # ---- cells and places --------------------------------------------------------------------

    def cell(self, x: float, y: float) -> int:
        """Return the cell at a place; -1 off the map, or for what is no number."""
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
        up, across = _disc(reach + 0.5)
        order = np.argsort(up * up + across * across, kind='stable')
        up, across = up[order], across[order]
        row, column = divmod(cell, self.width)
        keep = ((row + up >= 0) & (row + up < self.static.size // self.width)
                & (column + across >= 0) & (column + across < self.width))
        return cell + up[keep] * self.width + across[keep]

    def has_room(self, cells: Cells, room_m: float) -> npt.NDArray[np.bool_]:
        """Return which cells are so far, with their middles, from what the map has."""
        least_m = min(room_m + 0.49 * self.grid.resolution_m, self._reach_m)
        return np.asarray(self._wall_m[cells] >= least_m)

    def beside_wall(self, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64],
                    within_m: float) -> npt.NDArray[np.bool_]:
        """Return which places are so near to what the map has, or off the map."""
        cells = self.cells(x, y)
        return np.asarray((self._wall_m[cells] <= within_m) | self.solid[cells])

    # ---- what is not on the map --------------------------------------------------------------

    def stamp(self, obstacles: Iterable[int]) -> Iterator[None]:
        """
        Forbid what the map forbids and the surroundings of obstacles, piece by piece.

        :param obstacles: cells in which something stands.
        """
        for begin in range(0, self.static.size, PIECE):
            self.cost[begin:begin + PIECE] = self.static[begin:begin + PIECE]
            yield
        up, across = self._stamp
        offsets = up * self.width + across
        for cell in obstacles:
            self.cost[cell + offsets] = math.inf
            yield


def distances(occupied: npt.NDArray[np.bool_], most: float) -> Costs:
    """
    Return how far each cell is from the nearest occupied one, in cells, middle to middle.

    :param occupied: of shape (rows, columns).
    :param most: longer distances are given as this.
    """
    rows = occupied.shape[0]
    far = np.float32(most + 1.0)
    # Along the columns first: down, then up.
    column = np.where(occupied, np.float32(0.0), far)
    for row in range(1, rows):
        np.minimum(column[row], column[row - 1] + 1, out=column[row])
    for row in range(rows - 2, -1, -1):
        np.minimum(column[row], column[row + 1] + 1, out=column[row])
    squares = column * column
    best = squares.copy()
    for shift in range(1, int(most) + 1):
        other = squares + np.float32(shift * shift)
        np.minimum(best[:, shift:], other[:, :-shift], out=best[:, shift:])
        np.minimum(best[:, :-shift], other[:, shift:], out=best[:, :-shift])
    found: Costs = np.minimum(np.sqrt(best), np.float32(most))
    return found


def _disc(radius: float) -> tuple[Cells, Cells]:
    """Return the rows and columns of all cells nearer than a radius, seen from one."""
    reach = int(radius)
    span = np.arange(-reach, reach + 1)
    up, across = np.meshgrid(span, span, indexing='ij')
    inside = up * up + across * across < radius * radius
    return up[inside], across[inside]
