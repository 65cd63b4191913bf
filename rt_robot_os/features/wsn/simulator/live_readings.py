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
The measurements of the nodes of a simulated house, in their units and as raw sensor values.

Temperature, light and motion are those of the position; vital signs are those of the wearer. For a
node without a wearer they are generated: plausible values that vary slowly.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
import math
from random import Random
from typing import Final
from typing import NamedTuple
from typing import Protocol

from rt_robot_os.features.wsn.packets.conversions import battery_raw
from rt_robot_os.features.wsn.packets.conversions import centikelvin_raw
from rt_robot_os.features.wsn.packets.conversions import par_illuminance_raw
from rt_robot_os.features.wsn.packets.conversions import same_raw
from rt_robot_os.features.wsn.packets.conversions import sht1x_humidity_raw
from rt_robot_os.features.wsn.packets.conversions import sht1x_temperature_raw
from rt_robot_os.features.wsn.packets.paper import Kind
from rt_robot_os.messages.quantities import ALARMS
from rt_robot_os.messages.survey import SurveyedNode

# Change of the relative humidity for each degree: warm air takes up more water.
_HUMIDITY: Final = 0.45
_AT_DEG_C: Final = 21.0
_HUMIDITY_PER_DEG: Final = -0.025
_EXCITED_PER_MIN: Final = 25.0


class Environment(Protocol):
    """The physical quantities at a position."""

    def temperature_c(self, x: float, y: float) -> float:
        """Return the temperature at a position."""

    def light_lux(self, x: float, y: float) -> float:
        """Return the illuminance at a position."""

    def noticed(self, x: float, y: float) -> bool:
        """Return whether a motion detector at a position detects a person."""


class LiveNode(Protocol):
    """The current state of a node; its owner may change it at any time."""

    @property
    def surveyed(self) -> SurveyedNode:
        """Return its number, name and quantities."""

    @property
    def on(self) -> bool:
        """Return whether it has power."""

    @property
    def boots(self) -> int:
        """Return the number of times it was switched on."""

    @property
    def alarms(self) -> Mapping[str, int]:
        """Return the active alarms of its button and its smoke and water sensors."""

    @property
    def worn(self) -> bool:
        """Return whether a person wears it."""

    def vital(self, sign: str) -> float | None:
        """Return a vital sign of the wearer; None without a wearer or such a sign."""

    @property
    def position_m(self) -> tuple[float, float, float]:
        """Return its position."""


class _Slow(NamedTuple):
    """
    A value that varies about its mean.

    :ivar spread: its standard deviation.
    :ivar time_s: its correlation time.
    """

    mean: float
    spread: float
    time_s: float


_SLOW: Final[Mapping[str, _Slow]] = {
    'temperature': _Slow(0.0, 0.15, 300.0), 'humidity': _Slow(0.0, 0.01, 300.0),
    'light': _Slow(1.0, 0.03, 20.0), 'pulse_per_min': _Slow(72.0, 4.0, 60.0),
    'respiration_per_min': _Slow(15.0, 1.5, 60.0), 'spo2_percent': _Slow(97.0, 0.7, 60.0),
    'body_temperature': _Slow(36.8, 0.15, 1800.0), 'systolic_mmhg': _Slow(126.0, 6.0, 600.0),
    'diastolic_mmhg': _Slow(78.0, 4.0, 600.0)}
# For user-defined quantities.
_ANY: Final = _Slow(50.0, 5.0, 60.0)


class NodeReadings:
    """
    The sensors of one node.

    :param node: the node.
    :param environment: the quantities at its position.
    :param random: random numbers for noise.
    :param nearest: returns the number of the node with the strongest signal.
    """

    def __init__(self, node: LiveNode, environment: Environment, random: Random,
                 nearest: Callable[[], int] = lambda: 0) -> None:
        self._node = node
        self._nearest = nearest
        self._environment = environment
        self._random = random
        # Quantity -> time of its last value, and deviation from the mean in standard deviations.
        self._wandering: dict[str, tuple[float, float]] = {}
        self._was_at: tuple[float, float, float] = (0.0, *node.position_m[:2])

    def value(self, quantity: str, now_s: float, battery_v: float) -> float:
        """
        Measure in the unit of the quantity.

        :param battery_v: of the node's battery.
        :return: for an unknown quantity a value that varies about 50.
        """
        if quantity == 'battery':
            return battery_v
        if quantity in ALARMS:
            return float(self._node.alarms.get(quantity, 0))
        vital = self._node.vital(quantity)
        if vital is not None:
            return vital
        measure = _MEASURES.get(quantity)
        return self._slow(quantity, now_s) if measure is None else measure(self, now_s)

    def raw(self, quantity: str, now_s: float, battery_v: float) -> tuple[Kind, int]:
        """
        Measure as a raw sensor value.

        :return: kind and raw value; ``Kind.NONE`` and 0 if the paper has no kind for the quantity.
        """
        kind, convert = _SENSORS.get(quantity, (Kind.NONE, None))
        if convert is None:
            return Kind.NONE, 0
        return kind, convert(self.value(quantity, now_s, battery_v))

    def _slow(self, quantity: str, now_s: float) -> float:
        """Return a value of a random walk that returns to its mean."""
        slow = _SLOW.get(quantity, _ANY)
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
        return self._environment.temperature_c(x, y) + self._slow('temperature', now_s)

    def _humidity(self, now_s: float) -> float:
        fraction = (_HUMIDITY + _HUMIDITY_PER_DEG * (self._temperature_c(now_s) - _AT_DEG_C)
                    + self._slow('humidity', now_s))
        return min(max(fraction, 0.0), 1.0)

    def _light_lx(self, now_s: float) -> float:
        x, y, _ = self._node.position_m
        return max(self._environment.light_lux(x, y) * self._slow('light', now_s), 0.0)

    def _pulse_per_min(self, now_s: float) -> float:
        excited = _EXCITED_PER_MIN if self._node.alarms else 0.0
        return self._slow('pulse_per_min', now_s) + excited

    def _spo2_percent(self, now_s: float) -> float:
        return min(self._slow('spo2_percent', now_s), 100.0)

    def _acceleration_g(self, now_s: float) -> float:
        """Return 1 g, with variations while the wearer of the node walks."""
        x, y, _ = self._node.position_m
        before_s, before_x, before_y = self._was_at
        self._was_at = now_s, x, y
        took_s = now_s - before_s
        speed = math.hypot(x - before_x, y - before_y) / took_s if took_s > 0.0 else 0.0
        return 1.0 + self._random.gauss(0.0, 0.01 + 0.2 * min(speed, 1.5))

    def _nothing(self, now_s: float) -> float:
        """Return 0: breathing air, alert."""
        return 0.0

    def _presence(self, now_s: float) -> float:
        return float(self._environment.noticed(*self._node.position_m[:2]))

    def _nearest_node(self, now_s: float) -> float:
        return float(self._nearest())


def _milli_raw(value: float) -> int:
    return same_raw(1000.0 * value)


def _tenths_raw(value: float) -> int:
    return same_raw(10.0 * value)


# Quantities not listed here only vary.
_MEASURES: Final[Mapping[str, Callable[[NodeReadings, float], float]]] = {
    'temperature': NodeReadings._temperature_c, 'humidity': NodeReadings._humidity,
    'light': NodeReadings._light_lx, 'pulse_per_min': NodeReadings._pulse_per_min,
    'spo2_percent': NodeReadings._spo2_percent, 'acceleration_g': NodeReadings._acceleration_g,
    'presence': NodeReadings._presence, 'nearest_node': NodeReadings._nearest_node,
    **dict.fromkeys(('oxygen_l_per_min', 'consciousness'), NodeReadings._nothing)}
# Quantity -> its kind in the paper, and the conversion to the raw value.
_SENSORS: Final[Mapping[str, tuple[Kind, Callable[[float], int]]]] = {
    'temperature': (Kind.TEMPERATURE, sht1x_temperature_raw),
    'humidity': (Kind.HUMIDITY, sht1x_humidity_raw), 'light': (Kind.LIGHT, par_illuminance_raw),
    'battery': (Kind.BATTERY, battery_raw), 'pulse_per_min': (Kind.PULSE, same_raw),
    'respiration_per_min': (Kind.RESPIRATION, same_raw), 'spo2_percent': (Kind.SPO2, same_raw),
    'body_temperature': (Kind.BODY_TEMPERATURE, centikelvin_raw),
    'acceleration_g': (Kind.ACCELERATION, _milli_raw), 'alarm': (Kind.ALARM, same_raw),
    'smoke': (Kind.SMOKE, same_raw), 'water': (Kind.WATER, same_raw),
    'systolic_mmhg': (Kind.SYSTOLIC, same_raw), 'diastolic_mmhg': (Kind.DIASTOLIC, same_raw),
    'oxygen_l_per_min': (Kind.OXYGEN, _tenths_raw),
    'consciousness': (Kind.CONSCIOUSNESS, same_raw), 'presence': (Kind.PRESENCE, same_raw),
    'nearest_node': (Kind.NEAREST_NODE, same_raw)}
