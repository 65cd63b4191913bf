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
A simulated MPU-6050, on the robot or turned by hand: its registers, its FIFO and its measurements.

It moves like the other simulated units, so its rates and its accelerations are consistent.
"""

from __future__ import annotations

import math
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import STANDARD_GRAVITY_M_S2
from rt_robot_os.devices.i2c.simulated_device import common_settings
from rt_robot_os.devices.i2c.simulated_device import RegisterChip
from rt_robot_os.devices.mpu6050 import wire as chip
from rt_robot_os.sim import world
from rt_robot_os.sim.world.inertial import inertial
from rt_robot_os.sim.world.inertial import ON_SETTING

_ACCELERATION_NOISE: Final = 0.03
_RATE_NOISE: Final = 0.001
_IDS: Final = {model.name: number for number, model in chip.MODELS.items()}
_ACCEL_RANGES: Final = {field: limit for limit, field in chip.ACCEL_RANGES_G.items()}
_GYRO_RANGES: Final = {field: limit for limit, field in chip.GYRO_RANGES_DEG_S.items()}


def counts(value: float, unit: float) -> int:
    """Return a value in counts of a unit, limited to 16 bits."""
    return min(max(round(value / unit), -32768), 32767)


class SimulatedMpu6050(RegisterChip):
    """
    An MPU-6050, MPU-6500 or MPU-9250.

    :ivar fifo: bytes in the FIFO.
    :ivar queued: samples put into the FIFO.
    """

    SETTINGS = common_settings() + (
        Field('model', str, 'MPU-6050', 'The model of the chip.', choices=tuple(_IDS)),
        Field('temperature_c', float, 30.0, 'Temperature of the chip.', unit='C', minimum=-40.0,
              maximum=85.0),
        world.NOISE_SETTING,
        ON_SETTING,
        Field('drift', float, 0.0,
              'How much faster its clock runs than that of the computer.', minimum=-0.1,
              maximum=0.1),
    )
    ADDRESS = 0x68
    FIXED = frozenset((chip.FIFO,))
    FOREIGN = {0xD0: 0x58}

    def prepare(self) -> None:
        """Start in the state after power-on."""
        self._inertial = inertial(self.site, self.settings)
        self._id = _IDS[self.settings['model']]
        self._model = chip.MODELS[self._id]
        self.fifo = bytearray()
        self._began_ns = 0
        self._sampled = 0
        self.queued = 0

    def power_on(self, now_ns: int) -> None:
        """Start with the registers of the chip after power-on: asleep."""
        super().power_on(now_ns)
        self.registers[chip.WHO_AM_I] = self._id
        self.registers[chip.POWER] = chip.POWER_SLEEP
        self.fifo.clear()
        self._restart(now_ns)

    def write(self, register: int, value: int, now_ns: int) -> None:
        """Write a register."""
        if register == chip.POWER and value & chip.POWER_RESET:
            self.power_on(now_ns)
        elif register == chip.USER_CONTROL:
            if value & chip.USER_FIFO_RESET and not value & chip.USER_FIFO:
                self.fifo.clear()
            self.registers[register] = value & ~chip.USER_FIFO_RESET
        elif register not in (chip.WHO_AM_I, chip.FIFO, chip.FIFO_COUNT, chip.FIFO_COUNT + 1):
            self.registers[register] = value
            if register in (chip.POWER, chip.RATE_DIVIDER):
                self._restart(now_ns)

    def read(self, register: int, now_ns: int) -> int:
        """Read a register; reading that of the FIFO removes a byte."""
        if register == chip.FIFO:
            # An empty FIFO returns its last byte again.
            if self.fifo:
                self.registers[chip.FIFO] = self.fifo.pop(0)
        elif register == chip.FIFO_COUNT:
            return len(self.fifo) >> 8
        elif register == chip.FIFO_COUNT + 1:
            return len(self.fifo) & 0xFF
        return self.registers[register]

    def advance(self, now_ns: int) -> None:
        """Make the samples that are due."""
        if self.registers[chip.POWER] & chip.POWER_SLEEP or not self.measuring:
            self._restart(now_ns)
            return
        period_ns = self._period_ns()
        due = (now_ns - self._began_ns) // period_ns
        # Older samples have left the FIFO anyway.
        kept = self._model.fifo_size // chip.FRAME_SIZE + 2
        skipped = due - self._sampled - kept
        if skipped > 0:
            self._sampled += skipped
            if self._queueing():
                self.queued += skipped
                self.fifo[:] = bytes(self._model.fifo_size)
        while self._sampled < due:
            self._sampled += 1
            self._sample(self.time_s(self._began_ns + self._sampled * period_ns))

    def _sample(self, time_s: float) -> None:
        unit = _ACCEL_RANGES[self.registers[chip.ACCEL_CONFIG] >> 3 & 3] * (
            STANDARD_GRAVITY_M_S2 / chip.FULL_SCALE)
        force = [counts(self._noisy(v, _ACCELERATION_NOISE), unit)
                 for v in self._inertial.force(time_s)]
        unit = math.radians(_GYRO_RANGES[self.registers[chip.GYRO_CONFIG] >> 3 & 3]) / (
            chip.FULL_SCALE)
        rate = [counts(self._noisy(v, _RATE_NOISE), unit)
                for v in self._inertial.angular_velocity(time_s)]
        model = self._model
        warmth = self.settings['temperature_c'] - model.temperature_zero_c
        data = chip.pack((force[0], force[1], force[2],
                          counts(warmth, 1 / model.temperature_scale), rate[0], rate[1], rate[2]))
        self.registers[chip.DATA:chip.DATA + chip.FRAME_SIZE] = data
        if self._queueing():
            self.queued += 1
            self.fifo += data
            # The oldest bytes are dropped, whole frame or not.
            del self.fifo[:max(0, len(self.fifo) - model.fifo_size)]

    def _queueing(self) -> bool:
        return bool(self.registers[chip.USER_CONTROL] & chip.USER_FIFO
                    and self.registers[chip.FIFO_ENABLE] == chip.FIFO_ALL)

    def _noisy(self, value: float, deviation: float) -> float:
        return value + self.random.gauss(0.0, deviation * self.settings['noise'])

    def _restart(self, now_ns: int) -> None:
        self._began_ns = now_ns
        self._sampled = 0

    def _period_ns(self) -> int:
        divider = self.registers[chip.RATE_DIVIDER] + 1
        base_hz = chip.BASE_RATE_HZ * (1.0 + float(self.settings['drift']))
        if self.registers[chip.CONFIG] & 7 in (0, 7):
            base_hz *= 8
        return round(divider * NS_PER_S / base_hz)
