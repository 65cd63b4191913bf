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


"""A simulated BNO055 on its UART: registers that are read and written, sent only on request."""

from __future__ import annotations

import math
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.devices.bno055 import wire
from rt_robot_os.devices.bno055.wire import BLOCK_FIRST
from rt_robot_os.devices.bno055.wire import BLOCK_SIZE
from rt_robot_os.devices.bno055.wire import OVERRUN
from rt_robot_os.devices.bno055.wire import WRITE_SUCCESS
from rt_robot_os.sim import world
from rt_robot_os.sim.device import common_settings
from rt_robot_os.sim.device import SimulatedDevice
from rt_robot_os.sim.world.inertial import inertial
from rt_robot_os.sim.world.inertial import ON_SETTING

_ACCELERATION_NOISE: Final = 0.03
_RATE_NOISE_DEG_S: Final = 0.3
_FIELD_NOISE_T: Final = 1e-6
_REGISTERS: Final = 128
_HEADER: Final = 4
_NO_SUCH_REGISTER: Final = 0x04
_WRONG_START: Final = 0x06
_FUSING: Final = (wire.MODE_IMU, wire.MODE_NDOF)
_TEMPERATURE_C: Final = 31
_CALIBRATED: Final = 0xFF
_MAX_PENDING: Final = 256


class SimulatedBno055(SimulatedDevice):
    """A BNO055; it starts in configuration mode."""

    SETTINGS = common_settings(100.0, 100.0) + (
        world.NOISE_SETTING,
        ON_SETTING,
        Field('chip_id', int, wire.CHIP_ID, 'The chip id that it reports; 160 is a BNO055.',
              minimum=0, maximum=255),
        Field('overrun_every', int, 0,
              'It reports a bus overrun once in this number of requests; 0: never.',
              minimum=0, maximum=1_000_000),
        Field('calibration_s', float, 0.0,
              'Time until it reports that it is calibrated.', unit='s', minimum=0.0, maximum=1e6),
    )
    BAUD = 115200

    def prepare(self) -> None:
        """Start in the state after power-on."""
        self._inertial = inertial(self.site, self.settings)
        self._registers = bytearray(_REGISTERS)
        self._registers[wire.REGISTER_CHIP_ID] = self.settings['chip_id']
        self._registers[wire.REGISTER_UNITS] = wire.UNITS_SI
        self._received = b''
        self._requests = 0

    def sample(self, time_s: float) -> bytes:
        """Measure: update the registers, send nothing."""
        fusing = self._registers[wire.REGISTER_MODE] in _FUSING
        felt = self._inertial
        roll, pitch, yaw = (math.degrees(v) for v in felt.angular_velocity(time_s))
        done = time_s >= self.settings['calibration_s']
        noise, chance = self.settings['noise'], self.random
        block = wire.block(
            world.noisy(felt.force(time_s), _ACCELERATION_NOISE * noise, chance),
            world.noisy(felt.field(time_s), _FIELD_NOISE_T * noise, chance),
            world.noisy((roll, pitch, yaw), _RATE_NOISE_DEG_S * noise, chance),
            felt.quaternion(time_s) if fusing else (0.0, 0.0, 0.0, 0.0), felt.gravity(time_s),
            temperature_c=_TEMPERATURE_C, calibration=_CALIBRATED if fusing and done else 0)
        self._registers[BLOCK_FIRST:BLOCK_FIRST + BLOCK_SIZE] = block
        return b''

    def handle_command(self, data: bytes) -> None:
        """Answer each request."""
        received = (self._received + data)[-_MAX_PENDING:]
        while received:
            if received[0] != wire.START:
                self.reply(wire.status_answer(_WRONG_START))
                at = received.find(bytes((wire.START,)))
                received = received[at:] if at >= 0 else b''
                continue
            if len(received) < _HEADER:
                break
            _, direction, register, size = received[:_HEADER]
            end = _HEADER + (size if direction == wire.WRITE else 0)
            if len(received) < end:
                break
            self._answer(direction, register, size, received[_HEADER:end])
            received = received[end:]
        self._received = received

    def _answer(self, direction: int, register: int, size: int, data: bytes) -> None:
        self._requests += 1
        every = self.settings['overrun_every']
        if every and self._requests % every == 0:
            self.reply(wire.status_answer(OVERRUN))
        elif register + size > _REGISTERS or not size:
            self.reply(wire.status_answer(_NO_SUCH_REGISTER))
        elif direction == wire.READ:
            self.reply(wire.data_answer(bytes(self._registers[register:register + size])))
        else:
            self._registers[register:register + size] = data
            self.reply(wire.status_answer(WRITE_SUCCESS))
