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


"""Xbus messages, for commands to Xsens motion trackers, simulated ones and tests."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Sequence
import struct
from typing import Final

from rt_robot_os.drivers.decoders.mtdata2 import MTDATA2
from rt_robot_os.drivers.decoders.xbus import EXTENDED
from rt_robot_os.drivers.decoders.xbus import MAX_PAYLOAD

GO_TO_MEASUREMENT: Final = 0x10
GO_TO_CONFIG: Final = 0x30
ERROR: Final = 0x42
SET_OUTPUT_CONFIGURATION: Final = 0xC0
# For items that come with every message, such as the packet counter.
EVERY_MESSAGE: Final = 0xFFFF

ERRORS: Final = {
    0x03: 'period not within its range', 0x04: 'message not known to it',
    0x1E: 'timer overflow', 0x20: 'baud rate not within its range',
    0x21: 'parameter not valid for it',
}

Item = tuple[int, bytes]


def message(mid: int, payload: bytes = b'') -> bytes:
    """
    Make a message.

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
    """Make a measurement message of items: identifier and data."""
    return message(MTDATA2, b''.join(
        struct.pack('>HB', identifier, len(data)) + data for identifier, data in items))


def reals(values: Sequence[float], precision: int = 0) -> bytes:
    """
    Encode numbers as an item has them.

    :param precision: 0 single, 1 fixed 12.20, 2 fixed 16.32, 3 double.
    """
    if precision == 1:
        return struct.pack(f'>{len(values)}i', *(round(v * 1048576) for v in values))
    if precision == 2:
        # Whole and fraction change places.
        return b''.join(
            struct.pack('>Ih', number & 0xFFFFFFFF, number >> 32)
            for number in (round(v * 4294967296) for v in values))
    return struct.pack(f'>{len(values)}{"d" if precision == 3 else "f"}', *values)


def output_configuration(wanted: Iterable[tuple[int, int]]) -> bytes:
    """Make the payload of SetOutputConfiguration from identifiers and rates in Hz."""
    return b''.join(struct.pack('>HH', identifier, rate) for identifier, rate in wanted)


def read_output_configuration(payload: bytes) -> tuple[tuple[int, int], ...]:
    """Read identifiers and rates; what is left over is passed over."""
    return tuple(struct.iter_unpack('>HH', payload[:len(payload) // 4 * 4]))
