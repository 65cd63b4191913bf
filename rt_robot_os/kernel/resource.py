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
Mutual exclusion by priority ceiling: no waiting, no deadlock, at most one blocking per job.

This is the immediate ceiling protocol (Baker's stack resource policy, 1991, with one unit per
resource; PTHREAD_PRIO_PROTECT in POSIX). A task that enters a resource runs at the highest
priority of all tasks that declared it, until it leaves. None of them can start meanwhile, so the
resource is free whenever it is entered.
"""

from __future__ import annotations

from types import TracebackType

from rt_robot_os.base.errors import TaskError
from rt_robot_os.kernel.black_box import CEILING
from rt_robot_os.kernel.releases import Releases
from rt_robot_os.kernel.statistics import ResourceStatistics
from rt_robot_os.kernel.task import Task


class Resource:
    """
    A shared resource that one task at a time may use; made by ``kernel.resource``.

    Use it as a context manager, in a task that declared it; safe in the real-time loop. A budget
    that is used up inside takes effect on leaving.

    :ivar ceiling: the highest priority among its users.
    :ivar holder: the task that is inside.
    """

    __slots__ = ('name', 'ceiling', 'holder', 'entries', 'held_maximum_ns', '_kernel', '_users',
                 '_below', '_enter_ns')

    def __init__(self, kernel: Releases, name: str) -> None:
        self.name = name
        self.ceiling = 0
        self._users: set[Task] = set()
        self.holder: Task | None = None
        self.entries = 0
        self.held_maximum_ns = 0
        self._kernel = kernel
        self._below = 0
        self._enter_ns = 0

    def declare(self, task: Task) -> None:
        """
        Declare a task as a user; before the kernel runs.

        :raises TaskError: the kernel is running.
        """
        if self._kernel.running:
            raise TaskError(f'resource {self.name!r}: the kernel is running; task {task.name!r} '
                            'must declare it before')
        self._users.add(task)
        self.ceiling = max(self.ceiling, task.priority)

    @property
    def users(self) -> tuple[Task, ...]:
        """Return the tasks that declared it, in the order of their declaration."""
        return tuple(sorted(self._users, key=lambda task: task.index))

    def __enter__(self) -> Resource:
        kernel = self._kernel
        kernel.locked = True
        task = kernel.current
        if task is None or task not in self._users or self.holder is not None:
            kernel.locked = False
            raise self._misuse(task)
        self.holder = task
        task.inside += 1
        self._below = below = kernel.level
        if self.ceiling > below:
            kernel.level = self.ceiling
        self._enter_ns = kernel.now_ns()
        kernel.locked = False
        if kernel.pending:
            kernel.settle()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 traceback: TracebackType | None) -> None:
        kernel = self._kernel
        kernel.locked = True
        task = self.holder
        if task is None or task is not kernel.current:  # its job had ended inside
            kernel.locked = False
            raise TaskError(f'resource {self.name!r} is left by a task that is not inside')
        self.holder = None
        below = self._below
        leave_ns = kernel.now_ns()
        held_ns = leave_ns - self._enter_ns
        if held_ns > self.held_maximum_ns:
            self.held_maximum_ns = held_ns
        self.entries += 1
        kernel.record((CEILING, task, self._enter_ns, leave_ns, self.name))
        task.inside -= 1
        kernel.level = below
        kernel.locked = False
        if kernel.pending or kernel.ready_above(below) or task.abort_pending:
            kernel.settle()

    def _misuse(self, task: Task | None) -> TaskError:
        if task is None:
            return TaskError(f'resource {self.name!r} can be entered by a running task, not from '
                             'outside')
        if self.holder is not None:
            return TaskError(f'resource {self.name!r}: task {task.name!r} is inside already; '
                             'leave it before entering it again')
        users = ', '.join(repr(user.name) for user in self.users) or 'none'
        return TaskError(f'resource {self.name!r}: task {task.name!r} did not declare it; declare '
                         f'it with the task (resources=...). Declared users: {users}')

    def abandon(self, task: Task) -> None:
        """Release the resource of a task whose job ended inside."""
        if self.holder is task:
            self.holder = None

    def statistics(self) -> ResourceStatistics:
        """Return the statistics; not for the real-time loop."""
        return ResourceStatistics(self.name, self.ceiling, tuple(t.name for t in self.users),
                                  self.entries, self.held_maximum_ns)
