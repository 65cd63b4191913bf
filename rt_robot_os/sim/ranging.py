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


"""Simulated range finders before a wall that comes and goes."""

from __future__ import annotations

import math
from typing import Final

from rt_robot_os.drivers.decoders.maxbotix import UNITS
from rt_robot_os.drivers.encoders import nmea
from rt_robot_os.drivers.encoders import ranging as encode
from rt_robot_os.drivers.encoders import witmotion
from rt_robot_os.schema import Field
from rt_robot_os.sim.device import common_settings
from rt_robot_os.sim.device import SimulatedDevice

_NOISE: Final = 0.003


def _wall(minimum_m: float, maximum_m: float) -> tuple[Field, ...]:
    return (
        Field('nearest_m', float, minimum_m, 'Where the wall turns back.', 'm', 0.01, 20.0),
        Field('farthest_m', float, maximum_m, 'Where the wall turns back.', 'm', 0.01, 20.0),
        Field('period_s', float, 10.0, 'Time for there and back.', 's', 0.1, 1e4),
    )


class SimulatedRange(SimulatedDevice):
    """A device before a wall."""

    def distance_m(self, time_s: float) -> float:
        """Say where the wall is."""
        s = self.settings
        middle, swing = (s['farthest_m'] + s['nearest_m']) / 2, s['farthest_m'] - s['nearest_m']
        return float(middle - swing / 2 * math.cos(2 * math.pi * time_s / s['period_s']))


class SimulatedMaxBotix(SimulatedRange):
    """A MaxBotix range finder; it stays at its shortest distance below that."""

    SETTINGS = common_settings(10.0, 50.0) + _wall(0.2, 6.0) + (
        Field('unit', str, 'mm', 'Unit of the model.', choices=tuple(UNITS)),
        Field('minimum_m', float, 0.3, 'Shortest distance.', 'm', 0.0, 20.0),
        Field('maximum_m', float, 5.0, 'Longest distance.', 'm', 0.0, 20.0),
    )
    BAUD = 9600

    def sample(self, time_s: float) -> bytes:
        """Give one reading."""
        s = self.settings
        unit_m, digits, no_target = UNITS[s['unit']]
        distance_m = self.distance_m(time_s) + self.random.gauss(0.0, _NOISE)
        if distance_m > s['maximum_m']:
            return encode.maxbotix(no_target[0], digits)
        return encode.maxbotix(round(max(distance_m, s['minimum_m']) / unit_m), digits)

    def foreign(self) -> bytes:
        """Give what a satellite receiver sends."""
        return nmea.sentence('GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,')


class SimulatedSharp(SimulatedRange):
    """A converter with Sharp range finders on its first channels; below 0.1 m they are wrong."""

    SETTINGS = common_settings(25.0, 1000.0) + _wall(0.08, 1.0) + (
        Field('model', str, 'gp2y0a21', 'Whose fit gives the voltage.',
              choices=tuple(encode.SHARP_FITS)),
        Field('channels', int, 1, 'Channels that it sends, all of the same wall.', minimum=1,
              maximum=16),
    )
    BAUD = 115200

    def sample(self, time_s: float) -> bytes:
        """Give one reading of each channel."""
        coefficient_m, exponent = encode.SHARP_FITS[self.settings['model']]
        distance_m = max(self.distance_m(time_s) + self.random.gauss(0.0, _NOISE), 0.01)
        volts = (distance_m / coefficient_m) ** (1 / exponent)
        return b''.join(encode.adc(channel, min(round(volts * 1000), 5000))
                        for channel in range(self.settings['channels']))

    def foreign(self) -> bytes:
        """Give what an inertial measurement unit sends."""
        return witmotion.acceleration_frame(0.0, 0.0, 9.8)
