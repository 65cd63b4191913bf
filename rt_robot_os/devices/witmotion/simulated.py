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


"""A simulated WitMotion unit, on the robot or turned by hand; its frames are consistent."""

from __future__ import annotations

import struct
from typing import Final

from rt_robot_os.devices.witmotion import wire
from rt_robot_os.sim import world
from rt_robot_os.sim.device import common_settings
from rt_robot_os.sim.device import SimulatedDevice
from rt_robot_os.sim.world.inertial import inertial
from rt_robot_os.sim.world.inertial import ON_SETTING

MAG_SCALE_T: Final = 1.5e-7

_ACCELERATION_NOISE: Final = 0.02
_RATE_NOISE: Final = 0.002
_FIELD_NOISE_T: Final = 3e-7

_OUTPUTS: Final = (wire.ACCELERATION, wire.ANGULAR_VELOCITY, wire.ANGLE, wire.MAGNETIC_FIELD,
                   wire.QUATERNION)
_RATES_HZ: Final = {value: rate for rate, value in wire.RATES_HZ.items()}


class SimulatedWitMotion(SimulatedDevice):
    """A WitMotion unit; it executes the commands for rate and outputs once it is unlocked."""

    SETTINGS = (*common_settings(100.0, 200.0), world.NOISE_SETTING, ON_SETTING)
    BAUD = 115200

    def prepare(self) -> None:
        """Start in the state after power-on."""
        self._inertial = inertial(self.site, self.settings)
        self._outputs = wire.output_mask(_OUTPUTS)
        self._unlocked = False
        self._received = b''

    def sample(self, time_s: float) -> bytes:
        """Return the enabled frames."""
        felt = self._inertial
        roll, pitch, yaw = felt.attitude(time_s)
        noise, chance = self.settings['noise'], self.random
        force = world.noisy(felt.force(time_s), _ACCELERATION_NOISE * noise, chance)
        rate = world.noisy(felt.angular_velocity(time_s), _RATE_NOISE * noise, chance)
        field = world.noisy(felt.field(time_s), _FIELD_NOISE_T * noise, chance)
        frames = (
            (wire.ACCELERATION, wire.acceleration_frame(*force)),
            (wire.ANGULAR_VELOCITY, wire.angular_velocity_frame(*rate)),
            (wire.ANGLE, wire.angle_frame(roll, pitch, yaw)),
            (wire.MAGNETIC_FIELD, wire.magnetic_field_frame(*field, MAG_SCALE_T)),
            (wire.QUATERNION, wire.quaternion_frame(*felt.quaternion(time_s))),
        )
        return b''.join(data for kind, data in frames if self._outputs >> (kind - 0x50) & 1)

    def handle_command(self, data: bytes) -> None:
        """Execute commands: unlock, outputs, rate."""
        received = self._received + data
        while True:
            at = received.find(b'\xff\xaa')
            if at < 0 or len(received) - at < wire.COMMAND_SIZE:
                # A command that is not complete yet has less than five bytes.
                self._received = received[-(wire.COMMAND_SIZE - 1):]
                return
            self._handle_one(received[at:at + wire.COMMAND_SIZE])
            received = received[at + wire.COMMAND_SIZE:]

    def _handle_one(self, command: bytes) -> None:
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
