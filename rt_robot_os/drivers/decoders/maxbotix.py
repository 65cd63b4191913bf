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

# Metres of a unit, digits of a reading, what is sent without a target.
UNITS: Final = {'mm': (0.001, 4, (5000, 9999)), 'cm': (0.01, 3, (765, 1068)),
                'inch': (0.0254, 3, (255,))}

# "R1234 P1\r" has nine bytes.
_LONGEST: Final = 10
_LINE: Final = re.compile(rb'R(\d{3,4}) ?(P\d)? ?\r').fullmatch
_CR: Final = b'\r'


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


class MaxBotixDecoder:
    """
    Find the readings in a stream of bytes; safe in the loop, keeps less than 10 bytes.

    :ivar frames: valid readings so far.
    :ivar rejected_bytes: bytes that belong to no reading.
    :ivar rejected_frames: lines that begin with R and are no reading.
    """

    def __init__(self) -> None:
        self.frames = 0
        self.rejected_bytes = 0
        self.rejected_frames = 0
        self._pending = b''

    @property
    def pending_bytes(self) -> int:
        """Give the number of bytes that wait for the rest of their reading."""
        return len(self._pending)

    def reset(self) -> None:
        """Reject what is pending: the stream starts anew."""
        self.rejected_bytes += len(self._pending)
        self._pending = b''

    def feed(self, data: bytes) -> list[MaxBotixFrame]:
        """
        Take the next bytes of the stream.

        :return: the readings that they complete, in order; the same however the stream is cut.
        """
        held = len(self._pending)
        buffer = self._pending + data
        size = len(buffer)
        frames: list[MaxBotixFrame] = []
        used = 0
        at = buffer.find(b'R')
        while at >= 0:
            end = buffer.find(_CR, at, at + _LONGEST) + 1
            # Another R before the end: the first reading was cut off.
            again = buffer.find(b'R', at + 1, end or at + _LONGEST)
            if again >= 0:
                self.rejected_frames += 1
                at = again
                continue
            if not end and size - at < _LONGEST:
                break
            match = _LINE(buffer[at:end]) if end else None
            if match is None:
                self.rejected_frames += 1
            else:
                frames.append(MaxBotixFrame(int(match[1]), len(match[1]), end - at, end - held))
                used += end - at
            at = buffer.find(b'R', end or at + _LONGEST)
        self._pending = buffer[at:] if at >= 0 else b''
        self.rejected_bytes += size - len(self._pending) - used
        self.frames += len(frames)
        return frames
