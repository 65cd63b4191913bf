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


"""What a kernel is told: its tasks, what they share, what releases them, which are held."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence
from typing import Any

from rt_robot_os.errors import TaskError
from rt_robot_os.kernel.black_box import RECORDS_DEFAULT
from rt_robot_os.kernel.clock import Clock
from rt_robot_os.kernel.coroutine import AsyncBody
from rt_robot_os.kernel.coroutine import AsyncFunction
from rt_robot_os.kernel.coroutine import Ticks
from rt_robot_os.kernel.coroutine import Until
from rt_robot_os.kernel.declare import check_async
from rt_robot_os.kernel.declare import make_task
from rt_robot_os.kernel.logical import Logical
from rt_robot_os.kernel.one_shot import OneShot
from rt_robot_os.kernel.policy import FailurePolicy
from rt_robot_os.kernel.resource import Resource
from rt_robot_os.kernel.scheduler import Scheduler
from rt_robot_os.kernel.state import LEVEL_INPUTS
from rt_robot_os.kernel.state import LEVEL_OUTPUTS
from rt_robot_os.kernel.task import checked_period_ns
from rt_robot_os.kernel.task import Task
from rt_robot_os.units import NS_PER_US

SEPARATION_NS = 100 * NS_PER_US


class Declarations(Scheduler):
    """The tables of tasks and resources."""

    __slots__ = ('_tasks', '_by_name')

    def __init__(self, clock: Clock, spin_ns: int = 0, records: int = RECORDS_DEFAULT) -> None:
        super().__init__(clock, spin_ns, records)
        self._tasks: list[Task] = []
        self._by_name: dict[str, Task] = {}

    def add_task(self, name: str, function: Callable[[], object], *, priority: int,
                 rate_hz: float | None = None, resources: Sequence[Resource] = (),
                 after: Sequence[Task] = (), on_restart: Callable[[], object] | None = None,
                 on_safe_state: Callable[[], object] | None = None, **declared: Any) -> Task:
        """
        Declare a task; before :meth:`run`.

        :param name: unique in this kernel.
        :param function: called without arguments for each job; runs to its end. Of a coroutine
            function each segment between two awaits is a job.
        :param priority: 1..99, higher runs first; equals run in order of release, then of
            declaration.
        :param rate_hz: above 0; None for a task that only events release.
        :param resources: what it may enter.
        :param after: tasks whose ended jobs release it.
        :param on_restart: run as its next job when it is restarted or re-armed.
        :param on_safe_state: run as its last job when it goes to its safe state.
        :param declared: the rest of :class:`~rt_robot_os.kernel.TaskSpec`: ``phase_ns``,
            ``deadline_ns``, ``budget_ns``, ``overrun``, ``failure``, ...
        :raises TaskError: the name is taken, values are out of range or contradict each other
            (all of them are named), or the kernel runs.
        """
        if self.running:
            raise TaskError(f'task {name!r}: the kernel is running; add all tasks before run()')
        if name in self._by_name:
            raise TaskError(f'task {name!r} exists already; names are unique')
        task = make_task(self, name, function, len(self._tasks), priority=priority,
                         rate_hz=rate_hz, on_restart=on_restart, on_safe_state=on_safe_state,
                         declared=declared)
        for resource in resources:
            resource.declare(task)
        for before in after:
            before.successors = (*before.successors, task)
        self._tasks.append(task)
        self._by_name[name] = task
        if task.spec.logical:
            task.logical = Logical(self, task, (LEVEL_INPUTS, LEVEL_OUTPUTS))
            self._tasks.extend(task.logical.helpers)
        return task

    def add_async_task(self, name: str, function: AsyncFunction, *, priority: int,
                       on_restart: Callable[[], object] | None = None, **declared: Any) -> Task:
        """
        Declare a task that is written as a coroutine; before :meth:`run`.

        It starts with the kernel. Each segment between two awaits is a job. When it returns, the
        task makes no more jobs; when it fails, it begins anew after the back-off
        (``failure`` is ``restart`` unless given).

        :param function: an ``async def`` without arguments.
        :param declared: as for :meth:`add_task`, but neither ``rate_hz`` nor ``logical``.
        :raises TaskError: as for :meth:`add_task`.
        """
        body = AsyncBody(self, function)

        def restart() -> None:
            if on_restart is not None:
                on_restart()
            body.start()

        declared.setdefault('failure', FailurePolicy.RESTART)
        task = self.add_task(name, body.segment, priority=priority, on_restart=restart,
                             **check_async(name, function, declared))
        body.bind(task)
        task.coroutine = body
        return task

    def sleep(self, delay_ns: int) -> Until:
        """Give something to await: over after a delay."""
        return Until(self.now_ns() + delay_ns)

    def every(self, rate_hz: float) -> Ticks:
        """
        Give a grid of times to await, which begins now.

        :raises TaskError: the rate is out of range.
        """
        return Ticks(self, checked_period_ns('every', rate_hz))

    def resource(self, name: str) -> Resource:
        """Make a resource, or find the one that has this name; see :class:`Resource`."""
        if name not in self._resources:
            self._resources[name] = Resource(self, name)
        found: Resource = self._resources[name]
        return found

    def timer(self, task: Task) -> OneShot:
        """Make a timer that releases a task once each time it is started."""
        return OneShot(self, task)

    def add_interrupt(self, fd: int, task: Task, *, separation_ns: int = SEPARATION_NS,
                      name: str = '') -> None:
        """
        Release a task whenever a file descriptor becomes readable.

        The task reads until nothing is left: several arrivals may make one release. May be called
        before :meth:`run` and by a task.

        :param separation_ns: shortest time between two releases: what comes sooner waits until
            then, and is counted. Without it a flood could take the whole CPU.
        :param name: of the source, for the statistics.
        :raises OSError: the descriptor cannot do that.
        """
        locked, self.locked = self.locked, True
        try:
            self._interrupts.add(fd, task, separation_ns, name)
            if self.running:
                self._interrupted = self.pending = True  # it may be readable already
        finally:
            self.locked = locked
        if self.pending and not locked:
            self.settle()

    def remove_interrupt(self, fd: int) -> None:
        """Undo :meth:`add_interrupt`, before the descriptor is closed; unknown ones are fine."""
        locked, self.locked = self.locked, True
        try:
            self._interrupts.remove(fd)
        finally:
            self.locked = locked
        if self.pending and not locked:
            self.settle()

    @property
    def tasks(self) -> Sequence[Task]:
        """All tasks in the order of their declaration."""
        return tuple(self._tasks)

    def task(self, name: str) -> Task:
        """
        Find a task.

        :raises TaskError: there is none of that name.
        """
        try:
            return self._by_name[name]
        except KeyError:
            known = ', '.join(self._by_name) or 'none'
            raise TaskError(f'no task {name!r}; there are: {known}') from None

    def account(self, task: Task) -> None:
        """Bring the counters of a task up to date; as :meth:`Task.account`."""
        if not self.running:
            return
        locked, self.locked = self.locked, True
        self._account(task, self.now_ns())
        self.locked = locked
        if self.pending and not locked:
            self.settle()

    # ---- holding -----------------------------------------------------------------------------

    def hold(self, task: Task, policy: FailurePolicy, reason: str) -> None:
        """
        Apply a failure policy from outside, as a watchdog or an emergency stop does.

        A job that runs or waits ends first. Safe in the real-time loop.

        :param reason: for the report.
        """
        locked, self.locked = self.locked, True
        self._demand(task, policy, reason, self.now_ns())
        self.locked = locked
        if not locked and (self.pending or self._ready >> self._level + 1):
            self.settle()

    def rearm(self, task: Task) -> None:
        """Let a held task make jobs again, beginning with its ``on_restart``; as Task.rearm."""
        locked, self.locked = self.locked, True
        self._resume(task, self.now_ns())
        self.locked = locked
        if not locked and (self.pending or self._ready >> self._level + 1):
            self.settle()
