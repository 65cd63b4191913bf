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
The National Early Warning Score 2, by its chart.

The score belongs to the Royal College of Physicians (National Early Warning Score (NEWS) 2,
London, 2017), which permits its use free of charge, with acknowledgement. It applies to people of
16 years and more who are not pregnant. The second SpO2 scale applies only to patients with
hypercapnic respiratory failure that a clinician has confirmed.

The chart has integers, and tenths of a degree, so values are rounded first: half up, and by their
decimal digits, so that 38.05 becomes 38.1 although no binary number is 38.05. A missing value
never counts as normal: the sum of the others is a lower bound of the score.
"""

from __future__ import annotations

from collections.abc import Mapping
from decimal import Decimal
from decimal import ROUND_HALF_UP
from enum import IntEnum
import math
from types import MappingProxyType
from typing import Final
from typing import NamedTuple

from rt_robot_os.messages.signs import Consciousness
from rt_robot_os.messages.signs import SIGNS

RESPIRATION: Final = 'respiration_per_min'
SPO2: Final = 'spo2_percent'
OXYGEN: Final = 'oxygen_l_per_min'
SYSTOLIC: Final = 'systolic_mmhg'
PULSE: Final = 'pulse_per_min'
CONSCIOUSNESS: Final = 'consciousness'
TEMPERATURE: Final = 'body_temperature'
#: Parameters of the score, in the order of the chart.
PARAMETERS: Final = (RESPIRATION, SPO2, OXYGEN, SYSTOLIC, PULSE, CONSCIOUSNESS, TEMPERATURE)
SCALES: Final = (1, 2)
MOST: Final = 20


class Risk(IntEnum):
    """The clinical risk of a score; a higher value is worse."""

    LOW = 0
    #: A single parameter scores 3.
    LOW_MEDIUM = 1
    MEDIUM = 2
    HIGH = 3

    @property
    def title(self) -> str:
        """Return the name in the chart."""
        return _TITLES[self]


_TITLES: Final = {Risk.LOW: 'Low', Risk.LOW_MEDIUM: 'Low-Medium', Risk.MEDIUM: 'Medium',
                  Risk.HIGH: 'High'}
_RESPONSES: Final = {
    Risk.LOW: 'ward-based response', Risk.LOW_MEDIUM: 'urgent ward-based response',
    Risk.MEDIUM: 'urgent response', Risk.HIGH: 'emergency response'}
_FREQUENCIES: Final = {
    Risk.LOW: 'minimum 4-6-hourly', Risk.LOW_MEDIUM: 'minimum hourly',
    Risk.MEDIUM: 'minimum hourly', Risk.HIGH: 'continuous'}
_FREQUENCY_OF_0: Final = 'minimum 12-hourly'
_URGENT: Final = 5
_EMERGENCY: Final = 7
_RED: Final = 3

# (upper bound, inclusive; points): the first band that contains a value counts.
_Bands = tuple[tuple[float, int], ...]
_BANDS: Final[Mapping[str, _Bands]] = MappingProxyType({
    RESPIRATION: ((8, 3), (11, 1), (20, 0), (24, 2), (math.inf, 3)),
    SYSTOLIC: ((90, 3), (100, 2), (110, 1), (219, 0), (math.inf, 3)),
    PULSE: ((40, 3), (50, 1), (90, 0), (110, 1), (130, 2), (math.inf, 3)),
    TEMPERATURE: ((35.0, 3), (36.0, 1), (38.0, 0), (39.0, 1), (math.inf, 2)),
})
_SPO2_SCALE_1: Final[_Bands] = ((91, 3), (93, 2), (95, 1), (math.inf, 0))
_SPO2_SCALE_2_AIR: Final[_Bands] = ((83, 3), (85, 2), (87, 1), (math.inf, 0))
_SPO2_SCALE_2_OXYGEN: Final[_Bands] = (
    (83, 3), (85, 2), (87, 1), (92, 0), (94, 1), (96, 2), (math.inf, 3))
# Above it scale 2 depends on supplemental oxygen.
_SPO2_SCALE_2_ANY: Final = 92

# Decimal digits that count; further ones are the rounding error of a float.
_DIGITS: Final = 4
_ONE: Final = Decimal(1)
_TENTH: Final = Decimal('0.1')


class Score(NamedTuple):
    """
    The score of a set of values.

    :ivar scores: points of each known parameter.
    :ivar missing: the other parameters, in the order of the chart.
    :ivar scale: SpO2 scale, 1 or 2.
    """

    scores: Mapping[str, int]
    missing: tuple[str, ...]
    scale: int

    @property
    def complete(self) -> bool:
        """Return whether no parameter is missing; else there is no score."""
        return not self.missing

    @property
    def at_least(self) -> int:
        """Return the sum of the known points, a lower bound of the score."""
        return sum(self.scores.values())

    @property
    def total(self) -> int | None:
        """Return the score; None when a parameter is missing."""
        return None if self.missing else self.at_least

    @property
    def red(self) -> tuple[str, ...]:
        """Return the parameters that score 3."""
        return tuple(name for name, score in self.scores.items() if score == _RED)

    @property
    def least_risk(self) -> Risk:
        """Return the risk of the known points, a lower bound of the risk."""
        return risk_of(self.at_least, bool(self.red))

    @property
    def risk(self) -> Risk | None:
        """Return the clinical risk; None when a parameter is missing."""
        return None if self.missing else self.least_risk

    @property
    def response(self) -> str:
        """Return the least response; empty when parameters are missing and none scores."""
        if self.missing and not self.at_least:
            return ''
        return _RESPONSES[self.least_risk]

    @property
    def frequency(self) -> str:
        """Return how often to measure; empty when parameters are missing and none scores."""
        if not self.at_least:
            return '' if self.missing else _FREQUENCY_OF_0
        return _FREQUENCIES[self.least_risk]


def risk_of(total: int, has_red: bool) -> Risk:
    """Return the clinical risk of a sum, and of whether a single parameter scores 3."""
    if total >= _EMERGENCY:
        return Risk.HIGH
    if total >= _URGENT:
        return Risk.MEDIUM
    return Risk.LOW_MEDIUM if has_red else Risk.LOW


def rounded(name: str, value: float) -> float:
    """
    Round a value for the chart: a temperature to tenths, others to integers; half up.

    Safe in the real-time loop.
    """
    step = _TENTH if name == TEMPERATURE else _ONE
    return float(Decimal(f'{float(value):.{_DIGITS}f}').quantize(step, ROUND_HALF_UP))


def score(values: Mapping[str, float | None], scale: int = 1) -> Score:
    """
        Score a set of values; safe in the real-time loop.

        :param values: by parameter, in the units of :data:`SIGNS`; an absent, implausible or NaN
            value is missing. Oxygen in l/min: 0 is air.
        :param scale: SpO2 scale: 1, or 2 on a clinician's decision.
    :raises ValueError: there is no such scale.
    """
    if scale not in SCALES:
        raise ValueError(f'SpO2 scale {scale!r}: must be 1, or 2 by the decision of a clinician')
    known = {name: float(value) for name in PARAMETERS
             if (value := values.get(name)) is not None and SIGNS[name].is_plausible(value)}
    found: dict[str, int] = {}
    for name in PARAMETERS:
        points = _points(name, known, scale)
        if points is not None:
            found[name] = points
    return Score(found, tuple(name for name in PARAMETERS if name not in found), scale)


def _points(name: str, known: Mapping[str, float], scale: int) -> int | None:
    value = known.get(name)
    if value is None:
        return None
    if name == OXYGEN:
        return 2 if value > 0.0 else 0
    if name == CONSCIOUSNESS:
        return 0 if value == Consciousness.ALERT else _RED
    number = rounded(name, value)
    if name != SPO2:
        return _band_points(_BANDS[name], number)
    if scale == 1:
        return _band_points(_SPO2_SCALE_1, number)
    if number <= _SPO2_SCALE_2_ANY:
        return _band_points(_SPO2_SCALE_2_AIR, number)
    if OXYGEN not in known:
        return None  # no points on air, points on oxygen
    return _band_points(_SPO2_SCALE_2_OXYGEN if known[OXYGEN] > 0.0 else _SPO2_SCALE_2_AIR, number)


def _band_points(bands: _Bands, number: float) -> int:
    for most, points in bands:
        if number <= most:
            return points
    raise AssertionError('the last band is unbounded')
