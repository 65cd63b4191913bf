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

"""The clock of tests and replays: time passes when a task spends it or all tasks are idle."""

from __future__ import annotations

from rt_robot_os.base.errors import TaskError
from rt_robot_os.kernel.clock import Clock
from rt_robot_os.kernel.clock import Handler
from rt_robot_os.kernel.clock import NEVER_NS
from rt_robot_os.linux.timer import REPEAT_NS


class VirtualClock(Clock):
    """
    Time that passes only when a task spends it or when all tasks are idle.

    The same tasks run in the same order each time, without signals and as fast as possible.

    :param start_ns: the initial time.
    """

    def __init__(self, start_ns: int = 0) -> None:
        self._now_ns = start_ns
        self._timer_ns = NEVER_NS
        self._spare_ns = NEVER_NS
        self._on_tick: Handler | None = None
        self.now_ns = self.computed_ns = self._read

    def _read(self) -> int:
        return self._now_ns

    def attach(self, on_tick: Handler, on_interrupt: Handler, on_break: Handler) -> None:
        self._on_tick = on_tick

    def detach(self) -> None:
        self._on_tick = None
        self._timer_ns = self._spare_ns = NEVER_NS

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

    def wait_masked(self) -> bool:
        first_ns = min(self._timer_ns, self._spare_ns)
        if first_ns >= NEVER_NS:
            raise TaskError('the virtual clock has nothing to wait for: add a periodic task, or '
                            'give run() a duration')
        self._now_ns = max(self._now_ns, first_ns)
        self._expire_timers(NEVER_NS)
        return True

    def poll(self, until_ns: int) -> int:
        first_ns = min(self._timer_ns, self._spare_ns)
        self._now_ns = max(self._now_ns, min(until_ns, first_ns))
        if self._expire_timers(self._now_ns + REPEAT_NS) and self._on_tick is not None:
            self._on_tick()
        return self._now_ns

    def _expire_timers(self, repeat_ns: int) -> bool:
        """Let the timers that are due expire; they repeat at a given time."""
        timer, spare = self._timer_ns <= self._now_ns, self._spare_ns <= self._now_ns
        if timer:
            self._timer_ns = repeat_ns
        if spare:
            self._spare_ns = repeat_ns
        return timer or spare

    def spend(self, duration_ns: int) -> None:
        """Advance the time; tasks that fall due preempt the caller and spend their own time."""
        left_ns = duration_ns
        while left_ns > 0:
            first_ns = min(self._timer_ns, self._spare_ns)
            step_ns = min(left_ns, max(0, first_ns - self._now_ns))
            self._now_ns += step_ns
            left_ns -= step_ns
            if self._expire_timers(self._now_ns + REPEAT_NS) and self._on_tick is not None:
                self._on_tick()
