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
Frontiers: places where known free ground borders on unknown, and their distances.

B. Yamauchi, A frontier-based approach for autonomous exploration, 1997. A frontier is free ground
next to unknown; it counts if the robot, with its width, can come near enough to look past it.
"""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.features.mapping.slam.ground import Cell
from rt_robot_os.features.mapping.slam.ground import Mask
from rt_robot_os.features.mapping.slam.ground import Place
from rt_robot_os.features.mapping.slam.ground import ReachableGround
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.grid_map import UNKNOWN

Cells = npt.NDArray[np.intp]

#: Frontiers this far beyond the reachable ground are observed from its edge.
_BESIDE_M: Final = 0.3
#: Preferred distance to unknown ground and walls beyond the radius; each missing cell costs as
#: many cells of distance.
_ROOM_M: Final = 0.1
_NARROW: Final = 3.0
#: Frontiers that are described at most, the largest: a noisy map has thousands.
_MOST: Final = 200
_AROUND: Final = np.ones((3, 3), np.bool_)


@dataclass(frozen=True)
class Frontier:
    """
    Free ground next to unknown.

    :ivar x: of its middle in m, as y; by these it is identified later.
    :ivar stand: x, y in m of the nearest place at which the robot can stand.
    :ivar size_m: its extent.
    :ivar way_m: length of the path to that place.
    :ivar cell: the cell of that place, for :meth:`Horizon.ways_between`.
    """

    x: float
    y: float
    stand: Place
    size_m: float
    way_m: float
    cell: Cell


@dataclass(frozen=True)
class Horizon:
    """
    The frontiers of a map.

    :ivar frontiers: the reachable ones, the nearest first.
    :ivar out_of_reach: number of unreachable ones.
    :ivar ground: the reachable ground; None when the robot does not stand on known ground, so
        that the rest is not determined.
    """

    frontiers: tuple[Frontier, ...]
    out_of_reach: int
    ground: ReachableGround | None

    def ways_between(self, frontiers: list[Frontier]) -> Floats:
        """Return the lengths of the paths between them in m; shape (frontiers, frontiers)."""
        if self.ground is None:
            raise ValueError('the robot does not stand on known ground')
        return self.ground.ways_between([each.cell for each in frontiers])


def frontiers_of(grid: GridMap, place: Place, radius_m: float, least_m: float) -> Horizon:
    """
    Find the frontiers of a map.

    :param place: x, y of the robot in m.
    :param radius_m: that must be free round the robot, as ``planner`` has it: with its clearance.
    :param least_m: extent of the smallest one that counts.
    """
    from scipy import ndimage  # of the extra slam
    reach = math.ceil((radius_m + _BESIDE_M) / grid.resolution_m)
    cut = _known_part(grid, reach + math.ceil((radius_m + _ROOM_M) / grid.resolution_m))
    free = (cut.cells >= 0) & (cut.cells < 50)
    beside = free & ndimage.binary_dilation(cut.unknown_mask())
    names, count = ndimage.label(beside, _AROUND)
    large = _large(names, count, least_m / cut.resolution_m)
    try:
        ground = ReachableGround(cut, place, radius_m)
    except ValueError:
        return Horizon((), int(large.sum()), None)
    near = ndimage.binary_dilation(ground.standing, _AROUND, iterations=reach, mask=free)
    # What is near enough to be observed may be part of a larger frontier.
    names, count = ndimage.label(near & large[names], _AROUND)
    seen = np.flatnonzero(_large(names, count, least_m / cut.resolution_m))
    boxes = ndimage.find_objects(names)
    found = []
    for name in sorted(seen.tolist(), key=lambda each: -_extent(*boxes[each - 1]))[:_MOST]:
        rows, columns = boxes[name - 1]
        inner = np.argwhere(names[rows, columns] == name) + (rows.start, columns.start)
        found.append(_frontier(cut, inner, ground, reach, radius_m))
    found.sort(key=lambda each: each.way_m)
    return Horizon(tuple(found), max(0, int(large.sum()) - len(found)), ground)


def _known_part(grid: GridMap, margin: int) -> GridMap:
    """Return the known part of a map, with a margin of unknown cells."""
    rows, columns = (np.flatnonzero((grid.cells >= 0).any(axis)) for axis in (1, 0))
    low, high = (0, 0), (1, 1)
    if len(rows):
        low, high = (int(rows[0]), int(columns[0])), (int(rows[-1]) + 1, int(columns[-1]) + 1)
    cells = np.pad(grid.cells[low[0]:high[0], low[1]:high[1]], margin, constant_values=UNKNOWN)
    x, y = grid.point((low[1] - margin) * grid.resolution_m, (low[0] - margin) * grid.resolution_m)
    return GridMap(cells, grid.resolution_m, (x, y, grid.origin[2]))


def _large(names: npt.NDArray[np.int32], count: int, least_cells: float) -> Mask:
    """Return by label which clusters are large enough; label 0 is the background."""
    from scipy import ndimage
    large = np.zeros(count + 1, np.bool_)
    for name, (rows, columns) in enumerate(ndimage.find_objects(names), 1):
        large[name] = _extent(rows, columns) >= least_cells
    return large


def _extent(rows: slice, columns: slice) -> float:
    return math.hypot(rows.stop - rows.start, columns.stop - columns.start)


def _frontier(grid: GridMap, cells: Cells, ground: ReachableGround, reach: int, radius_m: float
              ) -> Frontier:
    """Describe a cluster by its middle cell, and a place for the robot near it."""
    middle = cells[np.argmin(np.hypot(*(cells - cells.mean(0)).T))]
    extent = cells.max(0) - cells.min(0) + 1
    cell = _stand(grid, middle, ground.standing, reach,
                  (radius_m + _ROOM_M) / grid.resolution_m)
    x, y = grid.centre(int(middle[0]), int(middle[1]))
    return Frontier(x, y, grid.centre(*cell), float(np.hypot(*extent)) * grid.resolution_m,
                    ground.way_m(cell), cell)


def _stand(grid: GridMap, middle: Cells, standing: Mask, reach: int, room: float) -> Cell:
    """
    Return a cell near the middle of a frontier with free ground all round the robot.

    On ground that is not completely seen the robot could get stuck.
    """
    from scipy import ndimage
    side = reach + math.ceil(room)  # the map has a margin of that
    around = grid.cells[middle[0] - side:middle[0] + side + 1,
                        middle[1] - side:middle[1] + side + 1]
    away = ndimage.distance_transform_edt((around >= 0) & (around < 50))
    # The dilation came to the middle from some cell of this square.
    low = middle - reach
    cells = np.argwhere(standing[low[0]:low[0] + 2 * reach + 1, low[1]:low[1] + 2 * reach + 1])
    seen = away[cells[:, 0] + side - reach, cells[:, 1] + side - reach]
    apart = np.hypot(cells[:, 0] - reach, cells[:, 1] - reach)
    best = cells[np.argmin(apart + _NARROW * np.maximum(room - seen, 0.0))] + low
    return int(best[0]), int(best[1])
