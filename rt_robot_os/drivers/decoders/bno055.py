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
What a Bosch BNO055 answers over its UART: ``BB LEN data`` to a read, ``EE STATUS`` otherwise.

There is no checksum and no word of what was asked. So only the lengths that are ever asked for
count, only statuses that exist, and of the large block only one whose quaternion is a rotation (or
nothing at all, before fusion begins). A flipped bit elsewhere in the data cannot be noticed.
"""

from __future__ import annotations

import re
import struct
from typing import Final
from typing import NamedTuple

DATA: Final = 0xBB
STATUS: Final = 0xEE

# Acceleration to calibration status, registers 0x08 to 0x35.
BLOCK_FIRST: Final = 0x08
BLOCK_SIZE: Final = 46
# Acceleration, field, rate, angles, quaternion, linear acceleration, gravity; temperature, status.
BLOCK: Final = struct.Struct('<22hbB')

WRITE_SUCCESS: Final = 0x01
OVERRUN: Final = 0x07
STATUSES: Final = {
    0x01: 'written', 0x02: 'read failed', 0x03: 'write failed', 0x04: 'no such register',
    0x05: 'register not writable', 0x06: 'wrong start byte', 0x07: 'bus overrun',
    0x08: 'too long', 0x09: 'too short', 0x0A: 'request came too slowly',
}

_START: Final = re.compile(b'[\xbb\xee]').search
_QUATERNION: Final = struct.Struct('<4h').unpack_from
_QUATERNION_AT: Final = 24
_UNIT: Final = 1 << 28
_TOLERANCE: Final = _UNIT // 20


class Bno055Frame(NamedTuple):
    """
    One answer.

    :ivar status: of ``EE STATUS``; 0 with data.
    :ivar data: what was read.
    :ivar end: index just after its last byte in the chunk that completed it.
    """

    status: int
    data: bytes
    end: int


class Bno055Decoder:
    """
    Find the answers in a stream of bytes; safe in the loop, keeps less than 48 bytes.

    :ivar frames: valid answers so far.
    :ivar rejected_bytes: bytes that belong to no valid answer.
    :ivar rejected_frames: blocks that cannot be measurements.
    """

    def __init__(self) -> None:
        self.frames = 0
        self.rejected_bytes = 0
        self.rejected_frames = 0
        self._pending = b''

    @property
    def pending_bytes(self) -> int:
        """Give the number of bytes that wait for the rest of their answer."""
        return len(self._pending)

    def reset(self) -> None:
        """Reject what is pending: the stream starts anew."""
        self.rejected_bytes += len(self._pending)
        self._pending = b''

    def feed(self, data: bytes) -> list[Bno055Frame]:
        """
        Take the next bytes of the stream.

        :return: the answers that they complete, in order; the same however the stream is cut.
        """
        held = len(self._pending)
        buffer = self._pending + data
        size = len(buffer)
        frames: list[Bno055Frame] = []
        used = at = 0
        while True:
            match = _START(buffer, at)
            at = size if match is None else match.start()
            if size - at < 2:
                break
            second = buffer[at + 1]
            if buffer[at] == STATUS:
                end = at + 2 if second in STATUSES else 0
            else:
                end = at + 2 + second if second in (1, BLOCK_SIZE) else 0
            if end > size:
                break
            if end and buffer[at] == DATA and second == BLOCK_SIZE \
                    and not _plausible(buffer, at + 2):
                self.rejected_frames += 1
                end = 0
            if not end:
                at += 1
                continue
            frames.append(Bno055Frame(second, b'', end - held) if buffer[at] == STATUS
                          else Bno055Frame(0, buffer[at + 2:end], end - held))
            used += end - at
            at = end
        self.rejected_bytes += at - used
        self._pending = buffer[at:]
        self.frames += len(frames)
        return frames


def _plausible(buffer: bytes, at: int) -> bool:
    """Say whether the quaternion of a block is a rotation, or nothing."""
    w, x, y, z = _QUATERNION(buffer, at + _QUATERNION_AT)
    length = w * w + x * x + y * y + z * z
    return not length or -_TOLERANCE < length - _UNIT < _TOLERANCE
