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
Steal time: what Linux took from the kernel's thread while that had something to compute.

A job that was interrupted by another program, or whose process was stopped, took long without
computing long. Only when something looks long are the clocks read that show it: the thread's
computing time, and the time that it waited for a CPU. They are compared with their values at the
last reading, at most a few milliseconds before; so what is attributed is what Linux took since
then, and never more than the time in question.

The time that a job waits in a system call of its own (a disk) remains its own. It does not count
for a budget to abort, see :meth:`FaultHandling.did_not_compute`: there the thread's computing time
decides, also where something above the job lost time as well and was attributed its part first.
"""

from __future__ import annotations

from typing import Final

from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.kernel.clock import Clock
from rt_robot_os.kernel.histogram import Histogram

_LEAST_NS: Final = 50 * NS_PER_US


class StealTime:
    """
    The account of it.

    :ivar times: how long, each time.
    :ivar events: how often.
    :ivar total_ns: in all.
    """

    __slots__ = ('times', 'events', 'total_ns', '_clock', '_at_ns', '_computed_ns', '_waited_ns')

    def __init__(self, clock: Clock) -> None:
        self.times = Histogram()
        self.events = self.total_ns = 0
        self._clock = clock
        self._at_ns = self._computed_ns = self._waited_ns = 0

    def start(self, now_ns: int) -> None:
        """Begin anew with the kernel."""
        self.reset()
        self._read(now_ns)

    def reset(self) -> None:
        """Begin to count anew."""
        self.times.clear()
        self.events = self.total_ns = 0

    def keep_fresh(self, now_ns: int) -> None:
        """Read the clocks: what came before is nobody's; about 1 us."""
        self._clock.was_stopped = False
        self._read(now_ns)

    def _read(self, now_ns: int) -> None:
        """Read the clocks."""
        self._at_ns = now_ns
        self._computed_ns = self._clock.computed_ns()
        self._waited_ns = self._clock.waited_ns()

    def attribute(self, now_ns: int, window_ns: int) -> int:
        """
        Return how much of a time that looks long Linux took, and count it; called locked.

        :param window_ns: the time, up to now.
        """
        clock = self._clock
        at_ns, computed_ns, waited_ns = self._at_ns, self._computed_ns, self._waited_ns
        self._read(now_ns)  # calls Python, so that a stop that is not noted yet is now
        idle_ns = now_ns - at_ns - (self._computed_ns - computed_ns)  # or waiting, or stopped
        taken_ns = self._waited_ns - waited_ns
        if clock.was_stopped:
            stopped_ns = min(window_ns - (self._computed_ns - computed_ns), idle_ns)
            # Else the stop came since then, and belongs to the next that looks long.
            if stopped_ns > clock.now_ns() - now_ns:
                clock.was_stopped = False
                taken_ns = stopped_ns
        taken_ns = min(taken_ns, idle_ns, window_ns)
        if taken_ns < _LEAST_NS:
            return 0
        self.times.add(taken_ns)
        self.events += 1
        self.total_ns += taken_ns
        return taken_ns
