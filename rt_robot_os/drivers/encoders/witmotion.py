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
WitMotion frames and commands from physical values.

The driver sends the commands; simulated devices and tests make the frames.
"""

from __future__ import annotations

import math
import struct
from typing import Final

from rt_robot_os.drivers.decoders.witmotion import ACCELERATION
from rt_robot_os.drivers.decoders.witmotion import ACCELERATION_RANGE_G
from rt_robot_os.drivers.decoders.witmotion import ANGLE
from rt_robot_os.drivers.decoders.witmotion import ANGLE_RANGE_DEG
from rt_robot_os.drivers.decoders.witmotion import ANGULAR_VELOCITY
from rt_robot_os.drivers.decoders.witmotion import ANGULAR_VELOCITY_RANGE_DEG_S
from rt_robot_os.drivers.decoders.witmotion import FULL_SCALE
from rt_robot_os.drivers.decoders.witmotion import HEADER
from rt_robot_os.drivers.decoders.witmotion import MAGNETIC_FIELD
from rt_robot_os.drivers.decoders.witmotion import QUATERNION
from rt_robot_os.units import STANDARD_GRAVITY_M_S2

REGISTER_OUTPUTS: Final = 0x02
REGISTER_RATE: Final = 0x03
UNLOCK: Final = bytes((0xFF, 0xAA, 0x69, 0x88, 0xB5))
COMMAND_SIZE: Final = 5

# Value of the rate register for each rate that the device knows.
RATES_HZ: Final = {
    0.1: 0x1, 0.5: 0x2, 1.0: 0x3, 2.0: 0x4, 5.0: 0x5, 10.0: 0x6, 20.0: 0x7, 50.0: 0x8, 100.0: 0x9,
    125.0: 0xA, 200.0: 0xB,
}

_ACCELERATION_SCALE: Final = FULL_SCALE / (ACCELERATION_RANGE_G * STANDARD_GRAVITY_M_S2)
_ANGULAR_VELOCITY_SCALE: Final = FULL_SCALE / math.radians(ANGULAR_VELOCITY_RANGE_DEG_S)
_ANGLE_SCALE: Final = FULL_SCALE / math.radians(ANGLE_RANGE_DEG)


def frame(kind: int, first: int, second: int, third: int, fourth: int) -> bytes:
    """Make a frame of four int16; values beyond the range are limited to it."""
    limited = [min(max(v, -32768), 32767) for v in (first, second, third, fourth)]
    content = struct.pack('<BB4h', HEADER, kind, *limited)
    return content + bytes((sum(content) & 0xFF,))


def acceleration_frame(x: float, y: float, z: float, temperature_c: float = 25.0) -> bytes:
    """Make frame 0x51 from the specific force in m/s^2, along the device's axes."""
    scale = _ACCELERATION_SCALE
    return frame(ACCELERATION, round(x * scale), round(y * scale), round(z * scale),
                 round(temperature_c * 100))


def angular_velocity_frame(x: float, y: float, z: float, temperature_c: float = 25.0) -> bytes:
    """Make frame 0x52 from rad/s about the device's axes."""
    scale = _ANGULAR_VELOCITY_SCALE
    return frame(ANGULAR_VELOCITY, round(x * scale), round(y * scale), round(z * scale),
                 round(temperature_c * 100))


def angle_frame(roll: float, pitch: float, yaw: float, temperature_c: float = 25.0) -> bytes:
    """Make frame 0x53 from rad, each from -pi to pi; turned in the order yaw, pitch, roll."""
    scale = _ANGLE_SCALE
    return frame(ANGLE, round(roll * scale), round(pitch * scale), round(yaw * scale),
                 round(temperature_c * 100))


def magnetic_field_frame(
    x: float, y: float, z: float, scale_t: float, temperature_c: float = 25.0,
) -> bytes:
    """
    Make frame 0x54.

    :param x: field in tesla, as ``y`` and ``z``.
    :param scale_t: tesla a count.
    """
    return frame(MAGNETIC_FIELD, round(x / scale_t), round(y / scale_t), round(z / scale_t),
                 round(temperature_c * 100))


def quaternion_frame(w: float, x: float, y: float, z: float) -> bytes:
    """Make frame 0x59 in the manual's order, w first."""
    return frame(QUATERNION, round(w * FULL_SCALE), round(x * FULL_SCALE), round(y * FULL_SCALE),
                 round(z * FULL_SCALE))


def command(register: int, value: int) -> bytes:
    """Make the command that sets a register; the device obeys it only after ``UNLOCK``."""
    return bytes((0xFF, 0xAA, register)) + struct.pack('<H', value)


def output_mask(kinds: tuple[int, ...]) -> int:
    """Give the value of the output register for frames with these IDs."""
    return sum(1 << (kind - 0x50) for kind in set(kinds))
