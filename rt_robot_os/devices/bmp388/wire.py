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

"""Bosch BMP388 and BMP390: registers, and pressure and temperature from raw readings."""

from __future__ import annotations

import struct
from typing import Final
from typing import NamedTuple

CHIP_IDS: Final = {0x50: 'BMP388', 0x60: 'BMP390'}
RESET_VALUE: Final = 0xB6

ID: Final = 0x00
ERROR: Final = 0x02
STATUS: Final = 0x03
DATA: Final = 0x04
EVENT: Final = 0x10
POWER: Final = 0x1B
OVERSAMPLING_REGISTER: Final = 0x1C
RATE: Final = 0x1D
CONFIG: Final = 0x1F
CALIBRATION: Final = 0x31
CALIBRATION_SIZE: Final = 21
COMMAND: Final = 0x7E
CHIPS: Final = {ID: CHIP_IDS}

# One read from the status (3) to the event register (0x10).
BURST_SIZE: Final = 14
STATUS_READY: Final = 0x60
EVENT_POWER_ON: Final = 0x01
ERROR_CONFIG: Final = 0x04
# Pressure and temperature on, normal mode.
POWER_NORMAL: Final = 0x33

START_UP_NS: Final = 3_000_000
OVERSAMPLING: Final = {1: 0, 2: 1, 4: 2, 8: 3, 16: 4, 32: 5}
FILTER: Final = {0: 0, 1: 1, 3: 2, 7: 3, 15: 4, 31: 5, 63: 6, 127: 7}
# Rates of the normal mode and their field.
RATES_HZ: Final = {200.0: 0, 100.0: 1, 50.0: 2, 25.0: 3, 12.5: 4, 6.25: 5, 3.125: 6, 1.5625: 7}

_TRIMMING: Final = struct.Struct('<HHbhhbbHHbbhbb')
_FACTORS: Final = (2.0**8, 2.0**-30, 2.0**-48, 2.0**-20, 2.0**-29, 2.0**-32, 2.0**-37, 2.0**3,
                   2.0**-6, 2.0**-8, 2.0**-15, 2.0**-48, 2.0**-48, 2.0**-65)


class Bmp388Trimming(NamedTuple):
    """The factory trimming of one chip, as stored."""

    t1: int
    t2: int
    t3: int
    p1: int
    p2: int
    p3: int
    p4: int
    p5: int
    p6: int
    p7: int
    p8: int
    p9: int
    p10: int
    p11: int

    @classmethod
    def unpack(cls, data: bytes) -> Bmp388Trimming | None:
        """
        Read the trimming.

        :param data: the 21 bytes from register 0x31.
        :return: None if no valid chip can hold these values.
        """
        found = cls(*_TRIMMING.unpack(data))
        blank = not any(data) or set(data) == {0xFF}
        return None if blank or not found.t1 or not found.t2 else found

    def pack(self) -> bytes:
        """Return the bytes of the registers."""
        return _TRIMMING.pack(*self)

    def scaled(self) -> Scaled:
        """Return the coefficients for the formulas."""
        offsets = (0, 0, 0, 1 << 14, 1 << 14, 0, 0, 0, 0, 0, 0, 0, 0, 0)
        return tuple((value - offset) * factor
                     for value, offset, factor in zip(self, offsets, _FACTORS))


Scaled = tuple[float, ...]


def conversion_ns(oversampling_temperature: int, oversampling_pressure: int) -> int:
    """Return the longest time of a conversion."""
    return 234_000 + 392_000 + 2_020_000 * oversampling_pressure + (
        163_000 + 2_020_000 * oversampling_temperature)


def raw(data: bytes) -> tuple[int, int]:
    """
    Unpack the readings.

    :param data: the six bytes from register 4.
    :return: raw pressure and raw temperature, 24 bit.
    """
    return (data[0] | data[1] << 8 | data[2] << 16, data[3] | data[4] << 8 | data[5] << 16)


def compensate(scaled: Scaled, raw_p: int, raw_t: int) -> tuple[float, float]:
    """
    Compute pressure and temperature; safe in the loop, raises nothing.

    :param scaled: from :meth:`Bmp388Trimming.scaled`.
    :return: pressure in Pa and temperature in degrees C.
    """
    t1, t2, t3, p1, p2, p3, p4, p5, p6, p7, p8, p9, p10, p11 = scaled
    d = raw_t - t1
    t = d * t2 + d * d * t3
    square = float(raw_p) * raw_p
    pressure = (p5 + t * (p6 + t * (p7 + t * p8))
                + raw_p * (p1 + t * (p2 + t * (p3 + t * p4)))
                + square * (p9 + p10 * t) + square * raw_p * p11)
    return pressure, t
