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
When a NEWS2 score is a cause of an alarm, and when that ends.

Missing values never help: an alarm starts by the known points, to which missing signs can only
add, and it ends only when each sign that had points has been measured again.
"""

from __future__ import annotations

from collections.abc import Mapping
import math

from rt_robot_os.features.health.assessment.news2 import Risk
from rt_robot_os.features.health.assessment.news2 import risk_of
from rt_robot_os.features.health.assessment.news2 import Score
from rt_robot_os.messages.cause import Level
from rt_robot_os.modules.debounce import Debounce

#: Least risk of each level, the highest level first.
LEVELS_OF_RISK = ((Level.CRITICAL, Risk.HIGH), (Level.URGENT, Risk.LOW_MEDIUM))


class News2Watch:
    """
    Alarm level of successive scores; safe in the real-time loop.

    :ivar level: the active one; None without an alarm.
    """

    __slots__ = ('level', '_levels', '_points')

    def __init__(self, for_ns: int, clear_ns: int) -> None:
        """
        Start without an alarm.

        :param for_ns: time for which a score must be high before an alarm starts.
        :param clear_ns: time for which it must be lower before the alarm ends.
        """
        self.level: Level | None = None
        self._levels = [(level, risk, Debounce(for_ns, clear_ns))
                        for level, risk in LEVELS_OF_RISK]
        self._points: dict[str, int] = {}

    @property
    def due_ns(self) -> float:
        """Time of the next deadline; infinite without one."""
        return min(debounce.due_ns for _, _, debounce in self._levels)

    @property
    def held(self) -> Mapping[str, int]:
        """Return the points that count in an active alarm, also of signs that are missing now."""
        return self._points

    def put(self, score: Score, stamp_ns: int) -> None:
        """Add a score; the caller has called :meth:`advance` with the time before it."""
        if self.level is None:
            self._points.clear()
        self._points.update(score.scores)
        held = risk_of(sum(self._points.values()), 3 in self._points.values())
        for _, risk, debounce in self._levels:
            debounce.put((held if debounce.on else score.least_risk) >= risk, stamp_ns)

    def advance(self, now_ns: int) -> list[tuple[int, Level | None]]:
        """Process the deadlines until a time; return each change of the level with its time."""
        found: list[tuple[int, Level | None]] = []
        while (due_ns := self.due_ns) <= now_ns and due_ns != math.inf:
            for _, _, debounce in self._levels:
                debounce.advance(int(due_ns))
            level = next((level for level, _, debounce in self._levels if debounce.on), None)
            if level != self.level:
                self.level = level
                found.append((int(due_ns), level))
        return found
