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
The log lines of the core: stored in the loop, written elsewhere.

Formatting and writing take time and may block, so the real-time code only adds a line here. The
lowest-priority task and the link take it out of the core. The log of modules and drivers is stored
separately from the core's own reports, so that a flood of the former evicts none of the latter.
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

# An unformatted log line: at_ns, severity, source, text, arguments.
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
class LogEntry:
    """
    One log line.

    :ivar at_ns: CLOCK_MONOTONIC.
    :ivar source: device, task or part of the core.
    """

    at_ns: int
    severity: Severity
    source: str
    text: str

    def __str__(self) -> str:
        return f'[{self.severity.name}] {self.source}: {self.text}'


def formatted(line: RawLine) -> LogEntry:
    """Format a log line; arguments that do not fit are appended to the text."""
    at_ns, severity, source, text, arguments = line
    if arguments:
        try:
            text = text % arguments
        except Exception:
            text = f'{text} {_shown(arguments)} (the arguments do not fit the text)'
    return LogEntry(at_ns, Severity(severity), source, text[:TEXT_MAXIMUM])


def _safe(report: LogEntry) -> LogEntry:
    """Make a report safe for consoles and messages; most are safe already."""
    source, text = safe_line(report.source), safe_text(report.text)
    if source is report.source and text is report.text:
        return report
    return replace(report, source=source, text=text)


def _shown(arguments: tuple[Any, ...]) -> str:
    try:
        return repr(arguments)
    except Exception as error:  # such as an integer of 5000 digits
        return f'({type(error).__name__})'


class Reports:
    """
    A bounded list of reports; each reader stores its own position in it.

    :param capacity: of the core's reports; when it is full the oldest is dropped.
    :param lines: the same for the log of modules and drivers.
    :ivar lines: the log of modules and drivers, with numbers; each
        :class:`rt_robot_os.base.logger.Logger` adds to it.
    :ivar numbers: a common sequence for both.
    """

    def __init__(self, capacity: int = 256, lines: int = 1024) -> None:
        self._stored: deque[tuple[LogEntry, int]] = deque(maxlen=capacity)
        self.lines: deque[tuple[RawLine, int]] = deque(maxlen=lines)
        self.numbers = itertools.count()

    @property
    def total(self) -> int:
        """Return the number of all lines so far."""
        kept = self._stored[-1][1] + 1 if self._stored else 0
        return max(kept, self.lines[-1][1] + 1) if self.lines else kept

    def note(self, report: LogEntry) -> None:
        """Add a report; safe in the real-time loop."""
        # Numbered and added in one native call, which another task cannot preempt.
        self._stored.extend(zip((report,), self.numbers))

    def since(self, place: int) -> tuple[int, int, tuple[LogEntry, ...]]:
        """
        Return the reports after a position; it formats log lines, so not for high priorities.

        Their texts can be encoded and contain no control characters.

        :param place: 0 at first, then the position that the last call returned.
        :return: the new position, the number of reports dropped unread, the reports.
        """
        # The end is read first: lines that are added from here on are for the next call.
        end = self.total
        if end <= place:
            return place, 0, ()
        kept, lines = tuple(self._stored), tuple(self.lines)
        found: list[tuple[LogEntry | RawLine, int]] = sorted(
            [*_between(kept, place, end), *_between(lines, place, end)], key=_NUMBER)
        reports = tuple(_safe(each if isinstance(each, LogEntry) else formatted(each))
                        for each, _ in found)
        return end, end - place - len(found), reports


def _between(numbered: tuple[tuple[Any, int], ...], place: int, end: int
             ) -> Iterable[tuple[Any, int]]:
    return numbered[bisect_left(numbered, place, key=_NUMBER):
                    bisect_left(numbered, end, key=_NUMBER)]
