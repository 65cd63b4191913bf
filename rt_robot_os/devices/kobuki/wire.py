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
Packets of the Kobuki base: ``AA 55 LEN payload CS``, of 115200 baud, both ways.

CS is the XOR of LEN and the payload. The payload is a chain of parts ``id, length, data`` that
ends where the payload ends; numbers are little-endian. The base sends one packet each 20 ms, with
its core data and further parts.

Commands, and packets for simulated bases and tests, are encoded here as well.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping
from functools import reduce
import math
from operator import xor
import struct
from types import MappingProxyType
from typing import Final
from typing import NamedTuple

from rt_robot_os.devices.framing import FrameDecoder

SEPARATION_M: Final = 0.23
WHEEL_RADIUS_M: Final = 0.035
TICK_RAD: Final = 0.002436916871363930187454
TICKS_PER_TURN: Final = 2 * math.pi / TICK_RAD
ENCODER_BITS: Final = 16
PACKET_HZ: Final = 50.0
# Time from the last command until it stops by itself.
SILENCE_S: Final = 0.6
BATTERY_V: Final = 0.1
CURRENT_A: Final = 0.01
HEADING_RAD: Final = math.radians(0.01)
GYRO_RAD_S: Final = math.radians(0.00875)

# Parts that the base sends.
CORE: Final = 0x01
DOCK: Final = 0x03
INERTIA: Final = 0x04
CLIFF: Final = 0x05
CURRENT: Final = 0x06
HARDWARE: Final = 0x0A
FIRMWARE: Final = 0x0B
GYRO: Final = 0x0D
PINS: Final = 0x10
UNIQUE_ID: Final = 0x13
# Commands.
BASE_CONTROL: Final = 0x01
SOUND_SEQUENCE: Final = 0x04
REQUEST_EXTRA: Final = 0x09
OUTPUTS: Final = 0x0C
# Of REQUEST_EXTRA: versions of hardware and firmware, unique identifier.
ALL_EXTRA: Final = 0x000B

ADAPTER: Final = 0x10
CHARGED: Final = 2
CHARGING: Final = 6

_PREAMBLE: Final = b'\xaa\x55'
# All parts together have 132 bytes; a longer false start would hide valid packets.
_LONGEST_PAYLOAD: Final = 160
# A part with one byte.
_SHORTEST_PAYLOAD: Final = 3
_AROUND: Final = 4
_CORE: Final = struct.Struct('<HBBBHHbbBBBB')
_CIRCLING_MM: Final = 1
_STRAIGHT_RAD_S: Final = 1e-4
_STANDING_M_S: Final = 1e-4
_LIMIT: Final = 32767


class KobukiFrame(NamedTuple):
    """
    One packet.

    :ivar parts: data of its parts by identifier.
    :ivar size: bytes of the whole packet.
    :ivar end: index just after its last byte in the chunk that completed it.
    """

    parts: Mapping[int, bytes]
    size: int
    end: int


class CoreSensors(NamedTuple):
    """
    The core data of each packet of a base.

    :ivar time_ms: clock of the base, 16 bits.
    :ivar bumper: 1 right, 2 centre, 4 left.
    :ivar wheel_drop: 1 right, 2 left.
    :ivar cliff: 1 right, 2 centre, 4 left.
    :ivar left: ticks, 16 bits that wrap, as ``right``.
    :ivar left_duty: -127 to 127, as ``right_duty``.
    :ivar buttons: 1, 2, 4.
    :ivar charger: 0 discharging, 2 charged, 6 charging; plus 16 at the adapter instead of the
        dock.
    :ivar battery: in 0.1 V.
    :ivar overcurrent: 1 left, 2 right.
    """

    time_ms: int
    bumper: int
    wheel_drop: int
    cliff: int
    left: int
    right: int
    left_duty: int
    right_duty: int
    buttons: int
    charger: int
    battery: int
    overcurrent: int


class KobukiDecoder(FrameDecoder[KobukiFrame]):
    """
    Find the packets in a stream of bytes; safe in the loop, keeps less than 164 bytes.

    The checksum has only eight bits, so the parts must also fill the payload exactly.
    """

    STARTS = _PREAMBLE[:1]
    SHORTEST = _AROUND + _SHORTEST_PAYLOAD
    LONGEST = _AROUND + _LONGEST_PAYLOAD
    # No part is empty, and the first fits into the payload.
    PATTERN = rb'\xaa(?:\x55(?:[\x%02x-\x%02x]|\Z)|\Z)' % (_SHORTEST_PAYLOAD, _LONGEST_PAYLOAD)

    def end(self, buffer: bytes, at: int) -> int:
        """Return where a packet ends, 0 if none begins here."""
        length = buffer[at + 2]
        if buffer[at + 1] != _PREAMBLE[1] or not _SHORTEST_PAYLOAD <= length <= _LONGEST_PAYLOAD:
            return 0
        # The first part must fit, which rejects most false starts.
        if not 0 < buffer[at + 4] <= length - 2:
            return 0
        return at + length + _AROUND

    def frame(self, buffer: bytes, at: int, end: int, arrived: int) -> KobukiFrame | None:
        """Decode a packet with a valid checksum, filled by its parts."""
        begin, stop = at + 3, end - 1
        parts: dict[int, bytes] = {}
        while begin + 2 < stop:
            data = begin + 2
            after = data + buffer[begin + 1]
            if not data < after <= stop:
                return None
            parts[buffer[begin]] = buffer[data:after]
            begin = after
        if begin != stop or checksum(buffer[at + 2:stop]) != buffer[stop]:
            return None
        return KobukiFrame(MappingProxyType(parts), end - at, arrived)


def checksum(content: bytes) -> int:
    """Return the XOR of some bytes."""
    return reduce(xor, content, 0)


def is_kobuki(data: bytes) -> bool:
    """Return whether some bytes are of two packets with core data."""
    return sum(core_of(frame) is not None for frame in KobukiDecoder().feed(data)) > 1


# ---- what the base sends ------------------------------------------------------------------------

def core_of(frame: KobukiFrame) -> CoreSensors | None:
    """Decode the core data; None if the packet has none."""
    data = frame.parts.get(CORE, b'')
    return CoreSensors(*_CORE.unpack(data)) if len(data) == _CORE.size else None


def heading(data: bytes) -> tuple[float, float] | None:
    """Decode the part ``INERTIA``: heading in rad and its rate in rad/s; None if it is short."""
    if len(data) < 4:
        return None
    angle, rate = struct.unpack_from('<hh', data)
    return angle * HEADING_RAD, rate * HEADING_RAD


def angular_velocities(data: bytes) -> list[tuple[float, float, float]]:
    """
    Decode the part ``GYRO``: some measurements, the oldest first, in rad/s.

    The chip is mounted a quarter of a turn off; the result is in the axes of REP 103.
    """
    count = min(data[1] // 3, (len(data) - 2) // 6) if len(data) > 2 else 0
    raw = struct.unpack_from(f'<{3 * count}h', data, 2) if count else ()
    return [(-raw[i + 1] * GYRO_RAD_S, raw[i] * GYRO_RAD_S, raw[i + 2] * GYRO_RAD_S)
            for i in range(0, 3 * count, 3)]


def version(data: bytes) -> str:
    """Decode the parts ``HARDWARE`` and ``FIRMWARE``, such as 1.2.0; empty if short."""
    return f'{data[2]}.{data[1]}.{data[0]}' if len(data) >= 3 else ''


# ---- commands and packets -----------------------------------------------------------------------

def packet(parts: Iterable[tuple[int, bytes]]) -> bytes:
    """Encode a packet of parts, each of identifier and data."""
    payload = b''.join(bytes((part, len(data))) + data for part, data in parts)
    content = bytes((len(payload),)) + payload
    return _PREAMBLE + content + bytes((checksum(content),))


def base_control(linear_m_s: float, angular_rad_s: float) -> tuple[int, int]:
    """
    Return speed in mm/s and radius in mm of the command for a velocity.

    The base expects the speed of its outer wheel and the radius of the arc; radius 0 is straight
    on, 1 turns on the spot. Both are truncated, as in the base's own driver.
    """
    if abs(angular_rad_s) < _STRAIGHT_RAD_S:
        return _short(1000 * linear_m_s), 0
    radius = 1000 * linear_m_s / angular_rad_s
    half = 1000 * SEPARATION_M / 2
    if abs(radius) > 2 * _LIMIT:
        # Closer to a straight line than the widest possible arc.
        return _short(1000 * linear_m_s), 0
    if abs(linear_m_s) < _STANDING_M_S or abs(radius) <= _CIRCLING_MM:
        return _short(half * angular_rad_s), _CIRCLING_MM
    return _short((radius + math.copysign(half, radius)) * angular_rad_s), _short(radius)


def velocity_command(linear_m_s: float, angular_rad_s: float) -> bytes:
    """Encode the command for a velocity; both numbers are finite."""
    return packet([(BASE_CONTROL, struct.pack('<hh', *base_control(linear_m_s, angular_rad_s)))])


def velocity_of(speed_mm_s: int, radius_mm: int) -> tuple[float, float]:
    """Return the velocity, in m/s and rad/s, at which the base executes a command."""
    half = 1000 * SEPARATION_M / 2
    if radius_mm == 0:
        return speed_mm_s / 1000, 0.0
    if abs(radius_mm) == _CIRCLING_MM:
        return 0.0, speed_mm_s / half * (1 if radius_mm > 0 else -1)
    angular = speed_mm_s / (radius_mm + math.copysign(half, radius_mm))
    return radius_mm * angular / 1000, angular


def request_extra() -> bytes:
    """Encode the request for versions and the unique identifier."""
    return packet([(REQUEST_EXTRA, struct.pack('<H', ALL_EXTRA))])


def outputs(flags: int) -> bytes:
    """Encode the command for the outputs: pins 0x00F, powers 0x0F0, lights 0xF00."""
    return packet([(OUTPUTS, struct.pack('<H', flags & 0xFFFF))])


def sound(number: int) -> bytes:
    """Encode the command for one of the seven sounds: 0 on, 1 off, 4 error, ..."""
    return packet([(SOUND_SEQUENCE, bytes((number & 0xFF,)))])


def core(values: CoreSensors) -> tuple[int, bytes]:
    """Encode the part with core data."""
    return CORE, _CORE.pack(*values)


def inertia(heading_rad: float, rate_rad_s: float) -> tuple[int, bytes]:
    """Encode the part with heading and rate."""
    return INERTIA, struct.pack('<hh3x', _wrapped(heading_rad / HEADING_RAD),
                                _short(rate_rad_s / HEADING_RAD))


def gyro(number: int, rates_rad_s: Iterable[tuple[float, float, float]]) -> tuple[int, bytes]:
    """Encode the part with the gyroscope's measurements, given in the axes of REP 103."""
    raw = [_short(value / GYRO_RAD_S) for x, y, z in rates_rad_s for value in (y, -x, z)]
    return GYRO, struct.pack(f'<BB{len(raw)}h', number & 0xFF, len(raw), *raw)


def _short(value: float) -> int:
    """Limit to 16 bits, without wrapping."""
    return int(min(max(value, -_LIMIT), _LIMIT))


def _wrapped(value: float) -> int:
    """Wrap an angle in hundredths of a degree to half a turn in either direction."""
    return round(value + 18000) % 36000 - 18000
