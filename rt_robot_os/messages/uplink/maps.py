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
A map as a gateway sends it to a server, and a server to a page: cells, packed into a message.

Cells are those of ``nav_msgs/OccupancyGrid``: a byte each, row by row from the lower left, 0 free
to 100 occupied, 255 unknown. Walls and rooms pack well: a flat of 200 by 200 cells is 2 KB.
"""

from __future__ import annotations

import base64
import binascii
from collections.abc import Mapping
import hashlib
import json
import math
from typing import Any
from typing import Final
import zlib

from rt_robot_os.messages.uplink.messages import MESSAGE_BYTES

#: The largest map: 4000 by 4000 cells.
CELLS_MOST: Final = 16_000_000
#: The longest packed form: it has to fit into a message with the rest of it.
PACKED_MOST: Final = MESSAGE_BYTES - 4096
_LEVEL: Final = 9
_KEYS: Final = ('sha256', 'width', 'height', 'resolution_m', 'origin', 'cells')


def map_message(width: int, height: int, resolution_m: float,
                origin: tuple[float, float, float], cells: bytes) -> dict[str, Any]:
    """
    Make the content of a message ``map``.

    :param resolution_m: edge of a cell.
    :param origin: x and y in m of the outer corner of the lower left cell, and the yaw in rad of
        the rows.
    :param cells: ``width * height`` bytes; -1 of an ``int8`` is 255, unknown.
    :raises ValueError: it is no map, or too large for a message; the text says by how much.
    """
    packed = base64.b64encode(zlib.compress(cells, _LEVEL)).decode()
    content = {'sha256': _digest(width, height, resolution_m, origin, cells), 'width': width,
               'height': height, 'resolution_m': float(resolution_m),
               'origin': [float(each) for each in origin], 'cells': packed}
    return read_map(content)


def read_map(message: Mapping[str, Any]) -> dict[str, Any]:
    """
    Check a map that was received.

    :return: what a map has, and nothing else of the message.
    :raises ValueError: it is none.
    """
    width, height = (_whole(message, name) for name in ('width', 'height'))
    resolution_m = _number(message.get('resolution_m'), 'resolution_m')
    origin = message.get('origin')
    if width * height > CELLS_MOST:
        raise ValueError(f'a map of {width} by {height} cells; {CELLS_MOST} are the most')
    if not resolution_m > 0.0:
        raise ValueError(f'a map with cells of {resolution_m} m')
    if not isinstance(origin, (list, tuple)) or len(origin) != 3:
        raise ValueError('origin is no list of x, y and yaw')
    x, y, yaw = (_number(each, 'origin') for each in origin)
    cells = _unpacked(message.get('cells'), width * height)
    if message.get('sha256') != _digest(width, height, resolution_m, (x, y, yaw), cells):
        raise ValueError('the SHA-256 of the map is another')
    return {key: message[key] for key in _KEYS}


def _digest(width: int, height: int, resolution_m: float, origin: tuple[float, float, float],
            cells: bytes) -> str:
    head = json.dumps([width, height, float(resolution_m), [float(each) for each in origin]])
    return hashlib.sha256(head.encode() + b'\n' + cells).hexdigest()


def _unpacked(packed: object, size: int) -> bytes:
    if not isinstance(packed, str) or len(packed) > PACKED_MOST:
        raise ValueError(f'cells are no text of at most {PACKED_MOST} characters: a map with '
                         'larger cells is smaller')
    unpacker = zlib.decompressobj()
    try:
        cells = unpacker.decompress(base64.b64decode(packed, validate=True), size + 1)
    except (binascii.Error, zlib.error, ValueError) as error:
        raise ValueError(f'cells cannot be unpacked: {error}') from None
    if len(cells) != size:
        raise ValueError(f'{size} cells were to come')
    return cells


def _whole(message: Mapping[str, Any], name: str) -> int:
    value = message.get(name)
    if not isinstance(value, int) or isinstance(value, bool) or value < 1:
        raise ValueError(f'{name} is no whole number above 0')
    return value


def _number(value: object, name: str) -> float:
    if not isinstance(value, (int, float)) or isinstance(value, bool):
        raise ValueError(f'{name} is no number')
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ValueError(f'{name} is not finite')
    return number
