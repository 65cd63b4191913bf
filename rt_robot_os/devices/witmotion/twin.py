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
A simulated WitMotion unit that is turned by hand.

Roll and pitch swing, yaw goes round. The frames agree with each other: the angular velocity is the
derivative of the attitude, the acceleration is gravity seen in the device's axes, the magnetic
field is the earth's, and noise of a usual size is on top.
"""

from __future__ import annotations

from collections.abc import Mapping
import math
import struct
from typing import Any
from typing import Final

from rt_robot_os.devices.nmea import wire as nmea
from rt_robot_os.devices.witmotion import wire
from rt_robot_os.schema import Field
from rt_robot_os.sim.device import common_settings
from rt_robot_os.sim.device import SimulatedDevice
from rt_robot_os.sim.pty_port import PtyPort
from rt_robot_os.units import STANDARD_GRAVITY_M_S2

MAG_SCALE_T: Final = 1.5e-7
# East, north, up: the field of central Europe.
EARTH_FIELD_T: Final = (0.0, 2.0e-5, -4.4e-5)

_SWING_RAD: Final = (math.radians(20), math.radians(12))
_SWING_HZ: Final = (0.23, 0.31)
_TURN_RAD_S: Final = math.radians(15)

_ACCELERATION_NOISE: Final = 0.02
_RATE_NOISE: Final = 0.002
_FIELD_NOISE_T: Final = 3e-7

_OUTPUTS: Final = (wire.ACCELERATION, wire.ANGULAR_VELOCITY, wire.ANGLE, wire.MAGNETIC_FIELD,
                   wire.QUATERNION)
_RATES_HZ: Final = {value: rate for rate, value in wire.RATES_HZ.items()}

Vector = tuple[float, float, float]


class SimulatedWitMotion(SimulatedDevice):
    """A WitMotion unit; it obeys the commands for rate and outputs once it is unlocked."""

    SETTINGS = common_settings(100.0, 200.0) + (
        Field('noise', float, 1.0, 'Noise, as a multiple of what is usual.', minimum=0.0,
              maximum=1000.0),
    )
    BAUD = 115200

    def __init__(
        self, name: str, settings: Mapping[str, Any], port: PtyPort, baud: int | None = None,
    ) -> None:
        """
        Check the settings; nothing is plugged in yet.

        :raises ConfigError: a setting is wrong.
        """
        super().__init__(name, settings, port, baud)
        self._noise: float = self.settings['noise']
        self._outputs = wire.output_mask(_OUTPUTS)
        self._unlocked = False
        self._received = b''

    def sample(self, time_s: float) -> bytes:
        """Give the frames that are enabled."""
        roll, pitch, yaw = attitude(time_s)
        force = self._noisy(body_vector(time_s, (0.0, 0.0, STANDARD_GRAVITY_M_S2)),
                            _ACCELERATION_NOISE)
        rate = self._noisy(angular_velocity(time_s), _RATE_NOISE)
        field = self._noisy(body_vector(time_s, EARTH_FIELD_T), _FIELD_NOISE_T)
        frames = (
            (wire.ACCELERATION, wire.acceleration_frame(*force)),
            (wire.ANGULAR_VELOCITY, wire.angular_velocity_frame(*rate)),
            (wire.ANGLE, wire.angle_frame(roll, pitch, yaw)),
            (wire.MAGNETIC_FIELD, wire.magnetic_field_frame(*field, MAG_SCALE_T)),
            (wire.QUATERNION, wire.quaternion_frame(*quaternion(time_s))),
        )
        return b''.join(data for kind, data in frames if self._outputs >> (kind - 0x50) & 1)

    def foreign(self) -> bytes:
        """Give what a satellite receiver sends."""
        return nmea.sentence('GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,')

    def obey(self, data: bytes) -> None:
        """Take commands: unlock, outputs, rate."""
        received = self._received + data
        while True:
            at = received.find(b'\xff\xaa')
            if at < 0 or len(received) - at < wire.COMMAND_SIZE:
                # A command that is not complete yet has less than five bytes.
                self._received = received[-(wire.COMMAND_SIZE - 1):]
                return
            self._obey_one(received[at:at + wire.COMMAND_SIZE])
            received = received[at + wire.COMMAND_SIZE:]

    def _obey_one(self, command: bytes) -> None:
        if command == wire.UNLOCK:
            self._unlocked = True
            return
        register, value = struct.unpack('<xxBH', command)
        if not self._unlocked:
            return
        if register == wire.REGISTER_OUTPUTS:
            self._outputs = value
        elif register == wire.REGISTER_RATE and value in _RATES_HZ:
            self.set_rate(_RATES_HZ[value])

    def _noisy(self, vector: Vector, deviation: float) -> Vector:
        x, y, z = vector
        spread = deviation * self._noise
        gauss = self.random.gauss
        return x + gauss(0.0, spread), y + gauss(0.0, spread), z + gauss(0.0, spread)


def attitude(time_s: float) -> Vector:
    """Give roll, pitch and yaw in rad, yaw from -pi to pi; east, north, up."""
    roll = _SWING_RAD[0] * math.sin(2 * math.pi * _SWING_HZ[0] * time_s)
    pitch = _SWING_RAD[1] * math.sin(2 * math.pi * _SWING_HZ[1] * time_s)
    return roll, pitch, math.remainder(_TURN_RAD_S * time_s, 2 * math.pi)


def angular_velocity(time_s: float) -> Vector:
    """Give the rate of the attitude in rad/s about the device's axes."""
    roll, pitch, _ = attitude(time_s)
    swing = [amplitude * 2 * math.pi * hz * math.cos(2 * math.pi * hz * time_s)
             for amplitude, hz in zip(_SWING_RAD, _SWING_HZ)]
    return (swing[0] - _TURN_RAD_S * math.sin(pitch),
            swing[1] * math.cos(roll) + _TURN_RAD_S * math.cos(pitch) * math.sin(roll),
            -swing[1] * math.sin(roll) + _TURN_RAD_S * math.cos(pitch) * math.cos(roll))


def quaternion(time_s: float) -> tuple[float, float, float, float]:
    """Give the attitude as w, x, y, z."""
    (cr, sr), (cp, sp), (cy, sy) = (
        (math.cos(angle / 2), math.sin(angle / 2)) for angle in attitude(time_s))
    return (cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy)


def body_vector(time_s: float, world: Vector) -> Vector:
    """Turn a vector of east, north, up into the device's axes."""
    roll, pitch, yaw = attitude(time_s)
    east, north, up = world
    cr, sr = math.cos(roll), math.sin(roll)
    cp, sp = math.cos(pitch), math.sin(pitch)
    ahead = math.cos(yaw) * east + math.sin(yaw) * north
    left = -math.sin(yaw) * east + math.cos(yaw) * north
    ahead, above = cp * ahead - sp * up, sp * ahead + cp * up
    return ahead, cr * left + sr * above, -sr * left + cr * above
