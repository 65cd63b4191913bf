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
WitMotion frames (WT901, JY901, WT61, WT31N, ...): ``55 ID d0..d7 SUM``, 11 bytes.

SUM is the low byte of the sum of the ten bytes before it; d0..d7 are four little-endian int16.
0x55 may appear in the data, so a header is accepted only with a known ID and a valid sum;
otherwise the decoder advances by one byte. A false frame in noise or during synchronisation passes
that test once in 256 headers; the format allows no better test.

Commands, and frames from physical values for simulated devices and tests, are encoded here as
well.
"""

from __future__ import annotations

import math
import re
import struct
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.units import STANDARD_GRAVITY_M_S2
from rt_robot_os.devices.framing import StreamDecoder


TIME: Final = 0x50
ACCELERATION: Final = 0x51
ANGULAR_VELOCITY: Final = 0x52
ANGLE: Final = 0x53
MAGNETIC_FIELD: Final = 0x54
QUATERNION: Final = 0x59
LAST: Final = 0x5A

HEADER: Final = 0x55
FRAME_SIZE: Final = 11

# Full scale is 2^15 counts in each of them.
ACCELERATION_RANGE_G: Final = 16.0
ANGULAR_VELOCITY_RANGE_DEG_S: Final = 2000.0
ANGLE_RANGE_DEG: Final = 180.0
FULL_SCALE: Final = 32768.0

# A header with a known ID, or its part before the end of the buffer.
_START: Final = re.compile(rb'\x55(?:[\x50-\x5a]|\Z)').search
_BLUETOOTH: Final = re.compile(rb'(?:\x55[\x61\x71].{18}){2}\x55[\x61\x71]', re.DOTALL).search
_UNPACK: Final = struct.Struct('<4h').unpack_from


class WitMotionFrame(NamedTuple):
    """
    One valid frame.

    :ivar kind: its ID, 0x50 to 0x5A.
    :ivar values: the four int16.
    :ivar end: index just after its last byte in the chunk that completed it.
    :ivar skipped: bytes rejected between the previous frame and this one.
    """

    kind: int
    values: tuple[int, int, int, int]
    end: int
    skipped: int


class WitMotionDecoder(StreamDecoder[WitMotionFrame]):
    """
    Find the frames in a stream of bytes; safe in the loop, keeps at most 10 bytes.

    A rejected frame is a header with a known ID and a wrong sum. The class has its own loop: the
    frames are so short and many that two calls for each would cost a fifth of the time.
    """

    def __init__(self) -> None:
        super().__init__()
        self._skipped = 0

    def reset(self) -> None:
        """Reject the pending bytes: the stream restarts."""
        super().reset()
        self._skipped = 0

    def feed(self, data: bytes) -> list[WitMotionFrame]:
        """
        Decode the next bytes of the stream.

        :return: the frames that they complete, in order; independent of how the stream is split.
        """
        held = len(self._pending)
        buffer = self._pending + data
        size = len(buffer)
        frames: list[WitMotionFrame] = []
        at = 0
        rejected = 0
        skipped = self._skipped
        while size - at >= FRAME_SIZE:
            kind = buffer[at + 1]
            if buffer[at] == HEADER and TIME <= kind <= LAST:
                if sum(buffer[at:at + 10]) & 0xFF == buffer[at + 10]:
                    values = _UNPACK(buffer, at + 2)
                    at += FRAME_SIZE
                    frames.append(WitMotionFrame(kind, values, at - held, skipped))
                    skipped = 0
                    continue
                self.rejected_frames += 1
            found = _START(buffer, at + 1)
            slid = (size if found is None else found.start()) - at
            rejected += slid
            skipped += slid
            at += slid
        found = _START(buffer, at)
        start = size if found is None else found.start()
        self.rejected_bytes += rejected + start - at
        self._skipped = skipped + start - at
        self._pending = buffer[start:]
        self.frames += len(frames)
        return frames


# ---- encoding ---------------------------------------------------------------------------------

REGISTER_OUTPUTS: Final = 0x02
REGISTER_RATE: Final = 0x03
UNLOCK: Final = bytes((0xFF, 0xAA, 0x69, 0x88, 0xB5))
COMMAND_SIZE: Final = 5

# Value of the rate register for each rate of the device.
RATES_HZ: Final = {
    0.1: 0x1, 0.5: 0x2, 1.0: 0x3, 2.0: 0x4, 5.0: 0x5, 10.0: 0x6, 20.0: 0x7, 50.0: 0x8, 100.0: 0x9,
    125.0: 0xA, 200.0: 0xB,
}

_ACCELERATION_SCALE: Final = FULL_SCALE / (ACCELERATION_RANGE_G * STANDARD_GRAVITY_M_S2)
_ANGULAR_VELOCITY_SCALE: Final = FULL_SCALE / math.radians(ANGULAR_VELOCITY_RANGE_DEG_S)
_ANGLE_SCALE: Final = FULL_SCALE / math.radians(ANGLE_RANGE_DEG)


def frame(kind: int, first: int, second: int, third: int, fourth: int) -> bytes:
    """Encode a frame of four int16; values are limited to their range."""
    limited = [min(max(v, -32768), 32767) for v in (first, second, third, fourth)]
    content = struct.pack('<BB4h', HEADER, kind, *limited)
    return content + bytes((sum(content) & 0xFF,))


def acceleration_frame(x: float, y: float, z: float, temperature_c: float = 25.0) -> bytes:
    """Encode frame 0x51 from the specific force in m/s^2, along the device's axes."""
    scale = _ACCELERATION_SCALE
    return frame(ACCELERATION, round(x * scale), round(y * scale), round(z * scale),
                 round(temperature_c * 100))


def angular_velocity_frame(x: float, y: float, z: float, temperature_c: float = 25.0) -> bytes:
    """Encode frame 0x52 from rad/s about the device's axes."""
    scale = _ANGULAR_VELOCITY_SCALE
    return frame(ANGULAR_VELOCITY, round(x * scale), round(y * scale), round(z * scale),
                 round(temperature_c * 100))


def angle_frame(roll: float, pitch: float, yaw: float, temperature_c: float = 25.0) -> bytes:
    """Encode frame 0x53 from rad, each from -pi to pi; in the order yaw, pitch, roll."""
    scale = _ANGLE_SCALE
    return frame(ANGLE, round(roll * scale), round(pitch * scale), round(yaw * scale),
                 round(temperature_c * 100))


def magnetic_field_frame(
    x: float, y: float, z: float, scale_t: float, temperature_c: float = 25.0,
) -> bytes:
    """
    Encode frame 0x54.

    :param x: field in tesla, as ``y`` and ``z``.
    :param scale_t: tesla per count.
    """
    return frame(MAGNETIC_FIELD, round(x / scale_t), round(y / scale_t), round(z / scale_t),
                 round(temperature_c * 100))


def quaternion_frame(w: float, x: float, y: float, z: float) -> bytes:
    """Encode frame 0x59 in the manual's order, w first."""
    return frame(QUATERNION, round(w * FULL_SCALE), round(x * FULL_SCALE), round(y * FULL_SCALE),
                 round(z * FULL_SCALE))


def command(register: int, value: int) -> bytes:
    """Encode the command that sets a register; the device executes it only after ``UNLOCK``."""
    return bytes((0xFF, 0xAA, register)) + struct.pack('<H', value)


def output_mask(kinds: tuple[int, ...]) -> int:
    """Return the value of the output register for frames with these IDs."""
    return sum(1 << (kind - 0x50) for kind in set(kinds))


def is_witmotion(data: bytes) -> bool:
    """Return whether some bytes are frames: two in sequence, as one may be valid by chance."""
    return any(not frame.skipped for frame in WitMotionDecoder().feed(data)[1:])


def is_bluetooth(data: bytes) -> bool:
    """Return whether some bytes are of a Bluetooth model: three packets in sequence."""
    return _BLUETOOTH(data) is not None
