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
The scheduler: preemptive, fixed-priority, run-to-completion tasks on one stack.

Prior art: OSEK basic tasks (BCC1), M. Samek's Super Simple Tasker, Baker's stack resource policy.
An alarm interrupts whatever Python code runs; the handler releases what is due and runs every
ready task above the interrupted one on top of it, to the end, and returns. There is one thread and
one stack: the depth of nesting is at most the number of priorities.

The whole synchronisation is one flag. While :attr:`Scheduler.locked` is set an alarm only notes
itself in :attr:`Scheduler.pending`; whoever clears the flag looks at the note afterwards and calls
:meth:`Scheduler.settle`. Nested code always finishes before the code below it goes on, so nothing
else can come in between. Whoever serves a note clears it first and reads the clock then: an alarm
that came before is due by that time, and one that comes later leaves a new note. The other way
round an alarm would be lost in between.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from collections.abc import Sequence
import heapq
import sys

from rt_robot_os.kernel.clock import Clock
from rt_robot_os.kernel.clock import NEVER_NS
from rt_robot_os.kernel.failure import describe
from rt_robot_os.kernel.histogram import BUCKETS
from rt_robot_os.kernel.interrupts import InterruptSources
from rt_robot_os.kernel.task import FailureReport
from rt_robot_os.kernel.task import PRIORITY_MAXIMUM
from rt_robot_os.kernel.task import Task

IDLE_LEVEL = 0
_FAILURES_KEPT = 32
_LAST_BUCKET = BUCKETS - 1
# Python frames that each level of nesting adds to the limit: a task that recursed to its own must
# not leave too few for those that preempt it.
_RECURSION_ROOM = 200
_set_recursion_limit = sys.setrecursionlimit

TraceHook = Callable[[int, str, str], None]


class Scheduler:
    """
    Release and dispatch: what runs in every tick. :class:`Kernel` adds the rest.

    :ivar locked: set inside a critical section of the kernel or of a topic.
    :ivar pending: something came up meanwhile: call :meth:`settle` after clearing ``locked``.
    :ivar trace: called with (time, kind, task name) for each start and end, unless it is None.
    """

    # Slots are the fastest attributes, and there are more than an inline dictionary holds.
    __slots__ = (
        'clock', 'now_ns', 'locked', 'pending', 'trace', 'running', 'failures_total', 'failures',
        '_interrupts', '_interrupted', '_stopping', '_stop_reason', '_current', '_level',
        '_stolen_ns', '_armed_ns', '_ready', '_queues', '_bits', '_timers', '_end_ns',
        '_recursion_limit')

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        self.now_ns = clock.now_ns
        self.locked = False
        self.pending = False
        self.trace: TraceHook | None = None
        self.running = False
        self.failures_total = 0
        self.failures: deque[FailureReport] = deque(maxlen=_FAILURES_KEPT)
        self._interrupts = InterruptSources(clock)
        self._interrupted = False
        self._stopping = False
        self._stop_reason = ''
        self._current: Task | None = None
        self._level = IDLE_LEVEL
        self._stolen_ns = 0
        self._armed_ns = 0
        self._ready = 0
        self._queues: list[deque[Task]] = [deque() for _ in range(PRIORITY_MAXIMUM + 1)]
        self._bits = [1 << priority for priority in range(PRIORITY_MAXIMUM + 1)]
        # (time, order among equals, task, period in force until then); without a task: the end.
        self._timers: list[tuple[int, int, Task | None, int]] = []
        self._end_ns = NEVER_NS
        self._recursion_limit = 0

    def stop(self, reason: str = 'stop') -> None:
        """
        End :meth:`run` when the job that runs now has ended; safe in the real-time loop.

        Before :meth:`run`, for instance by a signal while the robot starts, it ends it at once.
        """
        self._stopping = True
        self._stop_reason = reason

    # ---- ticks -------------------------------------------------------------------------------

    def _on_tick(self, signum: int = 0, frame: object = None) -> None:
        """Release what is due and run what is above the interrupted task, on top of it."""
        if self.locked:
            self.pending = True
            return
        self.locked = True
        if not self.running:
            self.locked = self.pending = False
            return
        limit = self._recursion_limit
        try:
            _set_recursion_limit(limit + _RECURSION_ROOM)
        except RecursionError:  # the interrupted task left no room even for this
            self.locked = False
            raise
        self._recursion_limit = limit + _RECURSION_ROOM
        current, level = self._current, self._level
        while True:
            stolen_ns = self._stolen_ns
            self.pending = False
            entry_ns = self.now_ns()
            if current is not None and not self._stopping:
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
        try:
            _set_recursion_limit(limit)
        except RecursionError:  # the interrupted task is at its very limit: the next tick does it
            pass
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
            for task in self._interrupts.ready():
                self._make_ready(task, now_ns)

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
        locked, self.locked = self.locked, True
        self.wake((task,), self.now_ns())
        self.locked = locked
        if self.pending and not locked:
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

    def _note_failure(self, failure: FailureReport) -> None:
        self.failures_total += 1
        self.failures.append(failure)
