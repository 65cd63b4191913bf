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

from collections.abc import Mapping
from datetime import datetime
import struct
from typing import Final
from typing import NamedTuple

from rt_robot_os.drivers.decoders.ubx import ACK
from rt_robot_os.drivers.decoders.ubx import CFG
from rt_robot_os.drivers.decoders.ubx import fletcher
from rt_robot_os.drivers.decoders.ubx import HPPOSLLH
from rt_robot_os.drivers.decoders.ubx import NAV
from rt_robot_os.drivers.decoders.ubx import PVT
from rt_robot_os.drivers.decoders.ubx import SYNC

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

_HPPOSLLH: Final = struct.Struct('<B2xBI4i4b2I')
_PVT: Final = struct.Struct('<IH6BIi4B4i2I5i2I2H4xihH')
_WEEK_MS: Final = 7 * 86_400_000
_GPS_EPOCH_S: Final = 315_964_800
_LEAP_S: Final = 18


def message(kind: int, identifier: int, payload: bytes = b'') -> bytes:
    """Make a message."""
    content = bytes((kind, identifier)) + struct.pack('<H', len(payload)) + payload
    return SYNC + content + fletcher(content)


def enable(identifier: int) -> bytes:
    """Ask for a message of class NAV with each solution, on the port that this is sent to."""
    return message(CFG, CFG_MSG, bytes((NAV, identifier, 1)))


def valset(values: Mapping[int, int], layers: int = LAYER_RAM) -> bytes:
    """Set values by their keys; one that the receiver does not know makes it refuse all."""
    return message(CFG, CFG_VALSET, bytes((0, layers, 0, 0)) + b''.join(
        key.to_bytes(4, 'little') + value.to_bytes(_VALUE_BYTES[key >> 28 & 7], 'little')
        for key, value in values.items()))


def parse_valset(payload: bytes) -> dict[int, int] | None:
    """Take a CFG-VALSET apart; None when it is none."""
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
    tow_ms = time_of_week_ms(time)
    height_mm = round(height_m * 1000)
    return message(NAV, PVT, _PVT.pack(
        tow_ms, time.year, time.month, time.day, time.hour, time.minute, time.second, valid,
        50, time.microsecond * 1000 if nano is None else nano, fix_type, flags, 0, satellites,
        round(longitude_deg * 1e7), round(latitude_deg * 1e7), height_mm,
        height_mm - round(separation_m * 1000), round(horizontal_m * 1000),
        round(vertical_m * 1000), north, east, -up, round((north ** 2 + east ** 2) ** 0.5), 0,
        round(speed_accuracy_m_s * 1000), 0, 150, flags3, 0, 0, 0))


def nav_hpposllh(
    time: datetime, latitude_deg: float, longitude_deg: float, height_m: float, *,
    separation_m: float = 0.0, horizontal_m: float = 0.014, vertical_m: float = 0.021,
    invalid: bool = False,
) -> bytes:
    """
    Make the position with nine decimals of a degree and a tenth of a millimetre.

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
    """Give the time of the GPS week."""
    return (round(time.timestamp() * 1000) + (_LEAP_S - _GPS_EPOCH_S) * 1000) % _WEEK_MS


def _split(value: float, parts: int = 100) -> tuple[int, int]:
    """Give the whole part and the rest, which has the same sign."""
    whole = round(value)
    rest = whole - int(whole / parts) * parts
    return (whole - rest) // parts, rest
