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
Xbus messages of Xsens (Movella) motion trackers: ``FA FF MID LEN payload CS``.

LEN 0xFF means that the length follows in two bytes. The sum of all bytes after the preamble 0xFA,
CS included, is 0 modulo 256. 0xFA may appear in the payload, so a message is accepted only with a
valid sum; otherwise the decoder advances by one byte.

Commands, and messages for simulated trackers and tests, are encoded here as well.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Sequence
import struct
from typing import Final
from typing import NamedTuple

from rt_robot_os.devices.framing import FrameDecoder
from rt_robot_os.devices.partial_sums import PartialSums
from rt_robot_os.devices.xsens.mtdata2 import MTDATA2


PREAMBLE: Final = b'\xfa\xff'
EXTENDED: Final = 0xFF
# A false header delays the bytes behind it by its length, so that is limited.
MAX_PAYLOAD: Final = 2048

_BUS: Final = PREAMBLE[1]
_HEADER: Final = 4
_LONG_HEADER: Final = 6
_MOST_HIGH: Final = MAX_PAYLOAD >> 8
# The header, or its part before the end of the buffer; no length is above MAX_PAYLOAD.
_MESSAGE: Final = (
    rb'\xfa(?:\xff(?:.(?:[\x00-\xfe]|\xff(?:[\x00-\x%02x]|\Z)|\Z)|\Z)|\Z)' % _MOST_HIGH)


class XbusFrame(NamedTuple):
    """
    One message with a valid sum.

    :ivar mid: its identifier.
    :ivar payload: its content.
    :ivar size: bytes of the whole message.
    :ivar end: index just after its last byte in the chunk that completed it.
    """

    mid: int
    payload: bytes
    size: int
    end: int


class XbusDecoder(FrameDecoder[XbusFrame]):
    """Find the messages in a stream of bytes; safe in the loop, keeps at most about 2 KiB."""

    STARTS = PREAMBLE[:1]
    SHORTEST = _HEADER + 1
    LONGEST = _LONG_HEADER + MAX_PAYLOAD + 1
    PATTERN = _MESSAGE

    def __init__(self) -> None:
        super().__init__()
        self._sums = PartialSums()

    def end(self, buffer: bytes, at: int) -> int:
        """Return where a message ends, 0 if none begins here."""
        if buffer[at + 1] != _BUS:
            return 0
        length = buffer[at + 3]
        if length < EXTENDED:
            return at + _HEADER + length + 1
        # SHORTEST bytes are available, including the high byte of the length.
        if buffer[at + 4] > _MOST_HIGH:
            return 0
        if len(buffer) - at < _LONG_HEADER:
            return at + _LONG_HEADER
        return at + _LONG_HEADER + (buffer[at + 4] << 8 | buffer[at + 5]) + 1

    def frame(self, buffer: bytes, at: int, end: int, arrived: int) -> XbusFrame | None:
        """Decode a message with a valid sum."""
        if self._sums.sum8(buffer, at + 1, end):
            return None
        begin = at + (_HEADER if buffer[at + 3] < EXTENDED else _LONG_HEADER)
        return XbusFrame(buffer[at + 2], buffer[begin:end - 1], end - at, arrived)


# ---- encoding ---------------------------------------------------------------------------------

GO_TO_MEASUREMENT: Final = 0x10
GO_TO_CONFIG: Final = 0x30
ERROR: Final = 0x42
SET_OUTPUT_CONFIGURATION: Final = 0xC0
# Rate of items in every message, such as the packet counter.
EVERY_MESSAGE: Final = 0xFFFF

ERRORS: Final = {
    0x03: 'period not within its range', 0x04: 'message not known to it',
    0x1E: 'timer overflow', 0x20: 'baud rate not within its range',
    0x21: 'parameter not valid for it',
}

Item = tuple[int, bytes]


def message(mid: int, payload: bytes = b'') -> bytes:
    """
    Encode a message.

    :param payload: at most 2048 bytes.
    """
    size = len(payload)
    if size > MAX_PAYLOAD:
        raise ValueError(f'{size} bytes of payload: at most {MAX_PAYLOAD} fit')
    head = bytes((0xFF, mid, size)) if size < EXTENDED else (
        bytes((0xFF, mid, EXTENDED)) + size.to_bytes(2, 'big'))
    content = head + payload
    return b'\xfa' + content + bytes((-sum(content) & 0xFF,))


def mtdata2(items: Iterable[Item]) -> bytes:
    """Encode a measurement message of items: identifier and data."""
    return message(MTDATA2, b''.join(
        struct.pack('>HB', identifier, len(data)) + data for identifier, data in items))


def reals(values: Sequence[float], precision: int = 0) -> bytes:
    """
    Encode the numbers of an item.

    :param precision: 0 single, 1 fixed 12.20, 2 fixed 16.32, 3 double.
    """
    if precision == 1:
        return struct.pack(f'>{len(values)}i', *(round(v * 1048576) for v in values))
    if precision == 2:
        # Integer part and fraction are exchanged.
        return b''.join(
            struct.pack('>Ih', number & 0xFFFFFFFF, number >> 32)
            for number in (round(v * 4294967296) for v in values))
    return struct.pack(f'>{len(values)}{"d" if precision == 3 else "f"}', *values)


def output_configuration(wanted: Iterable[tuple[int, int]]) -> bytes:
    """Encode the payload of SetOutputConfiguration from identifiers and rates in Hz."""
    return b''.join(struct.pack('>HH', identifier, rate) for identifier, rate in wanted)


def read_output_configuration(payload: bytes) -> tuple[tuple[int, int], ...]:
    """Decode identifiers and rates; incomplete data are ignored."""
    return tuple(struct.iter_unpack('>HH', payload[:len(payload) // 4 * 4]))


def is_xbus(data: bytes) -> bool:
    """Return whether some bytes contain a message with a payload."""
    return any(frame.payload for frame in XbusDecoder().feed(data))
