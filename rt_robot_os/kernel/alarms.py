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
The two alarms of the kernel, and spinning up to a release.

To set an alarm costs a system call and, on most machines, an access to the timer hardware:
microseconds that the next job would wait for. So the second alarm is set for the release after the
next when a job has ended, and before one begins there is nothing left to do but to swap them.
"""

from __future__ import annotations

from rt_robot_os.kernel.clock import NEVER_NS
from rt_robot_os.kernel.consequences import Consequences
from rt_robot_os.kernel.task import Task


class Alarms(Consequences):
    """When the clock is to interrupt. All methods are called locked."""

    __slots__ = ()

    def _arm_for(self, task: Task, level: int, due_ns: int) -> None:
        """Let the alarm come for the next release, or at the end of the budget of a new job."""
        alarm_ns = due_ns
        if self.spin_ns and due_ns == self._firsts[0][0]:
            alarm_ns = self._early_ns(level)
        if task.aborts:
            task.limit_ns = task.budget_ns
            alarm_ns = min(alarm_ns, self.now_ns() + task.budget_ns)
        self._arm(alarm_ns)
        # Spinning depends on who runs, budgets end: these must be looked at each time.
        self._armed_due_ns = due_ns if alarm_ns == due_ns else 0

    def _arm(self, alarm_ns: int) -> None:
        if alarm_ns == self._armed_ns:
            return
        if alarm_ns == self._spare_ns:
            self.clock.swap()
            self._spare_ns = 0
        else:
            self.clock.arm(alarm_ns)
        self._armed_ns = alarm_ns

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
        if spin_ns and not self._stopping:
            alarm_ns = self._early_ns(level)
        if look_ns < alarm_ns:
            alarm_ns = look_ns
            spare_ns = due_ns - spin_ns
        else:
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
        self._armed_due_ns = due_ns if alarm_ns == due_ns else 0
        if alarm_ns != self._armed_ns:
            self._arm(alarm_ns)
        if spare_ns != self._spare_ns:
            self._spare_ns = spare_ns
            self.clock.arm_spare(spare_ns)

    def _early_ns(self, level: int) -> int:
        """Give the time of the alarm before the first release, early if that is worth spinning."""
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
