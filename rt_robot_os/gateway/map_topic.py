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

"""Converts a growing map from ``nav_msgs/msg/OccupancyGrid`` to the message for the server."""

from __future__ import annotations

import struct
from types import SimpleNamespace
from typing import Any
from typing import Final

import numpy as np
import numpy.typing as npt
from rt_robot_os.messages.cdr import CdrReader
from rt_robot_os.messages.uplink.maps import MapMessage
from rt_robot_os.motion.grid_map import UNKNOWN
from rt_robot_os.motion.map_message import grid_of

MAP_MESSAGE: Final = 'nav_msgs/msg/OccupancyGrid'
#: Size limit, since it is sent repeatedly: an alarm behind it waits half a second at 1 Mbit/s.
PACKED_MOST: Final = 64 << 10

_INFO: Final = struct.Struct('<fII')


def grid_in(cdr: bytes) -> Any:
    """
    Read an ``OccupancyGrid`` as :func:`~rt_robot_os.motion.map_message.grid_of` takes it.

    :raises ValueError: the bytes are not such a message.
    """
    reader = CdrReader(cdr)
    reader.skip(4, 8)  # stamp
    reader.text()
    reader.skip(4, 8)  # map_load_time
    resolution_m, width, height = _INFO.unpack_from(cdr, reader.skip(4, _INFO.size))
    pose = reader.doubles(7)
    count = reader.count()
    data = np.frombuffer(cdr, np.int8, count, reader.skip(1, count))
    return SimpleNamespace(data=data, info=SimpleNamespace(
        resolution=resolution_m, width=width, height=height,
        origin=SimpleNamespace(position=pose[:3], orientation=pose[3:])))


def message_of(cdr: bytes, packed_most: int = PACKED_MOST) -> MapMessage:
    """
    Make the message of a map without its unknown margin, as coarse as necessary.

    :param cdr: a ``nav_msgs/msg/OccupancyGrid``.
    :param packed_most: most characters of its cells.
    :raises ConfigError: it is not a map, or all of its cells are unknown.
    :raises ValueError: the bytes are not such a message, or the map cannot be made small enough.
    """
    work = grid_of(grid_in(cdr))
    while True:
        try:
            next(work)
        except StopIteration as done:
            grid = done.value
            break
    cells, column, row = _cropped(grid.cells)
    size_m = grid.resolution_m
    origin = (*grid.point(column * size_m, row * size_m), grid.origin[2])
    while True:
        rows, columns = cells.shape
        message = MapMessage.pack(columns, rows, size_m, origin, cells.tobytes())
        if len(message.cells) <= packed_most:
            return message
        if min(cells.shape) < 2:
            raise ValueError(f'it takes {len(message.cells)} characters; {packed_most} are the '
                             'most')
        cells, size_m = _coarser(cells), 2.0 * size_m


def _cropped(cells: npt.NDArray[np.int8]) -> tuple[npt.NDArray[np.int8], int, int]:
    """Remove the unknown margin; return also the first column and row."""
    known = cells != UNKNOWN
    rows, columns = np.flatnonzero(known.any(1)), np.flatnonzero(known.any(0))
    return (cells[rows[0]:rows[-1] + 1, columns[0]:columns[-1] + 1], int(columns[0]),
            int(rows[0]))


def _coarser(cells: npt.NDArray[np.int8]) -> npt.NDArray[np.int8]:
    """Merge four cells into one: it is occupied if one of them is."""
    rows, columns = cells.shape
    even = np.pad(cells, ((0, rows % 2), (0, columns % 2)), constant_values=UNKNOWN)
    found: npt.NDArray[np.int8] = even.reshape(
        (rows + 1) // 2, 2, (columns + 1) // 2, 2).max((1, 3))
    return found
