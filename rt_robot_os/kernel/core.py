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
The upper third of the kernel's core: dispatch, the handler of interrupts, and waiting.

Prior art: OSEK basic tasks (BCC1), M. Samek's Super Simple Tasker, Baker's stack resource policy.
The timer interrupts whatever Python code runs; the handler releases what is due and runs every
ready task above the interrupted one on top of it, to the end, and returns. There is one thread and
one stack: the depth of nesting is at most the number of priorities.

The whole synchronisation is one flag. While ``locked`` is set an interrupt only notes itself in
``pending``; whoever clears the flag reads that note afterwards and calls :meth:`Core.settle`.
Nested code always finishes before the code below it goes on, so nothing else can come in between.
Whoever serves a note clears it first and reads the clock then: what an earlier interrupt was for
is due by that time, and a later interrupt leaves a new note. In the other order, one that comes
between the two steps would be lost.

This is the specification, and what runs where nothing was compiled. The extension in C has the
same class: what is changed here is changed in ``_core.c`` as well.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from collections.abc import Iterable
import sys
from typing import Any
from typing import Final
from typing import Protocol
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
from rt_robot_os.kernel.failure import FailureReport
from rt_robot_os.kernel.failure import TaskAborted
from rt_robot_os.kernel.releases import IDLE_LEVEL
from rt_robot_os.kernel.task_core import Judge
from rt_robot_os.kernel.timer_interrupt import TimerInterrupt
from rt_robot_os.linux.recursion import force_recursion_limit
from rt_robot_os.linux.recursion import SEPARATE_LIMITS

# Python frames that each level of nesting adds to the limit: a task that recursed to its own must
# not leave too few for those that preempt it.
RECURSION_ROOM: Final = 200
# An interrupt that came so much later is charged to the job that held it up.
BLOCKED_NS: Final = 50 * NS_PER_US
# The limit of a job that is aborted as often as it can be.
ABORT_ALWAYS_NS: Final = 1
# A wake-up that came so much later asks what Linux did meanwhile.
LATE_NS: Final = 200 * NS_PER_US
# While idle the clocks that say what Linux took are read this often (1 us each), so that a job is
# not credited with what Linux took before it.
FRESH_NS: Final = 20 * NS_PER_MS

TraceHook = Callable[[int, str, str], None]

_set_recursion_limit: Final = sys.setrecursionlimit


class Faults(Judge, Protocol):
    """What the core asks when a job was not ordinary: the kernel's FaultHandling."""

    def held_up(self, task: Any, level: int, at_ns: int, late_ns: int) -> int:
        """Charge an interrupt that came late to the job that ran; return what Linux took of it."""

    def did_not_compute(self, task: Any, now_ns: int, gap_ns: int) -> int:
        """Find out where the time of a job went; return what Linux took of it."""

    def after_job(self, task: Any, failure: FailureReport | None, outcome: int,
                  now_ns: int) -> None:
        """Do what is due when a job has ended that was not ordinary."""


class StealAccount(Protocol):
    """Who knows what Linux took: the kernel's StealTime."""

    def keep_fresh(self, now_ns: int) -> None:
        """Read the clocks from which it is computed."""

    def attribute(self, now_ns: int, window_ns: int) -> int:
        """Return how much of a time up to now Linux took."""


class Core(TimerInterrupt):
    """
    Dispatch: what runs with every job. :class:`~rt_robot_os.kernel.Kernel` adds the rest.

    :param clock: the time.
    :param black_box: gets a record of each job.
    :param spin_ns: wake this much before a release and spin until it.
    :ivar faults: what is asked when a job was not ordinary.
    :ivar steal_time: the account of what Linux took.
    :ivar trace: called with (time, kind, task name) for each start and end, unless it is None;
        may not raise.
    :ivar on_idle: called, preemptible, before the kernel waits, with the time until the next
        release in nanoseconds, unless it is None.
    :ivar overhead_ns: what the kernel itself computed for: releasing, dispatching, setting timers.
    :ivar wakeups: times that it woke from idling, since it was made.
    :ivar recursion_limit: of the code that runs.
    """

    __slots__ = ('faults', 'steal_time', 'trace', 'on_idle', 'overhead_ns', 'wakeups',
                 'recursion_limit', '_fresh_ns')

    faults: Faults
    steal_time: StealAccount

    def __init__(self, clock: Clock, black_box: BlackBox, spin_ns: int = 0) -> None:
        super().__init__(clock, black_box, spin_ns)
        self.trace: TraceHook | None = None
        self.on_idle: Callable[[int], None] | None = None
        self.overhead_ns = 0
        self.wakeups = 0
        self.recursion_limit = 0
        self._fresh_ns = 0

    # ---- what the rest of the kernel provides --------------------------------------------------

    @abstractmethod
    def check_budget(self, task: Any, used_ns: int) -> int:
        """
        Have the interrupted task aborted if it has used what it may, or the kernel stops.

        :param used_ns: its computing time at the interrupt.
        :return: when to check again.
        """

    @abstractmethod
    def make_abort(self, task: Any) -> tuple[TaskAborted, Iterable[object]]:
        """Return what is to be raised in the interrupted task, and what raises it as well."""

    @abstractmethod
    def contain(self, task: Any, error: BaseException) -> FailureReport:
        """Describe what came out of the job that runs."""

    @abstractmethod
    def undescribed(self, task: Any) -> FailureReport:
        """Return the report of an exception that raised another when it was described."""

    @abstractmethod
    def fail(self, error: Exception) -> bool:
        """Let ``run`` end with a defect of the kernel; return whether it was the first."""

    @abstractmethod
    def check_depth(self, task: Any, limit: int) -> None:
        """Have a job aborted that is about to reach its recursion limit."""

    @abstractmethod
    def idle(self, slack_ns: int) -> bool:
        """Call ``on_idle``, preemptible; return whether it is the end."""

    @abstractmethod
    def note_failure(self, failure: FailureReport) -> None:
        """Store a report, and count it."""

    @abstractmethod
    def rearm_sources(self, task: Any) -> None:
        """Listen again to the sources that were ignored while a job of their task waited."""

    # ---- interrupts --------------------------------------------------------------------------

    def settle(self, signum: int = 0, frame: object = None) -> None:
        """
        Release what is due and run what is above the interrupted task, on top of it.

        The handler of the timer's signal, and what is called after ``locked`` was cleared if there
        is something ``pending``. On a clock that does not preempt, a job calls it where others may
        run.

        :raises TaskAborted: in the interrupted task, when it has used up its budget.
        """
        limit = self.recursion_limit
        if self.locked or not self.running:
            self.pending = self.locked
            if signum:
                narrow_recursion(limit)
            return
        self.locked = True
        self.recursion_limit = limit + RECURSION_ROOM
        try:
            _set_recursion_limit(limit + RECURSION_ROOM)
        except RecursionError:  # the interrupted task left no room even for this
            self.recursion_limit = limit
            self.locked = False
            raise
        current, level = self.current, self.level
        if signum and not SEPARATE_LIMITS and current is not None:
            self.check_depth(current, limit)
        abort, steps = self._serve_interrupts(current, level)
        self.recursion_limit = limit
        # Written out: no call may follow where the stack is as deep as it may be.
        try:
            _set_recursion_limit(limit)
        except RecursionError:
            try:
                force_recursion_limit(limit)
            except RecursionError:  # of a handler that found no room any more: the limit is set
                pass
        self.locked = False
        try:
            for _ in steps:  # raises the abort as well
                pass
            if abort is None and self.pending:
                self.settle()
        except RecursionError:  # no room: the interrupt comes again
            pass
        if abort is not None:
            raise abort

    def _serve_interrupts(self, current: Any, level: int
                          ) -> tuple[TaskAborted | None, Iterable[object]]:
        """
        Serve the interrupt of a task, or of none, and those that came meanwhile; locked.

        :return: what is to be raised in the task, and what raises it as well when it is iterated.
        """
        while True:
            try:
                self._serve_interrupt(current, level)
            except RecursionError:
                raise
            except Exception as error:  # of the kernel, not of the job that it would end
                self.current, self.level = current, level
                if not self.fail(error):
                    break
            if not self.pending:
                break
        if current is not None and current.abort_pending and not current.inside:
            return self.make_abort(current)
        return None, ()

    def _serve_interrupt(self, current: Any, level: int) -> None:
        """Serve one of them."""
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
            stolen_ns += self.faults.held_up(current, level, entry_ns, late_ns)
        if limited:  # before others run, whose time is theirs
            stolen_ns += self._stolen_from(current, entry_ns, stolen_ns, computed_ns)
        done_ns = entry_ns
        if self._ready.bit_length() - 1 > level:
            done_ns = self._dispatch(level, now_ns, entry_ns)
        if self._near_ns and self._firsts[0][0] - done_ns <= self._near_ns:
            done_ns = self._stay(level, done_ns)
        if self._firsts[0][1] <= level:
            self._defer(level, now_ns)
        due_ns = self._firsts[0][0]
        if current is not None and (current.limit_ns or self.stopping):
            used_ns = entry_ns - current.start_ns - stolen_ns - current.waited_ns
            if used_ns < current.limit_ns and not self.stopping:
                left_ns = current.limit_ns - used_ns
                if current.waited_ns:  # while it waits that does not become less
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

    def _stolen_from(self, task: Any, entry_ns: int, stolen_ns: int, computed_ns: int) -> int:
        """
        Return what Linux took from a job with a limit, if it did not compute all the time.

        :param stolen_ns: as far as that is known.
        :param computed_ns: the computing time of the thread.
        """
        gap_ns = (entry_ns - task.start_ns - stolen_ns - task.waited_ns
                  - (computed_ns - task.computed_ns))
        return self.faults.did_not_compute(task, entry_ns, gap_ns) if gap_ns > LATE_NS else 0

    def _stay(self, level: int, end_ns: int) -> int:
        """
        Serve what is due above the interrupted job soon: to go back to it would cost more.

        :param end_ns: when the last job ended, or whatever the kernel did not do itself.
        :return: the same, on return.
        """
        left_ns = self._near_ns
        while not self.stopping:
            due_ns, first_level = self._firsts[0]
            now_ns = self.now_ns()
            if first_level <= level or due_ns - now_ns > left_ns:  # or that would never go on
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

        A task that waits already is not released twice; that is counted (``coalesced``). One that
        is running runs once more. Safe in the real-time loop.
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

        :param now_ns: when the clock was read last.
        :param end_ns: when the last job ended, or whatever the kernel did not do itself.
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
                self._rest_level(level)
                continue
            task = queue.popleft()
            task.pending = False
            release_ns = task.release_ns  # an event may release it again while it runs
            previous_ns = self._begin_job(task, level, now_ns, end_ns)
            outcome, failure = self._call(task)
            end_ns = now_ns = self.now_ns()
            self._end_job(task, release_ns, previous_ns, end_ns, outcome, failure)
            # The second condition finds an interrupt whose handler had no room on the stack.
            if self.pending or firsts[0][0] <= end_ns:
                now_ns = self._collect_after(task, level)
        self.current, self.level = None, floor
        return end_ns

    def _begin_job(self, task: Any, level: int, now_ns: int, end_ns: int) -> int:
        """Set the interrupt for what may preempt a job; return when that before it began."""
        task.busy = True
        self.current, self.level = task, level
        next_ns = self._firsts[0][0]
        # Set now for what comes after it at its level, nothing is left to do when it has ended;
        # for what is due very soon the clock will be polled.
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
        Let the job run; return its outcome, and what it raised.

        The flag is cleared and set inside, so that no TaskAborted can come outside.
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
                task.limit_ns = 0  # what comes now is not its own
                outcome = ABORTED if issubclass(type(error), TaskAborted) else FAILED
                failure = self.contain(task, error)  # preemptible as well
            # Only here is an exception gone, with code that its author may have for that.
            self.locked = True
        except BaseException:
            self.locked = True
            outcome = outcome or FAILED
            failure = failure or self.undescribed(task)
        return outcome, failure

    def _end_job(self, task: Any, release_ns: int, previous_ns: int, end_ns: int, outcome: int,
                 failure: FailureReport | None) -> None:
        """Account for a job that has ended, and find out when its task is due again."""
        self.record((JOB, task, release_ns, task.start_ns, end_ns, outcome))
        task.count(release_ns, previous_ns, end_ns, self.stolen_ns, self.faults)
        if self.trace is not None:
            self.trace(end_ns, 'end' if outcome == OK else 'fail', task.name)
        if task.period_ns and not task.next_ns:  # an event had released it
            self._pull_timer(task, end_ns)
        if task.next_ns:
            self.return_timer(task, end_ns)
        task.busy = False
        if failure is not None or task.follow_up or task.inside:
            self.faults.after_job(task, failure, outcome, end_ns)

    def _collect_after(self, task: Any, level: int) -> int:
        """Note what came up while a job ran; return the time."""
        self.pending = False
        now_ns = self.now_ns()
        late_ns = now_ns - max(self._armed_ns, task.start_ns)
        self.collect_due(now_ns)
        if late_ns > BLOCKED_NS:  # it ended in a native call
            self.faults.held_up(task, level, now_ns, late_ns)
        return now_ns

    # ---- waiting -----------------------------------------------------------------------------

    def loop(self) -> None:
        """Run what is due and wait for what comes, until the kernel is to stop; ends locked."""
        end_ns = idled_ns = 0
        while True:
            self.locked = True
            self.pending = False
            if self.stopping:  # who says so later leaves a note, so that nothing is waited for
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
            if now_ns - self._fresh_ns > FRESH_NS:
                self._fresh_ns = now_ns
                self.steal_time.keep_fresh(now_ns)
            if self.clock.wait(self):
                self.interrupted = True
            self.wakeups += 1


def narrow_recursion(limit: int) -> None:
    """Take back the room that the handler of a signal was given."""
    try:
        _set_recursion_limit(limit)
    except RecursionError:
        try:
            force_recursion_limit(limit)
        except RecursionError:  # of a handler that found no room any more: the limit is set
            pass


if not TYPE_CHECKING and NATIVE is not None:
    Core = NATIVE.Core  # noqa: F811
