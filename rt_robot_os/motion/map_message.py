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
Maps as messages, ``nav_msgs/msg/OccupancyGrid``: checked and copied in pieces.

The map may come from another, faulty program: everything is checked.
"""

from __future__ import annotations

from collections.abc import Generator
import math
from typing import Any
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.motion.angles import yaw_of
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.grid_map import OCCUPIED
from rt_robot_os.motion.grid_map import UNKNOWN

MOST_CELLS: Final = 4_000_000
# Cells checked and copied in one native call: some 10 us.
_PIECE: Final = 1 << 16
_FURTHEST_M: Final = 1e6
_SMALLEST_M, _LARGEST_M = 0.005, 10.0
# How far the rows of a map may be tilted, as a part of a quaternion.
_TILT: Final = 1e-3


def grid_of(message: Any) -> Generator[None, None, GridMap]:
    """
    Convert a message to a map; it yields after each bounded piece of work.

    :param message: a ``nav_msgs/msg/OccupancyGrid``; it may change afterwards.
    :raises ConfigError: it is not a valid map, or all cells are unknown; the text says why.
    """
    info, data = message.info, message.data
    rows, columns = int(info.height), int(info.width)
    given = len(data)
    if not rows or not columns:
        raise ConfigError([f'it is empty: {columns} x {rows} cells'])
    if rows * columns > MOST_CELLS:
        raise ConfigError([f'{columns} x {rows} cells are more than {MOST_CELLS}'])
    if given != rows * columns:
        raise ConfigError([f'it has {given} cells instead of {columns} x {rows}'])
    resolution_m, origin = _resolution(float(info.resolution)), _origin(info.origin)
    source = np.asarray(data, np.int8)
    cells: npt.NDArray[np.int8] = np.empty(given, np.int8)
    is_known = False
    for begin in range(0, given, _PIECE):
        piece = cells[begin:begin + _PIECE]
        piece[:] = source[begin:begin + _PIECE]
        least, most = int(piece.min()), int(piece.max())
        if least < UNKNOWN or most > OCCUPIED:
            wrong = least if least < UNKNOWN else most
            raise ConfigError([f'it has the value {wrong}: values are from {UNKNOWN} (unknown) to '
                               f'{OCCUPIED} (occupied)'])
        is_known |= most > UNKNOWN
        yield
    if not is_known:
        raise ConfigError([f'all its {columns} x {rows} cells are unknown ({UNKNOWN})'])
    return GridMap.owning(cells.reshape(rows, columns), resolution_m, origin)


def _resolution(given: float) -> float:
    # A message has 32 bits: the shortest number with the same 32 bits is meant.
    found = float(str(np.float32(given)))
    if not _SMALLEST_M <= found <= _LARGEST_M:
        raise ConfigError([f'its cells are {found:g} m wide: must be {_SMALLEST_M:g} to '
                           f'{_LARGEST_M:g} m'])
    return found


def _origin(given: Any) -> tuple[float, float, float]:
    x, y, _ = map(float, given.position)
    a, b, c, d = map(float, given.orientation)
    if not (abs(x) <= _FURTHEST_M and abs(y) <= _FURTHEST_M):
        raise ConfigError([f'its origin is at {x:g}, {y:g}'])
    if not any((a, b, c, d)):
        return x, y, 0.0  # not filled in: no rotation
    if not abs(math.hypot(a, b, c, d) - 1.0) < 0.1 or math.hypot(a, b) > _TILT:
        raise ConfigError([f'its origin is tilted, or not a rotation: {a:g}, {b:g}, {c:g}, {d:g}'])
    return x, y, yaw_of(a, b, c, d)
