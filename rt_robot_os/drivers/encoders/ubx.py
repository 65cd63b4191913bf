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


"""UBX messages: commands to u-blox receivers, and what simulated ones send."""

from __future__ import annotations

from datetime import datetime
import struct
from typing import Final

from rt_robot_os.drivers.decoders.ubx import ACK
from rt_robot_os.drivers.decoders.ubx import CFG
from rt_robot_os.drivers.decoders.ubx import fletcher
from rt_robot_os.drivers.decoders.ubx import NAV
from rt_robot_os.drivers.decoders.ubx import PVT
from rt_robot_os.drivers.decoders.ubx import SYNC

CFG_MSG: Final = 0x01
CFG_RATE: Final = 0x08
ACK_NAK: Final = 0x00
ACK_ACK: Final = 0x01

_PVT: Final = struct.Struct('<IH6BIi4B4i2I5i2I2H4xihH')
_WEEK_MS: Final = 7 * 86_400_000
_GPS_EPOCH_S: Final = 315_964_800
_LEAP_S: Final = 18


def message(kind: int, identifier: int, payload: bytes = b'') -> bytes:
    """Make a message."""
    content = bytes((kind, identifier)) + struct.pack('<H', len(payload)) + payload
    return SYNC + content + fletcher(content)


def enable_nav_pvt() -> bytes:
    """Ask for NAV-PVT with each solution, on the port that this is sent to."""
    return message(CFG, CFG_MSG, bytes((NAV, PVT, 1)))


def set_rate(rate_hz: float) -> bytes:
    """Set the measurements a second, with one solution each, aligned to UTC."""
    return message(CFG, CFG_RATE, struct.pack('<HHH', round(1000 / rate_hz), 1, 0))


def acknowledge(kind: int, identifier: int, *, done: bool = True) -> bytes:
    """Answer a command."""
    return message(ACK, ACK_ACK if done else ACK_NAK, bytes((kind, identifier)))


def nav_pvt(
    time: datetime, latitude_deg: float, longitude_deg: float, height_m: float, *,
    separation_m: float = 0.0, fix_type: int = 3, flags: int = 0x01, valid: int = 0x07,
    satellites: int = 12, horizontal_m: float = 1.5, vertical_m: float = 2.5,
    velocity_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0), speed_accuracy_m_s: float = 0.1,
    nano: int | None = None, flags3: int = 0,
) -> bytes:
    """
    Make position, velocity and time.

    :param time: UTC.
    :param height_m: above the ellipsoid.
    :param separation_m: of the geoid above the ellipsoid.
    :param velocity_m_s: east, north, up.
    :param nano: of the second; that of ``time`` when None. The receiver's may be negative.
    """
    east, north, up = (round(v * 1000) for v in velocity_m_s)
    tow_ms = (round(time.timestamp() * 1000) + (_LEAP_S - _GPS_EPOCH_S) * 1000) % _WEEK_MS
    height_mm = round(height_m * 1000)
    return message(NAV, PVT, _PVT.pack(
        tow_ms, time.year, time.month, time.day, time.hour, time.minute, time.second, valid,
        50, time.microsecond * 1000 if nano is None else nano, fix_type, flags, 0, satellites,
        round(longitude_deg * 1e7), round(latitude_deg * 1e7), height_mm,
        height_mm - round(separation_m * 1000), round(horizontal_m * 1000),
        round(vertical_m * 1000), north, east, -up, round((north ** 2 + east ** 2) ** 0.5), 0,
        round(speed_accuracy_m_s * 1000), 0, 150, flags3, 0, 0, 0))
