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
Bosch BMP388 and BMP390 barometers on I2C.

The chip measures by itself at the configured rate, and flags new measurements. Each read includes
the event register, which shows a chip that lost its power for a moment.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from typing import Final

from rt_robot_os.devices.barometer import averaging_settings
from rt_robot_os.devices.barometer import Barometer
from rt_robot_os.devices.barometer import barometer_settings
from rt_robot_os.devices.bmp388 import wire as chip
from rt_robot_os.devices.i2c.device import i2c_settings
from rt_robot_os.devices.i2c.device import Transactions

# Fraction of the period after which a late measurement is polled again.
_LOOKS: Final = 8


class Bmp388(Barometer):
    """A BMP388 or BMP390."""

    SETTINGS = (
        *i2c_settings(address=0x76, addresses=(0x76, 0x77), frame_id='baro_link',
                      topic='baro/pressure', rate_hz=25.0, maximum_hz=200.0,
                      rates_hz=tuple(chip.RATES_HZ)),
        *barometer_settings(0.5),
        *averaging_settings(8, tuple(chip.OVERSAMPLING), tuple(chip.FILTER)),
    )
    description = 'Bosch BMP388 and BMP390 barometers (I2C): pressure, temperature, altitude'

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Store the settings; nothing is opened.

        :raises ConfigError: a conversion takes longer than there is between two samples.
        """
        super().__init__(name, settings)
        over_t: int = settings['temperature_oversampling']
        over_p: int = settings['pressure_oversampling']
        self.expect_time_for(chip.conversion_ns(over_t, over_p))
        self._oversampling = chip.OVERSAMPLING[over_t] << 3 | chip.OVERSAMPLING[over_p]
        self._rate = chip.RATES_HZ[settings['output_rate_hz']]
        self._filter = chip.FILTER[settings['filter']] << 1
        self._scaled: chip.Scaled = ()
        self._expected_ns = 0

    def identify(self) -> Transactions[None]:
        """
        Check the chip id, and reset the chip.

        :raises DeviceError: it is another chip, or the bus failed.
        """
        yield from self.expect_chip(chip.ID, tuple(chip.CHIP_IDS), 'a BMP388 or BMP390')
        yield self.put(chip.COMMAND, chip.RESET_VALUE)

    def begin(self, now_ns: int) -> int:
        """Wait until the chip is up."""
        return self.then(self._set_up, now_ns + chip.START_UP_NS)

    def _set_up(self, now_ns: int) -> Transactions[int]:
        """Read the trimming and write the settings."""
        data = yield self.fetch(chip.CALIBRATION, chip.CALIBRATION_SIZE)
        trimming = chip.Bmp388Trimming.unpack(data)
        if trimming is None:
            self.then(self._set_up, now_ns + chip.START_UP_NS)
            return self.reject('its trimming is blank')
        self._scaled = trimming.scaled()
        yield self.fetch(chip.EVENT, 1)  # reading it clears the flag of the reset
        yield self.put(chip.OVERSAMPLING_REGISTER, self._oversampling)
        yield self.put(chip.RATE, self._rate)
        yield self.put(chip.CONFIG, self._filter)
        yield self.put(chip.POWER, chip.POWER_NORMAL)
        return self.then(self._check, now_ns + chip.START_UP_NS)

    def _check(self, now_ns: int) -> Transactions[int]:
        """Check whether the chip accepts the settings."""
        self._expected_ns = now_ns
        self.then(self._fetch, now_ns)
        if (yield self.fetch(chip.ERROR, 1))[0] & chip.ERROR_CONFIG:
            return self.reject('it refuses the combination of rate and oversampling')
        return 0

    def _fetch(self, now_ns: int) -> Transactions[int]:
        """Fetch a measurement, if there is a new one."""
        data = yield self.fetch(chip.STATUS, chip.BURST_SIZE)
        if data[chip.EVENT - chip.STATUS] & chip.EVENT_POWER_ON:
            self.then(self.begin, now_ns)
            return self.reject('it lost its power for a moment')
        if data[0] & chip.STATUS_READY != chip.STATUS_READY:
            self._expected_ns = now_ns + self.period_ns // _LOOKS
            return self.then(self._fetch, self._expected_ns)
        self._bytes_read += len(data)
        # The chip has its own clock, and has measured at the latest now.
        self._expected_ns = min(self._expected_ns, now_ns) + self.period_ns
        self.then(self._fetch, self._expected_ns)
        raw_p, raw_t = chip.raw(data[1:7])
        return self.publish(*chip.compensate(self._scaled, raw_p, raw_t), now_ns)
