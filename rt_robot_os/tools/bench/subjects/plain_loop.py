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
Floors: plain loops and bare signal handlers that do what the kernel does, without it.

What a machine's host decides (lost time, cold caches, a slow clock) meets them as it meets the
kernel, so that the ratio of both says what the kernel adds. All sleep with ``clock_nanosleep`` to
absolute deadlines, by one call of ctypes, and leave out what they are too late for.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence
import time


from rt_robot_os.linux.timer import Sleeper

Job = Callable[[], object]


class LoopGroup:
    """
    Functions that one plain loop calls at the same moments.

    :ivar due_ns: when next.
    :ivar missed: moments that were left out.
    """

    __slots__ = ('period_ns', 'jobs', 'due_ns', 'missed')

    def __init__(self, period_ns: int, jobs: Sequence[Job]) -> None:
        self.period_ns = period_ns
        self.jobs = jobs
        self.due_ns = self.missed = 0

    def call(self, now_ns: Callable[[], int]) -> None:
        """Call all, and stay on the grid."""
        for job in self.jobs:
            job()
        self.due_ns += self.period_ns
        late_ns = now_ns() - self.due_ns
        if late_ns >= 0:
            left_out = late_ns // self.period_ns + 1
            self.missed += left_out
            self.due_ns += left_out * self.period_ns


def plain_loop(groups: Sequence[LoopGroup], begin_ns: int, end_ns: int) -> None:
    """
    Call each group at its moments, the one that is due first before others.

    :param groups: of two that are due at the same moment the first is called first.
    """
    sleep_until_ns, now_ns = Sleeper().sleep_until_ns, time.monotonic_ns
    for group in groups:
        group.due_ns = begin_ns
        group.missed = 0
    while (due_ns := min(group.due_ns for group in groups)) < end_ns:
        if due_ns > now_ns():
            sleep_until_ns(due_ns)
        moment_ns = now_ns()
        for group in groups:
            if group.due_ns <= moment_ns:
                group.call(now_ns)
