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

"""How well points fit what was seen before: a grid in which each point of it is a small hill."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
import numpy.typing as npt

from rt_robot_os.slam.transforms import Floats

Likelihoods = npt.NDArray[np.float32]
Cells = npt.NDArray[np.int64]
#: The hills end at so many standard deviations.
_REACH = 3.0
#: Around the points, in m, in which a match may put others.
_MARGIN_M = 1.0
#: Larger grids are made coarser: 4096 x 4096 cells are 64 MB.
_SIDE_MOST = 4096
#: Values that are added up at once: they fit into a cache.
_AT_ONCE = 200_000


class LikelihoodField:
    """
    The likelihood that a beam ends in a cell: 1 on a point, falling off like a bell.

    :param points: shape (n, 2), in m, n > 0.
    :param cell_m: edge of a cell.
    :param sigma_m: standard deviation of a hill.
    """

    def __init__(self, points: Floats, cell_m: float = 0.05, sigma_m: float = 0.07) -> None:
        low, high = points.min(0) - _MARGIN_M, points.max(0) + _MARGIN_M
        self.cell_m = max(cell_m, float((high - low).max()) / _SIDE_MOST)
        self.low = low
        columns, rows = (np.ceil((high - low) / self.cell_m).astype(np.int64) + 1).tolist()
        self.values: Likelihoods = np.zeros((rows, columns), np.float32)
        self._phases: dict[int, tuple[int, Likelihoods]] = {}
        self._raise_hills(points, sigma_m)

    def _raise_hills(self, points: Floats, sigma_m: float) -> None:
        # The margin is wider than any hill, so that all of them fit.
        cells = ((points - self.low) / self.cell_m).astype(np.int64)
        columns = self.values.shape[1]
        at = np.unique(cells[:, 1] * columns + cells[:, 0])
        reach = min(math.ceil(_REACH * sigma_m / self.cell_m), int(_MARGIN_M / self.cell_m) - 1)
        scale = self.cell_m ** 2 / (2.0 * sigma_m ** 2)
        flat = self.values.reshape(-1)
        # Of hills that overlap the highest counts: what is lower is written before it.
        shifts = sorted(((dx * dx + dy * dy, dy * columns + dx)
                         for dy in range(-reach, reach + 1) for dx in range(-reach, reach + 1)),
                        reverse=True)
        for far, shift in shifts:
            flat[at + shift] = math.exp(-far * scale)

    def means(self, cells: Cells, across: Cells, up: Cells, side: int) -> Likelihoods:
        """
        Return the mean value under points, for each of ``side`` x ``side`` shifts.

        :param cells: shape (n, points, 2), column and row; they may lie outside.
        :param across: shape (n,): the first shift in cells; ``up`` is that of rows.
        :return: shape (n, side, side), rows first.
        """
        windows = self._windows(1, side)
        column = cells[..., 0] + across[:, None]
        row = cells[..., 1] + up[:, None]
        return _summed(windows, np.zeros_like(row), row, column) / np.float32(cells.shape[1])

    def coarse_means(self, cells: Cells, reach: int, factor: int) -> Likelihoods:
        """
        Return the most that any shift from a coarse one to the next can give.

        :param cells: shape (n, points, 2), column and row; they may lie outside.
        :param reach: coarse shifts to each side, of ``factor`` cells each.
        :return: shape (n, 2 reach + 1, 2 reach + 1), rows first.
        """
        windows = self._windows(factor, 2 * reach + 1)
        column, column_phase = np.divmod(cells[..., 0], factor)
        row, row_phase = np.divmod(cells[..., 1], factor)
        return _summed(windows, row_phase * factor + column_phase, row - reach, column - reach
                       ) / np.float32(cells.shape[1])

    def _windows(self, factor: int, side: int) -> Any:
        """Return views of the best values within ``factor`` cells; by phase, row and column."""
        if self._phases.get(factor, (0,))[0] != side:
            best = self._best(factor)
            rows, columns = (-(-each // factor) for each in best.shape)
            padded = np.zeros(((rows + 2 * side) * factor, (columns + 2 * side) * factor),
                              np.float32)
            begin = side * factor
            padded[begin:begin + best.shape[0], begin:begin + best.shape[1]] = best
            apart = padded.reshape(rows + 2 * side, factor, columns + 2 * side, factor)
            phases = np.ascontiguousarray(apart.transpose(1, 3, 0, 2)).reshape(
                factor * factor, rows + 2 * side, columns + 2 * side)
            self._phases[factor] = (side, phases)
        return sliding_window_view(self._phases[factor][1], (side, side), axis=(1, 2))

    def _best(self, factor: int) -> Likelihoods:
        """Return the best value among the next ``factor`` x ``factor`` cells, for each cell."""
        best = self.values
        for axis in (0, 1) if factor > 1 else ():
            lead = [(0, 0), (0, 0)]
            lead[axis] = (0, factor)
            padded = np.pad(best, lead)
            best = padded[:best.shape[0], :best.shape[1]].copy()
            for step in range(1, factor):
                begin = [0, 0]
                begin[axis] = step
                np.maximum(best, padded[begin[0]:begin[0] + best.shape[0],
                                        begin[1]:begin[1] + best.shape[1]], out=best)
        return best

    def cells_of(self, points: Floats) -> Cells:
        """Return the cells of points, column and row, which may lie outside."""
        cells: Cells = np.floor((points - self.low) / self.cell_m).astype(np.int64)
        return cells


def _summed(windows: Any, phase: Cells, row: Cells, column: Cells) -> Likelihoods:
    """Add up the windows that begin at cells, from one side's width outside on."""
    count, points = row.shape
    side = windows.shape[-1]
    row = np.clip(row + side, 0, windows.shape[1] - 1)
    column = np.clip(column + side, 0, windows.shape[2] - 1)
    sums = np.empty((count, side, side), np.float32)
    some = max(1, _AT_ONCE // (points * side * side))
    for begin in range(0, count, some):
        part = slice(begin, begin + some)
        sums[part] = windows[phase[part], row[part], column[part]].sum(1)
    return sums
