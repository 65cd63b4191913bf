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
lowest-priority task and the link carry it out of the core. What modules and drivers log lies
beside what the core itself reports: a flood of the former drives out nothing of the latter.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from dataclasses import replace
from enum import IntEnum
import itertools
from operator import itemgetter
from typing import Any

from rt_robot_os.base.safe_text import safe_line
from rt_robot_os.base.safe_text import safe_text

# What is logged and not formatted yet: at_ns, severity, source, text, arguments.
RawLine = tuple[int, int, str, str, tuple[Any, ...]]

TEXT_MAXIMUM = 2000
_NUMBER = itemgetter(1)


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


def formatted(line: RawLine) -> Report:
    """Format what was logged; arguments that do not fit are shown beside the text."""
    at_ns, severity, source, text, arguments = line
    if arguments:
        try:
            text = text % arguments
        except Exception:
            text = f'{text} {_shown(arguments)} (the arguments do not fit the text)'
    return Report(at_ns, Severity(severity), source, text[:TEXT_MAXIMUM])


def _safe(report: Report) -> Report:
    """Make a report fit for consoles and messages; most are that already."""
    source, text = safe_line(report.source), safe_text(report.text)
    if source is report.source and text is report.text:
        return report
    return replace(report, source=source, text=text)


def _shown(arguments: tuple[Any, ...]) -> str:
    try:
        return repr(arguments)
    except Exception as error:  # an integer of 5000 digits
        return f'({type(error).__name__})'


class Reports:
    """
    A bounded list of reports; readers keep their own place in it.

    :param capacity: the oldest gives way to a new one when it is full.
    :param lines: the same for what modules and drivers log.
    :ivar lines: what they logged, each with its number; a :class:`rt_robot_os.base.logger.Logger`
        adds.
    :ivar numbers: of both, in one order.
    """

    def __init__(self, capacity: int = 256, lines: int = 1024) -> None:
        self._kept: deque[tuple[Report, int]] = deque(maxlen=capacity)
        self.lines: deque[tuple[RawLine, int]] = deque(maxlen=lines)
        self.numbers = itertools.count()

    @property
    def total(self) -> int:
        """Count all there were."""
        kept = self._kept[-1][1] + 1 if self._kept else 0
        return max(kept, self.lines[-1][1] + 1) if self.lines else kept

    def note(self, report: Report) -> None:
        """Add a report; safe in the real-time loop."""
        # Numbered and added by one native call, which another task that notes cannot divide.
        self._kept.extend(zip((report,), self.numbers))

    def since(self, place: int) -> tuple[int, int, tuple[Report, ...]]:
        """
        Return the reports after a place; formats what was logged, so not for high priorities.

        What others have put into them can be encoded and holds no control characters.

        :param place: 0 at first, afterwards what the last call returned.
        :return: the new place, how many were dropped unread, the reports.
        """
        # The end comes first: what is noted from here on is for the next call.
        end = self.total
        if end <= place:
            return place, 0, ()
        kept, lines = tuple(self._kept), tuple(self.lines)
        found: list[tuple[Report | RawLine, int]] = sorted(
            [*_between(kept, place, end), *_between(lines, place, end)], key=_NUMBER)
        reports = tuple(_safe(each if isinstance(each, Report) else formatted(each))
                        for each, _ in found)
        return end, end - place - len(found), reports


def _between(numbered: tuple[tuple[Any, int], ...], place: int, end: int
             ) -> Iterable[tuple[Any, int]]:
    return numbered[bisect_left(numbered, place, key=_NUMBER):
                    bisect_left(numbered, end, key=_NUMBER)]
