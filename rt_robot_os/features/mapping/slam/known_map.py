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
A saved map prepared for localisation: its surfaces, and the distances to them.

All is in the grid's own frame, whose first cell has its outer corner at 0, 0 and whose rows run
along x; :meth:`KnownMap.inside` and :meth:`KnownMap.outside` bring poses there and back.
"""

from __future__ import annotations

from collections.abc import Iterator
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.mapping.slam.transforms import between
from rt_robot_os.features.mapping.slam.transforms import composed
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.features.mapping.slam.transforms import rotation
from rt_robot_os.motion.grid_map import GridMap

Mask = npt.NDArray[np.bool_]
Bytes = npt.NDArray[np.uint8]
Indices = npt.NDArray[np.int64]

#: Cells are joined until they are about as large as this,
_CELL_M: Final = 0.05
#: and until there are no more than this.
_CELLS_MOST: Final = 20_000_000
#: Distances are stored in these steps, up to 255 of them.
STEP_M: Final = 0.0025
FAR_M: Final = 255 * STEP_M
_TILE: Final = 192


class KnownMap:
    """
    The surfaces of an immutable map.

    Its distances are computed in pieces: all by :meth:`build`, which takes 10 ms for a flat and
    seconds for a hall, or where the robot is by :meth:`measure_near`.

    :param grid: of any resolution; cells below 4 cm are joined.
    :ivar cell_m: edge of the cells that are used.
    :ivar free: shape (rows, columns): where a robot may be.
    :ivar surface: shape (rows, columns): what is occupied and borders on what is free.
    :ivar distances: shape (rows, columns): from the middle of each cell to the nearest surface,
        in steps of ``STEP_M``, at most 255 of them, and 255 where nothing was computed yet.
    :raises ConfigError: nothing in it is free, or nothing occupied.
    """

    def __init__(self, grid: GridMap) -> None:
        joined = max(1, round(_CELL_M / grid.resolution_m))
        while grid.cells.size > _CELLS_MOST * joined * joined:
            joined += 1
        self.origin = np.array(grid.origin)
        self.cell_m = grid.resolution_m * joined
        occupied = _joined(grid.cells >= 50, joined)
        self.free: Mask = _joined((grid.cells >= 0) & (grid.cells < 50), joined) & ~occupied
        self.surface: Mask = occupied & _grown(self.free)
        if not self.surface.any():
            missing = 'free' if not self.free.any() else 'occupied'
            raise ConfigError([f'{grid.path or "the map"}: nothing in it is {missing}, so that '
                               'localization cannot use it'])
        self.distances: Bytes = np.full(self.surface.shape, 255, np.uint8)
        rows, columns = self.surface.shape
        self._measured: Mask = np.zeros((-(-rows // _TILE), -(-columns // _TILE)), np.bool_)

    def inside(self, poses: Floats) -> Floats:
        """Return poses of the map's frame in the grid's own."""
        return between(np.broadcast_to(self.origin, poses.shape), poses)

    def outside(self, poses: Floats) -> Floats:
        """Return poses of the grid's own frame in the map's."""
        return composed(np.broadcast_to(self.origin, poses.shape), poses)

    def turned(self, covariance: Floats, inward: bool = False) -> Floats:
        """Return a covariance along the other frame's axes."""
        turn = np.eye(3)
        turn[:2, :2] = rotation(-self.origin[2] if inward else self.origin[2])
        return turn @ covariance @ turn.T

    def build(self) -> Iterator[None]:
        """Compute all distances; each step takes some milliseconds."""
        for tile in self._tiles(0, 0, *self.surface.shape):
            if self._measure(tile):
                yield

    def measure_near(self, middle: Floats, reach_m: float) -> None:
        """
        Compute the distances that are missing around a point, for :meth:`away`.

        :param middle: shape (2,) or more, in the grid's own frame.
        :param reach_m: to each side.
        """
        left, low = np.floor((middle[:2] - reach_m) / self.cell_m).astype(np.int64).tolist()
        right, high = np.ceil((middle[:2] + reach_m) / self.cell_m).astype(np.int64).tolist()
        for tile in self._tiles(low, left, high, right):
            self._measure(tile)

    def _tiles(self, low: int, left: int, high: int, right: int) -> list[tuple[int, int]]:
        """Return the tiles of some rows and columns that are not computed yet."""
        first_up, first_across = max(0, low // _TILE), max(0, left // _TILE)
        part = self._measured[first_up:max(0, -(-high // _TILE)),
                              first_across:max(0, -(-right // _TILE))]
        return [(up + first_up, across + first_across)
                for up, across in np.argwhere(~part).tolist()]

    def _measure(self, tile: tuple[int, int]) -> bool:
        """Compute the distances in a tile; return whether that took any time."""
        from scipy.ndimage import distance_transform_edt
        if self._measured[tile]:
            return False
        self._measured[tile] = True
        low, left = tile[0] * _TILE, tile[1] * _TILE
        margin = math.ceil(FAR_M / self.cell_m) + 1
        bottom, start = max(0, low - margin), max(0, left - margin)
        part = self.surface[bottom:low + _TILE + margin, start:left + _TILE + margin]
        if not part.any():
            return False
        away = distance_transform_edt(~part) * (self.cell_m / STEP_M)
        away = away[low - bottom:, left - start:][:_TILE, :_TILE]
        self.distances[low:low + _TILE, left:left + _TILE] = np.minimum(away, 255.0)
        return True

    def cells_at(self, x: Floats, y: Floats) -> tuple[Indices, Mask]:
        """Return the flat indices of the cells at points, and which are on the map."""
        rows, columns = self.surface.shape
        across = np.floor(x * (1.0 / self.cell_m)).astype(np.int64)
        up = np.floor(y * (1.0 / self.cell_m)).astype(np.int64)
        inside = (across >= 0) & (across < columns) & (up >= 0) & (up < rows)
        return np.where(inside, up * columns + across, 0), inside

    def away(self, x: Floats, y: Floats) -> Floats:
        """Return how far the nearest surface is from points, in m, at most ``FAR_M``."""
        at, inside = self.cells_at(x, y)
        found: Floats = np.where(inside, self.distances.reshape(-1)[at], 255) * STEP_M
        return found

    def cast(self, x: Floats, y: Floats, angles: Floats, most_m: float) -> Floats:
        """
        Return how far the first surface is along rays, ``most_m`` where there is none.

        :param x: of any shape, as y and angles.
        """
        dx, dy = np.cos(angles), np.sin(angles)
        reach = np.full(angles.shape, 0.5 * self.cell_m)
        touched = 0.6 * self.cell_m
        going = np.arange(angles.size)
        fx, fy, fdx, fdy = (np.broadcast_to(each, angles.shape).reshape(-1)
                            for each in (x, y, dx, dy))
        flat = reach.reshape(-1)
        for _ in range(int(most_m / (0.5 * self.cell_m))):
            if not len(going):
                break
            at = flat[going]
            near = self.away(fx[going] + at * fdx[going], fy[going] + at * fdy[going])
            on = near > touched
            going = going[on]
            # Distances are from the middle of a cell: a point may be nearer by half its diagonal.
            flat[going] += np.maximum(near[on] - 0.75 * self.cell_m, 0.5 * self.cell_m)
            going = going[flat[going] < most_m]
        found: Floats = np.minimum(flat, most_m).reshape(angles.shape)
        return found


def _joined(mask: Mask, count: int) -> Mask:
    """Return whether any of count x count cells is."""
    if count == 1:
        return mask
    rows, columns = mask.shape
    padded = np.pad(mask, ((0, -rows % count), (0, -columns % count)))
    across = padded[:, ::count].copy()
    for at in range(1, count):
        across |= padded[:, at::count]
    found = across[::count].copy()
    for at in range(1, count):
        found |= across[at::count]
    return found


def _grown(mask: Mask) -> Mask:
    """Return cells that are, or of whose eight neighbours one is."""
    rows, columns = mask.shape
    padded = np.pad(mask, 1)
    wide = padded[:, :columns] | padded[:, 1:columns + 1] | padded[:, 2:]
    return wide[:rows] | wide[1:rows + 1] | wide[2:]
