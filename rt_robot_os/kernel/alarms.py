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


class Alarms(Consequences):
    """When the clock is to interrupt. All methods are called locked."""

    __slots__ = ()

    def _arm(self, alarm_ns: int) -> None:
        """Let the alarm come at a time, which is another than before."""
        if alarm_ns == self._spare_ns:
            self.clock.swap()
            self._spare_ns = 0
        else:
            self.clock.arm(alarm_ns)
        self._armed_ns = alarm_ns

    def _arm_ahead(self, alarm_ns: int) -> None:
        """Set the alarm, and the other for what comes after, if that is cheap to say."""
        if alarm_ns != self._armed_ns:
            self._arm(alarm_ns)
        first, second, third = self._timers[0], self._timers[1][0], self._timers[2][0]
        due_ns = first[0]
        spare_ns = due_ns + first[3] if first[3] else NEVER_NS
        if due_ns < second < spare_ns:
            spare_ns = second
        if due_ns < third < spare_ns:
            spare_ns = third
        spare_ns -= self.spin_ns
        if alarm_ns < due_ns - self.spin_ns:  # the end of a budget comes first
            spare_ns = due_ns - self.spin_ns
        if spare_ns != self._spare_ns:
            self._spare_ns = spare_ns
            self.clock.arm_spare(spare_ns)

    def _early_ns(self, level: int) -> int:
        """Give the time of the alarm before the first release, early if that is worth spinning."""
        due_ns, _, task, period_ns = self._timers[0]
        if period_ns and task.priority > level:
            return due_ns - self.spin_ns
        return due_ns

    def _spin(self, now_ns: int, level: int) -> int:
        """Spin to the first release, if it is near and above a level."""
        due_ns = self._timers[0][0]
        if now_ns < due_ns and self._early_ns(level) <= now_ns:
            read_ns = self.now_ns
            while now_ns < due_ns:
                now_ns = read_ns()
        return now_ns
