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

import numpy as np
import numpy.typing as npt

from rt_robot_os.slam.transforms import Floats

Likelihoods = npt.NDArray[np.float32]
#: The hills end at so many standard deviations.
_REACH = 3.0
#: Around the points, in m, in which a match may put others.
_MARGIN_M = 1.0
#: Larger grids are made coarser: 4096 x 4096 cells are 64 MB.
_SIDE_MOST = 4096


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
        self._coarse: dict[int, Likelihoods] = {}
        self._raise_hills(points, sigma_m)

    def _raise_hills(self, points: Floats, sigma_m: float) -> None:
        # The margin is wider than any hill, so that all of them fit.
        cells = np.unique(((points - self.low) / self.cell_m).astype(np.int64), axis=0)
        reach = min(math.ceil(_REACH * sigma_m / self.cell_m), int(_MARGIN_M / self.cell_m) - 1)
        scale = self.cell_m ** 2 / (2.0 * sigma_m ** 2)
        for dy in range(-reach, reach + 1):
            for dx in range(-reach, reach + 1):
                value = np.float32(math.exp(-(dx * dx + dy * dy) * scale))
                at = (cells[:, 1] + dy, cells[:, 0] + dx)
                # No cell stands twice in the list, so that no maximum is lost.
                self.values[at] = np.maximum(self.values[at], value)

    def coarse(self, factor: int) -> Likelihoods:
        """
        Return the best value among the next ``factor`` x ``factor`` cells, for each cell.

        It bounds what any shift by less than that can give.
        """
        if factor not in self._coarse:
            rows, columns = self.values.shape
            padded = np.pad(self.values, ((0, factor), (0, factor)))
            across = padded[:, :columns].copy()
            for dx in range(1, factor):
                np.maximum(across, padded[:, dx:dx + columns], out=across)
            best = across[:rows].copy()
            for dy in range(1, factor):
                np.maximum(best, across[dy:dy + rows], out=best)
            self._coarse[factor] = best
        return self._coarse[factor]

    def cells_of(self, points: Floats) -> npt.NDArray[np.int64]:
        """Return the cells of points, column and row, which may lie outside."""
        cells: npt.NDArray[np.int64] = np.floor(
            (points - self.low) / self.cell_m).astype(np.int64)
        return cells
