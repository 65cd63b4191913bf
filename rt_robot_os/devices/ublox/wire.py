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
of everything between. With factory settings receivers send both protocols on one line, so
sentences are frames too, of class 0: they are not garbage, even if they are not used.

Commands, and messages of simulated receivers, are encoded here as well.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
import re
import struct
from typing import Final
from typing import NamedTuple

from rt_robot_os.devices.framing import FrameDecoder
from rt_robot_os.devices.nmea.wire import checked
from rt_robot_os.devices.nmea.wire import MAX_SENTENCE
from rt_robot_os.devices.nmea.wire import MIN_SENTENCE
from rt_robot_os.devices.nmea.wire import SENTENCE
from rt_robot_os.devices.nmea.wire import sentence_end
from rt_robot_os.devices.partial_sums import PartialSums


SYNC: Final = b'\xb5\x62'
# A false header delays the bytes behind it by its length, so that is limited.
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
# All classes that receivers are known to send; 0x03 and 0x0C are for u-blox's own use.
_CLASSES: Final = bytes((
    NAV, 0x02, 0x03, 0x04, ACK, CFG, 0x09, 0x0A, 0x0B, 0x0C, 0x0D, 0x10, 0x13, 0x21, 0x27, 0x28,
    0x29))
# The header, or its part before the end of the buffer; no length is above MAX_PAYLOAD.
_MESSAGE: Final = rb'\xb5(?:\x62(?:[%s](?:.(?:.(?:[\x00-\x0a]|\Z)|\Z)|\Z)|\Z)|\Z)' % (
    re.escape(_CLASSES))

# The first 84 bytes of NAV-PVT, which all generations have.
_PVT: Final = struct.Struct('<IH6BIi4B4i2I5i2I2H4x')
PVT_SIZES: Final = (84, 92)
_HPPOSLLH: Final = struct.Struct('<B2xBI4i4b2I')
FIX_2D, FIX_3D, FIX_AND_DEAD_RECKONING = 2, 3, 4


class UbxFrame(NamedTuple):
    """
    One message with a valid checksum, or one NMEA sentence.

    :ivar kind: its class; ``NMEA`` for a sentence.
    :ivar identifier: within its class.
    :ivar payload: its content; the sentence for NMEA.
    :ivar size: bytes of the whole frame.
    :ivar end: index just after its last byte in the chunk that completed it.
    """

    kind: int
    identifier: int
    payload: bytes
    size: int
    end: int


class NavPvt(NamedTuple):
    """Position, velocity and time in the units of the message: mm, mm/s, 1e-7 and 1e-5 degrees."""

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
        """Return whether date and time are valid, and the leap seconds known."""
        return self.valid & 0x07 == 0x07

    @property
    def has_fix(self) -> bool:
        """Return whether there is a position within the receiver's limits."""
        return bool(self.flags & 0x01 and FIX_2D <= self.fix_type <= FIX_AND_DEAD_RECKONING
                    and not self.flags3 & 0x01)

    @property
    def is_differential(self) -> bool:
        """Return whether corrections were applied, from SBAS or others."""
        return bool(self.flags & 0x02)

    @property
    def carrier(self) -> int:
        """Return the carrier phase solution: 0 none, 1 floating, 2 fixed."""
        return self.flags >> 6


class HighPrecision(NamedTuple):
    """
    The position of NAV-HPPOSLLH, both parts combined.

    :ivar tow_ms: of the epoch.
    :ivar valid: the receiver's flag.
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
    SHORTEST = MIN_SENTENCE  # the length of the header of a message
    LONGEST = _OVERHEAD + MAX_PAYLOAD
    PATTERN = _MESSAGE + b'|' + SENTENCE

    def __init__(self) -> None:
        super().__init__()
        self._sums = PartialSums()

    def end(self, buffer: bytes, at: int) -> int:
        """Return where a message or sentence ends, 0 if none begins here."""
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
        """Decode a message or sentence with a valid checksum."""
        if buffer[at] != _FIRST:
            sentence = buffer[at:end]
            return UbxFrame(NMEA, 0, sentence, end - at, arrived) if checked(sentence) else None
        if self._sums.fletcher8(buffer, at + 2, end - 2) != (buffer[end - 2], buffer[end - 1]):
            return None
        return UbxFrame(buffer[at + 2], buffer[at + 3], buffer[at + _HEADER:end - 2], end - at,
                        arrived)


def fletcher(content: bytes) -> bytes:
    """Return the checksum of the bytes between sync and checksum."""
    first = second = 0
    for byte in content:
        first += byte
        second += first
    return bytes((first & 0xFF, second & 0xFF))


def nav_pvt(payload: bytes) -> NavPvt | None:
    """Decode the payload of NAV-PVT; None if it is too short."""
    return NavPvt(*_PVT.unpack_from(payload)) if len(payload) >= _PVT.size else None


def high_precision(payload: bytes) -> HighPrecision | None:
    """Decode the payload of NAV-HPPOSLLH; None if it is invalid."""
    if len(payload) != _HPPOSLLH.size or payload[0]:
        return None
    (_, flags, tow_ms, longitude, latitude, height_mm, _, longitude_part, latitude_part,
     height_part, _, horizontal, vertical) = _HPPOSLLH.unpack(payload)
    return HighPrecision(
        tow_ms, not flags & 0x01, longitude * 100 + longitude_part,
        latitude * 100 + latitude_part, height_mm * 10 + height_part, horizontal, vertical)


# ---- encoding ---------------------------------------------------------------------------------

CFG_MSG: Final = 0x01
CFG_RATE: Final = 0x08
CFG_VALSET: Final = 0x8A
ACK_NAK: Final = 0x00
ACK_ACK: Final = 0x01

# Keys of the configuration from generation 9 on; bits 28 to 30 of a key are the size of its value.
RATE_MEAS: Final = 0x30210001
RATE_NAV: Final = 0x30210002
LAYER_RAM: Final = 1


class PortKeys(NamedTuple):
    """The keys of one port of a receiver."""

    name: str
    ubx_out: int
    rtcm_in: int
    nav_pvt: int
    nav_hpposllh: int


PORTS: Final = (
    PortKeys('UART1', 0x10740001, 0x10730004, 0x20910007, 0x20910034),
    PortKeys('USB', 0x10780001, 0x10770004, 0x20910009, 0x20910036),
    PortKeys('UART2', 0x10760001, 0x10750004, 0x20910008, 0x20910035),
)
_VALUE_BYTES: Final = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8}

_PVT_WHOLE: Final = struct.Struct('<IH6BIi4B4i2I5i2I2H4xihH')
_WEEK_MS: Final = 7 * 86_400_000
_GPS_EPOCH_S: Final = 315_964_800
_LEAP_S: Final = 18


def message(kind: int, identifier: int, payload: bytes = b'') -> bytes:
    """Make a message."""
    content = bytes((kind, identifier)) + struct.pack('<H', len(payload)) + payload
    return SYNC + content + fletcher(content)


def enable(identifier: int) -> bytes:
    """Encode the command that enables a NAV message with each solution, on the receiving port."""
    return message(CFG, CFG_MSG, bytes((NAV, identifier, 1)))


def valset(values: Mapping[int, int], layers: int = LAYER_RAM) -> bytes:
    """Encode values by their keys; the receiver refuses all if one is unknown."""
    return message(CFG, CFG_VALSET, bytes((0, layers, 0, 0)) + b''.join(
        key.to_bytes(4, 'little') + value.to_bytes(_VALUE_BYTES[key >> 28 & 7], 'little')
        for key, value in values.items()))


def parse_valset(payload: bytes) -> dict[int, int] | None:
    """Decode a CFG-VALSET; None if it is invalid."""
    found = {}
    at = 4
    while at + 4 < len(payload):
        key = int.from_bytes(payload[at:at + 4], 'little')
        size = _VALUE_BYTES.get(key >> 28 & 7, 0)
        if not size or at + 4 + size > len(payload):
            return None
        found[key] = int.from_bytes(payload[at + 4:at + 4 + size], 'little')
        at += 4 + size
    return found if at == len(payload) else None


def set_rate(rate_hz: float) -> bytes:
    """Encode the measurement rate, with one solution each, aligned to UTC."""
    return message(CFG, CFG_RATE, struct.pack('<HHH', round(1000 / rate_hz), 1, 0))


def acknowledge(kind: int, identifier: int, *, done: bool = True) -> bytes:
    """Answer a command."""
    return message(ACK, ACK_ACK if done else ACK_NAK, bytes((kind, identifier)))


def make_nav_pvt(
    time: datetime, latitude_deg: float, longitude_deg: float, height_m: float, *,
    separation_m: float = 0.0, fix_type: int = 3, flags: int = 0x01, valid: int = 0x07,
    satellites: int = 12, horizontal_m: float = 1.5, vertical_m: float = 2.5,
    velocity_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0), speed_accuracy_m_s: float = 0.1,
    nano: int | None = None, flags3: int = 0,
) -> bytes:
    """
    Encode position, velocity and time.

    :param time: UTC.
    :param height_m: above the ellipsoid.
    :param separation_m: of the geoid above the ellipsoid.
    :param velocity_m_s: east, north, up.
    :param nano: of the second; that of ``time`` if None. A receiver's may be negative.
    """
    east, north, up = (round(v * 1000) for v in velocity_m_s)
    tow_ms = time_of_week_ms(time)
    height_mm = round(height_m * 1000)
    return message(NAV, PVT, _PVT_WHOLE.pack(
        tow_ms, time.year, time.month, time.day, time.hour, time.minute, time.second, valid,
        50, time.microsecond * 1000 if nano is None else nano, fix_type, flags, 0, satellites,
        round(longitude_deg * 1e7), round(latitude_deg * 1e7), height_mm,
        height_mm - round(separation_m * 1000), round(horizontal_m * 1000),
        round(vertical_m * 1000), north, east, -up, round((north ** 2 + east ** 2) ** 0.5), 0,
        round(speed_accuracy_m_s * 1000), 0, 150, flags3, 0, 0, 0))


def make_nav_hpposllh(
    time: datetime, latitude_deg: float, longitude_deg: float, height_m: float, *,
    separation_m: float = 0.0, horizontal_m: float = 0.014, vertical_m: float = 0.021,
    invalid: bool = False,
) -> bytes:
    """
    Encode the position with nine decimals of a degree and a tenth of a millimetre.

    :param time: UTC, of the epoch.
    :param height_m: above the ellipsoid.
    """
    longitude, longitude_hp = _split(longitude_deg * 1e9)
    latitude, latitude_hp = _split(latitude_deg * 1e9)
    height, height_hp = _split(height_m * 1e4, 10)
    sea, sea_hp = _split((height_m - separation_m) * 1e4, 10)
    return message(NAV, HPPOSLLH, _HPPOSLLH.pack(
        0, int(invalid), time_of_week_ms(time), longitude, latitude, height, sea, longitude_hp,
        latitude_hp, height_hp, sea_hp, round(horizontal_m * 1e4), round(vertical_m * 1e4)))


def time_of_week_ms(time: datetime) -> int:
    """Return the time of the GPS week."""
    return (round(time.timestamp() * 1000) + (_LEAP_S - _GPS_EPOCH_S) * 1000) % _WEEK_MS


def _split(value: float, parts: int = 100) -> tuple[int, int]:
    """Return the quotient and the remainder, with the same sign."""
    whole = round(value)
    rest = whole - int(whole / parts) * parts
    return (whole - rest) // parts, rest


def is_ubx(data: bytes) -> bool:
    """Return whether some bytes contain a message."""
    return any(frame.kind for frame in UbxDecoder().feed(data))
