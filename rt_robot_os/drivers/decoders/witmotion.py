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
WitMotion frames (WT901, JY901, WT61, WT31N, ...): ``55 ID d0..d7 SUM``, 11 bytes.

SUM is the low byte of the sum of the ten bytes before it; d0..d7 are four little-endian int16.
0x55 may appear in the data, so a header counts only with a known ID and a good sum, otherwise the
decoder slides on by one byte. A frame found by chance in noise or while getting into step passes
that test once in 256 headers; the format has nothing better to offer.
"""

from __future__ import annotations

import re
import struct
from typing import Final
from typing import NamedTuple

from rt_robot_os.drivers.framing import StreamDecoder

TIME: Final = 0x50
ACCELERATION: Final = 0x51
ANGULAR_VELOCITY: Final = 0x52
ANGLE: Final = 0x53
MAGNETIC_FIELD: Final = 0x54
QUATERNION: Final = 0x59
LAST: Final = 0x5A

HEADER: Final = 0x55
FRAME_SIZE: Final = 11

# Full scale is 2^15 counts in each of them.
ACCELERATION_RANGE_G: Final = 16.0
ANGULAR_VELOCITY_RANGE_DEG_S: Final = 2000.0
ANGLE_RANGE_DEG: Final = 180.0
FULL_SCALE: Final = 32768.0

# A header with a known ID, or what the end of the buffer has left of one.
_START: Final = re.compile(rb'\x55(?:[\x50-\x5a]|\Z)').search
_UNPACK: Final = struct.Struct('<4h').unpack_from


class WitMotionFrame(NamedTuple):
    """
    One valid frame.

    :ivar kind: its ID, 0x50 to 0x5A.
    :ivar values: the four int16.
    :ivar end: index just after its last byte in the chunk that completed it.
    :ivar skipped: bytes rejected between the frame before and this one.
    """

    kind: int
    values: tuple[int, int, int, int]
    end: int
    skipped: int


class WitMotionDecoder(StreamDecoder[WitMotionFrame]):
    """
    Find the frames in a stream of bytes; safe in the loop, keeps at most 10 bytes.

    A rejected frame is a header with a known ID whose sum was wrong. The loop is its own: frames
    are so short, and so many, that two calls for each would cost a fifth of the time.
    """

    def __init__(self) -> None:
        super().__init__()
        self._skipped = 0

    def reset(self) -> None:
        """Reject what is pending: the stream starts anew."""
        super().reset()
        self._skipped = 0

    def feed(self, data: bytes) -> list[WitMotionFrame]:
        """
        Take the next bytes of the stream.

        :return: the frames that they complete, in order; the same however the stream is cut.
        """
        held = len(self._pending)
        buffer = self._pending + data
        size = len(buffer)
        frames: list[WitMotionFrame] = []
        at = 0
        rejected = 0
        skipped = self._skipped
        while size - at >= FRAME_SIZE:
            kind = buffer[at + 1]
            if buffer[at] == HEADER and TIME <= kind <= LAST:
                if sum(buffer[at:at + 10]) & 0xFF == buffer[at + 10]:
                    values = _UNPACK(buffer, at + 2)
                    at += FRAME_SIZE
                    frames.append(WitMotionFrame(kind, values, at - held, skipped))
                    skipped = 0
                    continue
                self.rejected_frames += 1
            found = _START(buffer, at + 1)
            slid = (size if found is None else found.start()) - at
            rejected += slid
            skipped += slid
            at += slid
        found = _START(buffer, at)
        start = size if found is None else found.start()
        self.rejected_bytes += rejected + start - at
        self._skipped = skipped + start - at
        self._pending = buffer[start:]
        self.frames += len(frames)
        return frames
