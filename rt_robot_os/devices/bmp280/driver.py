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
Bosch BMP280 barometer on I2C.

``mode: forced`` starts each conversion and fetches it when it is done, so each sample is new and
its time known. In ``mode: normal`` the chip measures by itself, with pauses; its filter is made
for that mode. The registers of the settings are read with each measurement, so a chip that lost
its power for a moment is detected, and set up again.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.devices.barometer import averaging_settings
from rt_robot_os.devices.barometer import Barometer
from rt_robot_os.devices.barometer import barometer_settings
from rt_robot_os.devices.bmp280 import wire as chip
from rt_robot_os.devices.i2c.device import i2c_settings
from rt_robot_os.devices.i2c.device import Transactions

# A conversion has failed after this many times its longest time.
_PATIENCE: Final = 4


class Bmp280(Barometer):
    """A BMP280."""

    SETTINGS = (
        *i2c_settings(address=0x76, addresses=(0x76, 0x77), frame_id='baro_link',
                      topic='baro/pressure', rate_hz=25.0, maximum_hz=155.0),
        *barometer_settings(1.3),
        Field('mode', str, 'forced',
              'Forced: the driver starts each measurement. Normal: the chip measures by itself.',
              choices=('forced', 'normal')),
        *averaging_settings(4, tuple(chip.OVERSAMPLING), tuple(chip.FILTER)),
    )
    description = 'Bosch BMP280 barometer (I2C): pressure, temperature, altitude'
    PRESSURE_RANGE_PA = (30_000.0, 110_000.0)

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Store the settings; nothing is opened.

        :raises ConfigError: a conversion takes longer than there is between two samples.
        """
        super().__init__(name, settings)
        over_t: int = settings['temperature_oversampling']
        over_p: int = settings['pressure_oversampling']
        self._conversion_ns = chip.conversion_ns(over_t, over_p)
        self.expect_time_for(self._conversion_ns)
        self._normal = settings['mode'] == 'normal'
        mode = chip.NORMAL if self._normal else chip.FORCED
        self._control = (chip.OVERSAMPLING[over_t] << 5 | chip.OVERSAMPLING[over_p] << 2 | mode)
        # The longest pause that gives a new conversion for each sample.
        fitting = [field for pause, field in chip.STANDBY_NS.items()
                   if pause + self._conversion_ns <= self.period_ns]
        self._config = (fitting or [0])[-1] << 5 | chip.FILTER[settings['filter']] << 2
        self._trimming: chip.Bmp280Trimming | None = None
        self._started_ns = 0

    def identify(self) -> Transactions[None]:
        """
        Check the chip id, and reset the chip.

        :raises DeviceError: it is another chip, or the bus failed.
        """
        yield from self.expect_chip(chip.ID, (chip.CHIP_ID,), 'a BMP280')
        yield self.put(chip.RESET, chip.RESET_VALUE)

    def begin(self, now_ns: int) -> int:
        """Wait until the chip is up."""
        return self.then(self._set_up, now_ns + chip.START_UP_NS)

    def _set_up(self, now_ns: int) -> Transactions[int]:
        """Read the trimming and write the settings."""
        if (yield self.fetch(chip.STATUS, 1))[0] & chip.STATUS_UPDATING:
            return self.then(self._set_up, now_ns + chip.START_UP_NS)
        self._trimming = chip.Bmp280Trimming.unpack(
            (yield self.fetch(chip.CALIBRATION, chip.CALIBRATION_SIZE)))
        if self._trimming is None:
            self.then(self._set_up, now_ns + chip.START_UP_NS)
            return self.reject('its trimming is blank')
        yield self.put(chip.CONFIG, self._config)
        self.start_grid(now_ns)
        if self._normal:
            yield self.put(chip.CONTROL, self._control)
            return self.then(self._fetch_normal, now_ns + self._conversion_ns)
        return (yield from self._start(now_ns))

    def _start(self, now_ns: int) -> Transactions[int]:
        """Start a conversion."""
        yield self.put(chip.CONTROL, self._control)
        self._started_ns = self.clock_ns()
        return self.then(self._fetch_forced, self._started_ns + self._conversion_ns)

    def _fetch_forced(self, now_ns: int) -> Transactions[int]:
        """Fetch the conversion; the chip sleeps after it."""
        data = yield self.fetch(chip.STATUS, chip.BURST_SIZE)
        if data[1] & 3 == chip.FORCED or data[0] & chip.STATUS_MEASURING:
            if now_ns - self._started_ns < _PATIENCE * self._conversion_ns:
                return 0
            self.advance(now_ns, self._start)
            return self.reject('a conversion does not end')
        self.advance(now_ns, self._start)
        return self._use(data, self._control & ~3, self._started_ns + self._conversion_ns)

    def _fetch_normal(self, now_ns: int) -> Transactions[int]:
        """Fetch the newest conversion."""
        self.advance(now_ns, self._fetch_normal)
        data = yield self.fetch(chip.STATUS, chip.BURST_SIZE)
        return self._use(data, self._control, now_ns)

    def _use(self, data: bytes, control: int, stamp_ns: int) -> int:
        self._bytes_read += len(data)
        if data[1] != control or data[2] & 0xFC != self._config:
            return self.reject(
                f'its settings read 0x{data[1]:02x} 0x{data[2]:02x} and were set to '
                f'0x{control:02x} 0x{self._config:02x}, did it lose power?')
        trimming = self._trimming
        if trimming is None:
            return 0
        raw_p, raw_t = chip.raw(data[4:])
        return self.publish(*chip.compensate(trimming, raw_p, raw_t), stamp_ns)
