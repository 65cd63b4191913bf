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
The kernel: tasks are declared, then run. :mod:`rt_robot_os.kernel.core` runs them.

This module declares tasks, starts, idles and stops the kernel, and makes its statistics.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence
import functools
import sys
from typing import Any
from typing import SupportsFloat
from typing import SupportsIndex

from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.base.errors import TaskError
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.kernel.black_box import BlackBoxDump
from rt_robot_os.kernel.black_box import dump
from rt_robot_os.kernel.black_box import RECORDS_DEFAULT
from rt_robot_os.kernel.clock import Clock
from rt_robot_os.kernel.clock import Handler
from rt_robot_os.kernel.clock import NEVER_NS
from rt_robot_os.kernel.clock import signal_name
from rt_robot_os.kernel.coroutine import AsyncBody
from rt_robot_os.kernel.coroutine import AsyncFunction
from rt_robot_os.kernel.coroutine import Ticks
from rt_robot_os.kernel.coroutine import Until
from rt_robot_os.kernel.declare import check_async
from rt_robot_os.kernel.declare import check_chains
from rt_robot_os.kernel.declare import make_spec
from rt_robot_os.kernel.failure import describe
from rt_robot_os.kernel.failure import TaskAborted
from rt_robot_os.kernel.logical import Logical
from rt_robot_os.kernel.logical_tasks import LogicalTasks
from rt_robot_os.kernel.monotonic_clock import MonotonicClock
from rt_robot_os.kernel.one_shot import OneShot
from rt_robot_os.kernel.releases import IDLE_LEVEL
from rt_robot_os.kernel.releases import LEVEL_END
from rt_robot_os.kernel.resource import Resource
from rt_robot_os.kernel.scheduler import Scheduler
from rt_robot_os.kernel.spec import checked_period_ns
from rt_robot_os.kernel.spec import FailurePolicy
from rt_robot_os.kernel.spec import PRIORITY_MAXIMUM
from rt_robot_os.kernel.statistics import KernelStatistics
from rt_robot_os.kernel.task import Task
from rt_robot_os.linux.recursion import restore_recursion_limit

_RECURSION_LIMIT = 5000
# Time until the first release; the timers have to be ready by then.
_START_DELAY_NS = NS_PER_MS
_START_TASK_NS = 5 * NS_PER_US
_CLOSE_NS = 100 * NS_PER_MS
SPIN_MAXIMUM_NS = NS_PER_MS
SEPARATION_NS = 100 * NS_PER_US


class Kernel(Scheduler):
    """
    A preemptive fixed-priority kernel.

    Add tasks, then :meth:`run`. All methods belong to the thread that runs it.

    :param clock: the time; by default CLOCK_MONOTONIC with signals. On a
        :class:`~rt_robot_os.kernel.CooperativeClock` nothing is preempted.
    :param spin_ns: wake this much before a release and spin until it: less jitter for more CPU.
    :param black_box_records: size of the black box, see :mod:`rt_robot_os.kernel.black_box`.
    :raises TaskError: a value is out of range.
    """

    __slots__ = ('start_ns', '_tasks', '_by_name', '_break_requested')

    def __init__(self, clock: Clock | None = None, *, spin_ns: SupportsIndex = 0,
                 black_box_records: SupportsIndex = RECORDS_DEFAULT) -> None:
        if not isinstance(spin_ns, int) or not 0 <= spin_ns <= SPIN_MAXIMUM_NS:
            raise TaskError(f'spin_ns {spin_ns!r} must be an integer of nanoseconds from 0 to '
                            f'{SPIN_MAXIMUM_NS}')
        super().__init__(clock or MonotonicClock(), spin_ns, int(black_box_records))
        self.start_ns = 0
        self._tasks: list[Task] = []
        self._by_name: dict[str, Task] = {}
        self._break_requested = False

    # ---- declaring ---------------------------------------------------------------------------

    def add_task(self, name: str, function: Callable[[], object], *, priority: SupportsIndex,
                 rate_hz: SupportsFloat | None = None, resources: Sequence[Resource] = (),
                 after: Sequence[Task] = (), on_restart: Callable[[], object] | None = None,
                 on_safe_state: Callable[[], object] | None = None, **declared: Any) -> Task:
        """
        Declare a task; before :meth:`run`.

        :param name: unique in this kernel.
        :param function: called without arguments for each job; runs to completion.
        :param priority: 1..99, the higher runs first; equal ones run in order of release, then of
            declaration.
        :param rate_hz: above 0; None for a task that only events release.
        :param resources: the resources that it may enter.
        :param after: tasks whose ended jobs release it.
        :param on_restart: run as its next job when it is restarted or re-armed.
        :param on_safe_state: run as its last job when it goes to its safe state.
        :param declared: the other fields of :class:`~rt_robot_os.kernel.TaskSpec`: ``phase_ns``,
            ``deadline_ns``, ``budget_ns``, ``overrun``, ``failure``, ...
        :raises TaskError: the name is taken, values are out of range or contradict each other
            (all of them are named), or the kernel runs.
        """
        if self.running:
            raise TaskError(f'task {name!r}: the kernel is running; add all tasks before run()')
        if name in self._by_name:
            raise TaskError(f'task {name!r} exists already; names are unique')
        spec = make_spec(name, function, priority=priority, rate_hz=rate_hz,
                         can_be_safe=on_safe_state is not None,
                         preemptive=self.clock.preemptive, declared=declared)
        task = Task(spec, function, len(self._tasks), on_restart=on_restart,
                    on_safe_state=on_safe_state, rearm=self.rearm, account=self.account)
        for resource in resources:
            resource.declare(task)
        for before in after:
            before.successors = (*before.successors, task)
        self._tasks.append(task)
        self._by_name[name] = task
        if task.spec.logical:
            task.logical = Logical()
            self._tasks.extend(LogicalTasks(self, task, task.logical).tasks)
        return task

    def add_async_task(self, name: str, function: AsyncFunction, *, priority: SupportsIndex,
                       on_restart: Callable[[], object] | None = None, **declared: Any) -> Task:
        """
        Declare a coroutine as a task; before :meth:`run`.

        It starts with the kernel. Each segment between two awaits is a job. When it returns, the
        task makes no more jobs; when it fails, it restarts after the back-off (``failure`` is
        ``restart`` unless given).

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

    def sleep(self, delay_ns: SupportsIndex) -> Until:
        """Return an awaitable that is ready after a delay."""
        return Until(self.now_ns() + int(delay_ns))

    def every(self, rate_hz: SupportsFloat) -> Ticks:
        """
        Return an awaitable grid of times that begins now.

        :raises TaskError: the rate is out of range.
        """
        return Ticks(self, checked_period_ns('every', rate_hz))

    def resource(self, name: str) -> Resource:
        """Return the resource of a name, made if necessary; see :class:`Resource`."""
        if name not in self._resources:
            self._resources[name] = Resource(self, name)
        return self._resources[name]

    def timer(self, task: Task) -> OneShot:
        """Make a timer that releases a task once each time it is started."""
        return OneShot(self, task)

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

    def run(self, duration_ns: SupportsIndex | None = None) -> str:
        """
        Run the tasks until :meth:`stop` or for a time; may be called again afterwards.

        :param duration_ns: None runs until :meth:`stop`; releases at its very end do not run.
        :return: the reason given to :meth:`stop`, or ``'duration'``.
        :raises TaskError: the kernel runs already, this thread cannot run it, or tasks release
            each other in a circle.
        :raises KeyboardInterrupt: Ctrl-C was pressed; the running job has ended.
        :raises SystemExit: a handler of a signal raised it; the running job has ended.
        :raises KernelError: a defect of the kernel, or of the caller's ``trace`` or clock.
        """
        if self.running:
            raise TaskError('the kernel runs already')
        check_chains(self._tasks)
        self.clock.attach(self.settle, self._on_interrupt, self._on_break)
        recursion_limit = sys.getrecursionlimit()
        self.recursion_limit = max(recursion_limit, _RECURSION_LIMIT)
        sys.setrecursionlimit(self.recursion_limit)
        unraisable_hook, sys.unraisablehook = sys.unraisablehook, self._on_unraisable
        try:
            self.clock.wrap_handlers(self._run_handler)
            self._prepare(duration_ns)
            try:
                self.loop()
            except RtRobotError:
                raise
            except Exception as error:
                self.fail(error)
        finally:
            self.locked = self.stopping = True
            self._sources.disarm()
            self._close_coroutines()
            self.clock.detach()
            self.running = False
            self._abandon()
            self.locked = self.pending = False
            self.level, self.current = IDLE_LEVEL, None
            sys.setrecursionlimit(recursion_limit)
            sys.unraisablehook = unraisable_hook
            reason, interrupted = self._stop_reason, self._break_requested
            self.stopping, self._stop_reason, self._break_requested = False, '', False
            self._stop_ns = NEVER_NS
            exit_error, self._exit_error = self._exit_error, None
        if exit_error is not None:
            raise exit_error
        if interrupted:
            raise KeyboardInterrupt
        return reason

    def _prepare(self, duration_ns: SupportsIndex | None) -> None:
        self.interrupted = True  # a descriptor may be readable already
        self.pending = False
        self.ended = []
        self.begin_timers()
        for task in self._tasks:
            task.reset()
            if task.coroutine is not None:
                task.coroutine.close()
                task.coroutine.finished = False
        start_ns = self.now_ns()
        if isinstance(self.clock, MonotonicClock):
            start_ns += _START_DELAY_NS + len(self._tasks) * _START_TASK_NS
        self.start_ns = start_ns
        self.steal_time.start(start_ns)
        self.end_ns = NEVER_NS if duration_ns is None else start_ns + int(duration_ns)
        self.clear_timers()
        self.schedule(self.end_ns, self._end_run, LEVEL_END)
        for task in self._tasks:
            if task.coroutine is not None:
                at_ns = start_ns + task.spec.phase_ns
                start = functools.partial(self._start_coroutine, task, at_ns)
                self.schedule(at_ns, start, task.priority)
            elif task.period_ns and task.logical is None:
                self.add_timer(task, start_ns + task.spec.phase_ns, task.period_ns)
        self._sources.arm()
        self.running = True

    def _start_coroutine(self, task: Task, at_ns: int, now_ns: int) -> None:
        if task.coroutine is not None and task.coroutine.replay_gate is None:
            self.arrive(task, at_ns)

    def _end_run(self, now_ns: int) -> None:
        self.stop('duration')

    def _abandon(self) -> None:
        """Count the released jobs that will not run as missed."""
        now_ns = min(self.now_ns(), self.end_ns - 1)
        self.release_unserved(now_ns)
        for task in self._tasks:
            if task.next_ns and task.next_ns <= now_ns:
                self.account_missed_releases(task, task.next_ns, now_ns)
            self.faults.withdraw(task)
            task.missed += task.rephasing
            task.next_ns = 0
            task.rephasing = False
        self.clear_timers()

    def _close_coroutines(self) -> None:
        """Close the coroutines, each within a time limit; exceptions are contained as in jobs."""
        for task in self._tasks:
            if task.coroutine is None or not self.running:
                continue
            now_ns = task.start_ns = self.now_ns()
            self.current, self.level, self.stolen_ns = task, PRIORITY_MAXIMUM, 0
            task.limit_ns, task.containing = _CLOSE_NS, True
            task.computed_ns, task.waited_ns = self.clock.computed_ns(), 0
            self._interrupt_by(now_ns + _CLOSE_NS)
            try:
                try:
                    self.locked = False
                    task.coroutine.close()
                except BaseException as error:
                    self.note_failure(describe(task.name, now_ns, error))
                self.locked = True
            except BaseException:
                self.locked = True
            task.limit_ns, task.containing = 0, False

    def idle(self, slack_ns: int) -> bool:
        """
        Call ``on_idle``, preemptible.

        :return: whether the kernel is to stop; an interrupt may have cleared ``pending``.
        """
        self.locked = False
        if self.pending:
            self.settle()
        try:
            if self.on_idle is not None:
                self.on_idle(slack_ns)
        except Exception as error:
            self.note_failure(describe('idle', self.now_ns(), error))
        self.locked = True
        return self.stopping

    # ---- while it runs -----------------------------------------------------------------------

    def hold(self, task: Task, policy: FailurePolicy, reason: str) -> None:
        """
        Apply a failure policy from outside, as a watchdog or an emergency stop does.

        A running or waiting job ends first. Safe in the real-time loop.

        :param reason: for the report.
        """
        before = self.lock()
        self.faults.request_policy(task, policy, reason, self.now_ns())
        self.unlock(before)

    def rearm(self, task: Task) -> None:
        """Re-arm a held task, beginning with its ``on_restart``; see Task.rearm."""
        before = self.lock()
        self.faults.resume(task, self.now_ns())
        self.unlock(before)

    # ---- interrupts --------------------------------------------------------------------------

    def add_interrupt(self, fd: int, task: Task, *, separation_ns: int = SEPARATION_NS,
                      name: str = '') -> None:
        """
        Release a task whenever a file descriptor becomes readable.

        The task reads until nothing is left: several arrivals may make one release. May be called
        before :meth:`run` and by a task.

        :param separation_ns: minimum time between two releases: an earlier arrival waits until
            then and is counted. Without it a flood could use the whole CPU.
        :param name: of the source, for the statistics.
        :raises OSError: the descriptor cannot send signals.
        """
        before = self.lock()
        try:
            self._sources.add(fd, task, separation_ns, name)
            if self.running:
                self.interrupted = self.pending = True  # it may be readable already
        finally:
            self.unlock(before)

    def remove_interrupt(self, fd: int) -> None:
        """Undo :meth:`add_interrupt` before the descriptor is closed; ignores unknown ones."""
        before = self.lock()
        try:
            self._sources.remove(fd)
        finally:
            self.unlock(before)

    def _on_interrupt(self, signum: int = 0, frame: object = None) -> None:
        self.interrupted = True
        self.settle(signum)

    def _on_break(self, signum: int = 0, frame: object = None) -> None:
        """Stop on Ctrl-C; a second Ctrl-C interrupts a job that does not end by itself."""
        current = self.current
        if (self._break_requested and current is not None
                and not (self.locked or current.containing)):
            raise KeyboardInterrupt
        self._break_requested = True
        self.stop('KeyboardInterrupt')

    def _run_handler(self, handler: Handler, signum: int = 0, frame: object = None) -> None:
        """Call a foreign handler of a signal; contain what it raises."""
        try:
            handler(signum, frame)
        except TaskAborted:
            raise  # meant for the running job
        except Exception as error:
            self.note_failure(describe(f'handler of {signal_name(signum)}', self.now_ns(), error))
        except BaseException as error:
            if self._break_requested and isinstance(error, KeyboardInterrupt):
                raise  # the second Ctrl-C
            self._exit_error = self._exit_error or error
            self.stop(type(error).__name__)
        finally:
            restore_recursion_limit(self.recursion_limit)

    def _on_unraisable(self, unraisable: sys.UnraisableHookArgs) -> None:
        """Report an exception of a finaliser; Python would print it and wait for the console."""
        if unraisable.exc_value is not None:
            name = self.current.name if self.current is not None else 'idle'
            self.note_failure(describe(name, self.now_ns(), unraisable.exc_value, outermost=True))

    def guard_handlers(self) -> None:
        """
        Contain exceptions of signal handlers that were installed after :meth:`run` began.

        Earlier handlers are contained in any case. About 10 us.
        """
        if self.running:
            self.clock.wrap_handlers(self._run_handler)

    # ---- reports -----------------------------------------------------------------------------

    def account(self, task: Task) -> None:
        """Update the counters of a task; see :meth:`Task.account`."""
        if not self.running:
            return
        before = self.lock()
        self.faults.account(task, self.now_ns())
        self.unlock(before)

    def black_box_dump(self, reason: str) -> BlackBoxDump:
        """Copy the black box; takes milliseconds, preemptible; not for the real-time loop."""
        return dump(self.black_box, self._tasks, reason, self.now_ns(), self.start_ns)

    def statistics(self) -> KernelStatistics:
        """Return the statistics of all tasks; 100 us per task, not for the real-time loop."""
        return KernelStatistics(
            elapsed_ns=self.now_ns() - self.start_ns, wakeups=self.wakeups,
            failures_total=self.failures_total,
            failures_dropped=self.failures_total - len(self.failures),
            overhead_ns=self.overhead_ns, polled_ns=self.polled_ns,
            interrupt_ns=self.clock.wake_ns,
            stolen=self.steal_time.times.summary(), stolen_total_ns=self.steal_time.total_ns,
            tasks=tuple(task.statistics() for task in self._tasks),
            resources=tuple(r.statistics() for r in self._resources.values()),
            sources=self._sources.statistics())
