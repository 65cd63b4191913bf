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

"""MS5611: commands, the checksum of its PROM, and pressure and temperature from raw readings."""

from __future__ import annotations

import struct
from typing import Final

RESET: Final = 0x1E
PROM: Final = 0xA0
PROM_WORDS: Final = 8
READ: Final = 0x00
CONVERT_PRESSURE: Final = 0x40
CONVERT_TEMPERATURE: Final = 0x50

START_UP_NS: Final = 3_000_000
# Oversampling -> offset of the command, and the longest conversion.
OVERSAMPLING: Final = {
    256: (0, 600_000), 512: (2, 1_170_000), 1024: (4, 2_280_000), 2048: (6, 4_540_000),
    4096: (8, 9_040_000)}

_WORDS: Final = struct.Struct('>8H')

Words = tuple[int, ...]


def words(data: bytes) -> Words:
    """Unpack the 16 bytes of the PROM."""
    return _WORDS.unpack(data)


def crc4(prom: Words) -> int:
    """Compute the checksum of the eight words, as in the maker's note AN520."""
    remainder = 0
    for byte in _WORDS.pack(*prom[:7], prom[7] & 0xFF00):
        remainder ^= byte
        for _ in range(8):
            remainder = (remainder << 1 ^ (0x3000 if remainder & 0x8000 else 0)) & 0xFFFF
    return remainder >> 12


def valid(prom: Words) -> bool:
    """Return whether the PROM is valid; a blank one is not."""
    return prom[7] & 0xF == crc4(prom) and any(prom[1:7])


def compensate(prom: Words, raw_p: int, raw_t: int) -> tuple[float, float]:
    """
    Compute with the second-order correction for low temperatures; safe in the loop.

    :param prom: the eight words.
    :return: pressure in Pa and temperature in degrees C.
    """
    _, c1, c2, c3, c4, c5, c6, _ = prom
    d = raw_t - c5 * 256.0
    t = 2000.0 + d * c6 / 8388608.0
    offset = c2 * 65536.0 + c4 * d / 128.0
    sensitivity = c1 * 32768.0 + c3 * d / 256.0
    if t < 2000.0:
        cold = (t - 2000.0) * (t - 2000.0)
        more_offset, more_sensitivity = 2.5 * cold, 1.25 * cold
        if t < -1500.0:
            colder = (t + 1500.0) * (t + 1500.0)
            more_offset += 7.0 * colder
            more_sensitivity += 5.5 * colder
        t -= d * d / 2147483648.0
        offset -= more_offset
        sensitivity -= more_sensitivity
    return (raw_p * sensitivity / 2097152.0 - offset) / 32768.0, t / 100.0


def compensate_int(prom: Words, raw_p: int, raw_t: int) -> tuple[int, int]:
    """
    Compute in integers, as the data sheet does.

    :return: pressure in Pa (1/100 mbar) and temperature in 1/100 degrees C.
    """
    _, c1, c2, c3, c4, c5, c6, _ = prom
    d = raw_t - (c5 << 8)
    t = 2000 + (d * c6 >> 23)
    offset = (c2 << 16) + (c4 * d >> 7)
    sensitivity = (c1 << 15) + (c3 * d >> 8)
    if t < 2000:
        t2 = d * d >> 31
        offset2 = 5 * (t - 2000) ** 2 >> 1
        sensitivity2 = 5 * (t - 2000) ** 2 >> 2
        if t < -1500:
            offset2 += 7 * (t + 1500) ** 2
            sensitivity2 += 11 * (t + 1500) ** 2 >> 1
        t, offset, sensitivity = t - t2, offset - offset2, sensitivity - sensitivity2
    return ((raw_p * sensitivity >> 21) - offset) >> 15, t
