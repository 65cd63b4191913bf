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

Volts, amperes (negative: the battery is being discharged), percent; then the XOR of what is
between ``$`` and ``*``, and the end of the line. Each frame has 23 bytes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from operator import xor
import re

FRAME = re.compile(rb'\$(B(\d\d\.\d\d),([+-]\d\d\.\d\d),(\d{3}))\*([0-9A-F]{2})\r\n')
FRAME_BYTES = 23


def checksum(body: bytes) -> int:
    """Give the XOR of some bytes."""
    return reduce(xor, body, 0)


def encode(voltage: float, current: float, percent: int) -> bytes:
    """Give the bytes of a reading, as the gauge sends it."""
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


class GaugeDecoder:
    """Turn bytes into readings; each byte is in a reading, rejected, or pending."""

    def __init__(self) -> None:
        self.frames = 0
        self.rejected_bytes = 0
        self.rejected_frames = 0
        self._pending = b''

    @property
    def pending_bytes(self) -> int:
        """Give the number of bytes that wait for the rest of their frame."""
        return len(self._pending)

    def reset(self) -> None:
        """Reject what is pending: the stream starts anew."""
        self.rejected_bytes += len(self._pending)
        self._pending = b''

    def feed(self, data: bytes) -> list[Reading]:
        """Take the next bytes and give the readings that they complete; never raises."""
        before = len(self._pending)
        data = self._pending + data
        found: list[Reading] = []
        at = 0
        for match in FRAME.finditer(data):
            body, voltage, current, percent, check = match.groups()
            if checksum(body) == int(check, 16):
                self.rejected_bytes += match.start() - at
                found.append(Reading(
                    float(voltage), float(current), int(percent), match.end() - before))
            else:
                self.rejected_bytes += match.end() - at
                self.rejected_frames += 1
            at = match.end()
        # Only what follows the last $ can be the beginning of a frame.
        start = data.rfind(b'$', at)
        if start < 0 or len(data) - start >= FRAME_BYTES:
            start = len(data)
        self.rejected_bytes += start - at
        self._pending = data[start:]
        self.frames += len(found)
        return found
