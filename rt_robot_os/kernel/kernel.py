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
The kernel: tasks are declared, then run; see :mod:`rt_robot_os.kernel.scheduler` for the how.

What is here happens before, after and between the ticks: declaration, start, idling, stop and
statistics.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence
from dataclasses import dataclass
import heapq
import sys

from rt_robot_os.errors import TaskError
from rt_robot_os.kernel.clock import Clock
from rt_robot_os.kernel.clock import MonotonicClock
from rt_robot_os.kernel.clock import NEVER_NS
from rt_robot_os.kernel.failure import describe
from rt_robot_os.kernel.scheduler import IDLE_LEVEL
from rt_robot_os.kernel.scheduler import Scheduler
from rt_robot_os.kernel.task import checked_period_ns
from rt_robot_os.kernel.task import Task
from rt_robot_os.kernel.task import TaskSpec
from rt_robot_os.kernel.task import TaskStatistics
from rt_robot_os.units import NS_PER_MS

_RECURSION_LIMIT = 5000
_START_DELAY_NS = NS_PER_MS


@dataclass(frozen=True)
class KernelStatistics:
    """
    The kernel as a whole.

    :ivar elapsed_ns: since the kernel was started last.
    :ivar wakeups: times that it woke from idling.
    :ivar failures_dropped: failure reports that gave way to newer ones.
    """

    elapsed_ns: int
    wakeups: int
    failures_total: int
    failures_dropped: int
    tasks: tuple[TaskStatistics, ...]


class Kernel(Scheduler):
    """
    A preemptive fixed-priority kernel.

    Add tasks, then :meth:`run`. All methods belong to the thread that runs it.

    :param clock: the time; by default CLOCK_MONOTONIC with signals.
    :ivar on_idle: called, preemptible, before the kernel waits, with the time until the next
        release in nanoseconds, unless it is None.
    """

    __slots__ = ('on_idle', 'start_ns', 'wakeups', '_tasks', '_by_name', '_broken')

    def __init__(self, clock: Clock | None = None) -> None:
        super().__init__(clock or MonotonicClock())
        self.on_idle: Callable[[int], None] | None = None
        self.start_ns = 0
        self.wakeups = 0
        self._tasks: list[Task] = []
        self._by_name: dict[str, Task] = {}
        self._broken = False

    # ---- declaration -------------------------------------------------------------------------

    def add_task(self, name: str, function: Callable[[], object], *, priority: int,
                 rate_hz: float | None = None, phase_ns: int = 0) -> Task:
        """
        Declare a task; before :meth:`run`.

        :param name: unique in this kernel.
        :param function: called without arguments for each job; runs to its end.
        :param priority: 1..99, higher runs first; equals run in order of release, then of
            declaration.
        :param rate_hz: above 0; None for a task that only events release.
        :param phase_ns: offset of its first release from the start.
        :raises TaskError: the name is taken, a value is out of range, or the kernel runs.
        """
        if self.running:
            raise TaskError(f'task {name!r}: the kernel is running; add all tasks before run()')
        if name in self._by_name:
            raise TaskError(f'task {name!r} exists already; names are unique')
        if not callable(function):
            raise TaskError(f'task {name!r}: {function!r} cannot be called')
        period_ns = 0 if rate_hz is None else checked_period_ns(name, rate_hz)
        task = Task(TaskSpec(name, priority, period_ns, phase_ns), function, len(self._tasks))
        self._tasks.append(task)
        self._by_name[name] = task
        return task

    def add_interrupt(self, fd: int, task: Task) -> None:
        """
        Release a task whenever a file descriptor becomes readable.

        The task reads until nothing is left: several arrivals may make one release. May be called
        before :meth:`run` and by a task.

        :raises OSError: the descriptor cannot do that.
        """
        self._interrupts.add(fd, task)
        if self.running:
            self._interrupted = True  # it may be readable already
            self.settle()

    def remove_interrupt(self, fd: int) -> None:
        """Undo :meth:`add_interrupt`, before the descriptor is closed; unknown ones are fine."""
        self._interrupts.remove(fd)

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

    # ---- running -----------------------------------------------------------------------------

    def run(self, duration_ns: int | None = None) -> str:
        """
        Run the tasks until :meth:`stop` or for a time; may be called again afterwards.

        :param duration_ns: None runs until :meth:`stop`; what is due at its very end does not run.
        :return: the reason that :meth:`stop` was given, or ``'duration'``.
        :raises TaskError: the kernel runs already, or this thread cannot run it.
        :raises KeyboardInterrupt: Ctrl-C was pressed; the job that ran then has ended.
        """
        if self.running:
            raise TaskError('the kernel runs already')
        self.clock.attach(self._on_tick, self._on_interrupt, self._on_break)
        recursion_limit = sys.getrecursionlimit()
        self._recursion_limit = max(recursion_limit, _RECURSION_LIMIT)
        sys.setrecursionlimit(self._recursion_limit)
        try:
            self._prepare(duration_ns)
            self._loop()
        finally:
            self.locked = True
            self._interrupts.disarm()
            self.clock.detach()
            self._abandon()
            self.running = False
            self.locked = self.pending = False
            self._level, self._current = IDLE_LEVEL, None
            sys.setrecursionlimit(recursion_limit)
            reason, broken = self._stop_reason, self._broken
            self._stopping, self._stop_reason, self._broken = False, '', False
        if broken:
            raise KeyboardInterrupt
        return reason

    def _prepare(self, duration_ns: int | None) -> None:
        self._interrupted = True  # something may be readable already
        self.pending, self._armed_ns, self._ready = False, 0, 0
        start_ns = self.now_ns()
        if isinstance(self.clock, MonotonicClock):
            start_ns += _START_DELAY_NS
        self.start_ns = start_ns
        self._end_ns = NEVER_NS if duration_ns is None else start_ns + duration_ns
        self._timers = [(self._end_ns, -1, None, 0)]
        for task in self._tasks:
            task.rest()
            if task.period_ns:
                first_ns = start_ns + task.spec.phase_ns
                heapq.heappush(self._timers, (first_ns, task.index, task, task.period_ns))
        self._interrupts.arm()
        self.running = True

    def _abandon(self) -> None:
        """Count what was released and does not run any more as missed."""
        for queue in self._queues:
            for task in queue:
                task.missed += 1
            queue.clear()

    def _loop(self) -> None:
        clock = self.clock
        while not self._stopping:
            self.locked = True
            self.pending = False
            now_ns = self.now_ns()
            self._release_due(now_ns)
            if self._ready or self._stopping:
                self._dispatch(IDLE_LEVEL)
                continue
            next_ns = self._timers[0][0]
            if next_ns != self._armed_ns:
                self._armed_ns = next_ns
                clock.arm(next_ns)
            if self.on_idle is not None:
                self._idle(self.on_idle, next_ns - now_ns)
            clock.hold()
            # A signal that came before hold() has left its note; one after it is held.
            if not (self.pending or self._stopping) and clock.wait():
                self._interrupted = True
            clock.admit()
            self.wakeups += 1

    def _idle(self, hook: Callable[[int], None], slack_ns: int) -> None:
        self.locked = False
        if self.pending:
            self.settle()
        try:
            hook(slack_ns)
        except Exception as error:
            self._note_failure(describe('idle', self.now_ns(), error))
        self.locked = True

    # ---- interrupts --------------------------------------------------------------------------

    def _on_interrupt(self, signum: int = 0, frame: object = None) -> None:
        self._interrupted = True
        self._on_tick()

    def _on_break(self, signum: int = 0, frame: object = None) -> None:
        """Stop on Ctrl-C; pressed again, it ends a job that does not end by itself."""
        if self._broken and self._current is not None and not self.locked:
            raise KeyboardInterrupt
        self._broken = True
        self.stop('KeyboardInterrupt')

    # ---- reports -----------------------------------------------------------------------------

    def statistics(self) -> KernelStatistics:
        """Take the statistics of all tasks; about 100 us a task, not for the real-time loop."""
        return KernelStatistics(
            elapsed_ns=self.now_ns() - self.start_ns, wakeups=self.wakeups,
            failures_total=self.failures_total,
            failures_dropped=self.failures_total - len(self.failures),
            tasks=tuple(task.statistics() for task in self._tasks))
