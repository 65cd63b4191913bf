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
The log of modules and drivers: a call in the loop only stores the text and its arguments.

The text and its arguments are stored unmodified and formatted by the lowest-priority tasks when
they leave the core. Nothing here waits. A task may be preempted anywhere in it by another that
uses the same logger: each critical step is one native call.
"""

from __future__ import annotations

from collections.abc import Callable
import itertools
from numbers import Number
import sys
import time
from types import CodeType
from types import FrameType
from typing import Any

from rt_robot_os.base.reports import RawLine
from rt_robot_os.base.reports import Reports
from rt_robot_os.base.reports import Severity
from rt_robot_os.base.reports import TEXT_MAXIMUM
from rt_robot_os.base.units import NS_PER_S

DEBUG, INFO, WARN, ERROR, FATAL = (int(severity) for severity in Severity)
LEVELS = tuple(severity.name.lower() for severity in Severity)
ARGUMENT_MAXIMUM = 500
SITES_MAXIMUM = 256

_FOREVER_NS = 1 << 63
# Immutable types that are stored unmodified. A long string is cut; others are converted to
# strings.
_IMMUTABLE_TYPES = frozenset({int, float, bool, type(None)})


def _immutable(value: object) -> object:
    """Return an immutable value of limited size, which can be formatted later."""
    if isinstance(value, Number):
        return value
    if isinstance(value, str):
        return str(value[:ARGUMENT_MAXIMUM])
    try:
        return str(value)[:ARGUMENT_MAXIMUM]
    except Exception as error:
        return f'<{type(value).__name__}: its str() raised {type(error).__name__}>'


class _Window:
    """
    The throttling window of one line of code after it has logged.

    :ivar tally: counts the suppressed calls.
    :ivar total: their number, once the window is closed; -1 before.
    :ivar last: text and arguments of the last suppressed call.
    """

    __slots__ = ('code', 'severity', 'begin_ns', 'end_ns', 'tally', 'total', 'last')

    def __init__(self, code: CodeType, severity: int, begin_ns: int, end_ns: int) -> None:
        self.code = code  # referenced, so that its id() stays unique
        self.severity = severity
        self.begin_ns = begin_ns
        self.end_ns = end_ns
        self.tally = itertools.count()
        self.total = -1
        self.last: tuple[str, tuple[Any, ...]] = ('', ())


class Logger:
    """
    A named logger.

    Texts are formatted with ``%`` as in Python's own logging: ``log.info('%.1f m/s', speed)``.

    :param name: of the module or the device.
    :ivar level: the lowest severity that is logged; may be set at any time.
    """

    def __init__(self, name: str, level: int = INFO) -> None:
        self.name = name
        self.level = level
        self._windows: dict[tuple[int, int], _Window] = {}
        self.connect(Reports(), time.monotonic_ns)

    def connect(self, reports: Reports, now_ns: Callable[[], int]) -> None:
        """
        Set the destination of the lines; before this they go to a private list.

        :param now_ns: the clock for their stamps.
        """
        self._now_ns = now_ns
        self._extend = reports.lines.extend
        self._numbers = reports.numbers

    @property
    def level_name(self) -> str:
        """Return the name of the lowest severity that is logged, as in a configuration."""
        return next((name for name, severity in zip(LEVELS, Severity) if severity >= self.level),
                    LEVELS[-1])

    def set_level(self, name: str) -> None:
        """Set the lowest severity that is logged, one of ``LEVELS``."""
        self.level = int(Severity[name.upper()])

    def debug(self, text: str, *arguments: object, throttle_s: float = 0.0,
              once: bool = False) -> None:
        """Log at DEBUG; see :meth:`info`."""
        if self.level <= 10:
            self._log(10, text, arguments, throttle_s, once)

    def info(self, text: str, *arguments: object, throttle_s: float = 0.0,
             once: bool = False) -> None:
        """
        Log at INFO; safe in the real-time loop, about a microsecond.

        :param text: with ``%`` placeholders for the arguments; formatted later.
        :param arguments: numbers and short strings are stored unmodified; anything else is
            converted by ``str()`` immediately.
        :param throttle_s: time during which this line of code is suppressed after it has logged;
            the suppressed calls are summarised afterwards.
        :param once: this line of code logs only once.
        """
        if self.level <= 20:
            self._log(20, text, arguments, throttle_s, once)

    def warn(self, text: str, *arguments: object, throttle_s: float = 0.0,
             once: bool = False) -> None:
        """Log at WARN; see :meth:`info`."""
        if self.level <= 30:
            self._log(30, text, arguments, throttle_s, once)

    def error(self, text: str, *arguments: object, throttle_s: float = 0.0,
              once: bool = False) -> None:
        """Log at ERROR; see :meth:`info`."""
        if self.level <= 40:
            self._log(40, text, arguments, throttle_s, once)

    def fatal(self, text: str, *arguments: object, throttle_s: float = 0.0,
              once: bool = False) -> None:
        """Log at FATAL; the robot keeps running; see :meth:`info`."""
        if self.level <= 50:
            self._log(50, text, arguments, throttle_s, once)

    def _log(self, severity: int, text: str, arguments: tuple[object, ...], throttle_s: float,
             once: bool) -> None:
        for value in arguments:
            if type(value) not in _IMMUTABLE_TYPES and not (
                    type(value) is str and len(value) <= ARGUMENT_MAXIMUM):
                arguments = tuple(map(_immutable, arguments))
                break
        if type(text) is not str or len(text) > TEXT_MAXIMUM:
            text = str(_immutable(text)) if type(text) is not str else text[:TEXT_MAXIMUM]
        now_ns = self._now_ns()
        if (once or throttle_s) and not self._passes(
                sys._getframe(2), severity, text, arguments, now_ns,
                _FOREVER_NS if once else now_ns + round(throttle_s * NS_PER_S)):
            return
        self._note((now_ns, severity, self.name, text, arguments))

    def _note(self, line: RawLine) -> None:
        # Numbered and added in one native call, which another task cannot preempt.
        self._extend(zip((line,), self._numbers))

    # ---- throttling --------------------------------------------------------------------------

    def _passes(self, caller: FrameType, severity: int, text: str,
                arguments: tuple[object, ...], now_ns: int, end_ns: int) -> bool:
        """Return whether a line may be logged now; otherwise count it."""
        # By place in the code, not by text: a formatted text differs each time.
        site = (id(caller.f_code), caller.f_lasti)
        while True:
            window = self._windows.get(site)
            if window is None or now_ns >= window.end_ns:
                if window is not None:
                    self._close(site, now_ns)
                elif len(self._windows) >= SITES_MAXIMUM:
                    for other in list(self._windows):
                        self._close(other, now_ns)
                fresh = _Window(caller.f_code, severity, now_ns, end_ns)
                window = self._windows.setdefault(site, fresh)
                if window is fresh:
                    return True
            window.last = text, arguments
            number = next(window.tally)
            if window.total < 0 or number < window.total:
                return False
            # A preempting task closed the window before this line was counted: retry.

    def _close(self, site: tuple[int, int], now_ns: int) -> None:
        """Close a window and summarise it; the task that removes it from the table owns it."""
        window = self._windows.pop(site, None)
        if window is None:
            return
        window.total = next(window.tally)
        if window.total and window.end_ns < _FOREVER_NS:
            text, arguments = window.last
            if not arguments:
                text = text.replace('%', '%%')
            seconds = (min(now_ns, window.end_ns) - window.begin_ns) / NS_PER_S
            self._note((now_ns, window.severity, self.name, f'%d more in %.1f s, the last: {text}',
                        (window.total, seconds, *arguments)))

    def sweep(self, now_ns: int) -> None:
        """Close expired windows; called a few times per second by the lowest-priority task."""
        for site, window in list(self._windows.items()):
            if now_ns >= window.end_ns:
                self._close(site, now_ns)


class Logs:
    """
    The loggers of a core.

    :ivar by_name: the connected loggers.
    """

    def __init__(self, reports: Reports, now_ns: Callable[[], int]) -> None:
        self.by_name: dict[str, Logger] = {}
        self._reports = reports
        self._now_ns = now_ns

    def connect(self, log: object, level: str) -> None:
        """Connect a logger and set its level; an attribute ``log`` of another type is ignored."""
        if isinstance(log, Logger):
            log.connect(self._reports, self._now_ns)
            log.set_level(level)
            self.by_name[log.name] = log

    def sweep(self) -> None:
        """Close the expired windows of all loggers."""
        now_ns = self._now_ns()
        for log in self.by_name.values():
            log.sweep(now_ns)
