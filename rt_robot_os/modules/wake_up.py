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

"""Wake-ups of a task at a time of its own choice: the earliest that was asked for counts."""

from __future__ import annotations

import math

from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import OneShot
from rt_robot_os.kernel import Task


class WakeUp:
    """
    Release a task at the earliest time that it asked for; safe in the real-time loop.

    Who is told "there is more time now" with each message would start a timer each time. This one
    stays as it is, and the task, woken too early, asks again.
    """

    def __init__(self, kernel: Kernel | None, task: Task | None) -> None:
        """Take the task; None for either, as in a test of the module alone, wakes nobody."""
        self._kernel = kernel
        self._timer: OneShot | None = kernel.timer(task) if kernel and task else None
        self._at_ns = 0

    def no_later_than(self, time_ns: float) -> None:
        """Release the task at that time, or before; infinite asks for nothing."""
        timer, kernel = self._timer, self._kernel
        if timer is None or kernel is None or time_ns == math.inf:
            return
        # One whose time has come is of an earlier run of the kernel, and never fires.
        if not timer.started or time_ns < self._at_ns or self._at_ns < kernel.now_ns():
            self._at_ns = int(time_ns)
            timer.start_at(self._at_ns)
