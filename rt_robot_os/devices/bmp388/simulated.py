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

"""A simulated BMP388: its registers, and conversions at the configured rate."""

from __future__ import annotations

from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.bmp388 import wire as chip
from rt_robot_os.devices.i2c.simulated_device import common_settings
from rt_robot_os.devices.i2c.simulated_device import RegisterChip
from rt_robot_os.sim.world import Air
from rt_robot_os.sim.world import air_settings
from rt_robot_os.sim.world import raw_readings

# No data sheet has an example; these values are of a typical size.
TRIMMING: Final = chip.Bmp388Trimming(
    27800, 19000, -7, -1000, -6000, 35, 0, 26000, 31000, -7, -7, 9000, 30, -60)

_SCALED: Final = TRIMMING.scaled()
_RAW_MAXIMUM: Final = (1 << 24) - 1
_COMMAND_READY: Final = 0x10
_CHIP_ID: Final = 0x50


def encode(scaled: chip.Scaled, pressure_pa: float, temperature_c: float) -> tuple[int, int]:
    """Return the raw readings, pressure and temperature, nearest to physical values."""
    return raw_readings(chip.compensate, scaled, (pressure_pa, temperature_c), 0, _RAW_MAXIMUM)


class SimulatedBmp388(RegisterChip):
    """A BMP388."""

    SETTINGS = common_settings() + air_settings(0.5)
    PAIRS = True
    FOREIGN = {0xD0: 0x58}

    def prepare(self) -> None:
        """Start in the state after power-on."""
        self.air = Air(self.settings, self.random, self.site)
        self.conversions = 0
        self._began_ns = 0
        self._cycles = 0

    def power_on(self, now_ns: int) -> None:
        """Start with the registers of the chip after power-on."""
        super().power_on(now_ns)
        self.registers[chip.ID] = _CHIP_ID
        self.registers[chip.STATUS] = _COMMAND_READY
        self.registers[chip.EVENT] = chip.EVENT_POWER_ON
        self.registers[chip.OVERSAMPLING_REGISTER] = 0x02
        trimming = TRIMMING.pack()
        self.registers[chip.CALIBRATION:chip.CALIBRATION + len(trimming)] = trimming

    def write(self, register: int, value: int, now_ns: int) -> None:
        """Write a register."""
        if register == chip.COMMAND:
            if value == chip.RESET_VALUE:
                self.power_on(now_ns)
        elif chip.POWER <= register <= chip.CONFIG:
            self.registers[register] = value
            self._began_ns = now_ns
            self._cycles = 0
            if register == chip.POWER and self._running() and (
                    self._conversion_ns() > self._period_ns()):
                self.registers[chip.ERROR] |= chip.ERROR_CONFIG

    def read(self, register: int, now_ns: int) -> int:
        """Read a register; some are cleared by reading."""
        value = self.registers[register]
        if register in (chip.EVENT, chip.ERROR):
            self.registers[register] = 0
        elif register == chip.DATA + 5:
            self.registers[chip.STATUS] &= ~chip.STATUS_READY
        return value

    def advance(self, now_ns: int) -> None:
        """Finish conversions."""
        if not self._running() or not self.measuring:
            return
        done = (now_ns - self._began_ns - self._conversion_ns()) // self._period_ns() + 1
        if done > self._cycles:
            self._cycles = done
            self.conversions += 1
            end_ns = self._began_ns + (done - 1) * self._period_ns() + self._conversion_ns()
            raw_p, raw_t = encode(_SCALED, *self.air.measure(self.time_s(end_ns)))
            self.registers[chip.DATA:chip.DATA + 6] = (
                raw_p.to_bytes(3, 'little') + raw_t.to_bytes(3, 'little'))
            self.registers[chip.STATUS] |= chip.STATUS_READY

    def _running(self) -> bool:
        return self.registers[chip.POWER] == chip.POWER_NORMAL

    def _period_ns(self) -> int:
        return NS_PER_S // 200 << min(self.registers[chip.RATE] & 31, 17)

    def _conversion_ns(self) -> int:
        fields = self.registers[chip.OVERSAMPLING_REGISTER]
        return chip.conversion_ns(1 << min(fields >> 3 & 7, 5), 1 << min(fields & 7, 5))
