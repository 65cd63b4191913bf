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
Bosch BMP280: registers, and pressure and temperature from raw readings.

The data sheet gives the compensation twice, in 64-bit integers and in floating point. The driver
uses the second, which keeps fractions of 0.01 degrees; :func:`compensate_int64` is the first, bit
for bit, and tests compare the two.
"""

from __future__ import annotations

import struct
from typing import Final
from typing import NamedTuple

CHIP_ID: Final = 0x58
RESET_VALUE: Final = 0xB6

CALIBRATION: Final = 0x88
CALIBRATION_SIZE: Final = 24
ID: Final = 0xD0
RESET: Final = 0xE0
STATUS: Final = 0xF3
CONTROL: Final = 0xF4
CONFIG: Final = 0xF5
DATA: Final = 0xF7
CHIPS: Final = {ID: {CHIP_ID: 'BMP280', 0x56: 'BMP280 (sample)', 0x57: 'BMP280 (sample)'}}

# One read from the status to the end of the data.
BURST_SIZE: Final = 10
STATUS_UPDATING: Final = 0x01
STATUS_MEASURING: Final = 0x08
SLEEP: Final = 0
FORCED: Final = 1
NORMAL: Final = 3

START_UP_NS: Final = 2_000_000
# Value of the oversampling fields, and of the filter field.
OVERSAMPLING: Final = {1: 1, 2: 2, 4: 3, 8: 4, 16: 5}
FILTER: Final = {0: 0, 2: 1, 4: 2, 8: 3, 16: 4}
# Standby between two conversions of the normal mode, and its field.
STANDBY_NS: Final = {
    500_000: 0, 62_500_000: 1, 125_000_000: 2, 250_000_000: 3, 500_000_000: 4, 1_000_000_000: 5,
    2_000_000_000: 6, 4_000_000_000: 7}

_TRIMMING: Final = struct.Struct('<HhhHhhhhhhhh')


class Bmp280Trimming(NamedTuple):
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

    @classmethod
    def unpack(cls, data: bytes) -> Bmp280Trimming | None:
        """
        Read the trimming.

        :param data: the 24 bytes from register 0x88.
        :return: None if no valid chip can hold these values.
        """
        found = cls(*_TRIMMING.unpack(data))
        blank = not any(data) or set(data) == {0xFF}
        return None if blank or not found.t1 or not found.p1 else found

    def pack(self) -> bytes:
        """Return the bytes of the registers."""
        return _TRIMMING.pack(*self)


def conversion_ns(oversampling_temperature: int, oversampling_pressure: int) -> int:
    """Return the longest time of a conversion."""
    return 1_250_000 + 2_300_000 * oversampling_temperature + (
        2_300_000 * oversampling_pressure + 575_000)


def raw(data: bytes) -> tuple[int, int]:
    """
    Unpack the readings.

    :param data: the six bytes from register 0xF7.
    :return: raw pressure and raw temperature, 20 bit.
    """
    return (data[0] << 12 | data[1] << 4 | data[2] >> 4,
            data[3] << 12 | data[4] << 4 | data[5] >> 4)


def compensate(trim: Bmp280Trimming, raw_p: int, raw_t: int) -> tuple[float, float]:
    """
    Compute in floating point; safe in the loop, raises nothing.

    :return: pressure in Pa and temperature in degrees C; pressure 0 if it cannot be computed.
    """
    t1, t2, t3, p1, p2, p3, p4, p5, p6, p7, p8, p9 = trim
    fine = (raw_t / 16384.0 - t1 / 1024.0) * t2
    part = raw_t / 131072.0 - t1 / 8192.0
    fine += part * part * t3
    v1 = fine / 2.0 - 64000.0
    v2 = v1 * v1 * p6 / 32768.0 + v1 * p5 * 2.0
    v2 = v2 / 4.0 + p4 * 65536.0
    v1 = (p3 * v1 * v1 / 524288.0 + p2 * v1) / 524288.0
    v1 = (1.0 + v1 / 32768.0) * p1
    if v1 <= 0.0:
        return 0.0, fine / 5120.0
    p = (1048576.0 - raw_p - v2 / 4096.0) * 6250.0 / v1
    p += (p9 * p * p / 2147483648.0 + p * p8 / 32768.0 + p7) / 16.0
    return p, fine / 5120.0


def compensate_int64(trim: Bmp280Trimming, raw_p: int, raw_t: int) -> tuple[int, int, int]:
    """
    Compute in integers, as the data sheet does in 64 bit.

    :return: pressure in 1/256 Pa, temperature in 1/100 degrees C, and the data sheet's ``t_fine``.
    """
    t1, t2, t3, p1, p2, p3, p4, p5, p6, p7, p8, p9 = trim
    v1 = (((raw_t >> 3) - (t1 << 1)) * t2) >> 11
    part = (raw_t >> 4) - t1
    v2 = (((part * part) >> 12) * t3) >> 14
    fine = v1 + v2
    temperature = (fine * 5 + 128) >> 8
    v1 = fine - 128000
    v2 = v1 * v1 * p6
    v2 += (v1 * p5) << 17
    v2 += p4 << 35
    v1 = ((v1 * v1 * p3) >> 8) + ((v1 * p2) << 12)
    v1 = (((1 << 47) + v1) * p1) >> 33
    if v1 == 0:
        return 0, temperature, fine
    # C rounds a quotient towards zero, Python down.
    dividend = (((1048576 - raw_p) << 31) - v2) * 3125
    p = abs(dividend) // abs(v1) * (1 if (dividend < 0) == (v1 < 0) else -1)
    v1 = (p9 * (p >> 13) * (p >> 13)) >> 25
    v2 = (p8 * p) >> 19
    return ((p + v1 + v2) >> 8) + (p7 << 4), temperature, fine
