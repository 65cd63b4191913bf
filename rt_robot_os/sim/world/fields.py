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

"""Light and temperature by position; of heat sources by time as well."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Final

from rt_robot_os.sim.world.scene import Heat
from rt_robot_os.sim.world.scene import Lamp

# A heat source reaches half of its temperature after some 40 s, and warms its surroundings.
_BURN_S: Final = 60.0
_BURN_RADIUS_M: Final = 1.5


def light_lux(lamps: Sequence[Lamp], x: float, y: float, height_m: float) -> float:
    """
    Return the light of lamps on the floor; walls cast no shadow.

    Source: the cosine law of an isotropic lamp.

    :param height_m: of the lamps above the floor.
    """
    total = 0.0
    for lamp in lamps:
        # The inverse square of the distance, times the cosines at the lamp and at the floor.
        share = height_m ** 2 / (height_m ** 2 + (x - lamp.x) ** 2 + (y - lamp.y) ** 2)
        total += lamp.lux * share ** 1.5
    return total


def warmth_c(places: Sequence[Heat], x: float, y: float) -> float:
    """Return the temperature difference by warm and cold places; a Gaussian of the distance."""
    return sum(place.degrees * math.exp(
        -((x - place.x) ** 2 + (y - place.y) ** 2) / (2.0 * place.radius_m ** 2))
        for place in places)


class HeatSource:
    """
    A place that warms up and cools down gradually.

    :param x: in m.
    :param y: in m.
    """

    def __init__(self, x: float, y: float) -> None:
        self._x, self._y = x, y
        self._from = self._to = self._since_s = 0.0

    def aim(self, degrees: float, time_s: float) -> None:
        """Approach a temperature difference from now on."""
        self._from, self._to, self._since_s = self._middle(time_s), degrees, time_s

    def degrees(self, time_s: float, x: float, y: float) -> float:
        """Return the temperature difference at a position."""
        place = Heat(self._x, self._y, self._middle(time_s), _BURN_RADIUS_M)
        return warmth_c((place,), x, y)

    def _middle(self, time_s: float) -> float:
        share = 1.0 - math.exp(-(time_s - self._since_s) / _BURN_S)
        return self._from + (self._to - self._from) * share
