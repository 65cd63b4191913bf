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

"""A simulated MS5611: its commands, and the duration of its conversions."""

from __future__ import annotations

from typing import Final

from rt_robot_os.devices.i2c.simulated_device import common_settings
from rt_robot_os.devices.i2c.simulated_device import SimulatedChip
from rt_robot_os.devices.ms5611 import wire as chip
from rt_robot_os.sim.world import Air
from rt_robot_os.sim.world import air_settings
from rt_robot_os.sim.world import raw_readings

_RAW_MAXIMUM: Final = (1 << 24) - 1
_TIMES_NS: Final = dict(chip.OVERSAMPLING.values())


def with_checksum(words: tuple[int, ...]) -> chip.Words:
    """Return the PROM with a valid checksum."""
    blank = (*words[:7], words[7] & 0xFFF0)
    return (*blank[:7], blank[7] | chip.crc4(blank))


# The coefficients of the worked example of the data sheet.
PROM: Final = with_checksum((0, 40127, 36924, 23317, 23282, 33464, 28312, 0x5A00))


def encode(prom: chip.Words, pressure_pa: float, temperature_c: float) -> tuple[int, int]:
    """Return the raw readings, pressure and temperature, nearest to physical values."""
    return raw_readings(chip.compensate, prom, (pressure_pa, temperature_c), 1, _RAW_MAXIMUM)


class SimulatedMs5611(SimulatedChip):
    """An MS5611."""

    SETTINGS = common_settings() + air_settings(1.2)
    ADDRESS = 0x77
    FOREIGN = {0xD0: 0x58}

    def prepare(self) -> None:
        """Start in the state after power-on."""
        self.air = Air(self.settings, self.random, self.site)
        self.conversions = 0
        self._command = 0
        self._converting = 0
        self._done_ns = 0
        self._result = 0

    def power_on(self, now_ns: int) -> None:
        """Discard the started conversion."""
        self._command = self._converting = self._result = 0

    def advance(self, now_ns: int) -> None:
        """Finish the conversion."""
        if self._converting and now_ns >= self._done_ns and self.measuring:
            self.conversions += 1
            readings = encode(PROM, *self.air.measure(self.time_s(self._done_ns)))
            self._result = readings[self._converting >= chip.CONVERT_TEMPERATURE]
            self._converting = 0

    def exchange(self, data: bytes, size: int, now_ns: int) -> bytes:
        """Execute a command, then return the requested bytes."""
        if data:
            self._execute(data[0], now_ns)
        if self._command == chip.READ:
            # A value that is fetched too early or twice is 0.
            result, self._result = self._result, 0
            if self._converting:
                self._converting = 0
            return result.to_bytes(3, 'big')[:size].ljust(size, b'\0')
        if chip.PROM <= self._command < chip.PROM + 2 * chip.PROM_WORDS:
            word = PROM[(self._command - chip.PROM) // 2]
            return word.to_bytes(2, 'big')[:size].ljust(size, b'\0')
        return bytes(size)

    def _execute(self, command: int, now_ns: int) -> None:
        self._command = command
        if command == chip.RESET:
            self.power_on(now_ns)
        elif command & ~0x1F == chip.CONVERT_PRESSURE and command & 0xF in _TIMES_NS:
            self._converting = command
            self._result = 0
            # Typically 10 % shorter than the longest.
            self._done_ns = now_ns + _TIMES_NS[command & 0xF] * 9 // 10
