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

"""The active message of TinyOS 2.x on the serial line: dispatch byte, header, payload."""

from __future__ import annotations

from struct import Struct
from typing import Final
from typing import NamedTuple

#: Dispatch bytes: an active message follows, or an unmodified frame of 802.15.4.
DISPATCH_AM: Final = 0
DISPATCH_802_15_4: Final = 2
HEADER: Final = Struct('>BHHBBB')
SIZE: Final = HEADER.size


class SerialAm(NamedTuple):
    """
    An active message, big-endian.

    :ivar destination: a root mote sends 0xFFFF.
    :ivar source: a root mote sends 0.
    :ivar group: 0x00 or 0x22 by default.
    """

    destination: int
    source: int
    am_type: int
    payload: bytes
    group: int = 0

    def pack(self) -> bytes:
        """Return the bytes, the dispatch byte included."""
        return HEADER.pack(DISPATCH_AM, self.destination, self.source, len(self.payload),
                           self.group, self.am_type) + self.payload

    @classmethod
    def unpack(cls, data: bytes) -> SerialAm:
        """
        Parse a message.

        :raises ValueError: it is not an active message, too short, or of a wrong length.
        """
        if len(data) < SIZE:
            raise ValueError(f'too short: {len(data)} bytes, the header of SerialAm has {SIZE}')
        dispatch, destination, source, length, group, am_type = HEADER.unpack_from(data)
        if dispatch != DISPATCH_AM:
            raise ValueError(f'its dispatch byte is {dispatch:#04x}, not that of active messages')
        if len(data) != SIZE + length:
            raise ValueError(f'its length byte is {length}, but the payload has {len(data) - SIZE}'
                             ' bytes')
        return cls(destination, source, am_type, data[SIZE:], group)
