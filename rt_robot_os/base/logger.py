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
The log of modules and drivers: a call in the loop only notes the text and its arguments.

The text and its arguments are kept as they are and formatted when they leave the core, by the
lowest tasks. Nothing here waits, and a task may be preempted anywhere in it by another that logs
with the same logger: each step that counts is one native call.
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
# What cannot change and costs nothing to keep. A long text is cut, everything else made a text.
_PLAIN = frozenset({int, float, bool, type(None)})


def _kept(value: object) -> object:
    """Return what may be formatted later: nobody changes it meanwhile, and it is not large."""
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
    The time during which one line of code is held back after it has logged.

    :ivar tally: counts what is held back.
    :ivar total: how many that were, once the window is closed; -1 before.
    :ivar last: the latest text and arguments that were held back.
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
    Log under one name.

    Texts are formatted with ``%`` as in Python's own logging: ``log.info('%.1f m/s', speed)``.

    :param name: of the module or the device.
    :ivar level: the least severity that is logged; may be set at any time.
    """

    def __init__(self, name: str, level: int = INFO) -> None:
        self.name = name
        self.level = level
        self._windows: dict[tuple[int, int], _Window] = {}
        self.connect(Reports(), time.monotonic_ns)

    def connect(self, reports: Reports, now_ns: Callable[[], int]) -> None:
        """
        Say where the lines go; into a list of its own before.

        :param now_ns: the clock that stamps them.
        """
        self._now_ns = now_ns
        self._extend = reports.lines.extend
        self._numbers = reports.numbers

    @property
    def level_name(self) -> str:
        """Name the least severity that is logged, as in a configuration."""
        return next((name for name, severity in zip(LEVELS, Severity) if severity >= self.level),
                    LEVELS[-1])

    def set_level(self, name: str) -> None:
        """Set it, to one of ``LEVELS``."""
        self.level = int(Severity[name.upper()])

    def debug(self, text: str, *arguments: object, throttle_s: float = 0.0,
              once: bool = False) -> None:
        """Log at DEBUG; all that :meth:`info` says holds."""
        if self.level <= 10:
            self._log(10, text, arguments, throttle_s, once)

    def info(self, text: str, *arguments: object, throttle_s: float = 0.0,
             once: bool = False) -> None:
        """
        Log at INFO; safe in the real-time loop, about a microsecond.

        :param text: with ``%`` places for the arguments, which are put in later.
        :param arguments: numbers and short texts are kept as they are; of anything else its
            ``str()`` is, made at once.
        :param throttle_s: this line of code is held back for so long after it has logged; what was
            held back is summed up then.
        :param once: this line of code logs once only.
        """
        if self.level <= 20:
            self._log(20, text, arguments, throttle_s, once)

    def warn(self, text: str, *arguments: object, throttle_s: float = 0.0,
             once: bool = False) -> None:
        """Log at WARN; all that :meth:`info` says holds."""
        if self.level <= 30:
            self._log(30, text, arguments, throttle_s, once)

    def error(self, text: str, *arguments: object, throttle_s: float = 0.0,
              once: bool = False) -> None:
        """Log at ERROR; all that :meth:`info` says holds."""
        if self.level <= 40:
            self._log(40, text, arguments, throttle_s, once)

    def fatal(self, text: str, *arguments: object, throttle_s: float = 0.0,
              once: bool = False) -> None:
        """Log at FATAL, which has no other effect; all that :meth:`info` says holds."""
        if self.level <= 50:
            self._log(50, text, arguments, throttle_s, once)

    def _log(self, severity: int, text: str, arguments: tuple[object, ...], throttle_s: float,
             once: bool) -> None:
        for value in arguments:
            if type(value) not in _PLAIN and not (
                    type(value) is str and len(value) <= ARGUMENT_MAXIMUM):
                arguments = tuple(map(_kept, arguments))
                break
        if type(text) is not str or len(text) > TEXT_MAXIMUM:
            text = str(_kept(text)) if type(text) is not str else text[:TEXT_MAXIMUM]
        now_ns = self._now_ns()
        if (once or throttle_s) and not self._passes(
                sys._getframe(2), severity, text, arguments, now_ns,
                _FOREVER_NS if once else now_ns + round(throttle_s * NS_PER_S)):
            return
        self._note((now_ns, severity, self.name, text, arguments))

    def _note(self, line: RawLine) -> None:
        # Numbered and added by one native call, which another task that logs cannot divide.
        self._extend(zip((line,), self._numbers))

    # ---- what is held back -------------------------------------------------------------------

    def _passes(self, caller: FrameType, severity: int, text: str,
                arguments: tuple[object, ...], now_ns: int, end_ns: int) -> bool:
        """Return whether a line may be logged now; if not, it is counted."""
        # By place, not by text: a formatted text differs each time.
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
            # A task above this one has closed the window before this line was counted: again.

    def _close(self, site: tuple[int, int], now_ns: int) -> None:
        """Close a window and sum up; whoever takes it out of the table does so alone."""
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
        """Sum up what was held back until now; called a few times a second by the lowest task."""
        for site, window in list(self._windows.items()):
            if now_ns >= window.end_ns:
                self._close(site, now_ns)


class Logs:
    """
    The loggers of a core.

    :ivar by_name: each that was connected.
    """

    def __init__(self, reports: Reports, now_ns: Callable[[], int]) -> None:
        self.by_name: dict[str, Logger] = {}
        self._reports = reports
        self._now_ns = now_ns

    def connect(self, log: object, level: str) -> None:
        """Make a log work, at a level; anything else is of somebody who has another use for it."""
        if isinstance(log, Logger):
            log.connect(self._reports, self._now_ns)
            log.set_level(level)
            self.by_name[log.name] = log

    def sweep(self) -> None:
        """Sum up what was held back and is due."""
        now_ns = self._now_ns()
        for log in self.by_name.values():
            log.sweep(now_ns)
