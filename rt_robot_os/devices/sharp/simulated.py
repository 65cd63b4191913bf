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

"""Simulated Sharp range finders on a converter, in the world or in front of a moving wall."""

from __future__ import annotations

from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.devices.sharp.wire import adc
from rt_robot_os.devices.sharp.wire import SHARP_FITS
from rt_robot_os.devices.witmotion.wire import acceleration_frame
from rt_robot_os.sim.device import common_settings
from rt_robot_os.sim.world import RANGE_NOISE_M
from rt_robot_os.sim.world import SimulatedRange
from rt_robot_os.sim.world import wall_settings

# Beyond this, its voltage is constant.
_FARTHEST_M: Final = 20.0


class SimulatedSharp(SimulatedRange):
    """A converter with Sharp range finders on its first channels; wrong below 0.1 m."""

    SETTINGS = common_settings(25.0, 1000.0) + wall_settings(0.08, 1.0) + (
        Field('model', str, 'gp2y0a21', 'Model whose fit gives the voltage.',
              choices=tuple(SHARP_FITS)),
        Field('channels', int, 1,
              'Channels that it sends, all with the same wall; in a world those of its driver.',
              minimum=1, maximum=16),
    )
    BAUD = 115200

    def sample(self, time_s: float) -> bytes:
        """Return one reading of each channel."""
        if self.world is None:
            reading = self._millivolts(self.distance_m(time_s))
            return b''.join(adc(channel, reading) for channel in range(self.settings['channels']))
        # Each of the driver's channels has its own mounting.
        channels = self.device.get('channels', range(self.settings['channels']))
        return b''.join(adc(channel, self._millivolts(self.distance_m(time_s, place)))
                        for place, channel in enumerate(channels))

    def _millivolts(self, distance_m: float) -> int:
        coefficient_m, exponent = SHARP_FITS[self.settings['model']]
        distance_m += self.random.gauss(0.0, RANGE_NOISE_M)
        distance_m = min(max(distance_m, 0.01), _FARTHEST_M)
        volts: float = (distance_m / coefficient_m) ** (1 / exponent)
        return min(round(volts * 1000), 5000)

    def foreign(self) -> bytes:
        """Return bytes of an inertial measurement unit."""
        return acceleration_frame(0.0, 0.0, 9.8)
