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
TOS_Msg, the active message of TinyOS 1.x on the serial line, for two families of motes.

Little-endian: a header with the length, then the payload. Metadata of the radio, such as the LQI,
is not sent on the line.
"""

from __future__ import annotations

from struct import Struct
from typing import Final
from typing import NamedTuple

TELOS: Final = 'telos'
MICA: Final = 'mica'
#: Motes with the radio CC2420 (telos, telosb, tmote, micaz), and mica, mica2, mica2dot.
PLATFORMS: Final = (TELOS, MICA)

GROUP: Final = 0x7D
#: Default capacity of motes for payload, in bytes.
TELOS_MOST_DATA: Final = 28
MICA_MOST_DATA: Final = 29

TELOS_HEADER: Final = Struct('<BHBHHBB')
MICA_HEADER: Final = Struct('<HBBB')
#: The frame control field in the order of these bytes: data, without and with a request for an
#: acknowledgement; 16-bit addresses, no source address.
FCF_DATA: Final = 0x0801
FCF_DATA_ACK: Final = 0x0821
_PAN: Final = 0xFFFF


class TelosMsg(NamedTuple):
    """
    TOS_Msg of motes with the radio CC2420: 10 bytes of header.

    :ivar destination: 0xFFFF broadcast, 0x007E the serial line.
    :ivar payload: up to 28 bytes by default, an even number.
    :ivar dsn: sequence number of 802.15.4.
    :ivar fcf: frame control field; its first byte is named fcfhi.
    """

    destination: int
    am_type: int
    payload: bytes
    group: int = GROUP
    dsn: int = 0
    fcf: int = FCF_DATA
    pan: int = _PAN

    def pack(self) -> bytes:
        """Return the bytes."""
        return TELOS_HEADER.pack(len(self.payload), self.fcf, self.dsn, self.pan,
                                 self.destination, self.am_type, self.group) + self.payload

    @classmethod
    def unpack(cls, data: bytes) -> TelosMsg:
        """
        Parse a message.

        :raises ValueError: it is too short, or of a wrong length.
        """
        size = TELOS_HEADER.size
        _check(data, size, data[0] if data else 0, 'TelosMsg')
        _, fcf, dsn, pan, destination, am_type, group = TELOS_HEADER.unpack_from(data)
        return cls(destination, am_type, data[size:], group, dsn, fcf, pan)


class MicaMsg(NamedTuple):
    """
    TOS_Msg of mica, mica2 and mica2dot ("avrmote"): 5 bytes of header.

    :ivar destination: 0xFFFF broadcast, 0x007E the serial line.
    :ivar payload: up to 29 bytes by default.
    """

    destination: int
    am_type: int
    payload: bytes
    group: int = GROUP

    def pack(self) -> bytes:
        """Return the bytes."""
        return MICA_HEADER.pack(
            self.destination, self.am_type, self.group, len(self.payload)) + self.payload

    @classmethod
    def unpack(cls, data: bytes) -> MicaMsg:
        """
        Parse a message.

        :raises ValueError: it is too short, or of a wrong length.
        """
        size = MICA_HEADER.size
        _check(data, size, data[4] if len(data) > 4 else 0, 'MicaMsg')
        destination, am_type, group, _ = MICA_HEADER.unpack_from(data)
        return cls(destination, am_type, data[size:], group)


def is_telos(data: bytes) -> bool:
    """Return whether a packet looks like one of a mote with the radio CC2420."""
    return (len(data) >= TELOS_HEADER.size and len(data) == data[0] + TELOS_HEADER.size
            and data[4:6] == b'\xff\xff')


def is_mica(data: bytes) -> bool:
    """Return whether the length of a packet is that of mica."""
    return len(data) >= MICA_HEADER.size and len(data) == data[4] + MICA_HEADER.size


def platform_of(data: bytes) -> str:
    """Return the probable family of motes of a packet; empty when neither fits."""
    if is_telos(data):
        return TELOS
    return MICA if is_mica(data) else ''


def _check(data: bytes, size: int, length: int, name: str) -> None:
    if len(data) < size:
        raise ValueError(f'too short: {len(data)} bytes, the header of {name} has {size}')
    if len(data) != size + length:
        raise ValueError(f'its length byte is {length}, but the payload has {len(data) - size} '
                         'bytes')
