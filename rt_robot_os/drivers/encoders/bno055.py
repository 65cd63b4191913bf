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


"""Requests to a BNO055 over its UART, and its answers for simulated ones and tests."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from rt_robot_os.drivers.decoders.bno055 import BLOCK
from rt_robot_os.drivers.decoders.bno055 import DATA
from rt_robot_os.drivers.decoders.bno055 import STATUS
from rt_robot_os.units import STANDARD_GRAVITY_M_S2

START: Final = 0xAA
WRITE: Final = 0x00
READ: Final = 0x01

REGISTER_CHIP_ID: Final = 0x00
REGISTER_PAGE: Final = 0x07
REGISTER_UNITS: Final = 0x3B
REGISTER_MODE: Final = 0x3D
REGISTER_POWER: Final = 0x3E
REGISTER_TRIGGER: Final = 0x3F

CHIP_ID: Final = 0xA0
MODE_CONFIG: Final = 0x00
MODE_IMU: Final = 0x08
MODE_NDOF: Final = 0x0C
# m/s^2, degrees a second, degrees, Celsius; angles as Android has them.
UNITS_SI: Final = 0x80
EXTERNAL_CRYSTAL: Final = 0x80

ACCELERATION_LSB: Final = 100.0
FIELD_LSB_PER_T: Final = 16e6
RATE_LSB_PER_DEG: Final = 16.0
QUATERNION_LSB: Final = 1 << 14

Vector = Sequence[float]


def read_request(register: int, size: int) -> bytes:
    """Ask for registers."""
    return bytes((START, READ, register, size))


def write_request(register: int, data: bytes) -> bytes:
    """Set registers."""
    return bytes((START, WRITE, register, len(data))) + data


def data_answer(data: bytes) -> bytes:
    """Answer a read."""
    return bytes((DATA, len(data))) + data


def status_answer(status: int) -> bytes:
    """Answer a write, or refuse."""
    return bytes((STATUS, status))


def block(
    acceleration: Vector, field_t: Vector, rate_deg_s: Vector, quaternion: Vector,
    gravity: Vector = (0.0, 0.0, STANDARD_GRAVITY_M_S2), *, temperature_c: int = 25,
    calibration: int = 0xFF,
) -> bytes:
    """
    Make the registers from acceleration to calibration status; angles are left 0.

    :param quaternion: w, x, y, z; zeros before fusion begins.
    :param calibration: two bits each: system, gyroscope, accelerometer, magnetometer.
    """
    linear = [a - g for a, g in zip(acceleration, gravity)]
    counts = [v * ACCELERATION_LSB for v in acceleration] + [v * FIELD_LSB_PER_T for v in field_t]
    counts += [v * RATE_LSB_PER_DEG for v in rate_deg_s] + [0.0, 0.0, 0.0]
    counts += [v * QUATERNION_LSB for v in quaternion]
    counts += [v * ACCELERATION_LSB for v in (*linear, *gravity)]
    limited = [min(max(round(c), -32768), 32767) for c in counts]
    return BLOCK.pack(*limited, temperature_c, calibration)
