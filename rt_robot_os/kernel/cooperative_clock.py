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

"""The clock of a kernel without preemption: where signals are not available."""

from __future__ import annotations

import time

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.kernel.clock import Clock
from rt_robot_os.kernel.clock import Handler
from rt_robot_os.kernel.clock import NEVER_NS
from rt_robot_os.kernel.clock import suspended_ns

# While the kernel idles it polls file descriptors at this interval.
_POLL_NS = NS_PER_MS


class CooperativeClock(Clock):
    """
    CLOCK_MONOTONIC without timer interrupts.

    A kernel on this clock checks the time between two jobs, where a job calls
    ``kernel.settle()``, and where it publishes. In between a job blocks all others, whatever
    their priorities: the longest job bounds every latency.
    """

    preemptive = False

    def __init__(self) -> None:
        self.now_ns = time.monotonic_ns
        self.computed_ns = time.thread_time_ns
        self._timer_ns = NEVER_NS
        self._spare_ns = NEVER_NS

    def attach(self, on_tick: Handler, on_interrupt: Handler, on_break: Handler) -> None:
        """Do nothing: handlers are never called."""

    def detach(self) -> None:
        """Do nothing: nothing was attached."""

    def arm(self, deadline_ns: int) -> None:
        self._timer_ns = deadline_ns

    def arm_spare(self, deadline_ns: int) -> None:
        self._spare_ns = deadline_ns

    def swap(self) -> None:
        self._timer_ns, self._spare_ns = self._spare_ns, self._timer_ns

    def mask_signals(self) -> None:
        """Do nothing: nothing is asynchronous here."""

    def unmask_signals(self) -> None:
        """Do nothing: nothing is asynchronous here."""

    def suspended_ns(self) -> int:
        return suspended_ns()

    def wait_masked(self) -> bool:
        left_ns = min(self._timer_ns - self.now_ns(), _POLL_NS)
        if left_ns > 0:
            time.sleep(left_ns / 1e9)
        return True

    def spend(self, duration_ns: int) -> None:
        read_ns = self.now_ns
        end_ns = read_ns() + duration_ns
        while read_ns() < end_ns:
            pass
