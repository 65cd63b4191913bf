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

"""InvenSense MPU-6050, MPU-6500 and MPU-9250: registers, and the frames of the FIFO."""

from __future__ import annotations

from dataclasses import dataclass
import struct
from typing import Final

RATE_DIVIDER: Final = 0x19
CONFIG: Final = 0x1A
GYRO_CONFIG: Final = 0x1B
ACCEL_CONFIG: Final = 0x1C
ACCEL_CONFIG_2: Final = 0x1D
FIFO_ENABLE: Final = 0x23
DATA: Final = 0x3B
USER_CONTROL: Final = 0x6A
POWER: Final = 0x6B
FIFO_COUNT: Final = 0x72
FIFO: Final = 0x74
WHO_AM_I: Final = 0x75

POWER_RESET: Final = 0x80
POWER_SLEEP: Final = 0x40
# Clock from the PLL of the gyroscope: 1 % error; the internal one has 5 %.
POWER_ON: Final = 0x01
FIFO_ALL: Final = 0xF8
USER_FIFO: Final = 0x40
USER_FIFO_RESET: Final = 0x04

RESET_NS: Final = 100_000_000
# Start-up time of the gyroscope.
WAKE_NS: Final = 35_000_000
BASE_RATE_HZ: Final = 1000
DIVIDER_MAXIMUM: Final = 255

FRAME_SIZE: Final = 14
FULL_SCALE: Final = 32768.0
GYRO_RANGES_DEG_S: Final = {250: 0, 500: 1, 1000: 2, 2000: 3}
ACCEL_RANGES_G: Final = {2: 0, 4: 1, 8: 2, 16: 3}
# Bandwidth of the digital low-pass filter: that of the gyroscope, rounded as commonly stated.
BANDWIDTHS_HZ: Final = {188: 1, 98: 2, 42: 3, 20: 4, 10: 5, 5: 6}

_FRAME: Final = struct.Struct('>7h')
Frame = tuple[int, int, int, int, int, int, int]


@dataclass(frozen=True)
class Model:
    """
    The differences between the models.

    :ivar fifo_size: bytes.
    :ivar temperature_scale: counts a degree.
    :ivar temperature_zero_c: temperature of count 0.
    :ivar accel_filter: the accelerometer has a filter register of its own.
    """

    name: str
    fifo_size: int
    temperature_scale: float
    temperature_zero_c: float
    accel_filter: bool


MODELS: Final = {
    0x68: Model('MPU-6050', 1024, 340.0, 36.53, False),
    0x70: Model('MPU-6500', 512, 333.87, 21.0, True),
    0x71: Model('MPU-9250', 512, 333.87, 21.0, True),
}
CHIPS: Final = {WHO_AM_I: {value: model.name for value, model in MODELS.items()}}


def frames(data: bytes) -> list[Frame]:
    """
    Unpack whole frames; safe in the loop.

    :param data: of the FIFO, or the 14 bytes from register 0x3B.
    :return: acceleration x y z, temperature, angular velocity x y z, in counts.
    """
    return [
        _FRAME.unpack_from(data, at) for at in range(0, len(data) - FRAME_SIZE + 1, FRAME_SIZE)]


def pack(frame: Frame) -> bytes:
    """Return the bytes of a frame."""
    return _FRAME.pack(*frame)
