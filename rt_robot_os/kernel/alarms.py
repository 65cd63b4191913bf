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
When the clock is to interrupt, and when it costs less to look at it.

To set an alarm costs a system call and, on most machines, an access to the timer hardware:
microseconds that the next job would wait for. So there are two alarms: the second is set for the
release after the next when a job has ended, and before one begins there is nothing left to do but
to swap them.

Where releases lie closer than an alarm costs, the kernel looks at the clock instead, and where one
has to be set again and again it may come late (docs/timing_model.md, "Alarms").
"""

from __future__ import annotations

from typing import Final

from rt_robot_os.kernel.black_box import RECORDS_DEFAULT
from rt_robot_os.kernel.clock import Clock
from rt_robot_os.kernel.clock import NEVER_NS
from rt_robot_os.kernel.releases import IDLE_LEVEL
from rt_robot_os.kernel.releases import Releases
from rt_robot_os.kernel.task import Task
from rt_robot_os.units import NS_PER_US

# An alarm that is set again so soon is set often; what one that is set often may be late. Both in
# times that it costs to be woken by one.
_OFTEN_WAKES: Final = 4
_SLACK_WAKES: Final = 4

# Where the kernel would look at the clock for ever, it rests so long so often: a bit more than the
# 5 % of a CPU that Linux takes for the others, in one piece of 50 ms, unless they get it anyway.
_REST_EVERY_NS: Final = 800 * NS_PER_US
_REST_NS: Final = 60 * NS_PER_US


class Alarms(Releases):
    """
    The two alarms of the clock. All methods are called locked.

    :ivar spin_ns: wake this much before a release and spin until it.
    :ivar looked_ns: what it looked at the clock for, where an alarm would have cost more.
    """

    __slots__ = (
        'spin_ns', '_armed_ns', '_armed_due_ns', '_spare_ns',
        # What is too near for an alarm
        'looked_ns', '_near_ns', '_slack_ns', '_set_ns')

    def __init__(self, clock: Clock, spin_ns: int = 0, records: int = RECORDS_DEFAULT) -> None:
        super().__init__(clock, records)
        self.spin_ns = spin_ns
        self._armed_ns = 0
        self._armed_due_ns = 0  # the release that the alarm is for, if nothing else matters
        self._spare_ns = 0
        self.looked_ns = 0
        self._near_ns = 0  # sooner than that the alarm costs more than looking at the clock
        self._slack_ns = 0  # what the alarm may be late, if only others run
        self._set_ns = 0  # when it was set last for what may preempt a job

    def _begin_alarms(self) -> None:
        """Forget what was set; the clock has measured what an alarm costs."""
        self._armed_ns = self._armed_due_ns = self._spare_ns = 0
        self._near_ns = 0 if self.spin_ns else self.clock.wake_ns
        self._slack_ns = self._set_ns = 0

    def _arm_or_look(self, due_ns: int, now_ns: int, idled_ns: int) -> int:
        """
        Set the alarm for the first release, while nothing is ready, or look at the clock.

        :param idled_ns: when the kernel waited last.
        :return: when the alarm comes; 0 when it looked.
        """
        if (due_ns - now_ns > self._near_ns
                or due_ns == self._armed_ns or due_ns == self._spare_ns):
            self._slack_ns = 0
            self._arm_ahead(IDLE_LEVEL, NEVER_NS)
            return due_ns
        if (now_ns - idled_ns <= _REST_EVERY_NS
                or self._end_ns - now_ns <= 2 * _REST_NS):  # at the end nothing is to be missed
            self._look(due_ns, now_ns)
            return 0
        alarm_ns = now_ns + _REST_NS
        self._arm(alarm_ns)
        self._armed_due_ns = 0
        self._drop_spare()
        return alarm_ns

    def _arm_for(self, task: Task, level: int, due_ns: int) -> None:
        """Let the alarm come for the next release, or at the end of the budget of a new job."""
        alarm_ns = due_ns
        if self._near_ns:
            alarm_ns = self._lenient_ns(due_ns)
        elif self.spin_ns and due_ns == self._firsts[0][0]:
            alarm_ns = self._early_ns(level)
        if task.aborts:
            task.limit_ns = task.budget_ns
            task.computed_ns = self.clock.computed_ns()
            task.waited_ns = 0
            alarm_ns = min(alarm_ns, self.now_ns() + task.budget_ns)
        self._arm(alarm_ns)
        # Spinning depends on who runs, budgets end: these must be looked at each time.
        self._armed_due_ns = alarm_ns if alarm_ns >= due_ns else 0

    def _lenient_ns(self, due_ns: int) -> int:
        """
        Return the time of an alarm that has to be set now for what may preempt a job.

        Where that is often, because releases lie closer than an alarm costs, it may come late, so
        that one does for several of them. One that is set for sooner stays, unless that is very
        soon: to move it away and back takes longer than to be woken in vain now and then.
        """
        if due_ns <= self._armed_due_ns <= due_ns + self._slack_ns:
            return self._armed_ns
        if due_ns == self._spare_ns:
            return due_ns
        wake_ns, now_ns = self.clock.wake_ns, self.now_ns()
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
        self._drop_spare()  # it would come in vain
        return due_ns + self._slack_ns

    def _look(self, until_ns: int, now_ns: int) -> int:
        """
        Look at the clock until a release that is near; locked.

        :return: the time, sooner if something else came up.
        """
        look, begin_ns = self.clock.look, now_ns
        while now_ns < until_ns and not (self.pending or self._stopping):
            now_ns = look(until_ns)
        self.looked_ns += now_ns - begin_ns
        return now_ns

    def _arm(self, alarm_ns: int) -> None:
        if alarm_ns == self._armed_ns:
            return
        if alarm_ns == self._spare_ns:
            self.clock.swap()
            self._spare_ns = 0
        else:
            self.clock.arm(alarm_ns)
        self._armed_ns = alarm_ns

    def _drop_spare(self) -> None:
        if self._spare_ns < NEVER_NS:
            self._spare_ns = NEVER_NS
            self.clock.arm_spare(NEVER_NS)

    def _look_at(self, at_ns: int) -> None:
        """Let the alarm come no later than that."""
        if not self.now_ns() < self._armed_ns <= at_ns:
            self._arm(at_ns)
            self._armed_due_ns = 0

    def _arm_ahead(self, level: int, look_ns: int) -> None:
        """
        Set the alarm, and the other one for what comes after, if that is cheap to say.

        :param level: of what goes on then.
        :param look_ns: when its budget may end.
        """
        first, second, third = self._firsts[:3]
        alarm_ns = due_ns = first[0] if not self._stopping else NEVER_NS
        spin_ns = self.spin_ns
        if self._near_ns and level and alarm_ns < NEVER_NS:
            alarm_ns = self._lenient_ns(due_ns)
        elif spin_ns and not self._stopping:
            alarm_ns = self._early_ns(level)
        if look_ns < alarm_ns:
            alarm_ns = look_ns
            spare_ns = due_ns - spin_ns
        elif alarm_ns > due_ns:
            spare_ns = NEVER_NS
        elif alarm_ns < due_ns and self._near_ns:
            self._armed_due_ns = 0
            return
        else:
            # The first of what is due after it at its level, or at the next levels above.
            timers = self._timers[first[1]]
            period_ns = timers[0][3]
            spare_ns = due_ns + period_ns if period_ns else NEVER_NS
            if due_ns < second[0] < spare_ns and second[1] > level:
                spare_ns = second[0]
            if due_ns < third[0] < spare_ns and third[1] > level:
                spare_ns = third[0]
            if due_ns < timers[1][0] < spare_ns:
                spare_ns = timers[1][0]
            if due_ns < timers[2][0] < spare_ns:
                spare_ns = timers[2][0]
            spare_ns -= spin_ns
        self._armed_due_ns = alarm_ns if alarm_ns >= due_ns else 0
        if alarm_ns != self._armed_ns:
            self._arm(alarm_ns)
        if spare_ns != self._spare_ns:
            self._spare_ns = spare_ns
            self.clock.arm_spare(spare_ns)

    def _early_ns(self, level: int) -> int:
        """Return the time of the alarm for the first release, early if that is worth spinning."""
        due_ns, first_level = self._firsts[0]
        if first_level > level and self._timers[first_level][0][3]:
            return due_ns - self.spin_ns
        return due_ns

    def _spin(self, now_ns: int, level: int) -> int:
        """Spin to the first release, if it is near and above a level."""
        due_ns = self._firsts[0][0]
        if now_ns < due_ns and self._early_ns(level) <= now_ns:
            read_ns = self.now_ns
            while now_ns < due_ns:
                now_ns = read_ns()
        return now_ns
