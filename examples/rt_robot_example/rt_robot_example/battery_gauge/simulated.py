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

"""The simulated battery gauge: a battery that is discharged and charged again."""

from __future__ import annotations

import math

from rt_robot_example.battery_gauge.wire import encode
from rt_robot_os.base.schema import Field
from rt_robot_os.sim.device import common_settings
from rt_robot_os.sim.device import SimulatedDevice


class SimulatedBatteryGauge(SimulatedDevice):
    """A gauge on a battery with three cells."""

    SETTINGS = (
        *common_settings(10.0, 30.0),
        Field('period_s', float, 60.0, 'Time from full to empty to full.', 's', 0.1, 1e5),
        Field('full_v', float, 12.6, 'Voltage of the full battery.', 'V', 1.0, 99.0),
        Field('empty_v', float, 9.6, 'Voltage of the empty battery.', 'V', 1.0, 99.0),
    )
    BAUD = 9600

    def sample(self, time_s: float) -> bytes:
        """Return the bytes of one reading."""
        s = self.settings
        phase = 2 * math.pi * time_s / s['period_s']
        level = (1 + math.cos(phase)) / 2
        voltage = s['empty_v'] + level * (s['full_v'] - s['empty_v'])
        return encode(voltage + self.random.gauss(0.0, 0.01), -2.0 * math.sin(phase),
                      round(100 * level))

    def foreign(self) -> bytes:
        """Return the bytes of another device, for the fault `wrong`."""
        return b'R0480\r'
