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

"""A likelihood field: how well points match earlier ones, each of which is a small hill."""

from __future__ import annotations

import math
from typing import Any
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import as_strided
import numpy.typing as npt

from rt_robot_os.features.mapping.slam.transforms import Floats

Likelihoods = npt.NDArray[np.float32]
Levels = npt.NDArray[np.uint16]
Cells = npt.NDArray[np.int64]
#: Sums of up to this many points are exact: the top of a hill is the highest level of which that
#: many fit into 16 bits, which is twice as fast as 32.
POINTS_MOST: Final = 120
_TOP: Final = 65535 // POINTS_MOST
#: The hills end at so many standard deviations.
_REACH: Final = 3.0
#: Margin round the points, in m and in cells. It is wider than a hill and a search window
#: together.
_MARGIN_M: Final = 1.0
_MARGIN: Final = 16
#: Larger grids are made coarser: 4096 x 4096 cells are 32 MB.
_SIDE_MOST: Final = 4096
#: Values that are added up together: they fit into a cache.
_AT_ONCE: Final = 200_000


class LikelihoodField:
    """
    The likelihood that a beam ends in a cell: 1 on a point, falling off like a bell.

    :param points: shape (n, 2), in m, n > 0.
    :param cell_m: edge of a cell.
    :param sigma_m: standard deviation of a hill.
    """

    def __init__(self, points: Floats, cell_m: float = 0.05, sigma_m: float = 0.07) -> None:
        low, high = points.min(0), points.max(0)
        self.cell_m = max(cell_m, float((high - low).max()) / _SIDE_MOST)
        margin = max(_MARGIN_M, _MARGIN * self.cell_m)
        self.low: Floats = low - margin
        columns, rows = (np.ceil((high - low + 2.0 * margin) / self.cell_m).astype(np.int64)
                         + 1).tolist()
        self._levels: Levels = np.zeros((rows, columns), np.uint16)
        self._best: tuple[int, int, Levels] | None = None
        self._raise_hills(points, sigma_m)

    def _raise_hills(self, points: Floats, sigma_m: float) -> None:
        # The margin is wider than any hill, so that all of them fit.
        cells = ((points - self.low) / self.cell_m).astype(np.int64)
        rows, columns = self._levels.shape
        is_top = np.zeros(rows * columns, np.bool_)
        is_top[cells[:, 1] * columns + cells[:, 0]] = True
        at = np.flatnonzero(is_top)
        reach = min(math.ceil(_REACH * sigma_m / self.cell_m), _MARGIN // 2)
        scale = self.cell_m ** 2 / (2.0 * sigma_m ** 2)
        flat = self._levels.reshape(-1)
        # Of overlapping hills the highest counts: lower ones are written before.
        shifts = sorted(((dx * dx + dy * dy, dy * columns + dx)
                         for dy in range(-reach, reach + 1) for dx in range(-reach, reach + 1)
                         if dx * dx + dy * dy <= reach * reach), reverse=True)
        for far, shift in shifts:
            flat[at + shift] = round(_TOP * math.exp(-far * scale))

    def means(self, cells: Cells, across: Cells, up: Cells, side: int) -> Likelihoods:
        """
        Return the mean value under points, for each of ``side`` x ``side`` shifts.

        :param cells: shape (n, points, 2), column and row; they may lie outside. No more than
            ``POINTS_MOST`` points.
        :param across: shape (n,): the first shift in cells; ``up`` is that of rows.
        :param side: no more than half the margin.
        :return: shape (n, side, side), rows first.
        """
        return _means(self._levels, 1, side, cells[..., 1] + up[:, None],
                      cells[..., 0] + across[:, None])

    def coarse_means(self, cells: Cells, reach: int, factor: int) -> Likelihoods:
        """
        Return the most that any shift from a coarse one to the next can give.

        :param cells: as of :meth:`means`.
        :param reach: coarse shifts to each side, of ``factor`` cells each; a power of 2.
        :return: shape (n, 2 reach + 1, 2 reach + 1), rows first.
        """
        side = 2 * reach + 1
        pad = side * factor
        if self._best is None or self._best[:2] != (pad, factor):
            self._best = pad, factor, _best_of(np.pad(self._levels, pad), factor)
        begin = pad - reach * factor
        return _means(self._best[2], factor, side, cells[..., 1] + begin, cells[..., 0] + begin)

    def cells_of(self, points: Floats) -> Cells:
        """Return the cells of points, column and row, which may lie outside."""
        cells: Cells = np.floor((points - self.low) / self.cell_m).astype(np.int64)
        return cells


def _best_of(levels: Levels, factor: int) -> Levels:
    """Return the best value among the next ``factor`` x ``factor`` cells, for each cell."""
    step = 1
    while step < factor:
        np.maximum(levels[:, :-step], levels[:, step:], out=levels[:, :-step])
        np.maximum(levels[:-step], levels[step:], out=levels[:-step])
        step *= 2
    return levels


def _means(levels: Levels, step: int, side: int, row: Cells, column: Cells) -> Likelihoods:
    """Return the means of windows of ``side`` x ``side`` cells, each ``step`` from the next."""
    rows, columns = (each - (side - 1) * step for each in levels.shape)
    high, wide = levels.strides
    windows: Any = as_strided(levels, (rows, columns, side, side),
                              (high, wide, high * step, wide * step), writeable=False)
    count, points = row.shape
    # Points first: so the sums of all windows are in one row. Beyond the grid the value is 0, as
    # at its border.
    up, across = np.clip(row.T, 0, rows - 1), np.clip(column.T, 0, columns - 1)
    sums = np.empty((count, side, side), np.uint16)
    some = max(1, _AT_ONCE // (points * side * side))
    for begin in range(0, count, some):
        part = slice(begin, begin + some)
        np.add.reduce(windows[up[:, part], across[:, part]], 0, np.uint16, out=sums[part])
    means: Likelihoods = sums * np.float32(1.0 / (_TOP * points))
    return means
