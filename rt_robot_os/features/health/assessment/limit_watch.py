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
Evaluation of personal limits and trends: which are exceeded, from when to when.

A sign without a good value changes nothing: no limit becomes exceeded, and a limit that is
exceeded stays so.
"""

from __future__ import annotations

from collections.abc import Iterable
import math
from typing import NamedTuple

from rt_robot_os.features.health.assessment.limits import Limit
from rt_robot_os.features.health.assessment.limits import TrendLimit
from rt_robot_os.features.health.assessment.trend import Trend
from rt_robot_os.messages.cause import Level
from rt_robot_os.messages.signs import SIGNS
from rt_robot_os.modules.debounce import Debounce

_NS_PER_S = 1_000_000_000
# Least time below a limit before it counts as no longer exceeded.
_CLEAR_NS = 10 * _NS_PER_S
# A trend ends below this share of its limit.
_TREND_CLEAR = 0.5


class LimitChange(NamedTuple):
    """
    The level of one kind of cause has changed.

    :ivar kind: of the cause.
    :ivar level: the highest level of the exceeded limits; None: no limit is exceeded.
    :ivar text: for people.
    :ivar value: of the sign, or of its change.
    :ivar stamp_ns: time of the change.
    """

    kind: str
    level: Level | None
    text: str
    value: float
    stamp_ns: int


class _LimitState:
    """State of a limit."""

    __slots__ = ('limit', 'debounce')

    def __init__(self, limit: Limit) -> None:
        self.limit = limit
        self.debounce = Debounce(limit.for_ns, max(limit.for_ns, _CLEAR_NS))


class _TrendState:
    """State of a trend limit."""

    __slots__ = ('limit', 'trend', 'on')

    def __init__(self, limit: TrendLimit) -> None:
        self.limit = limit
        self.trend = Trend(limit.window_ns)
        self.on = False

    def put(self, value: float, stamp_ns: int) -> bool:
        """Add a value; return whether the state changed."""
        if not self.trend.put(value, stamp_ns) or math.isnan(self.trend.change):
            return False
        change = self.trend.change if self.limit.is_rising else -self.trend.change
        was, self.on = self.on, change >= self.limit.amount * (_TREND_CLEAR if self.on else 1.0)
        return was != self.on


class LimitWatch:
    """All limits and trends of a person; safe in the real-time loop."""

    def __init__(self, limits: Iterable[Limit | TrendLimit]) -> None:
        """Store the limits; several of one kind, such as two levels, are one cause."""
        limits = tuple(limits)
        self._limits = [_LimitState(each) for each in limits if isinstance(each, Limit)]
        self._trends = [_TrendState(each) for each in limits if isinstance(each, TrendLimit)]
        self._values: dict[str, float] = {}
        self._reported: dict[str, Level | None] = {}

    @property
    def due_ns(self) -> float:
        """Time of the next deadline; infinite without one."""
        return min((each.debounce.due_ns for each in self._limits), default=math.inf)

    def put(self, sign: str, value: float | None, stamp_ns: int) -> list[LimitChange]:
        """
        Add a value of a sign; the caller has called :meth:`advance` with the time before it.

        :param value: None while there is no good one.
        :param stamp_ns: not before an earlier one.
        """
        for limit_state in self._limits:
            if limit_state.limit.sign == sign:
                if value is None:
                    limit_state.debounce.reset()
                else:
                    limit_state.debounce.put(
                        limit_state.limit.is_exceeded(value, limit_state.debounce.on), stamp_ns)
        if value is None:
            return []
        self._values[sign] = value
        changed = [each.put(value, stamp_ns) for each in self._trends
                   if each.limit.sign == sign]
        return self._changes(stamp_ns) if any(changed) else []

    def advance(self, now_ns: int) -> list[LimitChange]:
        """Process the deadlines until a time, in order; return what changed."""
        found: list[LimitChange] = []
        while (due_ns := self.due_ns) <= now_ns:
            for each in self._limits:
                each.debounce.advance(int(due_ns))
            found += self._changes(int(due_ns))
        return found

    def _changes(self, stamp_ns: int) -> list[LimitChange]:
        now: dict[str, tuple[Level, str, float]] = {}
        for limit_state in self._limits:
            limit = limit_state.limit
            if limit_state.debounce.on and limit.level > now.get(limit.kind, (0,))[0]:
                value = self._values[limit.sign]
                now[limit.kind] = limit.level, (
                    f'{_value_text(limit.sign, value)}, limit {limit.value:g}'), value
        for trend_state in self._trends:
            trend = trend_state.limit
            if trend_state.on and trend.level > now.get(trend.kind, (0,))[0]:
                change = trend_state.trend.change
                now[trend.kind] = trend.level, (
                    f'{_value_text(trend.sign, self._values[trend.sign])}, {change:+.1f} within '
                    f'{trend.window_ns / 60 / _NS_PER_S:g} min'), change
        found = []
        for kind in (*now, *(kind for kind in self._reported if kind not in now)):
            level, text, value = now.get(kind, (None, '', math.nan))
            if self._reported.get(kind) != level:
                found.append(LimitChange(kind, level, text, value, stamp_ns))
                self._reported[kind] = level
        return found


def _value_text(name: str, value: float) -> str:
    sign = SIGNS[name]
    return f'{sign.title} {value:g} {sign.unit}'.strip()
