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
What the core has to tell people: noted in the loop, written elsewhere.

Formatting and writing cost time and may block, so the real-time code only leaves a line here; the
lowest-priority task and the link carry it out of the core.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from enum import IntEnum
import itertools


class Severity(IntEnum):
    """The severities of ROS 2 logging, with its numbers."""

    DEBUG = 10
    INFO = 20
    WARN = 30
    ERROR = 40
    FATAL = 50


@dataclass(frozen=True)
class Report:
    """
    One line.

    :ivar at_ns: CLOCK_MONOTONIC.
    :ivar source: device, task or part of the core.
    """

    at_ns: int
    severity: Severity
    source: str
    text: str

    def __str__(self) -> str:
        return f'[{self.severity.name}] {self.source}: {self.text}'


class Reports:
    """
    A bounded list of reports; readers keep their own place in it.

    :param capacity: the oldest gives way to a new one when it is full.
    """

    def __init__(self, capacity: int = 256) -> None:
        self._kept: deque[tuple[Report, int]] = deque(maxlen=capacity)
        self._numbers = itertools.count()

    @property
    def total(self) -> int:
        """Count all there were."""
        return self._kept[-1][1] + 1 if self._kept else 0

    def note(self, report: Report) -> None:
        """Add a report; safe in the real-time loop."""
        # Numbered and added by one native call, which another task that notes cannot divide.
        self._kept.extend(zip((report,), self._numbers))

    def since(self, place: int) -> tuple[int, int, tuple[Report, ...]]:
        """
        Give the reports after a place.

        :param place: 0 at first, afterwards what the last call returned.
        :return: the new place, how many were dropped unread, the reports.
        """
        kept = tuple(self._kept)
        if not kept:
            return place, 0, ()
        first = kept[0][1]
        reports = tuple(report for report, _ in kept[max(0, place - first):])
        return kept[-1][1] + 1, max(0, first - place), reports
