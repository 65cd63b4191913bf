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


"""Timers that release a task once."""

from __future__ import annotations

from typing import SupportsIndex

from rt_robot_os.base.errors import TaskError
from rt_robot_os.kernel.releases import Releases
from rt_robot_os.kernel.task import Task


class OneShot:
    """
    A timer of one task; made by ``kernel.timer``.

    It is valid in the run of the kernel in which it was started.
    """

    __slots__ = ('task', '_kernel', '_order', '_due_ns')

    def __init__(self, kernel: Releases, task: Task) -> None:
        self.task = task
        self._kernel = kernel
        self._order = 0  # its identifier in the kernel; 0 when it is not started
        self._due_ns = 0

    @property
    def started(self) -> bool:
        """Whether it is running and will release its task."""
        return self._order != 0

    def start(self, delay_ns: SupportsIndex) -> None:
        """
        Release the task once, after a delay; this replaces an earlier start.

        Safe in the real-time loop.

        :raises TaskError: the delay is negative, or the kernel is not running.
        """
        length_ns = int(delay_ns)
        if length_ns < 0:
            raise TaskError(f'timer of task {self.task.name!r}: delay_ns {delay_ns} is negative')
        self.start_at(self._kernel.now_ns() + length_ns)

    def start_at(self, time_ns: int) -> None:
        """
        Release the task once, at a time of the kernel's clock; immediately if it has passed.

        :raises TaskError: the kernel is not running.
        """
        kernel = self._kernel
        if not kernel.running:
            raise TaskError(f'timer of task {self.task.name!r}: the kernel is not running; start '
                            'it from a task')
        before = kernel.lock()
        if self._order:
            kernel.cancel(self._order, self.task.priority)
        self._due_ns = max(time_ns, kernel.now_ns())
        self._order = kernel.schedule(self._due_ns, self._fire, self.task.priority)
        kernel.unlock(before)

    def cancel(self) -> None:
        """Stop the timer; does nothing if it has released its task already."""
        kernel = self._kernel
        before = kernel.lock()
        if self._order:
            kernel.cancel(self._order, self.task.priority)
            self._order = 0
        kernel.unlock(before)

    def _fire(self, now_ns: int) -> None:
        self._order = 0
        # Released as of its due time: the kernel serves it later if a higher level runs.
        self._kernel.arrive(self.task, self._due_ns)
