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

"""Timers by which a task wakes itself up at the earliest requested time."""

from __future__ import annotations

import math

from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import OneShot
from rt_robot_os.kernel import Task


class WakeUp:
    """
    Release a task at the earliest time that it requested; safe in the real-time loop.

    A task whose deadline moves later with each message would restart a timer each time. Here the
    timer is left unchanged; the task is woken too early and requests a later time.
    """

    def __init__(self, kernel: Kernel | None, task: Task | None) -> None:
        """Set the task; with None for either, as in a unit test of a module, it does nothing."""
        self._kernel = kernel
        self._timer: OneShot | None = kernel.timer(task) if kernel and task else None
        self._at_ns = 0

    def no_later_than(self, time_ns: float) -> None:
        """Release the task at a time or before; does nothing for infinity."""
        timer, kernel = self._timer, self._kernel
        if timer is None or kernel is None or time_ns == math.inf:
            return
        # A timer whose time has passed is of an earlier run of the kernel and never expires.
        if not timer.started or time_ns < self._at_ns or self._at_ns < kernel.now_ns():
            self._at_ns = int(time_ns)
            timer.start_at(self._at_ns)
