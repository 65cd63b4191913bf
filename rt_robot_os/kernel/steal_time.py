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
Steal time: time in which Linux did not run the kernel's thread although it was ready to run.

A job that was interrupted by another program, or whose process was stopped, took long without
computing long. The clocks that show this are read only when a time seems long: the thread's
CPU time, and the time that it waited for a CPU. They are compared with their values at the last
reading, at most a few milliseconds before. So the steal time since then is attributed, and never
more than the time in question.

The time that a job waits in a system call of its own (a disk) remains its own. It does not count
towards a budget with ``on_budget: abort``, see :meth:`FaultHandling.attribute_gap`: there the
thread's CPU time decides, also where a higher job lost time as well and was attributed its part
first.
"""

from __future__ import annotations

from typing import Final

from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.kernel.clock import Clock
from rt_robot_os.kernel.histogram import Histogram

_MINIMUM_NS: Final = 50 * NS_PER_US


class StealTime:
    """
    The account of steal time.

    :ivar times: histogram of its durations.
    :ivar events: their number.
    :ivar total_ns: their sum.
    """

    __slots__ = ('times', 'events', 'total_ns', '_clock', '_at_ns', '_computed_ns', '_waited_ns')

    def __init__(self, clock: Clock) -> None:
        self.times = Histogram()
        self.events = self.total_ns = 0
        self._clock = clock
        self._at_ns = self._computed_ns = self._waited_ns = 0

    def start(self, now_ns: int) -> None:
        """Reset the account at the start of the kernel."""
        self.reset()
        self._read(now_ns)

    def reset(self) -> None:
        """Reset the counters."""
        self.times.clear()
        self.events = self.total_ns = 0

    def refresh(self, now_ns: int) -> None:
        """Read the clocks, so that earlier steal time is charged to no job; about 1 us."""
        self._clock.was_stopped = False
        self._read(now_ns)

    def _read(self, now_ns: int) -> None:
        """Read the clocks."""
        self._at_ns = now_ns
        self._computed_ns = self._clock.computed_ns()
        self._waited_ns = self._clock.waited_ns()

    def attribute(self, now_ns: int, window_ns: int) -> int:
        """
        Return the steal time in a window that seems long, and count it; called locked.

        :param window_ns: its length; it ends now.
        """
        clock = self._clock
        at_ns, computed_ns, waited_ns = self._at_ns, self._computed_ns, self._waited_ns
        self._read(now_ns)  # runs Python code, so that a pending SIGCONT is handled
        idle_ns = now_ns - at_ns - (self._computed_ns - computed_ns)  # or waiting, or stopped
        taken_ns = self._waited_ns - waited_ns
        if clock.was_stopped:
            stopped_ns = min(window_ns - (self._computed_ns - computed_ns), idle_ns)
            # Otherwise the stop came after now_ns and belongs to the next window.
            if stopped_ns > clock.now_ns() - now_ns:
                clock.was_stopped = False
                taken_ns = stopped_ns
        taken_ns = min(taken_ns, idle_ns, window_ns)
        if taken_ns < _MINIMUM_NS:
            return 0
        self.times.add(taken_ns)
        self.events += 1
        self.total_ns += taken_ns
        return taken_ns
