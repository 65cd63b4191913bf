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
What the nodes of a simulated house measure, as the raw numbers that their sensors give.

Warmth and light are those of the place; what a body says is made up, plausible and slow.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
import math
from random import Random
from typing import Final
from typing import NamedTuple
from typing import Protocol

from rt_robot_os.wsn.packets.conversions import centikelvin_raw
from rt_robot_os.wsn.packets.conversions import par_illuminance_raw
from rt_robot_os.wsn.packets.conversions import same_raw
from rt_robot_os.wsn.packets.conversions import sht1x_humidity_raw
from rt_robot_os.wsn.packets.conversions import sht1x_temperature_raw
from rt_robot_os.wsn.packets.paper import Kind
from rt_robot_os.wsn.survey import SurveyedNode

#: What says 1 while the node's button is pressed, while there is smoke, or water.
ALARMS: Final = frozenset({'alarm', 'smoke', 'water'})
# Warm air takes up more water: so much of the humidity for each degree.
_HUMIDITY: Final = 0.45
_AT_DEG_C: Final = 21.0
_HUMIDITY_PER_DEG: Final = -0.025
_EXCITED_PER_MIN: Final = 25.0


class Surroundings(Protocol):
    """What a place is like."""

    def temperature_c(self, x: float, y: float) -> float:
        """Return the temperature at a place."""

    def light_lux(self, x: float, y: float) -> float:
        """Return the light at a place."""


class LiveNode(Protocol):
    """A node as it is now; whoever owns it may change it at any time."""

    @property
    def surveyed(self) -> SurveyedNode:
        """Return its number, its name, what it measures."""

    @property
    def on(self) -> bool:
        """Return whether it has power."""

    @property
    def boots(self) -> int:
        """Return how often it was switched on."""

    @property
    def alarm(self) -> bool:
        """Return whether its button is pressed."""

    @property
    def position_m(self) -> tuple[float, float, float]:
        """Return where it is."""


class _Slow(NamedTuple):
    """
    A number that wanders about its mean.

    :ivar spread: its standard deviation.
    :ivar time_s: it has forgotten after so long.
    """

    mean: float
    spread: float
    time_s: float


_SLOW: Final[Mapping[str, _Slow]] = {
    'temperature': _Slow(0.0, 0.15, 300.0), 'humidity': _Slow(0.0, 0.01, 300.0),
    'light': _Slow(1.0, 0.03, 20.0), 'pulse_per_min': _Slow(72.0, 4.0, 60.0),
    'respiration_per_min': _Slow(15.0, 1.5, 60.0), 'spo2_percent': _Slow(97.0, 0.7, 60.0),
    'body_temperature': _Slow(36.8, 0.15, 1800.0)}


class NodeReadings:
    """
    The sensors of one node.

    :param node: whose they are.
    :param surroundings: what its place is like.
    :param random: for noise.
    """

    def __init__(self, node: LiveNode, surroundings: Surroundings, random: Random) -> None:
        self._node = node
        self._surroundings = surroundings
        self._random = random
        # Quantity -> when it was looked at, and how far from its mean it was, in deviations.
        self._wandering: dict[str, tuple[float, float]] = {}
        self._was_at: tuple[float, float, float] = (0.0, *node.position_m[:2])

    def raw(self, quantity: str, now_s: float, battery_raw: int) -> tuple[Kind, int]:
        """
        Measure.

        :param quantity: one of the node's.
        :param battery_raw: what the converter gives of the battery.
        :return: what it is, and the number that its sensor gives; ``Kind.NONE`` and 0 for a
            quantity that no simulated sensor measures.
        """
        if quantity == 'battery':
            return Kind.BATTERY, battery_raw
        if quantity in ALARMS:
            return Kind[quantity.upper()], int(self._node.alarm)
        measure = _MEASURES.get(quantity)
        return (Kind.NONE, 0) if measure is None else measure(self, now_s)

    def _slow(self, quantity: str, now_s: float) -> float:
        """Return a number that wanders, by a random walk that returns to its mean."""
        slow = _SLOW[quantity]
        before = self._wandering.get(quantity)
        if before is None:
            away = self._random.gauss(0.0, 1.0)
        else:
            kept = math.exp(-(now_s - before[0]) / slow.time_s)
            away = kept * before[1] + math.sqrt(1 - kept * kept) * self._random.gauss(0.0, 1.0)
        self._wandering[quantity] = now_s, away
        return slow.mean + slow.spread * away

    def _temperature_c(self, now_s: float) -> float:
        x, y, _ = self._node.position_m
        return self._surroundings.temperature_c(x, y) + self._slow('temperature', now_s)

    def _temperature(self, now_s: float) -> tuple[Kind, int]:
        return Kind.TEMPERATURE, sht1x_temperature_raw(self._temperature_c(now_s))

    def _humidity(self, now_s: float) -> tuple[Kind, int]:
        fraction = (_HUMIDITY + _HUMIDITY_PER_DEG * (self._temperature_c(now_s) - _AT_DEG_C)
                    + self._slow('humidity', now_s))
        return Kind.HUMIDITY, sht1x_humidity_raw(min(max(fraction, 0.0), 1.0))

    def _light(self, now_s: float) -> tuple[Kind, int]:
        x, y, _ = self._node.position_m
        lux = self._surroundings.light_lux(x, y) * self._slow('light', now_s)
        return Kind.LIGHT, par_illuminance_raw(max(lux, 0.0))

    def _pulse(self, now_s: float) -> tuple[Kind, int]:
        excited = _EXCITED_PER_MIN if self._node.alarm else 0.0
        return Kind.PULSE, same_raw(self._slow('pulse_per_min', now_s) + excited)

    def _respiration(self, now_s: float) -> tuple[Kind, int]:
        return Kind.RESPIRATION, same_raw(self._slow('respiration_per_min', now_s))

    def _spo2(self, now_s: float) -> tuple[Kind, int]:
        return Kind.SPO2, same_raw(min(self._slow('spo2_percent', now_s), 100.0))

    def _body_temperature(self, now_s: float) -> tuple[Kind, int]:
        return Kind.BODY_TEMPERATURE, centikelvin_raw(self._slow('body_temperature', now_s))

    def _acceleration(self, now_s: float) -> tuple[Kind, int]:
        """Return 1 g, and more or less of it while somebody walks about with the node."""
        x, y, _ = self._node.position_m
        before_s, before_x, before_y = self._was_at
        self._was_at = now_s, x, y
        took_s = now_s - before_s
        speed = math.hypot(x - before_x, y - before_y) / took_s if took_s > 0.0 else 0.0
        shaking = 0.01 + 0.2 * min(speed, 1.5)
        return Kind.ACCELERATION, same_raw(1000.0 * (1.0 + self._random.gauss(0.0, shaking)))


_MEASURES: Final[Mapping[str, Callable[[NodeReadings, float], tuple[Kind, int]]]] = {
    'temperature': NodeReadings._temperature, 'humidity': NodeReadings._humidity,
    'light': NodeReadings._light, 'pulse_per_min': NodeReadings._pulse,
    'respiration_per_min': NodeReadings._respiration, 'spo2_percent': NodeReadings._spo2,
    'body_temperature': NodeReadings._body_temperature,
    'acceleration_g': NodeReadings._acceleration}
