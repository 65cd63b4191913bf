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
Estimate of the remaining battery life of a node, from its voltage over the last day.

The voltage alone is a poor measure: two alkaline cells have between 2.8 and 2.4 V for most of
their life, then drop quickly. So the discharge curve converts the voltage to the remaining charge,
and the slope of that over a day is extrapolated to the voltage where the radio fails. Bounded;
safe in the real-time loop.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from itertools import pairwise
import math
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_S

#: Of two AA alkaline cells under a small load: volts and remaining share of the charge. On the
#: plateau a tenth of a volt is a quarter of the life; below 2.1 V the radio fails.
ALKALINE: Final = ((2.1, 0.0), (2.2, 0.04), (2.3, 0.10), (2.4, 0.20), (2.5, 0.36), (2.6, 0.55),
                   (2.7, 0.72), (2.8, 0.85), (3.0, 0.95), (3.2, 1.0))

_DAY_NS: Final = 24 * 3600 * NS_PER_S
# Number of intervals of a day; their averages are stored.
_SPANS: Final = 96
_SPAN_NS: Final = _DAY_NS // _SPANS
# Least number of intervals for a slope: a shorter one shows the temperature, not the charge.
_SHORTEST_SPANS: Final = 12
# Least significant slope, in standard deviations.
_CLEAR: Final = 2.0


class Curve:
    """
    The discharge curve of a battery.

    :param points: volts and remaining share of the charge, both rising.
    :raises ConfigError: it does not rise.
    """

    def __init__(self, points: Sequence[tuple[float, float]] = ALKALINE) -> None:
        self._volts = [volts for volts, _ in points]
        self._shares = [share for _, share in points]
        if len(points) < 2 or any(b <= a for each in (self._volts, self._shares)
                                  for a, b in pairwise(each)):
            raise ConfigError(['a discharge curve must be at least two pairs of volts and share '
                               'of the charge, both rising'])

    def share(self, volts: float) -> float:
        """Return the remaining share of the charge, 0 to 1."""
        place = bisect_left(self._volts, volts)
        if place == 0:
            return self._shares[0]
        if place == len(self._volts):
            return self._shares[-1]
        low, high = self._volts[place - 1], self._volts[place]
        part = (volts - low) / (high - low)
        return self._shares[place - 1] + part * (self._shares[place] - self._shares[place - 1])


class _Span(NamedTuple):
    """The average share of the charge in a quarter of an hour."""

    number: int
    share: float


class BatteryLife:
    """
    The voltage of one node over a day.

    :ivar volts: smoothed; NaN before the first measurement.
    """

    __slots__ = ('volts', '_curve', '_spans', '_number', '_sum', '_count', '_days', '_dirty')

    def __init__(self, curve: Curve) -> None:
        self.volts = math.nan
        self._curve = curve
        self._spans: list[_Span] = []
        self._number = -1
        self._sum = 0.0
        self._count = 0
        self._days = math.nan
        self._dirty = False

    def add(self, volts: float, now_ns: int) -> None:
        """Add a measurement."""
        if volts > self.volts + 0.2:
            self._spans.clear()  # new cells
            self._number, self._count, self._sum = -1, 0, 0.0
            self.volts = volts
        # The ADC has a noise of a few mV, and a transmission lowers the voltage for a moment.
        self.volts = volts if self.volts != self.volts else self.volts + (
            volts - self.volts) / 8
        number = now_ns // _SPAN_NS
        if number != self._number:
            self._close()
            self._number = number
        self._sum += self._curve.share(volts)
        self._count += 1

    @property
    def share(self) -> float:
        """Return the remaining share of the charge; NaN when unknown."""
        return self._curve.share(self.volts) if self.volts == self.volts else math.nan

    def days_left(self) -> float:
        """
        Return the remaining days at the rate of the last 24 hours.

        :return: NaN while unknown: less than three hours of measurements, or no significant slope.
        """
        if self._dirty:
            self._dirty = False
            self._days = self._estimate()
        return self._days

    def _close(self) -> None:
        """Store the average of the interval that has ended."""
        if self._count:
            self._spans.append(_Span(self._number, self._sum / self._count))
            oldest = self._number - _SPANS
            while self._spans[0].number <= oldest:
                del self._spans[0]
            self._dirty = True
        self._sum, self._count = 0.0, 0

    def _estimate(self) -> float:
        spans = self._spans
        count = len(spans)
        if count < 3 or spans[-1].number - spans[0].number < _SHORTEST_SPANS:
            return math.nan
        middle = sum(each.number for each in spans) / count
        level = sum(each.share for each in spans) / count
        square = sum((each.number - middle) ** 2 for each in spans)
        slope = sum((each.number - middle) * (each.share - level) for each in spans) / square
        scatter = sum((each.share - level - slope * (each.number - middle)) ** 2
                      for each in spans) / (count - 2)
        if slope >= 0.0 or -slope < _CLEAR * math.sqrt(scatter / square):
            return math.nan
        left = max(0.0, level + slope * (spans[-1].number - middle))
        return left / -slope / _SPANS
