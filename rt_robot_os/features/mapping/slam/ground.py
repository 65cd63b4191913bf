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

"""The reachable ground of a map, and the lengths of paths on it."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Any
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.terrain import Terrain

Mask = npt.NDArray[np.bool_]
Cell = tuple[int, int]
Place = tuple[float, float]

#: Edge of the squares over which paths are measured, in m: thinner than a wall between rooms.
_SQUARE_M: Final = 0.15
#: How much nearer to a wall than a path the robot may stand at the start.
_START_M: Final = 0.6
_AROUND: Final = np.ones((3, 3), np.bool_)


class ReachableGround:
    """
    The ground that a robot can reach from its pose.

    :param radius_m: that must be free round the robot, as ``planner`` has it: with its clearance.
    :ivar standing: shape (rows, columns): the cells on which its centre can be.
    :raises ValueError: the robot cannot leave its place.
    """

    def __init__(self, grid: GridMap, place: Place, radius_m: float) -> None:
        from scipy import ndimage  # of the extra slam
        terrain = Terrain(grid, radius_m, 0.0, False)
        border = (terrain.width - grid.columns) // 2
        inner = slice(border, -border)
        passable = np.isfinite(terrain.static.reshape(-1, terrain.width)[inner, inner])
        begin = _nearest(passable, grid, place)
        if begin is None:
            raise ValueError(f'no ground at {place[0]:.2f}, {place[1]:.2f}')
        names, _ = ndimage.label(passable, _AROUND)
        self._grid, self._passable = grid, passable
        self.standing: Mask = names == names[begin]
        self._edge = max(1, int(_SQUARE_M / grid.resolution_m))
        self._numbers, self._graph = _squares(self.standing, self._edge, grid.resolution_m)
        self._ways = self._from([begin])[0]

    def has(self, place: Place) -> bool:
        """Return whether the cell nearest to a place is on the ground."""
        cell = _nearest(self._passable, self._grid, place)
        return cell is not None and bool(self.standing[cell])

    def way_m(self, cell: Cell) -> float:
        """Return the length of the path from the robot to a cell of the ground."""
        return float(self._ways[self._number(cell)])

    def ways_between(self, cells: Sequence[Cell]) -> Floats:
        """Return the lengths of paths between cells in m; shape (cells, cells)."""
        numbers = [self._number(each) for each in cells]
        ways: Floats = self._from(cells)[:, numbers]
        return ways

    def _number(self, cell: Cell) -> int:
        return int(self._numbers[cell[0] // self._edge, cell[1] // self._edge])

    def _from(self, cells: Sequence[Cell]) -> Floats:
        from scipy.sparse import csgraph
        ways: Floats = csgraph.dijkstra(self._graph, directed=False,
                                        indices=[self._number(each) for each in cells])
        return ways


def _squares(standing: Mask, edge: int, resolution_m: float
             ) -> tuple[npt.NDArray[np.int32], Any]:
    """Return numbers for the squares with ground, -1 for others, and the steps between."""
    from scipy import sparse
    rows, columns = (math.ceil(each / edge) for each in standing.shape)
    padded = np.pad(standing, ((0, rows * edge - standing.shape[0]),
                               (0, columns * edge - standing.shape[1])))
    ground = padded.reshape(rows, edge, columns, edge).any((1, 3))
    numbers = np.full((rows + 1, columns + 2), -1, np.int32)  # a border for the neighbours
    inner = numbers[:-1, 1:-1]
    inner[ground] = np.arange(ground.sum())
    starts, ends, lengths = [], [], []
    for down, across in ((0, 1), (1, 0), (1, 1), (1, -1)):
        there = numbers[down:down + rows, 1 + across:1 + across + columns][ground]
        starts.append(inner[ground][there >= 0])
        ends.append(there[there >= 0])
        lengths.append(np.full(len(ends[-1]), math.hypot(down, across) * edge * resolution_m))
    graph = sparse.csr_matrix((np.concatenate(lengths), (
        np.concatenate(starts), np.concatenate(ends))), shape=(int(ground.sum()),) * 2)
    return inner, graph


def _nearest(mask: Mask, grid: GridMap, place: Place) -> Cell | None:
    """Return the cell of a mask that is nearest to a place; None when none is near."""
    x, y, yaw = grid.origin
    dx, dy = place[0] - x, place[1] - y
    column = (math.cos(yaw) * dx + math.sin(yaw) * dy) / grid.resolution_m
    row = (math.cos(yaw) * dy - math.sin(yaw) * dx) / grid.resolution_m
    reach = math.ceil(_START_M / grid.resolution_m)
    low_row, low_column = max(0, int(row) - reach), max(0, int(column) - reach)
    near = np.argwhere(mask[low_row:max(0, int(row) + reach + 1),
                            low_column:max(0, int(column) + reach + 1)])
    if not len(near):
        return None
    near += (low_row, low_column)
    best = near[np.argmin(np.hypot(near[:, 0] + 0.5 - row, near[:, 1] + 0.5 - column))]
    return int(best[0]), int(best[1])
