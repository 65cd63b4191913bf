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
MS5611 barometer on I2C.

A measurement takes two conversions, temperature and pressure. Each is started in one poll and
fetched in a later one, after its duration; nothing blocks. The chip has no id; it is identified by
its PROM and the checksum in it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.schema import Field
from rt_robot_os.devices.barometer import Barometer
from rt_robot_os.devices.barometer import barometer_settings
from rt_robot_os.devices.i2c.device import i2c_settings
from rt_robot_os.devices.i2c.device import Transactions
from rt_robot_os.devices.ms5611 import wire as chip


class Ms5611(Barometer):
    """An MS5611."""

    SETTINGS = (
        *i2c_settings(address=0x77, addresses=(0x76, 0x77), frame_id='baro_link',
                      topic='baro/pressure', rate_hz=20.0, maximum_hz=400.0),
        *barometer_settings(1.2),
        Field('oversampling', int, 4096, 'Readings averaged for a conversion.',
              choices=tuple(chip.OVERSAMPLING)),
    )
    description = 'MS5611 barometer (I2C): pressure, temperature, altitude'
    PRESSURE_RANGE_PA = (1_000.0, 120_000.0)

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Store the settings; nothing is opened.

        :raises ConfigError: two conversions take longer than there is between two samples.
        """
        super().__init__(name, settings)
        self._added, self._conversion_ns = chip.OVERSAMPLING[settings['oversampling']]
        self.expect_time_for(2 * self._conversion_ns)
        self._prom: chip.Words = ()
        self._raw_t = 0
        self._done_ns = 0

    def identify(self) -> Transactions[None]:
        """
        Check the PROM, and reset the chip.

        :raises DeviceError: it is another chip, or the bus failed.
        """
        data = b''
        for i in range(chip.PROM_WORDS):
            data += yield self.fetch(chip.PROM + 2 * i, 2)
        self._prom = chip.words(data)
        if not chip.valid(self._prom):
            probably = yield from self.probably()
            raise DeviceError(
                f'{self.name}: {self.place}: the checksum of its PROM is 0x{self._prom[7] & 15:x} '
                f'and should be 0x{chip.crc4(self._prom):x}, so it is not an MS5611 (or there is '
                f'noise on the wires): {probably}')
        yield self.put(chip.RESET)

    def begin(self, now_ns: int) -> int:
        """Wait until the chip is up."""
        self.start_grid(now_ns)
        return self.then(self._start, now_ns + chip.START_UP_NS)

    def _start(self, now_ns: int) -> Transactions[int]:
        """Start the conversion of the temperature."""
        yield self.put(chip.CONVERT_TEMPERATURE + self._added)
        # The chip starts at the end of the command; fetching too early spoils the conversion.
        return self.then(self._fetch_temperature, self.clock_ns() + self._conversion_ns)

    def _fetch_temperature(self, now_ns: int) -> Transactions[int]:
        """Fetch the temperature and start the conversion of the pressure."""
        self._raw_t = int.from_bytes((yield self.fetch(chip.READ, 3)), 'big')
        yield self.put(chip.CONVERT_PRESSURE + self._added)
        self._done_ns = self.clock_ns() + self._conversion_ns
        return self.then(self._fetch_pressure, self._done_ns)

    def _fetch_pressure(self, now_ns: int) -> Transactions[int]:
        """Fetch the pressure and publish both."""
        raw_p = int.from_bytes((yield self.fetch(chip.READ, 3)), 'big')
        self._bytes_read += 6
        self.advance(now_ns, self._start)
        if not raw_p or not self._raw_t:
            return self.reject('it gives 0, so it made no conversion')
        return self.publish(*chip.compensate(self._prom, raw_p, self._raw_t), self._done_ns)
