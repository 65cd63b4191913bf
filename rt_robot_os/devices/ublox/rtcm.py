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
RTCM 3, the correction messages of base stations and casters for satellite receivers.

``D3``, six zero bits, ten bits of length, payload, CRC-24Q; the first twelve bits of the payload
are the number of the message.

Messages for simulated devices and tests are encoded here as well.
"""

from __future__ import annotations

from typing import Final
from typing import NamedTuple

from rt_robot_os.devices.framing import FrameDecoder


MAX_PAYLOAD: Final = 1023
_HEADER: Final = 3
_OVERHEAD: Final = 6
_EXPERIMENTAL: Final = 100
_POLYNOMIAL: Final = 0x1864CFB
# Number of bytes whose checksum is cheaper than a multiplication.
_SHORT: Final = 16


class RtcmFrame(NamedTuple):
    """
    One message with a valid checksum.

    :ivar number: of the message, such as 1005; 0 for one without content.
    :ivar data: the whole frame.
    :ivar end: index just after its last byte in the chunk that completed it.
    """

    number: int
    data: bytes
    end: int

    @property
    def size(self) -> int:
        """Return the bytes of the whole frame."""
        return len(self.data)


class RtcmDecoder(FrameDecoder[RtcmFrame]):
    """Find messages in a stream; keeps less than 1030 bytes."""

    STARTS = b'\xd3'
    PATTERN = rb'\xd3(?:[\x00-\x03]|\Z)'
    SHORTEST = _OVERHEAD
    LONGEST = _OVERHEAD + MAX_PAYLOAD

    def __init__(self) -> None:
        super().__init__()
        self._crc = PartialCrc()

    def end(self, buffer: bytes, at: int) -> int:
        """Return where a message ends, 0 if none begins here."""
        length = buffer[at + 1] << 8 | buffer[at + 2]
        # A false header delays the bytes behind it, for seconds on a slow link: most false headers
        # have a number that no message has.
        if length > MAX_PAYLOAD or (length and not self._is_number(_number(buffer, at), at)):
            return 0
        return at + _OVERHEAD + length

    def _is_number(self, number: int, at: int) -> bool:
        """
        Return whether a message with this number exists.

        RTCM 10403, DF002: from 1001 on those of the standard, from 4001 on those of makers. 1 to
        100 are experimental (63 is an ephemeris of BeiDou in use); noise looks like them too
        often, so they are accepted only directly behind another message.
        """
        return 1000 < number < 1400 or number > 4000 or (
            0 < number <= _EXPERIMENTAL and at == self._follows)

    def frame(self, buffer: bytes, at: int, end: int, arrived: int) -> RtcmFrame | None:
        """Decode a message with a valid checksum."""
        # The remainder of a message with its checksum behind it is 0.
        if self._crc.of(buffer, at, end):
            return None
        number = _number(buffer, at) if end - at > _OVERHEAD else 0
        return RtcmFrame(number, buffer[at:end], arrived)


def _number(buffer: bytes, at: int) -> int:
    return buffer[at + _HEADER] << 4 | buffer[at + _HEADER + 1] >> 4


def crc24q(content: bytes, crc: int = 0) -> int:
    """Return the checksum of some bytes."""
    for byte in content:
        crc = (crc << 8 & 0xFFFFFF) ^ _TABLE[crc >> 16 ^ byte]
    return crc


class PartialCrc:
    """
    The checksum of any part of a buffer in constant time, after one pass over its bytes.

    False starts may stand close together, each with a long frame behind it; see
    :mod:`rt_robot_os.devices.partial_sums`.
    """

    def __init__(self) -> None:
        self._buffer = b''
        self._states: list[int] = [0]

    def of(self, buffer: bytes, begin: int, end: int) -> int:
        """Return the checksum of a part of at most 1029 bytes."""
        if end - begin <= _SHORT:
            return crc24q(buffer[begin:end])
        if buffer is not self._buffer:
            self._buffer = buffer
            self._states = [0]
        states, table = self._states, _TABLE
        if len(states) <= end:
            crc = states[-1]
            for byte in buffer[len(states) - 1:end]:
                crc = (crc << 8 & 0xFFFFFF) ^ table[crc >> 16 ^ byte]
                states.append(crc)
        # The remainder of the bytes before, carried through the part as if it were zeros.
        before, factor, product = states[begin], _POWERS[end - begin], 0
        while factor:
            if factor & 1:
                product ^= before
            before <<= 1
            if before & 0x1000000:
                before ^= _POLYNOMIAL
            factor >>= 1
        return states[end] ^ product


def _shifted(value: int, bits: int) -> int:
    for _ in range(bits):
        value <<= 1
        if value & 0x1000000:
            value ^= _POLYNOMIAL
    return value


_TABLE: Final = tuple(_shifted(byte << 16, 8) for byte in range(256))


def _powers() -> tuple[int, ...]:
    """Return x to the power of 8 n, modulo the polynomial: the factor of n zero bytes."""
    found = [1]
    for _ in range(_OVERHEAD + MAX_PAYLOAD):
        found.append(_shifted(found[-1], 8))
    return tuple(found)


_POWERS: Final = _powers()


# ---- encoding ---------------------------------------------------------------------------------

def message(number: int, content: bytes = b'') -> bytes:
    """
    Encode a message.

    :param content: the bytes behind its number, which uses the first twelve bits of two bytes.
    """
    payload = (number << 4).to_bytes(2, 'big') + content
    frame = b'\xd3' + len(payload).to_bytes(2, 'big') + payload
    return frame + crc24q(frame).to_bytes(3, 'big')
