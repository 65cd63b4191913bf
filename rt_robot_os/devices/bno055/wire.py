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
The answers of a Bosch BNO055 over its UART: ``BB LEN data`` to a read, ``EE STATUS`` otherwise.

There is no checksum, and an answer does not identify its request. So only requested lengths and
existing statuses are accepted, and the large block only if its quaternion is a rotation (or all
zero, before fusion begins). A flipped bit elsewhere in the data cannot be detected.

Requests, and answers for simulated devices and tests, are encoded here as well.
"""

from __future__ import annotations

from collections.abc import Sequence
import struct
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.units import STANDARD_GRAVITY_M_S2
from rt_robot_os.devices.framing import FrameDecoder


DATA: Final = 0xBB
STATUS: Final = 0xEE

# Acceleration to calibration status, registers 0x08 to 0x35.
BLOCK_FIRST: Final = 0x08
BLOCK_SIZE: Final = 46
# Acceleration, field, rate, angles, quaternion, linear acceleration, gravity; temperature, status.
BLOCK: Final = struct.Struct('<22hbB')

WRITE_SUCCESS: Final = 0x01
OVERRUN: Final = 0x07
STATUSES: Final = {
    0x01: 'written', 0x02: 'read failed', 0x03: 'write failed', 0x04: 'no such register',
    0x05: 'register not writable', 0x06: 'wrong start byte', 0x07: 'bus overrun',
    0x08: 'too long', 0x09: 'too short', 0x0A: 'request came too slowly',
}

_QUATERNION: Final = struct.Struct('<4h').unpack_from
_QUATERNION_AT: Final = 24
_UNIT: Final = 1 << 28
_TOLERANCE: Final = _UNIT // 20


class Bno055Frame(NamedTuple):
    """
    One answer.

    :ivar status: of ``EE STATUS``; 0 with data.
    :ivar data: what was read.
    :ivar end: index just after its last byte in the chunk that completed it.
    """

    status: int
    data: bytes
    end: int


class Bno055Decoder(FrameDecoder[Bno055Frame]):
    """
    Find the answers in a stream of bytes; safe in the loop, keeps less than 48 bytes.

    A block that is not a possible measurement is a rejected frame.
    """

    STARTS = bytes((DATA, STATUS))
    SHORTEST = 2
    LONGEST = 2 + BLOCK_SIZE
    PATTERN = rb'\xbb(?:[\x01\x2e]|\Z)|\xee(?:[\x01-\x0a]|\Z)'

    def end(self, buffer: bytes, at: int) -> int:
        """Return where an answer ends, 0 if there is none of that kind."""
        second = buffer[at + 1]
        if buffer[at] == STATUS:
            return at + 2 if second in STATUSES else 0
        return at + 2 + second if second in (1, BLOCK_SIZE) else 0

    def frame(self, buffer: bytes, at: int, end: int, arrived: int) -> Bno055Frame | None:
        """Decode an answer; a block must contain a rotation."""
        second = buffer[at + 1]
        if buffer[at] == STATUS:
            return Bno055Frame(second, b'', arrived)
        if second == BLOCK_SIZE and not _plausible(buffer, at + 2):
            return None
        return Bno055Frame(0, buffer[at + 2:end], arrived)


def _plausible(buffer: bytes, at: int) -> bool:
    """Return whether the quaternion of a block is a rotation, or all zero."""
    w, x, y, z = _QUATERNION(buffer, at + _QUATERNION_AT)
    length = w * w + x * x + y * y + z * z
    return not length or -_TOLERANCE < length - _UNIT < _TOLERANCE


# ---- encoding ---------------------------------------------------------------------------------

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
CHIPS: Final = {REGISTER_CHIP_ID: {CHIP_ID: 'BNO055'}}
MODE_CONFIG: Final = 0x00
MODE_IMU: Final = 0x08
MODE_NDOF: Final = 0x0C
# m/s^2, degrees a second, degrees, Celsius; angles with the signs of Android.
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
    """Encode the answer to a write, or a refusal."""
    return bytes((STATUS, status))


def block(
    acceleration: Vector, field_t: Vector, rate_deg_s: Vector, quaternion: Vector,
    gravity: Vector = (0.0, 0.0, STANDARD_GRAVITY_M_S2), *, temperature_c: int = 25,
    calibration: int = 0xFF,
) -> bytes:
    """
    Encode the registers from acceleration to calibration status; angles are 0.

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
