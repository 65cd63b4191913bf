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
UBX, the binary protocol of u-blox receivers, with NMEA 0183 sentences in between.

``B5 62 CLASS ID LEN(2) payload CK_A CK_B``, little-endian; the checksum is the 8-bit Fletcher sum
of everything between. Receivers send both protocols on one line as delivered, so sentences are
frames too, of class 0: they are no rubbish, even where nobody wants them.
"""

from __future__ import annotations

import re
import struct
from typing import Final
from typing import NamedTuple

from rt_robot_os.drivers.decoders.nmea import checked
from rt_robot_os.drivers.decoders.nmea import MAX_SENTENCE
from rt_robot_os.drivers.decoders.nmea import MIN_SENTENCE
from rt_robot_os.drivers.decoders.nmea import SENTENCE
from rt_robot_os.drivers.decoders.nmea import sentence_end
from rt_robot_os.drivers.framing import FrameDecoder
from rt_robot_os.drivers.partial_sums import PartialSums

SYNC: Final = b'\xb5\x62'
# A header found by chance holds up what follows until its length is there: keep that short.
MAX_PAYLOAD: Final = 2560

NMEA: Final = 0
NAV: Final = 0x01
ACK: Final = 0x05
CFG: Final = 0x06
PVT: Final = 0x07
HPPOSLLH: Final = 0x14

_FIRST, _SECOND = SYNC
_HEADER: Final = 6
_OVERHEAD: Final = 8
# All that receivers have been seen to send; 0x03 and 0x0C are for u-blox's own use.
_CLASSES: Final = bytes((
    NAV, 0x02, 0x03, 0x04, ACK, CFG, 0x09, 0x0A, 0x0B, 0x0C, 0x0D, 0x10, 0x13, 0x21, 0x27, 0x28,
    0x29))
# The header, or what the end of the buffer has left of it; no length is above MAX_PAYLOAD.
_MESSAGE: Final = rb'\xb5(?:\x62(?:[%s](?:.(?:.(?:[\x00-\x0a]|\Z)|\Z)|\Z)|\Z)|\Z)' % (
    re.escape(_CLASSES))

# The first 84 bytes of NAV-PVT, which all generations have.
_PVT: Final = struct.Struct('<IH6BIi4B4i2I5i2I2H4x')
PVT_SIZES: Final = (84, 92)
_HPPOSLLH: Final = struct.Struct('<B2xBI4i4b2I')
FIX_2D, FIX_3D, FIX_AND_DEAD_RECKONING = 2, 3, 4


class UbxFrame(NamedTuple):
    """
    One message with a good checksum, or one NMEA sentence.

    :ivar kind: its class; ``NMEA`` for a sentence.
    :ivar identifier: within its class.
    :ivar payload: what it holds, the sentence for NMEA.
    :ivar size: bytes of the whole frame.
    :ivar end: index just after its last byte in the chunk that completed it.
    """

    kind: int
    identifier: int
    payload: bytes
    size: int
    end: int


class NavPvt(NamedTuple):
    """Position, velocity and time as the message has them; mm, mm/s, 1e-7 and 1e-5 degrees."""

    tow_ms: int
    year: int
    month: int
    day: int
    hour: int
    minute: int
    second: int
    valid: int
    time_accuracy_ns: int
    nano: int
    fix_type: int
    flags: int
    flags2: int
    satellites: int
    longitude: int
    latitude: int
    height_mm: int
    sea_height_mm: int
    horizontal_accuracy_mm: int
    vertical_accuracy_mm: int
    north_mm_s: int
    east_mm_s: int
    down_mm_s: int
    ground_speed_mm_s: int
    heading: int
    speed_accuracy_mm_s: int
    heading_accuracy: int
    pdop: int
    flags3: int

    @property
    def has_date(self) -> bool:
        """Say whether date and time are valid, and the leap seconds known."""
        return self.valid & 0x07 == 0x07

    @property
    def has_fix(self) -> bool:
        """Say whether there is a position within the receiver's limits."""
        return bool(self.flags & 0x01 and FIX_2D <= self.fix_type <= FIX_AND_DEAD_RECKONING
                    and not self.flags3 & 0x01)

    @property
    def is_differential(self) -> bool:
        """Say whether corrections were applied, of SBAS or others."""
        return bool(self.flags & 0x02)

    @property
    def carrier(self) -> int:
        """Give the carrier phase solution: 0 none, 1 floating, 2 fixed."""
        return self.flags >> 6


class HighPrecision(NamedTuple):
    """
    Position of NAV-HPPOSLLH, whole.

    :ivar tow_ms: of the epoch.
    :ivar valid: the receiver calls it so.
    :ivar latitude: in 1e-9 degrees, as ``longitude``.
    :ivar height: above the ellipsoid in 0.1 mm, as ``horizontal_accuracy`` and the vertical one.
    """

    tow_ms: int
    valid: bool
    longitude: int
    latitude: int
    height: int
    horizontal_accuracy: int
    vertical_accuracy: int


class UbxDecoder(FrameDecoder[UbxFrame]):
    """Find messages and sentences in a stream; safe in the loop, keeps less than 3 KiB."""

    STARTS = SYNC[:1] + b'$'
    SHORTEST = MIN_SENTENCE  # as long as the header of a message
    LONGEST = _OVERHEAD + MAX_PAYLOAD
    PATTERN = _MESSAGE + b'|' + SENTENCE

    def __init__(self) -> None:
        super().__init__()
        self._sums = PartialSums()

    def end(self, buffer: bytes, at: int) -> int:
        """Say where a message or sentence ends, 0 when none begins here."""
        if buffer[at] != _FIRST:
            end = sentence_end(buffer, at)
            return end if end <= at + MAX_SENTENCE else 0
        if buffer[at + 1] != _SECOND or buffer[at + 2] not in _CLASSES:
            return 0
        length = buffer[at + 4] | buffer[at + 5] << 8
        if buffer[at + 2] == NAV and buffer[at + 3] == PVT and length not in PVT_SIZES:
            return 0
        return at + _OVERHEAD + length

    def frame(self, buffer: bytes, at: int, end: int, arrived: int) -> UbxFrame | None:
        """Read a message or sentence with a good checksum."""
        if buffer[at] != _FIRST:
            sentence = buffer[at:end]
            return UbxFrame(NMEA, 0, sentence, end - at, arrived) if checked(sentence) else None
        if self._sums.fletcher8(buffer, at + 2, end - 2) != (buffer[end - 2], buffer[end - 1]):
            return None
        return UbxFrame(buffer[at + 2], buffer[at + 3], buffer[at + _HEADER:end - 2], end - at,
                        arrived)


def fletcher(content: bytes) -> bytes:
    """Give the checksum of what stands between sync and checksum."""
    first = second = 0
    for byte in content:
        first += byte
        second += first
    return bytes((first & 0xFF, second & 0xFF))


def nav_pvt(payload: bytes) -> NavPvt | None:
    """Read the payload of NAV-PVT; None when it is too short for one."""
    return NavPvt(*_PVT.unpack_from(payload)) if len(payload) >= _PVT.size else None


def high_precision(payload: bytes) -> HighPrecision | None:
    """Read the payload of NAV-HPPOSLLH; None when it is none."""
    if len(payload) != _HPPOSLLH.size or payload[0]:
        return None
    (_, flags, tow_ms, longitude, latitude, height_mm, _, longitude_part, latitude_part,
     height_part, _, horizontal, vertical) = _HPPOSLLH.unpack(payload)
    return HighPrecision(
        tow_ms, not flags & 0x01, longitude * 100 + longitude_part,
        latitude * 100 + latitude_part, height_mm * 10 + height_part, horizontal, vertical)
