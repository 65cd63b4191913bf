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
The upper layer of the kernel's core: dispatch, interrupt handling and waiting.

Prior art: OSEK basic tasks (BCC1), M. Samek's Super Simple Tasker, Baker's stack resource policy.
The timer interrupts the running Python code. Its handler releases the tasks that are due, runs
every ready task above the interrupted one on top of it, to completion, and returns. There is one
thread and one stack: the nesting depth is at most the number of priorities.

Synchronisation is by one flag. While ``locked`` is set, an interrupt only sets ``pending``. The
code that clears ``locked`` reads ``pending`` afterwards and calls :meth:`KernelCore.settle`.
Nested code always finishes before the code below it continues, so nothing else can come in
between. The code that serves ``pending`` clears it first and reads the clock then: whatever an
earlier interrupt was for is due by that time, and a later interrupt sets ``pending`` again. In the
other order, an interrupt between the two steps would be lost.

This is the specification, and the implementation where nothing was compiled. The extension in C
has the same class: each change here is made in ``_core.c`` as well.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from collections.abc import Iterable
import sys
from typing import Any
from typing import Final
from typing import TYPE_CHECKING

from rt_robot_os.base.compiled import NATIVE
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.kernel.black_box import ABORTED
from rt_robot_os.kernel.black_box import BlackBox
from rt_robot_os.kernel.black_box import FAILED
from rt_robot_os.kernel.black_box import JOB
from rt_robot_os.kernel.black_box import OK
from rt_robot_os.kernel.clock import Clock
from rt_robot_os.kernel.clock import NEVER_NS
from rt_robot_os.kernel.core_protocols import Faults
from rt_robot_os.kernel.core_protocols import StealAccount
from rt_robot_os.kernel.failure import FailureReport
from rt_robot_os.kernel.failure import TaskAborted
from rt_robot_os.kernel.releases import IDLE_LEVEL
from rt_robot_os.kernel.timer_interrupt import TimerInterrupt
from rt_robot_os.linux.recursion import force_recursion_limit
from rt_robot_os.linux.recursion import restore_recursion_limit
from rt_robot_os.linux.recursion import SEPARATE_LIMITS

# Python frames that each level of nesting adds to the recursion limit: a task that recurses up to
# its limit must leave enough frames for the tasks that preempt it.
RECURSION_ROOM: Final = 200
# An interrupt that is later than this is charged to the job that delayed it.
BLOCKED_NS: Final = 50 * NS_PER_US
# The limit of a job that is aborted at every opportunity.
ABORT_ALWAYS_NS: Final = 1
# A wake-up that is later than this is checked for steal time.
LATE_NS: Final = 200 * NS_PER_US
# While idle the clocks of steal time are read at this interval (1 us each), so that a job is not
# credited with steal time from before it.
REFRESH_NS: Final = 20 * NS_PER_MS

TraceHook = Callable[[int, str, str], None]

_set_recursion_limit: Final = sys.setrecursionlimit


class KernelCore(TimerInterrupt):
    """
    Dispatch: the code that runs with every job. :class:`~rt_robot_os.kernel.Kernel` has the rest.

    :param clock: the time.
    :param black_box: receives a record of each job.
    :param spin_ns: wake this much before a release and spin until it.
    :ivar faults: called in exceptional cases.
    :ivar steal_time: the account of steal time.
    :ivar trace: None, or called with (time, kind, task name) for each start and end; may not
        raise.
    :ivar on_idle: None, or called, preemptible, before the kernel waits, with the time until the
        next release in nanoseconds.
    :ivar overhead_ns: computing time of the kernel itself: releasing, dispatching, setting timers.
    :ivar wakeups: number of wake-ups from idling, since the kernel was made.
    :ivar recursion_limit: of the running code.
    """

    __slots__ = ('faults', 'steal_time', 'trace', 'on_idle', 'overhead_ns', 'wakeups',
                 'recursion_limit', '_refreshed_ns')

    faults: Faults
    steal_time: StealAccount

    def __init__(self, clock: Clock, black_box: BlackBox, spin_ns: int = 0) -> None:
        super().__init__(clock, black_box, spin_ns)
        self.trace: TraceHook | None = None
        self.on_idle: Callable[[int], None] | None = None
        self.overhead_ns = 0
        self.wakeups = 0
        self.recursion_limit = 0
        self._refreshed_ns = 0

    # ---- provided by the rest of the kernel ----------------------------------------------------

    @abstractmethod
    def check_budget(self, task: Any, used_ns: int) -> int:
        """
        Request an abort of the interrupted job if its budget is used up or the kernel stops.

        :param used_ns: its computing time at the interrupt.
        :return: when to check again.
        """

    @abstractmethod
    def make_abort(self, task: Any) -> tuple[TaskAborted, Iterable[object]]:
        """Return the exception for the interrupted task, and an iterable that raises it."""

    @abstractmethod
    def contain(self, task: Any, error: BaseException) -> FailureReport:
        """Describe the exception of the running job."""

    @abstractmethod
    def minimal_report(self, task: Any) -> FailureReport:
        """Return the report of an exception whose description failed."""

    @abstractmethod
    def fail(self, error: Exception) -> bool:
        """End ``run`` because of a defect of the kernel; return whether it was the first."""

    @abstractmethod
    def check_depth(self, task: Any, limit: int) -> None:
        """Request an abort of a job that is about to reach its recursion limit."""

    @abstractmethod
    def idle(self, slack_ns: int) -> bool:
        """Call ``on_idle``, preemptible; return whether the kernel is to stop."""

    @abstractmethod
    def note_failure(self, failure: FailureReport) -> None:
        """Store a report, and count it."""

    @abstractmethod
    def rearm_sources(self, task: Any) -> None:
        """Enable the sources again that were masked while a job of their task waited."""

    # ---- interrupts --------------------------------------------------------------------------

    def settle(self, signum: int = 0, frame: object = None) -> None:
        """
        Release the tasks that are due and run those above the interrupted task, on top of it.

        This is the handler of the timer's signal. It is also called after ``locked`` was cleared
        when ``pending`` is set. On a clock without preemption, a job calls it where other tasks
        may run.

        :raises TaskAborted: in the interrupted task, when it has used up its budget.
        """
        limit = self.recursion_limit
        if self.locked or not self.running:
            self.pending = self.locked
            if signum:
                restore_recursion_limit(limit)
            return
        self.locked = True
        self.recursion_limit = limit + RECURSION_ROOM
        try:
            _set_recursion_limit(limit + RECURSION_ROOM)
        except RecursionError:  # the interrupted task left no stack even for this
            self.recursion_limit = limit
            self.locked = False
            raise
        current, level = self.current, self.level
        if signum and not SEPARATE_LIMITS and current is not None:
            self.check_depth(current, limit)
        abort, steps = self._serve_interrupts(current, level)
        self.recursion_limit = limit
        # Inlined: no Python call is possible at the recursion limit.
        try:
            _set_recursion_limit(limit)
        except RecursionError:
            try:
                force_recursion_limit(limit)
            except RecursionError:  # a handler had no stack left; the limit is set all the same
                pass
        self.locked = False
        try:
            for _ in steps:  # raises the abort, too
                pass
            if abort is None and self.pending:
                self.settle()
        except RecursionError:  # no stack left: the interrupt repeats
            pass
        if abort is not None:
            raise abort

    def _serve_interrupts(self, current: Any, level: int
                          ) -> tuple[TaskAborted | None, Iterable[object]]:
        """
        Serve the interrupt, and those that arrive meanwhile; locked.

        :param current: the interrupted task; None when the kernel was idle.
        :return: the exception to raise in the task, and an iterable that raises it, too.
        """
        while True:
            try:
                self._serve_interrupt(current, level)
            except RecursionError:
                raise
            except Exception as error:  # an error of the kernel must not end the job
                self.current, self.level = current, level
                if not self.fail(error):
                    break
            if not self.pending:
                break
        if current is not None and current.abort_pending and not current.inside:
            return self.make_abort(current)
        return None, ()

    def _serve_interrupt(self, current: Any, level: int) -> None:
        """Serve one interrupt."""
        stolen_ns = self.stolen_ns
        self.pending = False
        entry_ns = now_ns = self.now_ns()
        late_ns = computed_ns = 0
        limited = current is not None and current.limit_ns > ABORT_ALWAYS_NS
        if limited:
            computed_ns = self.clock.computed_ns()
        if current is not None and not self.stopping:
            late_ns = entry_ns - max(self._armed_ns, current.start_ns)
        if self.spin_ns:
            now_ns = self._spin(now_ns, level)
        self.collect_due(now_ns)
        if late_ns and (late_ns > current.blocked_maximum_ns or late_ns > BLOCKED_NS):
            stolen_ns += self.faults.charge_blocking(current, level, entry_ns, late_ns)
        if limited:  # before other jobs run, which have their own accounts
            stolen_ns += self._steal_time_of(current, entry_ns, stolen_ns, computed_ns)
        done_ns = entry_ns
        if self._ready.bit_length() - 1 > level:
            done_ns = self._dispatch(level, now_ns, entry_ns)
        if self._near_ns and self._firsts[0][0] - done_ns <= self._near_ns:
            done_ns = self._serve_soon(level, done_ns)
        if self._firsts[0][1] <= level:
            self._defer(level, now_ns)
        due_ns = self._firsts[0][0]
        if current is not None and (current.limit_ns or self.stopping):
            used_ns = entry_ns - current.start_ns - stolen_ns - current.waited_ns
            if used_ns < current.limit_ns and not self.stopping:
                left_ns = current.limit_ns - used_ns
                if current.waited_ns:  # waiting does not use up the rest of the budget
                    left_ns = max(left_ns, LATE_NS)
                check_ns = self.now_ns() + left_ns
            else:
                check_ns = self.check_budget(current, used_ns)
            self._arm_ahead(level, check_ns)
        elif not self._spare_ns or not (
                due_ns <= self._armed_due_ns <= due_ns + self._slack_ns):
            self._arm_ahead(level, NEVER_NS)
        self.current, self.level = current, level
        if limited:
            current.computed_ns += self.clock.computed_ns() - computed_ns
        end_ns = self.now_ns()
        self.overhead_ns += end_ns - done_ns
        self.stolen_ns = stolen_ns + end_ns - entry_ns

    def _steal_time_of(self, task: Any, entry_ns: int, stolen_ns: int, computed_ns: int) -> int:
        """
        Return the steal time of a job with a limit, if it did not compute all the time.

        :param stolen_ns: the part of its time that is known to be of others.
        :param computed_ns: the computing time of the thread.
        """
        gap_ns = (entry_ns - task.start_ns - stolen_ns - task.waited_ns
                  - (computed_ns - task.computed_ns))
        return self.faults.attribute_gap(task, entry_ns, gap_ns) if gap_ns > LATE_NS else 0

    def _serve_soon(self, level: int, end_ns: int) -> int:
        """
        Poll for the next release above the interrupted job if it is near, instead of returning.

        :param end_ns: the end of the last work that was not the kernel's own.
        :return: the same, on return.
        """
        left_ns = self._near_ns
        while not self.stopping:
            due_ns, first_level = self._firsts[0]
            now_ns = self.now_ns()
            if first_level <= level or due_ns - now_ns > left_ns:  # else the job might starve
                break
            if now_ns < due_ns:
                if due_ns == self._armed_ns or due_ns == self._spare_ns:
                    break
                self.overhead_ns += now_ns - end_ns
                end_ns = self._poll(due_ns, now_ns)
                left_ns -= end_ns - now_ns
            self.pending = False
            now_ns = self.now_ns()
            self.collect_due(now_ns)
            if self._ready.bit_length() - 1 > level:
                end_ns = self._dispatch(level, now_ns, end_ns)
        return end_ns

    # ---- releases ----------------------------------------------------------------------------

    def release(self, task: Any) -> None:
        """
        Release a task now; it runs before this returns if its priority is above the caller's.

        A task that waits already is not released twice; that is counted (``coalesced``). A running
        task runs once more. Safe in the real-time loop.
        """
        locked, self.locked = self.locked, True
        self.wake((task,), self.now_ns())
        self.locked = locked
        if self.pending and not locked:
            self.settle()

    # ---- dispatch ----------------------------------------------------------------------------

    def _dispatch(self, floor: int, now_ns: int, end_ns: int) -> int:
        """
        Run every ready task above a level; locked on entry and on return.

        :param now_ns: the last reading of the clock.
        :param end_ns: the end of the last work that was not the kernel's own.
        :return: the same, on return.
        """
        timers, queues, firsts = self._timers, self._queues, self._firsts
        while not self.stopping:
            level = self._ready.bit_length() - 1
            if level <= floor:
                break
            if timers[level][0][0] <= now_ns:
                self.release_due(level, now_ns)
                if self.interrupted:
                    self.poll_sources(now_ns)
                continue
            queue = queues[level]
            if not queue:
                self._clear_ready(level)
                continue
            task = queue.popleft()
            task.pending = False
            release_ns = task.release_ns  # an event may release it again while it runs
            previous_ns = self._begin_job(task, level, now_ns, end_ns)
            outcome, failure = self._call(task)
            end_ns = now_ns = self.now_ns()
            self._end_job(task, release_ns, previous_ns, end_ns, outcome, failure)
            # The second condition finds an interrupt whose handler had no stack left.
            if self.pending or firsts[0][0] <= end_ns:
                now_ns = self._collect_after(task, level)
        self.current, self.level = None, floor
        return end_ns

    def _begin_job(self, task: Any, level: int, now_ns: int, end_ns: int) -> int:
        """Set the interrupt for tasks that may preempt a job; return the start of the last job."""
        task.busy = True
        self.current, self.level = task, level
        next_ns = self._firsts[0][0]
        # Setting the timer now for the next release at the same level saves that work at the end
        # of the job. For releases that are very near the clock will be polled.
        soon_ns = now_ns + self._near_ns
        level_ns = self._timers[level][0][0]
        if soon_ns < level_ns < next_ns:
            next_ns = level_ns
        if soon_ns < task.next_ns < next_ns:
            next_ns = task.next_ns
        if task.aborts or not next_ns <= self._armed_due_ns <= next_ns + self._slack_ns:
            self._arm_for(task, level, next_ns)
        start_ns = self.now_ns()
        self.overhead_ns += start_ns - end_ns
        previous_ns: int = task.start_ns
        task.start_ns = start_ns
        self.stolen_ns = 0
        if self.trace is not None:
            self.trace(start_ns, 'start', task.name)
        return previous_ns

    def _call(self, task: Any) -> tuple[int, FailureReport | None]:
        """
        Run the job; return its outcome, and the report of its exception.

        The flag is cleared and set inside the ``try``, so no TaskAborted can be raised outside.
        """
        failure: FailureReport | None = None
        outcome = OK
        try:
            try:
                self.locked = False
                if self.pending:
                    self.settle()
                task.function()
                self.locked = True
            except BaseException as error:
                task.limit_ns = 0  # the time from here on is not the job's own
                outcome = ABORTED if issubclass(type(error), TaskAborted) else FAILED
                failure = self.contain(task, error)  # preemptible as well
            # The exception is released here; that may run code of its author.
            self.locked = True
        except BaseException:
            self.locked = True
            outcome = outcome or FAILED
            failure = failure or self.minimal_report(task)
        return outcome, failure

    def _end_job(self, task: Any, release_ns: int, previous_ns: int, end_ns: int, outcome: int,
                 failure: FailureReport | None) -> None:
        """Account for a job that has ended, and set the next release of its task."""
        self.record((JOB, task, release_ns, task.start_ns, end_ns, outcome))
        task.count(release_ns, previous_ns, end_ns, self.stolen_ns, self.faults)
        if self.trace is not None:
            self.trace(end_ns, 'end' if outcome == OK else 'fail', task.name)
        if task.period_ns and not task.next_ns:  # an event released this job
            self._pull_timer(task, end_ns)
        if task.next_ns:
            self.return_timer(task, end_ns)
        task.busy = False
        if failure is not None or task.follow_up or task.inside:
            self.faults.after_job(task, failure, outcome, end_ns)

    def _collect_after(self, task: Any, level: int) -> int:
        """Collect what fell due while a job ran; return the time."""
        self.pending = False
        now_ns = self.now_ns()
        late_ns = now_ns - max(self._armed_ns, task.start_ns)
        self.collect_due(now_ns)
        if late_ns > BLOCKED_NS:  # the job ended with a native call
            self.faults.charge_blocking(task, level, now_ns, late_ns)
        return now_ns

    # ---- waiting -----------------------------------------------------------------------------

    def loop(self) -> None:
        """Run what is due, and wait, until the kernel is to stop; returns locked."""
        end_ns = idled_ns = 0
        while True:
            self.locked = True
            self.pending = False
            if self.stopping:  # a later stop() sets `pending`, so that the wait returns
                break
            now_ns = self.now_ns()
            end_ns = end_ns or now_ns
            late_ns = now_ns - self._armed_ns
            if late_ns > LATE_NS and self._armed_ns and not self._ready:
                self.steal_time.attribute(now_ns, late_ns)  # woken late
            if self.spin_ns:
                now_ns = self._spin(now_ns, IDLE_LEVEL)
            self.collect_due(now_ns)
            if self._ready:
                end_ns = self._dispatch(IDLE_LEVEL, now_ns, end_ns)
                continue
            interrupt_ns = self._arm_or_poll(now_ns, idled_ns)
            if not interrupt_ns:
                self.overhead_ns += now_ns - end_ns
                end_ns = 0
                continue
            idled_ns = now_ns
            self.overhead_ns += self.now_ns() - end_ns
            end_ns = 0
            if self.on_idle is not None and self.idle(interrupt_ns - now_ns):
                break
            if now_ns - self._refreshed_ns > REFRESH_NS:
                self._refreshed_ns = now_ns
                self.steal_time.refresh(now_ns)
            if self.clock.wait(self):
                self.interrupted = True
            self.wakeups += 1


if not TYPE_CHECKING and NATIVE is not None:
    KernelCore = NATIVE.KernelCore  # noqa: F811
