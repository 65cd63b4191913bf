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

"""The air around a simulated barometer that is moved up and down."""

from __future__ import annotations

from collections.abc import Mapping
import math
import random
from typing import Any

from rt_robot_os.devices.atmosphere import pressure_pa
from rt_robot_os.schema import Field


def air_settings(noise_pa: float) -> tuple[Field, ...]:
    """
    Declare the settings of the air.

    :param noise_pa: of the chip, at its usual settings.
    """
    return (
        Field('altitude_m', float, 34.0, 'Altitude about which it is moved.', unit='m',
              minimum=-500.0, maximum=9000.0),
        Field('swing_m', float, 1.0, 'How far it is moved up and down.', unit='m', minimum=0.0,
              maximum=500.0),
        Field('swing_s', float, 20.0, 'How long up and down takes.', unit='s', minimum=0.1,
              maximum=1e5),
        Field('temperature_c', float, 22.0, 'Temperature.', unit='C', minimum=-40.0, maximum=85.0),
        Field('noise_pa', float, noise_pa, 'Standard deviation of the pressure.', unit='Pa',
              minimum=0.0, maximum=1e4),
    )


class Air:
    """Pressure and temperature by time, in the standard atmosphere."""

    def __init__(self, settings: Mapping[str, Any], chance: random.Random) -> None:
        """
        Keep the settings.

        :param chance: for the noise.
        """
        self._settings = settings
        self._random = chance

    def altitude_m(self, time_s: float) -> float:
        """Give the altitude."""
        s = self._settings
        swing: float = s['swing_m']
        return float(s['altitude_m']) + swing * math.sin(2 * math.pi * time_s / s['swing_s'])

    def measure(self, time_s: float) -> tuple[float, float]:
        """Give pressure in Pa, with noise, and temperature in degrees C."""
        noise: float = self._settings['noise_pa']
        return (pressure_pa(self.altitude_m(time_s)) + self._random.gauss(0.0, noise),
                float(self._settings['temperature_c']))
