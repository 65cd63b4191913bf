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
The bytes of the battery gauge: ``$B12.34,+01.20,073*5A`` ten times a second.

Volts, amperes (negative: the battery is being discharged), percent; then the XOR of the characters
between ``$`` and ``*``, and the end of the line. Each frame has 23 bytes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from operator import xor
import re

from rt_robot_os.devices import FrameDecoder

FRAME = re.compile(
    rb'\$(B(\d\d\.\d\d),([+-]\d\d\.\d\d),(\d{3}))\*([0-9A-F]{2})\r\n').fullmatch
FRAME_BYTES = 23


def checksum(body: bytes) -> int:
    """Return the XOR of some bytes."""
    return reduce(xor, body, 0)


def encode(voltage: float, current: float, percent: int) -> bytes:
    """Encode a reading, as the gauge sends it."""
    body = f'B{voltage:05.2f},{current:+06.2f},{percent:03d}'.encode()
    return b'$%s*%02X\r\n' % (body, checksum(body))


@dataclass(frozen=True)
class Reading:
    """
    One reading.

    :ivar end: index just after its last byte in the chunk that completed it.
    """

    voltage: float
    current: float
    percent: int
    end: int


class GaugeDecoder(FrameDecoder[Reading]):
    """Decode readings; each byte is in a reading, rejected, or pending."""

    STARTS = b'$'
    SHORTEST = LONGEST = FRAME_BYTES

    def end(self, buffer: bytes, at: int) -> int:
        """Return the end of the frame that begins at an index."""
        return at + FRAME_BYTES

    def frame(self, buffer: bytes, at: int, end: int, arrived: int) -> Reading | None:
        """Check and decode a frame; None if it is invalid."""
        match = FRAME(buffer, at, end)
        if match is None:
            return None
        body, voltage, current, percent, check = match.groups()
        if checksum(body) != int(check, 16):
            return None
        return Reading(float(voltage), float(current), int(percent), arrived)


def is_gauge(data: bytes) -> bool:
    """Return whether some bytes are of a gauge; for other drivers, when ports are swapped."""
    return bool(GaugeDecoder().feed(data))
