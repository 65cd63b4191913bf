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
A grid map that follows a graph of keyframes, in bounded pieces of work.

Each keyframe has a footprint: the evidence of its beams for the cells round it. The map is their
sum. The footprint of a keyframe that moved is subtracted at its old pose and added at the new one.
The sum is stored in tiles, so that it grows in all directions without being copied.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
import itertools
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.features.mapping.slam.evidence import cells_of
from rt_robot_os.features.mapping.slam.evidence import Counts
from rt_robot_os.features.mapping.slam.evidence import WEIGHTS
from rt_robot_os.features.mapping.slam.keyframes import Keyframe
from rt_robot_os.features.mapping.slam.rays import Box
from rt_robot_os.features.mapping.slam.rays import footprint_of
from rt_robot_os.features.mapping.slam.rays import PackedScanFootprint
from rt_robot_os.features.mapping.slam.rays import ScanFootprint
from rt_robot_os.features.mapping.slam.scan import Surface
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.grid_map import UNKNOWN

#: Edge of a tile in cells.
_TILE: Final = 128
#: The edges of the map are at multiples of this many cells: it does not grow with every scan.
_EDGE: Final = 20
#: Margin of unknown cells, at least.
_MARGIN: Final = 4
#: A keyframe is redrawn after this movement, in cells, at half the maximum range.
_MOVED_CELLS: Final = 0.5
#: Poses further away are rejected.
_FARTHEST_M: Final = 1e5
#: Work of an update in cells of some 10 ns.
WORK_MOST: Final = 500_000
#: Work beyond the cells of a rectangle: to add or remove a scan, and to read a cell again.
_WORK_A_SCAN: Final = 15_000
_WORK_A_READING: Final = 3
CELLS_MOST: Final = 4_000_000
#: Cells are refined again when the map then needs at most this part of the limit.
_REFINED_SHARE: Final = 4 * 2


Key = tuple[int, int]


@dataclass
class _Tile:
    counts: Counts
    cells: npt.NDArray[np.int8]


@dataclass
class _Drawn:
    """
    A drawn keyframe.

    :ivar surface: referenced, so that its identity is not reused.
    :ivar given: the pose that was checked last, the same or one nearby.
    """

    surface: Surface
    pose: tuple[float, float, float]
    half_reach_m: float
    footprint: PackedScanFootprint
    given: Floats

    def moved_by(self, pose: Floats) -> float:
        """Return the movement of a point at half the maximum range, in m."""
        x, y, yaw = pose.tolist()
        return math.hypot(x - self.pose[0], y - self.pose[1]) + self.half_reach_m * abs(
            math.remainder(yaw - self.pose[2], math.tau))


class GrowingGrid:
    """
    A grid map of keyframes that are added, moved and removed.

    Readers always get a map in which all keyframes have their poses of one time.

    :param cell_m: edge of a cell.
    :param cells_most: of the whole rectangle; the cells of a larger map are
        doubled in size until it fits.
    :param reach_m: beams are drawn until there.
    :param echoless_m: length of free space along a beam without an echo, where there is no other
        evidence. Glass and black surfaces give no echo, either.
    :ivar cell_m: present edge of a cell.
    :ivar version: increases when :meth:`grid` returns another map; 0 before the first.
    :ivar counts: ``drawn`` and ``taken_away`` (footprints, in all), ``waiting`` (to be drawn or
        removed), ``keyframes`` and ``footprint_bytes`` (of the map now), ``tiles``,
        ``resized`` (how often cells got another size), and ``refused`` (keyframes with an
        invalid pose, which are not drawn).
    :raises ValueError: a length is invalid.
    """

    def __init__(self, cell_m: float = 0.05, *, cells_most: int = CELLS_MOST,
                 reach_m: float = 25.0, echoless_m: float = 3.0) -> None:
        if not (0.0 < cell_m < math.inf and cell_m < reach_m < math.inf and cells_most > 0
                and 0.0 <= echoless_m < math.inf):
            raise ValueError(f'cells of {cell_m} m, at most {cells_most}, drawn to {reach_m} m, '
                             f'without an echo to {echoless_m} m')
        self.cell_m = self._finest_m = cell_m
        self._cells_most, self._reach_m, self._echoless_m = cells_most, reach_m, echoless_m
        self.version = 0
        self.counts = dict.fromkeys(('drawn', 'taken_away', 'waiting', 'keyframes',
                                     'footprint_bytes', 'tiles', 'resized', 'refused'), 0)
        self._whole = GridMap(np.full((1, 1), UNKNOWN, np.int8), cell_m)
        self._forget()

    def _forget(self) -> None:
        self._tiles: dict[Key, _Tile] = {}
        self._changed: set[Key] = set()
        self._drawn: dict[int, _Drawn] = {}
        #: Pending work: a surface and its pose, or None to remove it.
        self._tasks: deque[tuple[Surface, Floats | None]] = deque()
        self._is_whole = True
        self._bounds: Box | None = None

    def grid(self) -> GridMap:
        """Return the last complete map; one unknown cell before the first."""
        return self._whole

    def update(self, keyframes: Sequence[Keyframe], most: int = WORK_MOST) -> bool:
        """
        Do a piece of work on the map.

        :param keyframes: all, with their present poses. They are identified by their surfaces; a
            moved one must get a new pose array.
        :param most: cells to process; the default takes some 5 ms.
        :return: whether the map is complete; call again if not.
        """
        left = most
        while True:
            if self._is_whole:
                self._begin(keyframes)
                if self._is_whole:
                    return True
            while self._tasks and left > 0:
                left -= self._draw(*self._tasks.popleft())
            while self._changed and left > 0:
                left -= self._read(self._changed.pop())
            self.counts['waiting'] = len(self._tasks)
            if self._tasks or self._changed:
                return False
            self._finish()

    # ---- drawing -----------------------------------------------------------------------------

    def _begin(self, keyframes: Sequence[Keyframe]) -> None:
        """Find what was added, moved and removed; readers see all of it together."""
        if self.cell_m > self._finest_m and (
                self._size(self._box_of_all()) * _REFINED_SHARE < self._cells_most):
            self._resize(0.5)
            return
        drawn = self._drawn
        there = [(each, drawn.get(id(each.surface))) for each in keyframes]
        if sum(before is not None for _, before in there) < len(drawn):
            kept = {id(each.surface) for each in keyframes}
            self._tasks.extend((before.surface, None) for key, before in drawn.items()
                               if key not in kept)
        asked = [(each, before) for each, before in there
                 if before is None or before.given is not each.pose]
        poses = np.array([each.pose for each, _ in asked]).reshape(-1, 3)
        usable = np.isfinite(poses).all(1) & (np.abs(poses[:, :2]).max(1) < _FARTHEST_M)
        self.counts['refused'] = len(asked) - int(usable.sum())
        for (each, before), pose in zip(itertools.compress(asked, usable), poses[usable]):
            if before is None or before.moved_by(pose) > _MOVED_CELLS * self.cell_m:
                self._tasks.append((each.surface, each.pose))
            else:
                before.given = each.pose
        self._is_whole = not self._tasks

    def _draw(self, surface: Surface, pose: Floats | None) -> int:
        """Remove a scan at its old pose, and add it at the new one; return the work."""
        work = 0
        before = self._drawn.pop(id(surface), None)
        if before is not None:
            work += self._add(before.footprint.unpacked(), -WEIGHTS)
            self.counts['taken_away'] += 1
            self.counts['footprint_bytes'] -= len(before.footprint.packed)
        if pose is not None:
            footprint = footprint_of(pose, surface, self.cell_m, self._reach_m, self._echoless_m)
            if not self._has_room(footprint.box):
                self._tasks.append((surface, pose))
                self._resize(2.0)
                return _WORK_A_SCAN
            work += self._add(footprint, WEIGHTS)
            packed = PackedScanFootprint.of(footprint)
            half = max(footprint.codes.shape) * self.cell_m / 4.0
            x, y, yaw = pose.tolist()
            self._drawn[id(surface)] = _Drawn(surface, (x, y, yaw), half, packed, pose)
            self.counts['drawn'] += 1
            self.counts['footprint_bytes'] += len(packed.packed)
        self.counts['keyframes'] = len(self._drawn)
        return work

    def _add(self, footprint: ScanFootprint, weights: Counts) -> int:
        rows, columns = footprint.codes.shape
        for tile_row in range(footprint.row // _TILE, (footprint.row + rows - 1) // _TILE + 1):
            first = tile_row * _TILE
            low, high = max(first, footprint.row), min(first + _TILE, footprint.row + rows)
            strip = footprint.codes[low - footprint.row:high - footprint.row]
            for tile_column in range(footprint.column // _TILE,
                                     (footprint.column + columns - 1) // _TILE + 1):
                start = tile_column * _TILE
                left = max(start, footprint.column)
                right = min(start + _TILE, footprint.column + columns)
                codes = strip[:, left - footprint.column:right - footprint.column]
                if codes.any():
                    counts = self._tile(tile_row, tile_column).counts
                    counts[low - first:high - first, left - start:right - start] += weights[codes]
        return int(footprint.codes.size) + _WORK_A_SCAN

    def _tile(self, row: int, column: int) -> _Tile:
        key = row, column
        self._changed.add(key)
        tile = self._tiles.get(key)
        if tile is None:
            tile = self._tiles[key] = _Tile(np.zeros((_TILE, _TILE), np.int64),
                                            np.full((_TILE, _TILE), UNKNOWN, np.int8))
        return tile

    def _read(self, key: Key) -> int:
        tile = self._tiles[key]
        if tile.counts.any():
            tile.cells = cells_of(tile.counts)
        else:
            del self._tiles[key]
        return _WORK_A_READING * _TILE * _TILE

    def _finish(self) -> None:
        """Combine the tiles to the map that readers get from now on."""
        self._is_whole = True
        self.version += 1
        self.counts['tiles'] = len(self._tiles)
        self._bounds = self._box_of_all()
        low_row, low_column, high_row, high_column = _outer(self._bounds)
        cells = np.full((high_row - low_row, high_column - low_column), UNKNOWN, np.int8)
        for (row, column), tile in self._tiles.items():
            first, start = row * _TILE - low_row, column * _TILE - low_column
            low, left = max(first, 0), max(start, 0)
            there = cells[low:max(first + _TILE, 0), left:max(start + _TILE, 0)]
            there[:] = tile.cells[low - first:, left - start:][:there.shape[0], :there.shape[1]]
        self._whole = GridMap(cells, self.cell_m, (round(low_column * self.cell_m, 9),
                                                   round(low_row * self.cell_m, 9), 0.0))

    # ---- size --------------------------------------------------------------------------------

    def _box_of_all(self) -> Box:
        """Return the cells of all footprints; those at the origin when there is none."""
        boxes = np.array([each.footprint.box for each in self._drawn.values()]).reshape(-1, 4)
        if not len(boxes):
            return 0, 0, 1, 1
        return (int(boxes[:, 0].min()), int(boxes[:, 1].min()), int(boxes[:, 2].max()),
                int(boxes[:, 3].max()))

    def _has_room(self, box: Box) -> bool:
        """Return whether the map is small enough with a new footprint, and include that."""
        together = box if self._bounds is None else _united(self._bounds, box)
        if self._size(together) > self._cells_most and self._drawn:
            together = _united(self._box_of_all(), box)  # without what was removed since
        self._bounds = together
        return self._size(together) <= self._cells_most

    def _size(self, box: Box) -> int:
        row, column, row_end, column_end = _outer(box)
        return (row_end - row) * (column_end - column)

    def _resize(self, factor: float) -> None:
        """Start again with another cell size; readers keep the old map until it is complete."""
        drawn = [(each.surface, each.given) for each in self._drawn.values()]
        rest = [(surface, pose) for surface, pose in self._tasks if pose is not None]
        redrawn = {id(surface) for surface, _ in self._tasks}
        self._forget()
        self._is_whole = False
        self.cell_m *= factor
        self._tasks.extend(each for each in drawn if id(each[0]) not in redrawn)
        self._tasks.extend(rest)
        self.counts['resized'] += 1
        self.counts['footprint_bytes'] = 0


def _outer(box: Box) -> Box:
    """Return the edges of the map for known cells: with a margin, and in large steps."""
    row, column, row_end, column_end = box
    return ((row - _MARGIN) // _EDGE * _EDGE, (column - _MARGIN) // _EDGE * _EDGE,
            -((-row_end - _MARGIN) // _EDGE) * _EDGE, -((-column_end - _MARGIN) // _EDGE) * _EDGE)


def _united(one: Box, other: Box) -> Box:
    return (min(one[0], other[0]), min(one[1], other[1]), max(one[2], other[2]),
            max(one[3], other[3]))
