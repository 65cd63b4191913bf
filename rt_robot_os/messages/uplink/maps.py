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
from dataclasses import dataclass
import hashlib
import json
from typing import Any
from typing import ClassVar
from typing import Final
import zlib

from rt_robot_os.messages.uplink.fields import count_in
from rt_robot_os.messages.uplink.fields import number_in
from rt_robot_os.messages.uplink.fields import wrong
from rt_robot_os.messages.uplink.messages import MESSAGE_BYTES
from rt_robot_os.messages.uplink.messages import UplinkMessage

#: The largest map: 4000 by 4000 cells.
CELLS_MOST: Final = 16_000_000
#: The longest packed form: it has to fit into a message with the rest of it.
PACKED_MOST: Final = MESSAGE_BYTES - 4096
_LEVEL: Final = 9


@dataclass(frozen=True)
class MapMessage(UplinkMessage):
    """
    A map.

    :ivar sha256: of its size, its place and its cells.
    :ivar resolution_m: edge of a cell.
    :ivar origin: x and y in m of the outer corner of the lower left cell, and the yaw in rad of
        the rows.
    :ivar cells: packed: zlib, then Base64.
    """

    KIND: ClassVar[str] = 'map'

    sha256: str
    width: int
    height: int
    resolution_m: float
    origin: tuple[float, float, float]
    cells: str

    def content(self) -> dict[str, Any]:
        """Return the fields on the wire, on the server's disk and for a page."""
        return {'sha256': self.sha256, 'width': self.width, 'height': self.height,
                'resolution_m': self.resolution_m, 'origin': list(self.origin),
                'cells': self.cells}

    @classmethod
    def pack(cls, width: int, height: int, resolution_m: float,
             origin: tuple[float, float, float], cells: bytes) -> MapMessage:
        """
        Make a map of cells.

        :param cells: ``width * height`` bytes; -1 of an ``int8`` is 255, unknown.
        :raises ValueError: it is malformed, or too large for a message; the text says by how much.
        """
        packed = base64.b64encode(zlib.compress(cells, _LEVEL)).decode()
        x, y, yaw = (float(each) for each in origin)
        digest = _digest(width, height, resolution_m, (x, y, yaw), cells)
        return cls.from_json(cls(digest, width, height, float(resolution_m), (x, y, yaw),
                                 packed).content())

    @classmethod
    def from_json(cls, message: Mapping[str, Any]) -> MapMessage:
        """
        Read a map; its cells are unpacked for a check, and stay packed.

        :raises ValueError: it is malformed.
        """
        width, height = (count_in(message, name) for name in ('width', 'height'))
        if not width or not height:
            raise ValueError(f'a map of {width} by {height} cells')
        resolution_m = number_in(message, 'resolution_m')
        origin = message.get('origin')
        if width * height > CELLS_MOST:
            raise ValueError(f'a map of {width} by {height} cells; {CELLS_MOST} are the most')
        if not resolution_m > 0.0:
            raise ValueError(f'a map with cells of {resolution_m} m')
        if not isinstance(origin, (list, tuple)) or len(origin) != 3:
            raise wrong('origin', origin, 'a list of x, y and yaw')
        x, y, yaw = (number_in({'origin': each}, 'origin') for each in origin)
        packed = message.get('cells')
        cells = _unpacked(packed, width * height)
        sha256 = message.get('sha256')
        if sha256 != _digest(width, height, resolution_m, (x, y, yaw), cells):
            raise ValueError('the SHA-256 of the map is another')
        return cls(str(sha256), width, height, resolution_m, (x, y, yaw), str(packed))


def _digest(width: int, height: int, resolution_m: float, origin: tuple[float, float, float],
            cells: bytes) -> str:
    head = json.dumps([width, height, float(resolution_m), [float(each) for each in origin]])
    return hashlib.sha256(head.encode() + b'\n' + cells).hexdigest()


def _unpacked(packed: object, size: int) -> bytes:
    if not isinstance(packed, str) or len(packed) > PACKED_MOST:
        raise ValueError(f'cells must be a string of at most {PACKED_MOST} characters: a map with '
                         'larger cells is smaller')
    unpacker = zlib.decompressobj()
    try:
        cells = unpacker.decompress(base64.b64decode(packed, validate=True), size + 1)
    except (binascii.Error, zlib.error, ValueError) as error:
        raise ValueError(f'cells cannot be unpacked: {error}') from None
    if len(cells) != size:
        raise ValueError(f'the map has {len(cells)} cells instead of {size}')
    return cells
