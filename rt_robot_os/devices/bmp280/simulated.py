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

"""A simulated BMP280: its registers, its modes and the duration of its conversions."""

from __future__ import annotations

from typing import Final

from rt_robot_os.devices.bmp280 import wire as chip
from rt_robot_os.devices.i2c.simulated_device import common_settings
from rt_robot_os.devices.i2c.simulated_device import RegisterChip
from rt_robot_os.sim.world import Air
from rt_robot_os.sim.world import air_settings
from rt_robot_os.sim.world import raw_readings

# From the worked example of the data sheet.
TRIMMING: Final = chip.Bmp280Trimming(
    27504, 26435, -1000, 36477, -10685, 3024, 2855, 140, -7, 15500, -14600, 6000)

_RAW_MAXIMUM: Final = (1 << 20) - 1
_RESET_DATA: Final = bytes((0x80, 0, 0, 0x80, 0, 0))
_UPDATE_NS: Final = 1_000_000
_OVERSAMPLING: Final = {field: times for times, field in chip.OVERSAMPLING.items()}
_FILTER: Final = {field: times for times, field in chip.FILTER.items()}
_STANDBY_NS: Final = {field: pause for pause, field in chip.STANDBY_NS.items()}


def encode(
        trimming: chip.Bmp280Trimming, pressure_pa: float, temperature_c: float,
) -> tuple[int, int]:
    """Return the raw readings, pressure and temperature, nearest to physical values."""
    return raw_readings(chip.compensate, trimming, (pressure_pa, temperature_c), 0, _RAW_MAXIMUM)


class SimulatedBmp280(RegisterChip):
    """A BMP280."""

    SETTINGS = common_settings() + air_settings(1.3)
    PAIRS = True

    def prepare(self) -> None:
        """Start in the state after power-on."""
        self.air = Air(self.settings, self.random, self.site)
        self.conversions = 0
        self._began_ns = 0
        self._cycles = 0
        self._ready_ns = 0
        self._filtered: float | None = None

    def power_on(self, now_ns: int) -> None:
        """Start with the registers of the chip after power-on."""
        super().power_on(now_ns)
        self.registers[chip.ID] = chip.CHIP_ID
        trimming = TRIMMING.pack()
        self.registers[chip.CALIBRATION:chip.CALIBRATION + len(trimming)] = trimming
        self.registers[chip.DATA:chip.DATA + 6] = _RESET_DATA
        self._ready_ns = now_ns + _UPDATE_NS
        self._filtered = None

    def write(self, register: int, value: int, now_ns: int) -> None:
        """Write a register."""
        if register == chip.RESET:
            if value == chip.RESET_VALUE:
                self.power_on(now_ns)
        elif register in (chip.CONTROL, chip.CONFIG):
            self.registers[register] = value
            if register == chip.CONTROL:
                self._began_ns = now_ns
                self._cycles = 0

    def advance(self, now_ns: int) -> None:
        """Finish conversions."""
        control = self.registers[chip.CONTROL]
        mode = control & 3
        busy = False
        # Modes 1 and 2 are the same.
        if mode and self.measuring and (conversion_ns := self._conversion_ns(control)):
            since_ns = now_ns - self._began_ns
            if mode == chip.NORMAL:
                cycle_ns = conversion_ns + _STANDBY_NS[self.registers[chip.CONFIG] >> 5]
                done = (since_ns - conversion_ns) // cycle_ns + 1
                busy = since_ns % cycle_ns < conversion_ns
                if done > self._cycles:
                    self._cycles = done
                    end_ns = self._began_ns + (done - 1) * cycle_ns + conversion_ns
                    self._convert(control, end_ns)
            elif since_ns >= conversion_ns:
                self.registers[chip.CONTROL] = control & ~3
                self._convert(control, self._began_ns + conversion_ns)
            else:
                busy = True
        updating = now_ns < self._ready_ns
        self.registers[chip.STATUS] = chip.STATUS_MEASURING * busy | updating

    def _convert(self, control: int, end_ns: int) -> None:
        self.conversions += 1
        pressure, temperature = self.air.measure(self.time_s(end_ns))
        times = _FILTER.get(self.registers[chip.CONFIG] >> 2 & 7, 16)
        if times and self._filtered is not None:
            pressure = self._filtered + (pressure - self._filtered) / times
        self._filtered = pressure
        raw_p, raw_t = encode(TRIMMING, pressure, temperature)
        bits_t = 20 if times else 15 + min(control >> 5, 5)
        bits_p = 20 if times else 15 + min(control >> 2 & 7, 5)
        raw_p &= -1 << 20 - bits_p
        raw_t &= -1 << 20 - bits_t
        self.registers[chip.DATA:chip.DATA + 6] = bytes((
            raw_p >> 12, raw_p >> 4 & 0xFF, (raw_p & 15) << 4,
            raw_t >> 12, raw_t >> 4 & 0xFF, (raw_t & 15) << 4))

    @staticmethod
    def _conversion_ns(control: int) -> int:
        """Return the typical time, 13 % below the longest; 0 if one of the two is off."""
        over_t = _OVERSAMPLING.get(control >> 5, 16 if control >> 5 else 0)
        over_p = _OVERSAMPLING.get(control >> 2 & 7, 16 if control >> 2 & 7 else 0)
        if not over_t or not over_p:
            return 0
        return chip.conversion_ns(over_t, over_p) * 87 // 100
