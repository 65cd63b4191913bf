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
The kernel: preemptive, fixed-priority, run-to-completion tasks on one stack.

Prior art: OSEK basic tasks (BCC1), M. Samek's Super Simple Tasker, Baker's stack resource policy.
An alarm interrupts whatever Python code runs; the handler releases what is due and runs every
ready task above the interrupted one on top of it, to the end, and returns. There is one thread and
one stack: the depth of nesting is at most the number of priorities.

The whole synchronisation is one flag. While :attr:`Kernel.locked` is set an alarm only notes
itself in :attr:`Kernel.pending`; whoever clears the flag looks at the note afterwards and calls
:meth:`Kernel.settle`. Nested code always finishes before the code below it goes on, so nothing
else can come in between. Whoever serves a note clears it first and reads the clock then: an alarm
that came before is due by that time, and one that comes later leaves a new note. The other way
round an alarm would be lost in between.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
import heapq
import select
import sys

from rt_robot_os.errors import TaskError
from rt_robot_os.kernel.clock import Clock
from rt_robot_os.kernel.clock import INTERRUPT_SIGNAL
from rt_robot_os.kernel.clock import MonotonicClock
from rt_robot_os.kernel.clock import NEVER_NS
from rt_robot_os.kernel.failure import describe
from rt_robot_os.kernel.histogram import BUCKETS
from rt_robot_os.kernel.task import checked_period_ns
from rt_robot_os.kernel.task import FailureReport
from rt_robot_os.kernel.task import PRIORITY_MAXIMUM
from rt_robot_os.kernel.task import Task
from rt_robot_os.kernel.task import TaskSpec
from rt_robot_os.kernel.task import TaskStatistics
from rt_robot_os.linux.interrupt import no_signal_when_readable
from rt_robot_os.linux.interrupt import signal_when_readable
from rt_robot_os.units import NS_PER_MS

_IDLE_LEVEL = 0
_FAILURES_KEPT = 32
_LAST_BUCKET = BUCKETS - 1
# Python frames for the tasks, and how many more for each level of nesting: a task that recursed to
# its limit must not leave too few for those that preempt it.
_RECURSION_LIMIT = 5000
_RECURSION_ROOM = 200
_START_DELAY_NS = NS_PER_MS
_set_recursion_limit = sys.setrecursionlimit

TraceHook = Callable[[int, str, str], None]


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


class Kernel:
    """
    A preemptive fixed-priority kernel.

    Add tasks, then :meth:`run`. All methods belong to the thread that runs it.

    :param clock: the time; by default CLOCK_MONOTONIC with signals.
    :ivar locked: set inside a critical section of the kernel or of a topic.
    :ivar pending: something came up meanwhile: call :meth:`settle` after clearing ``locked``.
    :ivar trace: called with (time, kind, task name) for each start and end, unless it is None.
    :ivar on_idle: called, preemptible, before the kernel waits, with the time until the next
        release in nanoseconds, unless it is None.
    """

    # Slots are the fastest attributes, and there are more than an inline dictionary holds.
    __slots__ = (
        'clock', 'now_ns', 'locked', 'pending', 'trace', 'on_idle', 'running', 'start_ns',
        'wakeups', 'failures_total', 'failures', '_tasks', '_by_name', '_interrupts', '_watched',
        '_poll', '_interrupted', '_stopping', '_stop_reason', '_broken', '_current', '_level',
        '_stolen_ns', '_armed_ns', '_ready', '_queues', '_bits', '_timers', '_end_ns',
        '_recursion_limit')

    def __init__(self, clock: Clock | None = None) -> None:
        self.clock = clock or MonotonicClock()
        self.now_ns = self.clock.now_ns
        self.locked = False
        self.pending = False
        self.trace: TraceHook | None = None
        self.on_idle: Callable[[int], None] | None = None
        self.running = False
        self.start_ns = 0
        self.wakeups = 0
        self.failures_total = 0
        self.failures: deque[FailureReport] = deque(maxlen=_FAILURES_KEPT)
        self._tasks: list[Task] = []
        self._by_name: dict[str, Task] = {}
        self._interrupts: dict[int, Task] = {}
        self._watched: dict[int, int] = {}
        self._poll = select.poll()
        self._interrupted = False
        self._stopping = False
        self._stop_reason = ''
        self._broken = False
        self._current: Task | None = None
        self._level = _IDLE_LEVEL
        self._stolen_ns = 0
        self._armed_ns = 0
        self._ready = 0
        self._queues: list[deque[Task]] = [deque() for _ in range(PRIORITY_MAXIMUM + 1)]
        self._bits = [1 << priority for priority in range(PRIORITY_MAXIMUM + 1)]
        # (time, order among equals, task, period in force until then); without a task: the end.
        self._timers: list[tuple[int, int, Task | None, int]] = []
        self._end_ns = NEVER_NS
        self._recursion_limit = 0

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
        if self.running:
            self._watch(fd, task)
        self._interrupts[fd] = task
        self._poll.register(fd, select.POLLIN)
        if self.running:
            self._interrupted = True  # it may be readable already
            self.settle()

    def _watch(self, fd: int, task: Task) -> None:
        # Only while the kernel runs: without a handler the signal would end the process.
        if isinstance(self.clock, MonotonicClock):
            try:
                self._watched[fd] = signal_when_readable(fd, INTERRUPT_SIGNAL)
            except OSError as error:
                raise OSError(error.errno, f'file descriptor {fd} cannot release task '
                              f'{task.name!r}: {error.strerror}') from error

    def remove_interrupt(self, fd: int) -> None:
        """Undo :meth:`add_interrupt`, before the descriptor is closed; unknown ones are fine."""
        if fd in self._interrupts:
            self._poll.unregister(fd)
            self._unwatch(fd)
            del self._interrupts[fd]

    def _unwatch(self, fd: int) -> None:
        flags = self._watched.pop(fd, None)
        if flags is not None:
            with suppress(OSError):  # closed without telling: nothing left to undo
                no_signal_when_readable(fd, flags)

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
        _set_recursion_limit(self._recursion_limit)
        try:
            self._prepare(duration_ns)
            self._loop()
        finally:
            self.locked = True
            for fd in tuple(self._watched):
                self._unwatch(fd)
            self.clock.detach()
            self._abandon()
            self.running = False
            self.locked = self.pending = False
            self._level, self._current = _IDLE_LEVEL, None
            _set_recursion_limit(recursion_limit)
            reason, broken = self._stop_reason, self._broken
            self._stopping, self._stop_reason, self._broken = False, '', False
        if broken:
            raise KeyboardInterrupt
        return reason

    def stop(self, reason: str = 'stop') -> None:
        """
        End :meth:`run` when the job that runs now has ended; safe in the real-time loop.

        Before :meth:`run`, for instance by a signal while the robot starts, it ends it at once.
        """
        self._stopping = True
        self._stop_reason = reason

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
        for fd, task in self._interrupts.items():
            self._watch(fd, task)
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
                self._dispatch(_IDLE_LEVEL)
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

    def _on_tick(self, signum: int = 0, frame: object = None) -> None:
        """Release what is due and run what is above the interrupted task, on top of it."""
        if self.locked:
            self.pending = True
            return
        self.locked = True
        if not self.running:
            self.locked = self.pending = False
            return
        limit, self._recursion_limit = self._recursion_limit, (
            self._recursion_limit + _RECURSION_ROOM)
        _set_recursion_limit(self._recursion_limit)
        current, level = self._current, self._level
        while True:
            stolen_ns = self._stolen_ns
            self.pending = False
            entry_ns = self.now_ns()
            if current is not None:
                late_ns = entry_ns - self._armed_ns
                if late_ns > current.blocked_maximum_ns:
                    current.blocked_maximum_ns = late_ns
            self._release_due(entry_ns)
            if self._ready.bit_length() - 1 > level:
                self._dispatch(level)
            if self._timers[0][0] != self._armed_ns:
                self._armed_ns = self._timers[0][0]
                self.clock.arm(self._armed_ns)
            self._current, self._level = current, level
            self._stolen_ns = stolen_ns + self.now_ns() - entry_ns
            again = self.pending
            if not again:
                break
        self._recursion_limit = limit
        _set_recursion_limit(limit)
        self.locked = False
        if self.pending:
            self.settle()

    settle = _on_tick

    # ---- releases ----------------------------------------------------------------------------

    def _release_due(self, now_ns: int) -> None:
        """Make ready what is due; locked."""
        timers = self._timers
        while timers[0][0] <= now_ns and not self._stopping:
            due_ns, index, task, period_ns = timers[0]
            if task is None:
                self.stop('duration')
                heapq.heapreplace(timers, (NEVER_NS, index, None, 0))
                return
            task.releases += 1
            if task.pending or task.busy:
                task.missed += 1
            else:
                task.pending = True
                task.release_ns = due_ns
                task.interval_ns = period_ns
                self._queues[task.priority].append(task)
                self._ready |= self._bits[task.priority]
            period_ns = task.period_ns
            next_ns = due_ns + period_ns
            if next_ns <= now_ns:
                # More than a period late: the grid points in between are missed as well.
                skipped = (min(now_ns, self._end_ns - 1) - next_ns) // period_ns + 1
                task.releases += skipped
                task.missed += skipped
                next_ns += skipped * period_ns
            heapq.heapreplace(timers, (next_ns, index, task, period_ns))
        if self._interrupted:
            self._interrupted = False
            for fd, _ in self._poll.poll(0):
                self._make_ready(self._interrupts[fd], now_ns)

    def _make_ready(self, task: Task, now_ns: int) -> None:
        """Note that an event released a task, also one that is running; locked."""
        task.releases += 1
        if task.pending:
            task.coalesced += 1
            return
        task.pending = True
        task.release_ns = now_ns
        self._queues[task.priority].append(task)
        self._ready |= self._bits[task.priority]
        if task.priority > self._level:
            self.pending = True

    def wake(self, tasks: Sequence[Task], now_ns: int) -> None:
        """Release tasks while ``locked`` is set; for topics. Ignored while not running."""
        if self.running:
            for task in tasks:
                self._make_ready(task, now_ns)

    def release(self, task: Task) -> None:
        """
        Release a task now; it runs before this returns if its priority is above the caller's.

        A task that waits already is not released twice; that is counted (``coalesced``). One that
        is running runs once more. Safe in the real-time loop.
        """
        if self.locked:
            self.wake((task,), self.now_ns())
            return
        self.locked = True
        self.wake((task,), self.now_ns())
        self.locked = False
        if self.pending:
            self.settle()

    # ---- dispatch ----------------------------------------------------------------------------

    def _dispatch(self, floor: int) -> None:
        """Run every ready task above ``floor``; locked on entry and on return."""
        now_ns, queues, timers, trace = self.now_ns, self._queues, self._timers, self.trace
        while not self._stopping:
            level = self._ready.bit_length() - 1
            if level <= floor:
                break
            queue = queues[level]
            task = queue.popleft()
            if not queue:
                self._ready ^= self._bits[level]
            task.pending = False
            task.busy = True
            release_ns = task.release_ns  # an event may release it again while it runs
            self._current, self._level = task, level
            if timers[0][0] != self._armed_ns:
                self._armed_ns = timers[0][0]
                self.clock.arm(self._armed_ns)
            start_ns = now_ns()
            self._stolen_ns = 0
            if trace is not None:
                trace(start_ns, 'start', task.name)
            failure: FailureReport | None = None
            self.locked = False
            try:
                try:
                    if self.pending:
                        self._on_tick()
                    task.function()
                except BaseException as error:
                    failure = describe(task.name, now_ns(), error)  # preemptible as well
            except BaseException:
                failure = FailureReport(
                    task.name, 0, 'an exception that raised another when it was looked at', ())
            self.locked = True
            end_ns = now_ns()
            self._account(task, release_ns, start_ns, end_ns - start_ns - self._stolen_ns)
            if failure is not None:
                task.failures += 1
                self._note_failure(failure)
            if trace is not None:
                trace(end_ns, 'end' if failure is None else 'fail', task.name)
            task.busy = False
            # The second condition finds an alarm whose handler had no room left on the stack.
            if self.pending or timers[0][0] <= end_ns:
                self.pending = False
                self._release_due(now_ns())
        self._current, self._level = None, floor

    def _account(self, task: Task, release_ns: int, start_ns: int, execution_ns: int) -> None:
        """Count a job; the arithmetic is that of :func:`rt_robot_os.kernel.histogram.bucket`."""
        latency_ns = start_ns - release_ns
        histogram = task.latency
        shift = latency_ns.bit_length() - 4
        index = latency_ns if shift <= 0 else (shift << 3) + (latency_ns >> shift)
        histogram.counts[index if index < _LAST_BUCKET else _LAST_BUCKET] += 1
        if latency_ns > histogram.maximum_ns:
            histogram.maximum_ns = latency_ns

        histogram = task.execution
        shift = execution_ns.bit_length() - 4
        index = execution_ns if shift <= 0 else (shift << 3) + (execution_ns >> shift)
        histogram.counts[index if index < _LAST_BUCKET else _LAST_BUCKET] += 1
        if execution_ns > histogram.maximum_ns:
            histogram.maximum_ns = execution_ns
        task.execution_total_ns += execution_ns

        task.runs += 1
        previous_ns, task.start_ns = task.start_ns, start_ns
        if previous_ns >= 0:
            gap_ns = start_ns - previous_ns
            if gap_ns > task.gap_maximum_ns:
                task.gap_maximum_ns = gap_ns
            if task.period_ns:
                jitter_ns = abs(gap_ns - task.interval_ns)
                histogram = task.jitter
                shift = jitter_ns.bit_length() - 4
                index = jitter_ns if shift <= 0 else (shift << 3) + (jitter_ns >> shift)
                histogram.counts[index if index < _LAST_BUCKET else _LAST_BUCKET] += 1
                if jitter_ns > histogram.maximum_ns:
                    histogram.maximum_ns = jitter_ns

    # ---- reports -----------------------------------------------------------------------------

    def _note_failure(self, failure: FailureReport) -> None:
        self.failures_total += 1
        self.failures.append(failure)

    def statistics(self) -> KernelStatistics:
        """Take the statistics of all tasks; about 100 us a task, not for the real-time loop."""
        return KernelStatistics(
            elapsed_ns=self.now_ns() - self.start_ns, wakeups=self.wakeups,
            failures_total=self.failures_total,
            failures_dropped=self.failures_total - len(self.failures),
            tasks=tuple(task.statistics() for task in self._tasks))
