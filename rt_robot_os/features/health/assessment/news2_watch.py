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
When a NEWS2 score is a reason for an alarm, and when it is one no longer.

What is not known never helps: an alarm begins by what is known for sure, as what is missing can
only add to it; and it is over only when each sign that had points has been measured anew.
"""

from __future__ import annotations

from collections.abc import Mapping
import math

from rt_robot_os.features.health.assessment.news2 import Risk
from rt_robot_os.features.health.assessment.news2 import risk_of
from rt_robot_os.features.health.assessment.news2 import Score
from rt_robot_os.messages.cause import Level
from rt_robot_os.modules.debounce import Debounce

#: The least risk of each level, the worst first.
LEVELS_OF_RISK = ((Level.CRITICAL, Risk.HIGH), (Level.URGENT, Risk.LOW_MEDIUM))


class News2Watch:
    """
    The level of alarm of scores; safe in the real-time loop.

    :ivar level: in force; None without an alarm.
    """

    __slots__ = ('level', '_levels', '_points')

    def __init__(self, for_ns: int, clear_ns: int) -> None:
        """
        Begin without an alarm.

        :param for_ns: a score has to be so high for that long.
        :param clear_ns: it has to be lower for that long.
        """
        self.level: Level | None = None
        self._levels = [(level, risk, Debounce(for_ns, clear_ns))
                        for level, risk in LEVELS_OF_RISK]
        self._points: dict[str, int] = {}

    @property
    def due_ns(self) -> float:
        """When :meth:`advance` has something to do if nothing comes; infinite for never."""
        return min(debounce.due_ns for _, _, debounce in self._levels)

    @property
    def held(self) -> Mapping[str, int]:
        """Return the points that count in an alarm, those of signs that are missing now too."""
        return self._points

    def put(self, score: Score, stamp_ns: int) -> None:
        """Take a score; :meth:`advance` to the moment before it first."""
        if self.level is None:
            self._points.clear()
        self._points.update(score.scores)
        held = risk_of(sum(self._points.values()), 3 in self._points.values())
        for _, risk, debounce in self._levels:
            debounce.put((held if debounce.on else score.least_risk) >= risk, stamp_ns)

    def advance(self, now_ns: int) -> list[tuple[int, Level | None]]:
        """Let time pass; return each change of the level with its moment."""
        found: list[tuple[int, Level | None]] = []
        while (due_ns := self.due_ns) <= now_ns and due_ns != math.inf:
            for _, _, debounce in self._levels:
                debounce.advance(int(due_ns))
            level = next((level for level, _, debounce in self._levels if debounce.on), None)
            if level != self.level:
                self.level = level
                found.append((int(due_ns), level))
        return found
