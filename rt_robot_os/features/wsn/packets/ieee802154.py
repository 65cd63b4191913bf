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
Frames of IEEE 802.15.4 of TinyOS: from the length byte to the frame check sequence.

TinyOS 1.x has no source address; TinyOS 2.x has one, and a network byte. Addresses are
little-endian in both; the byte order of the payload is that of the generation.
"""

from __future__ import annotations

from binascii import crc_hqx
from struct import Struct
from typing import Final
from typing import NamedTuple

from rt_robot_os.features.wsn.packets.tos_msg import FCF_DATA
from rt_robot_os.features.wsn.packets.tos_msg import GROUP

#: Frame control fields.
FCF_ACK: Final = 0x0002
FCF_T2_DATA: Final = 0x8841
FCF_T2_DATA_ACK: Final = 0x8861
#: The bit of a frame control field that requests an acknowledgement.
ACK_REQUEST: Final = 0x0020
#: The network byte of TinyOS' active messages.
NETWORK: Final = 0x3F
#: The PAN of TinyOS 2.x unless it was built with another.
PAN_T2: Final = 0x0022
LONGEST: Final = 127
_PAN_T1: Final = 0xFFFF
_KIND_MASK: Final = 0x0007
_KIND_DATA: Final = 1
# Format of both addresses, and PAN compression.
_ADDRESSES: Final = 0xCC40
_FCS_SIZE: Final = 2

_T1: Final = Struct('<BHBHHBB')
_T2: Final = Struct('<BHBHHHBB')
_ACK: Final = Struct('<BHB')
# By the address bits of the frame control field.
_LAYOUTS: Final = {FCF_DATA & _ADDRESSES: _T1, FCF_T2_DATA & _ADDRESSES: _T2}
# Bytes with reversed bits.
_MIRRORED: Final = bytes(int(f'{value:08b}'[::-1], 2) for value in range(256))


def fcs(data: bytes) -> bytes:
    """
    Return the frame check sequence, two bytes in the order on the air.

    It is the CRC-16 of the serial line with all bits reversed.
    """
    crc = crc_hqx(data.translate(_MIRRORED), 0)
    return bytes((_MIRRORED[crc >> 8], _MIRRORED[crc & 0xFF]))


class T1Frame(NamedTuple):
    """
    A data frame of TinyOS 1.x, without a source address.

    :ivar payload: of the active message.
    """

    destination: int
    am_type: int
    payload: bytes
    group: int = GROUP
    dsn: int = 0
    fcf: int = FCF_DATA
    pan: int = _PAN_T1

    def pack(self) -> bytes:
        """
        Return the bytes, from the length byte to the frame check sequence.

        :raises ValueError: it is too long for a frame.
        """
        return _whole(_T1.pack(0, self.fcf, self.dsn, self.pan, self.destination, self.am_type,
                               self.group) + self.payload)


class T2Frame(NamedTuple):
    """
    A data frame of TinyOS 2.x.

    :ivar payload: of the active message.
    """

    destination: int
    source: int
    am_type: int
    payload: bytes
    dsn: int = 0
    fcf: int = FCF_T2_DATA
    pan: int = PAN_T2
    network: int = NETWORK

    def pack(self) -> bytes:
        """
        Return the bytes, from the length byte to the frame check sequence.

        :raises ValueError: it is too long for a frame.
        """
        return _whole(_T2.pack(0, self.fcf, self.dsn, self.pan, self.destination, self.source,
                               self.network, self.am_type) + self.payload)


class AckFrame(NamedTuple):
    """
    An acknowledgement, of either generation.

    :ivar dsn: of the received frame.
    """

    dsn: int

    def pack(self) -> bytes:
        """Return the bytes, from the length byte to the frame check sequence."""
        return _whole(_ACK.pack(0, FCF_ACK, self.dsn))


AirFrame = T1Frame | T2Frame | AckFrame


def read_frame(data: bytes) -> AirFrame:
    """
    Parse a frame.

    :param data: from the length byte to the frame check sequence, which is not verified: some
        radios replace it, see :func:`check_sequence_fits`.
    :raises ValueError: it is truncated, has a wrong length, or is not a frame of TinyOS.
    """
    if len(data) < _ACK.size + _FCS_SIZE:
        raise ValueError(f'too short: {len(data)} bytes, a frame has {_ACK.size + _FCS_SIZE}')
    length, fcf, dsn = _ACK.unpack_from(data)
    if length != len(data) - 1:
        raise ValueError(f'its length byte is {length}, but {len(data) - 1} bytes follow')
    if fcf & _KIND_MASK == FCF_ACK:
        return AckFrame(dsn)
    if fcf & _KIND_MASK != _KIND_DATA:
        raise ValueError(f'its frame control field {fcf:#06x} is neither of data nor of an '
                         'acknowledgement')
    layout = _LAYOUTS.get(fcf & _ADDRESSES)
    if layout is None:
        raise ValueError(f'its frame control field {fcf:#06x} has an address format other than '
                         "TinyOS'")
    if len(data) < layout.size + _FCS_SIZE:
        raise ValueError(f'too short: {len(data)} bytes, a frame with data has '
                         f'{layout.size + _FCS_SIZE}')
    fields = layout.unpack_from(data)
    payload = data[layout.size:-_FCS_SIZE]
    if layout is _T1:
        _, fcf, dsn, pan, destination, am_type, group = fields
        return T1Frame(destination, am_type, payload, group, dsn, fcf, pan)
    _, fcf, dsn, pan, destination, source, network, am_type = fields
    if network != NETWORK:
        raise ValueError(f"its network byte is {network:#04x}, TinyOS' is {NETWORK:#04x}")
    return T2Frame(destination, source, am_type, payload, dsn, fcf, pan, network)


def check_sequence_fits(data: bytes) -> bool:
    """Return whether the frame check sequence of a frame on the air is correct."""
    return fcs(data[1:-_FCS_SIZE]) == data[-_FCS_SIZE:]


def _whole(data: bytes) -> bytes:
    """Set the length in the first byte, and append the frame check sequence."""
    body = data[1:] + fcs(data[1:])
    if len(body) > LONGEST:
        raise ValueError(f'a frame of {len(body)} bytes: at most {LONGEST} on the air')
    return bytes((len(body),)) + body
