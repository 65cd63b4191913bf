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
Personal limits and trends at work: which are broken, from when to when.

Nothing is concluded from what is not known: while a sign has no good value no limit begins to be
broken, and none that is broken is over.
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
# What has no duration of its own is over only when it has been for so long.
_CLEAR_NS = 10 * _NS_PER_S
# A trend is over when it is less than that share of its limit.
_TREND_CLEAR = 0.5


class Finding(NamedTuple):
    """
    What limits and trends say of one kind of trouble.

    :ivar kind: of the cause.
    :ivar level: the worst of those that are broken; None: it is over.
    :ivar text: for people.
    :ivar value: of the sign, or of its change.
    :ivar stamp_ns: since when.
    """

    kind: str
    level: Level | None
    text: str
    value: float
    stamp_ns: int


class _Broken:
    """Whether a limit is broken."""

    __slots__ = ('limit', 'debounce')

    def __init__(self, limit: Limit) -> None:
        self.limit = limit
        self.debounce = Debounce(limit.for_ns, max(limit.for_ns, _CLEAR_NS))


class _Changing:
    """Whether a sign changes too fast."""

    __slots__ = ('limit', 'trend', 'on')

    def __init__(self, limit: TrendLimit) -> None:
        self.limit = limit
        self.trend = Trend(limit.window_ns)
        self.on = False

    def put(self, value: float, stamp_ns: int) -> bool:
        """Take a value; return whether it is another than before."""
        if not self.trend.put(value, stamp_ns) or math.isnan(self.trend.change):
            return False
        change = self.trend.change if self.limit.is_rising else -self.trend.change
        was, self.on = self.on, change >= self.limit.amount * (_TREND_CLEAR if self.on else 1.0)
        return was != self.on


class LimitWatch:
    """All limits and trends of a person; safe in the real-time loop."""

    def __init__(self, limits: Iterable[Limit | TrendLimit]) -> None:
        """Take the limits; several of one kind, such as two levels, are one trouble."""
        limits = tuple(limits)
        self._broken = [_Broken(each) for each in limits if isinstance(each, Limit)]
        self._changing = [_Changing(each) for each in limits if isinstance(each, TrendLimit)]
        self._values: dict[str, float] = {}
        self._told: dict[str, Level | None] = {}

    @property
    def due_ns(self) -> float:
        """When :meth:`advance` has something to do if nothing comes; infinite for never."""
        return min((each.debounce.due_ns for each in self._broken), default=math.inf)

    def put(self, sign: str, value: float | None, stamp_ns: int) -> list[Finding]:
        """
        Take how a sign is; :meth:`advance` to the moment before it first.

        :param value: None while there is no good one.
        :param stamp_ns: never before an earlier one.
        """
        for broken in self._broken:
            if broken.limit.sign == sign:
                if value is None:
                    broken.debounce.reset()
                else:
                    broken.debounce.put(
                        broken.limit.is_broken(value, broken.debounce.on), stamp_ns)
        if value is None:
            return []
        self._values[sign] = value
        changed = [each.put(value, stamp_ns) for each in self._changing
                   if each.limit.sign == sign]
        return self._findings(stamp_ns) if any(changed) else []

    def advance(self, now_ns: int) -> list[Finding]:
        """Let time pass, each deadline at its own moment; return what begins, or is over."""
        found: list[Finding] = []
        while (due_ns := self.due_ns) <= now_ns:
            for each in self._broken:
                each.debounce.advance(int(due_ns))
            found += self._findings(int(due_ns))
        return found

    def _findings(self, stamp_ns: int) -> list[Finding]:
        now: dict[str, tuple[Level, str, float]] = {}
        for broken in self._broken:
            limit = broken.limit
            if broken.debounce.on and limit.level > now.get(limit.kind, (0,))[0]:
                value = self._values[limit.sign]
                now[limit.kind] = limit.level, (
                    f'{_said(limit.sign, value)}, limit {limit.value:g}'), value
        for changing in self._changing:
            trend = changing.limit
            if changing.on and trend.level > now.get(trend.kind, (0,))[0]:
                change = changing.trend.change
                now[trend.kind] = trend.level, (
                    f'{_said(trend.sign, self._values[trend.sign])}, {change:+.1f} within '
                    f'{trend.window_ns / 60 / _NS_PER_S:g} min'), change
        found = []
        for kind in (*now, *(kind for kind in self._told if kind not in now)):
            level, text, value = now.get(kind, (None, '', math.nan))
            if self._told.get(kind) != level:
                found.append(Finding(kind, level, text, value, stamp_ns))
                self._told[kind] = level
        return found


def _said(name: str, value: float) -> str:
    sign = SIGNS[name]
    return f'{sign.title} {value:g} {sign.unit}'.strip()
