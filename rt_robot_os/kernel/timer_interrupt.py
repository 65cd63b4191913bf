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
When the clock is to interrupt, and when polling it costs less.

Setting a timer costs a system call and, on most machines, an access to the timer hardware:
microseconds that the next job would wait for. So there are two timers. The spare one is set at the
end of a job, for the release after the next; before a job begins, swapping the two is enough.

Where releases are closer together than an interrupt costs, the kernel polls the clock instead, and
a timer that is set very often may interrupt late (docs/timing_model.md, "Timer interrupts").
"""

from __future__ import annotations

from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.kernel.black_box import BlackBox
from rt_robot_os.kernel.clock import Clock
from rt_robot_os.kernel.clock import NEVER_NS
from rt_robot_os.kernel.releases import IDLE_LEVEL
from rt_robot_os.kernel.releases import Releases

# A timer that is set again within this time is set often; a timer that is set often may interrupt
# this much late. Both are multiples of the cost of a timer interrupt.
_OFTEN_WAKES: Final = 4
_SLACK_WAKES: Final = 4

# While the kernel polls the clock continuously, it yields the CPU for this time at this interval:
# slightly more than 5 %. Linux would take 5 % for other programs otherwise, 50 ms at a time.
_YIELD_EVERY_NS: Final = 800 * NS_PER_US
_YIELD_NS: Final = 60 * NS_PER_US


class TimerInterrupt(Releases):
    """
    The middle layer of the kernel's core: the two timers of the clock. Its methods are internal.

    :ivar spin_ns: wake this much before a release and spin until it.
    :ivar polled_ns: how long it polled the clock because an interrupt would have cost more.

    Private attributes:

    - ``_armed_ns``: when the timer interrupts;
    - ``_armed_due_ns``: the release that it is set for; 0 when another reason decided;
    - ``_spare_ns``: when the spare timer interrupts;
    - ``_near_ns``: for a release nearer than this, polling costs less than an interrupt;
    - ``_slack_ns``: how late the interrupt may come; grows while it has to be set often;
    - ``_set_ns``: when it was last set for a release that may preempt a job.
    """

    __slots__ = ('spin_ns', 'polled_ns', '_armed_ns', '_armed_due_ns', '_spare_ns', '_near_ns',
                 '_slack_ns', '_set_ns')

    def __init__(self, clock: Clock, black_box: BlackBox, spin_ns: int) -> None:
        super().__init__(clock, black_box)
        self.spin_ns = spin_ns
        self.polled_ns = 0
        self.begin_timers()

    def begin_timers(self) -> None:
        """Reset the state of the timers; the clock has measured the cost of an interrupt."""
        self._armed_ns = self._armed_due_ns = self._spare_ns = 0
        self._near_ns = 0 if self.spin_ns else self.clock.wake_ns
        self._slack_ns = self._set_ns = 0

    # ---- when to interrupt -------------------------------------------------------------------

    def _arm_or_poll(self, now_ns: int, idled_ns: int) -> int:
        """
        Set the interrupt for the first release, or poll the clock; while nothing is ready.

        :param idled_ns: when the kernel last waited.
        :return: when the interrupt comes; 0 when it polled.
        """
        due_ns = self._firsts[0][0]
        if (due_ns - now_ns > self._near_ns
                or due_ns == self._armed_ns or due_ns == self._spare_ns):
            self._slack_ns = 0
            self._arm_ahead(IDLE_LEVEL, NEVER_NS)
            return due_ns
        if (now_ns - idled_ns <= _YIELD_EVERY_NS
                or self.end_ns - now_ns <= 2 * _YIELD_NS):  # else releases at the end are missed
            self._poll(due_ns, now_ns)
            return 0
        interrupt_ns = now_ns + _YIELD_NS
        self._arm(interrupt_ns)
        self._armed_due_ns = 0
        self._drop_spare()
        return interrupt_ns

    def _arm_for(self, task: Any, level: int, due_ns: int) -> None:
        """
        Set the interrupt for a release, or for the end of the budget of a job that begins.

        :param due_ns: the first release above the job, or the next one at its own level.
        """
        interrupt_ns = due_ns
        if self._near_ns:
            interrupt_ns = self._lenient_ns(due_ns)
        elif self.spin_ns and due_ns == self._firsts[0][0]:
            interrupt_ns = self._early_ns(level)
        if task.aborts:
            task.limit_ns = task.budget_ns
            task.computed_ns = self.clock.computed_ns()
            task.waited_ns = 0
            interrupt_ns = min(interrupt_ns, self.now_ns() + task.budget_ns)
        self._arm(interrupt_ns)
        # A time for spinning or for a budget is specific to this job: computed again each time.
        self._armed_due_ns = interrupt_ns if interrupt_ns >= due_ns else 0

    def _arm_ahead(self, level: int, check_ns: int) -> None:
        """
        Set the interrupt, and the spare timer for the release after it if that is easily known.

        :param level: of the code that continues then.
        :param check_ns: when its budget may end.
        """
        due_ns = interrupt_ns = NEVER_NS if self.stopping else self._firsts[0][0]
        if self._near_ns and level and due_ns < NEVER_NS:
            interrupt_ns = self._lenient_ns(due_ns)
        elif self.spin_ns and not self.stopping:
            interrupt_ns = self._early_ns(level)
        if check_ns < interrupt_ns:
            interrupt_ns = check_ns
            spare_ns = due_ns - self.spin_ns
        elif interrupt_ns > due_ns:
            spare_ns = NEVER_NS
        elif interrupt_ns < due_ns and self._near_ns:
            self._armed_due_ns = 0
            return
        else:
            spare_ns = self._second_ns(level, due_ns) - self.spin_ns
        self._armed_due_ns = interrupt_ns if interrupt_ns >= due_ns else 0
        self._arm(interrupt_ns)
        if spare_ns != self._spare_ns:
            self._spare_ns = spare_ns
            self.clock.arm_spare(spare_ns)

    def _second_ns(self, level: int, due_ns: int) -> int:
        """Return the release after the first one: at its level, or at others above a level."""
        _, second, third = self._firsts[:3]
        timers = self._timers[self._firsts[0][1]]
        period_ns = timers[0][3]
        found_ns = due_ns + period_ns if period_ns else NEVER_NS
        for other_ns, other_level in (second, third):
            if due_ns < other_ns < found_ns and other_level > level:
                found_ns = other_ns
        for other_ns in (timers[1][0], timers[2][0]):
            if due_ns < other_ns < found_ns:
                found_ns = other_ns
        return found_ns

    def _lenient_ns(self, due_ns: int) -> int:
        """
        Return the time of an interrupt that has to be set now for a release that may preempt.

        Where it is set often, because releases are closer together than an interrupt costs, it may
        come late, so that one interrupt serves several releases. A timer that is set for an
        earlier time is left alone unless that is very near: moving it away and back costs more
        than a needless interrupt now and then.
        """
        if due_ns <= self._armed_due_ns <= due_ns + self._slack_ns:
            return self._armed_ns
        if due_ns == self._spare_ns:
            return due_ns
        wake_ns, now_ns = self._near_ns, self.now_ns()
        often_ns = _OFTEN_WAKES * wake_ns
        if now_ns + 2 * often_ns < self._armed_ns <= due_ns:  # most jobs have ended by then
            return self._armed_ns
        if due_ns - now_ns > often_ns or now_ns - self._set_ns > often_ns + self._slack_ns:
            self._slack_ns = 0
        elif self._slack_ns < _SLACK_WAKES * wake_ns:
            self._slack_ns += wake_ns
        self._set_ns = now_ns
        if not self._slack_ns:
            return due_ns
        self._drop_spare()  # it would interrupt needlessly
        return due_ns + self._slack_ns

    def _early_ns(self, level: int) -> int:
        """Return when to interrupt for the first release: early when the kernel spins for it."""
        due_ns, first_level = self._firsts[0]
        if first_level > level and self._timers[first_level][0][3]:
            return due_ns - self.spin_ns
        return due_ns

    def _interrupt_by(self, at_ns: int) -> None:
        """Have the interrupt come no later than at a time."""
        if not self.now_ns() < self._armed_ns <= at_ns:
            self._arm(at_ns)
            self._armed_due_ns = 0

    # ---- setting the timers, and polling the clock -------------------------------------------

    def _arm(self, interrupt_ns: int) -> None:
        if interrupt_ns == self._armed_ns:
            return
        if interrupt_ns == self._spare_ns:
            self.clock.swap()
            self._spare_ns = 0
        else:
            self.clock.arm(interrupt_ns)
        self._armed_ns = interrupt_ns

    def _drop_spare(self) -> None:
        if self._spare_ns < NEVER_NS:
            self._spare_ns = NEVER_NS
            self.clock.arm_spare(NEVER_NS)

    def _poll(self, until_ns: int, now_ns: int) -> int:
        """
        Poll the clock until a release.

        :return: the time; earlier if something became pending.
        """
        begin_ns = now_ns
        while now_ns < until_ns and not (self.pending or self.stopping):
            now_ns = self.clock.poll(until_ns)
        self.polled_ns += now_ns - begin_ns
        return now_ns

    def _spin(self, now_ns: int, level: int) -> int:
        """Spin to the first release, if it is near and above a level; return the time."""
        due_ns = self._firsts[0][0]
        if now_ns < due_ns and self._early_ns(level) <= now_ns:
            while now_ns < due_ns:
                now_ns = self.now_ns()
        return now_ns
