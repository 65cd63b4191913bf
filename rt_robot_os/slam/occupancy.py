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
A grid map of keyframes: what beams ended on, what they went through, what nobody has seen.

Log-odds as in S. Thrun, W. Burgard and D. Fox, Probabilistic Robotics, 2005, chapter 9.
"""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.motion.grid_map import FREE
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.grid_map import OCCUPIED
from rt_robot_os.motion.grid_map import UNKNOWN
from rt_robot_os.slam.keyframes import Keyframe
from rt_robot_os.slam.transforms import Floats
from rt_robot_os.slam.transforms import placed

_HIT: Final = 0.85
_MISS: Final = -0.4
_MOST: Final = 5.0
#: Log-odds from which a cell is called a wall, and below which it is called free.
_WALL: Final = 0.5
_CLEAR: Final = -0.3
_MARGIN_M: Final = 0.5
#: Of a side; a larger map gets larger cells.
_CELLS_MOST: Final = 8192


def grid_of(keyframes: Sequence[Keyframe], cell_m: float = 0.05) -> GridMap:
    """
    Return the map of keyframes as they stand now.

    :param keyframes: at least one.
    :param cell_m: edge of a cell.
    """
    ends = [placed(each.pose, each.surface.points) for each in keyframes]
    origins = np.array([each.pose[:2] for each in keyframes])
    everything = np.concatenate([origins, *ends])
    low, high = everything.min(0) - _MARGIN_M, everything.max(0) + _MARGIN_M
    cell_m = max(cell_m, float((high - low).max()) / _CELLS_MOST)
    columns, rows = (math.ceil(each / cell_m) + 1 for each in high - low)
    odds = np.zeros((rows, columns), np.float32)
    for origin, points in zip(origins, ends):
        _add(odds, (origin - low) / cell_m, (points - low) / cell_m)
    cells = np.full(odds.shape, UNKNOWN, np.int8)
    cells[odds < _CLEAR] = FREE
    cells[odds > _WALL] = OCCUPIED
    return GridMap(cells, cell_m, (float(low[0]), float(low[1]), 0.0))


def _add(odds: npt.NDArray[np.float32], origin: Floats, ends: Floats) -> None:
    """Add a scan: each cell once, and where a beam ended counts more than who passed."""
    if not len(ends):
        return
    columns = odds.shape[1]
    hits = np.unique(ends.astype(np.int64) @ (1, columns))
    passed = np.setdiff1d(_passed(origin, ends, columns), hits, assume_unique=True)
    flat = odds.reshape(-1)
    flat[hits] = np.minimum(flat[hits] + _HIT, _MOST)
    flat[passed] = np.maximum(flat[passed] + _MISS, -_MOST)


def _passed(origin: Floats, ends: Floats, columns: int) -> npt.NDArray[np.int64]:
    """Return the cells on the way to each end, by steps of half a cell at most."""
    reach = ends - origin
    steps = int(np.ceil(np.abs(reach).max() * 2)) + 1
    part = np.arange(steps) / steps
    # Half a cell before the end the wall may begin.
    length = np.hypot(reach[:, 0], reach[:, 1])
    within = part[None, :] * length[:, None] < length[:, None] - 0.5
    x = (origin[0] + part[None, :] * reach[:, 0, None]).astype(np.int64)
    y = (origin[1] + part[None, :] * reach[:, 1, None]).astype(np.int64)
    cells: npt.NDArray[np.int64] = np.unique((y * columns + x)[within])
    return cells
