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
MaxBotix ultrasonic range finders: ``R``, three or four digits, a carriage return.

Some models add `` P0`` or `` P1`` (something near) or a space. There is no checksum.
"""

from __future__ import annotations

import re
from typing import Final
from typing import NamedTuple

from rt_robot_os.devices.framing import FrameDecoder

# Metres of a unit, digits of a reading, readings without a target.
UNITS: Final = {'mm': (0.001, 4, (5000, 9999)), 'cm': (0.01, 3, (765, 1068)),
                'inch': (0.0254, 3, (255,))}

# "R1234 P1\r" has nine bytes.
_LONGEST: Final = 10
_LINE: Final = re.compile(rb'R(\d{3,4}) ?(P\d)? ?\r').fullmatch
_CR: Final = b'\r'
_DIGITS: Final = b'0123456789'


class MaxBotixFrame(NamedTuple):
    """
    One reading.

    :ivar value: as sent, in the unit of the model.
    :ivar digits: how many digits it had: four are millimetres, three are centimetres or inches.
    :ivar size: bytes of the reading.
    :ivar end: index just after its last byte in the chunk that completed it.
    """

    value: int
    digits: int
    size: int
    end: int


class MaxBotixDecoder(FrameDecoder[MaxBotixFrame]):
    """
    Find the readings in a stream of bytes; safe in the loop, keeps less than 10 bytes.

    A line that begins with R and a digit and is not a reading is a rejected frame.
    """

    STARTS = b'R'
    SHORTEST = 5
    LONGEST = _LONGEST
    PATTERN = rb'R(?:[0-9]|\Z)'

    def end(self, buffer: bytes, at: int) -> int:
        """Return where the line ends, or where the next R is if the line was cut off there."""
        if buffer[at + 1] not in _DIGITS:
            return 0
        limit = at + _LONGEST
        end = buffer.find(_CR, at, limit) + 1 or limit
        again = buffer.find(b'R', at + 1, end)
        return again if again > 0 else end

    def frame(self, buffer: bytes, at: int, end: int, arrived: int) -> MaxBotixFrame | None:
        """Read a line."""
        match = _LINE(buffer[at:end])
        if match is None:
            return None
        return MaxBotixFrame(int(match[1]), len(match[1]), end - at, arrived)


def reading(value: int, digits: int = 4) -> bytes:
    """Encode a reading of a MaxBotix range finder."""
    return b'R%0*d\r' % (digits, value)


def is_maxbotix(data: bytes) -> bool:
    """Return whether most of some bytes are readings: they have no checksum."""
    decoder = MaxBotixDecoder()
    return len(decoder.feed(data)) > 1 and decoder.rejected_bytes < len(data) // 4
