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

from collections.abc import Iterable
import sys
from typing import Any
from typing import Final

from rt_robot_os.errors import KernelError
from rt_robot_os.kernel.alarms import Alarms
from rt_robot_os.kernel.black_box import ABORT
from rt_robot_os.kernel.black_box import ABORTED
from rt_robot_os.kernel.black_box import FAILED
from rt_robot_os.kernel.black_box import JOB
from rt_robot_os.kernel.black_box import OK
from rt_robot_os.kernel.black_box import RECORDS_DEFAULT
from rt_robot_os.kernel.clock import Clock
from rt_robot_os.kernel.clock import NEVER_NS
from rt_robot_os.kernel.consequences import BLOCKED_NS
from rt_robot_os.kernel.consequences import Consequences
from rt_robot_os.kernel.consequences import WAITING_LIMITS
from rt_robot_os.kernel.count import count
from rt_robot_os.kernel.failure import describe
from rt_robot_os.kernel.failure import drop_context
from rt_robot_os.kernel.failure import FailureReport
from rt_robot_os.kernel.failure import TaskAborted
from rt_robot_os.kernel.releases import IDLE_LEVEL
from rt_robot_os.kernel.resource import Resource
from rt_robot_os.kernel.stolen import LOOKS_LONG_NS
from rt_robot_os.kernel.task import Task
from rt_robot_os.kernel.timers import insert
from rt_robot_os.kernel.timers import Timer
from rt_robot_os.linux.recursion import force_recursion_limit
from rt_robot_os.linux.recursion import SEPARATE_LIMITS
from rt_robot_os.units import NS_PER_MS
from rt_robot_os.units import NS_PER_US

# Computing time for ``finally`` clauses between the first TaskAborted and the second, at least.
# After that the job resists: TaskAborted is raised wherever Python runs handlers of signals, until
# the job has ended. The alarm comes as well, where the stack had no room for that.
GRACE_NS: Final = 20 * NS_PER_MS
STRIKE_AGAIN_NS: Final = 50 * NS_PER_US
STRIKE_ALWAYS_NS: Final = 1
# Computing time for describing an exception and for dropping it: both may run its author's code.
CONTAIN_NS: Final = 10 * NS_PER_MS
# Python frames that each level of nesting adds to the limit: a task that recursed to its own must
# not leave too few for those that preempt it.
RECURSION_ROOM: Final = 200
# Before Python 3.12 a job that comes so close to its limit is ended: where it is deeper still
# there is no room for the handler of the alarm, and it would hold up everybody.
_RECURSION_EDGE: Final = 50

_set_recursion_limit: Final = sys.setrecursionlimit


class Scheduler(Alarms):
    """Dispatch, and ending jobs: what runs in every tick. :class:`Kernel` adds the rest."""

    __slots__ = ('_recursion_limit', '_resources', '_consequences', '_leaving')

    def __init__(self, clock: Clock, spin_ns: int = 0, records: int = RECORDS_DEFAULT) -> None:
        super().__init__(clock, spin_ns, records)
        self._recursion_limit = 0
        self._resources: dict[str, Resource] = {}
        self._consequences = Consequences(self, self._resources)
        self._leaving: BaseException | None = None  # what run() is to end with

    # ---- ticks -------------------------------------------------------------------------------

    def settle(self, signum: int = 0, frame: object = None) -> None:
        """
        Release what is due and run what is above the interrupted task, on top of it.

        The alarm's handler, and what is called after ``locked`` was cleared if there is something
        ``pending``. On a clock that does not preempt, a job calls it where others may run.

        :raises TaskAborted: in the interrupted task, when it has used up its budget.
        """
        limit = self._recursion_limit
        if self.locked or not self.running:
            self.pending = self.locked
            if signum:
                self._narrow(limit)
            return
        self.locked = True
        self._recursion_limit = limit + RECURSION_ROOM
        try:
            _set_recursion_limit(limit + RECURSION_ROOM)
        except RecursionError:  # the interrupted task left no room even for this
            self._recursion_limit = limit
            self.locked = False
            raise
        current, level = self.current, self._level
        if signum and not SEPARATE_LIMITS and current is not None:
            self._look_at_depth(current, limit)
        while True:
            try:
                self._tick(current, level)
            except RecursionError:
                raise
            except Exception as error:  # of the kernel, not of the job that it would end
                if self._leaving is not None:
                    break
                self._fail(error)
            again = self.pending
            if not again:
                break
        strike: TaskAborted | None = None
        steps: Iterable[object] = ()
        if current is not None and current.struck and not current.inside:
            strike = self._strike(current)
            if current.limit_ns == STRIKE_ALWAYS_NS:
                steps = self.clock.raising(strike)
        self._recursion_limit = limit
        # Written out: no call may follow where the stack is as deep as it may be.
        try:
            _set_recursion_limit(limit)
        except RecursionError:
            try:
                force_recursion_limit(limit)
            except RecursionError:  # of a handler that found no room any more: the limit is set
                pass
        self.locked = False
        if strike is not None:
            try:
                for _ in steps:  # raises it as well
                    pass
            except RecursionError:  # no room: the alarm comes again
                pass
            raise strike
        if self.pending:
            try:
                self.settle()
            except RecursionError:  # no room: the alarm comes again
                pass

    def stop(self, reason: str = 'stop') -> None:
        """
        End :meth:`run` when the jobs that run now have ended; safe in the real-time loop.

        Those that have not ended after ``stop_grace_ns`` get a TaskAborted, whatever their budget.
        Before :meth:`run`, for instance by a signal while the robot starts, it ends it at once.
        """
        if not self._stopping:
            self._stop_ns = min(NEVER_NS, self.now_ns() + self.stop_grace_ns)
        self._stopping = True
        self._stop_reason = reason
        if self.current is not None and self._stop_ns < NEVER_NS:
            if self.locked:
                self.pending = True
            else:
                self.settle()  # which sets the alarm
        elif self._level == IDLE_LEVEL:
            self.pending = True  # it may be about to wait

    def _fail(self, error: Exception) -> None:
        """Let :meth:`Kernel.run` end with a defect of the kernel."""
        told = describe('kernel', self.now_ns(), error, outermost=True).told
        leaving = KernelError(f'the kernel itself has failed; please report it with this: {told}')
        leaving.__cause__ = error
        self._leaving = self._leaving or leaving
        self.stop('KernelError')

    def _tick(self, current: Task | None, level: int) -> None:
        """Serve one alarm that interrupted a task, or none; locked."""
        stolen_ns = self._stolen_ns
        self.pending = False
        entry_ns = now_ns = self.now_ns()
        late_ns = 0
        computed_ns = 0
        limited = current is not None and current.limit_ns > STRIKE_ALWAYS_NS
        if limited:
            computed_ns = self.clock.computed_ns()
        if current is not None and not self._stopping:
            late_ns = entry_ns - (
                self._armed_ns if self._armed_ns > current.start_ns else current.start_ns)
        if self.spin_ns:
            now_ns = self._spin(now_ns, level)
        firsts = self._firsts
        if firsts[0][0] <= now_ns or self._interrupted:
            self._notice(now_ns)
        if current is not None and (
                late_ns > current.blocked_maximum_ns or late_ns > BLOCKED_NS):
            stolen_ns += self._consequences.held_up(current, level, entry_ns, late_ns)
        if current is not None and limited:  # before others run, whose time is theirs
            stolen_ns += self._consequences.taken(
                current, entry_ns, entry_ns - current.start_ns - stolen_ns, computed_ns)
        done_ns = entry_ns
        if self._ready.bit_length() - 1 > level:
            done_ns = self._dispatch(level, now_ns, entry_ns)
        if self._near_ns and firsts[0][0] - done_ns <= self._near_ns:
            done_ns = self._stay(level, done_ns)
        due_ns, first_level = firsts[0]
        if first_level <= level:
            self._set_aside(level, now_ns)
            due_ns = firsts[0][0]
        if current is not None and (current.limit_ns or self._stopping):
            used_ns = entry_ns - current.start_ns - stolen_ns - current.waited_ns
            self._arm_ahead(level, self._police(current, used_ns))
        elif not self._spare_ns or not (
                due_ns <= self._armed_due_ns <= due_ns + self._slack_ns):
            self._arm_ahead(level, NEVER_NS)
        self.current, self._level = current, level
        if current is not None and limited:
            current.computed_ns += self.clock.computed_ns() - computed_ns
        end_ns = self.now_ns()
        self.overhead_ns += end_ns - done_ns
        self._stolen_ns = stolen_ns + end_ns - entry_ns

    def _stay(self, level: int, end_ns: int) -> int:
        """
        Serve what is due above the interrupted job soon: to go back to it would cost more.

        :param end_ns: when the last job ended, or whatever the kernel did not do itself.
        :return: the same, on return.
        """
        firsts, left_ns = self._firsts, self._near_ns
        while not self._stopping:
            due_ns, first_level = firsts[0]
            now_ns = self.now_ns()
            if first_level <= level or due_ns - now_ns > left_ns:  # or that would never go on
                break
            if now_ns < due_ns:
                if due_ns == self._armed_ns or due_ns == self._spare_ns:
                    break
                self.overhead_ns += now_ns - end_ns
                end_ns = self._look(due_ns, now_ns)
                left_ns -= end_ns - now_ns
            self.pending = False
            now_ns = self.now_ns()
            self._notice(now_ns)
            if self._ready.bit_length() - 1 > level:
                end_ns = self._dispatch(level, now_ns, end_ns)
        return end_ns

    # ---- releases ----------------------------------------------------------------------------

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

    def _dispatch(self, floor: int, looked_ns: int, end_ns: int) -> int:
        """
        Run every ready task above ``floor``; locked on entry and on return.

        :param looked_ns: when the clock was read last.
        :param end_ns: when the last job ended, or whatever the kernel did not do itself.
        :return: the same, on return.
        """
        # Written out, each of its parts being 1 to 4 % of a job as a method: only counting is one.
        now_ns: Any = self.now_ns
        queues, trace = self._queues, self.trace
        all_timers, watched_ns, firsts = self._timers, self._watched_ns, self._firsts
        consequences = self._consequences
        overhead_ns = 0
        task: Task
        # Times that go into tuples: for the compiled build they stay objects, not made anew.
        release: Any
        period: Any
        start: Any
        end: Any
        own_ns: int
        following_ns: int
        timer: Timer
        while not self._stopping:
            level = self._ready.bit_length() - 1
            if level <= floor:
                break
            # Which job: of the task that waits first, or that falls due.
            queue, timers = queues[level], all_timers[level]
            first = timers[0]
            own_ns = first[0]  # its next release comes from the timers no sooner than that
            if own_ns > looked_ns:
                if not queue:
                    self._ready ^= self._bits[level]
                    if own_ns < watched_ns[level]:
                        watched_ns[level] = own_ns
                        insert(firsts, (own_ns, level))
                    continue
                task = queue.popleft()
                task.pending = False
                release = task.release_ns  # an event may release it again while it runs
            else:
                periodic = not queue and first[3]
                if periodic:
                    task = first[2]
                if not periodic or task.pending:
                    self._take_in(level, looked_ns)
                    if self._interrupted:
                        self._hear(looked_ns)
                    continue
                # The usual case, without the way through the queue.
                release, period = first[0], first[3]
                interval_ns: int = period
                task.interval_ns = interval_ns
                task.releases += 1
                task.release_ns = own_ns
                period_ns = task.period_ns
                own_ns += period_ns
                timer = (own_ns, first[1], task, period if period_ns == interval_ns else period_ns)
                if own_ns <= looked_ns:  # late
                    timers.pop(0)
                    task.timer = timer
                    own_ns = NEVER_NS
                else:
                    following_ns = timers[1][0]
                    if own_ns < following_ns:
                        timers[0] = timer
                    else:
                        timers.pop(0)
                        insert(timers, timer)
            # The alarm: for what may preempt it, or for its own next release after it.
            task.busy = True
            self.current, self._level = task, level
            next_ns = firsts[0][0]
            if own_ns < next_ns:
                next_ns = own_ns
            if task.aborts or not next_ns <= self._armed_due_ns <= next_ns + self._slack_ns:
                self._arm_for(task, level, next_ns)
            start = now_ns()
            start_ns: int = start
            overhead_ns += start_ns - end_ns
            previous_ns, task.start_ns = task.start_ns, start_ns
            self._stolen_ns = 0
            if trace is not None:
                trace(start_ns, 'start', task.name)
            # The job. The flag is cleared and set inside, so that no TaskAborted can come outside.
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
                    failure = self._contain(task, error)  # preemptible as well
                # Only here is an exception gone, with code that its author may have for that.
                self.locked = True
            except BaseException:
                self.locked = True
                outcome = outcome or FAILED
                failure = failure or FailureReport(
                    task.name, 0, 'an exception that raised another when it was looked at', ())
            # What it took, and when it is due again.
            end = now_ns()
            end_ns = end
            self.record((JOB, task, release, start, end, outcome))
            count(task, release, start_ns, previous_ns, end_ns, self._stolen_ns, consequences)
            if trace is not None:
                trace(end_ns, 'end' if outcome == OK else 'fail', task.name)
            if own_ns <= end_ns and task.period_ns:
                self._take_out(task, end_ns)
            if task.timer is not None:
                following = consequences.reckon(task, task.timer, end_ns)
                task.timer = None
                if following is not None:
                    insert(timers, following)
            task.busy = False
            if failure is not None or task.follow_up or task.inside:
                consequences.follow(task, failure, outcome, end_ns)
            # What is to do now: at this level, and above it.
            due_ns = timers[0][0]
            if due_ns > end_ns and not queue:
                self._ready ^= self._bits[level]
                if due_ns < watched_ns[level]:
                    watched_ns[level] = due_ns
                    insert(firsts, (due_ns, level))
            looked_ns = end_ns
            # The second condition finds an alarm whose handler had no room left on the stack.
            if self.pending or firsts[0][0] <= end_ns:
                self.pending = False
                self.overhead_ns += overhead_ns
                overhead_ns = 0
                looked_ns = now_ns()
                late_ns = looked_ns - (self._armed_ns if self._armed_ns > start_ns else start_ns)
                self._notice(looked_ns)
                if late_ns > BLOCKED_NS:  # it ended in a native call
                    consequences.held_up(task, level, looked_ns, late_ns)
        self.overhead_ns += overhead_ns
        self.current, self._level = None, floor
        return end_ns

    # ---- ending jobs -------------------------------------------------------------------------

    def _police(self, task: Task, used_ns: int) -> int:
        """
        Have the interrupted task struck if it has used what it may.

        :param used_ns: its computing time.
        :return: when to look again.
        """
        now_ns = self.now_ns()
        look_ns = NEVER_NS
        if task.limit_ns:
            left_ns = task.limit_ns - used_ns
            if left_ns > 0 and task.waited_ns:  # while it waits that does not become less
                left_ns = max(left_ns, LOOKS_LONG_NS)
            look_ns = now_ns + left_ns
        if self._stopping and not (task.strikes or task.over) and self._stop_ns < look_ns:
            look_ns = self._stop_ns
        if now_ns < look_ns:
            return look_ns
        if not task.struck:
            self._have_struck(task)
            if not (task.over or task.limit_ns == STRIKE_ALWAYS_NS):  # two tell it
                self.record((ABORT, task, now_ns, used_ns))
        return NEVER_NS  # when it is delivered, the alarm is set anew

    def _have_struck(self, task: Task) -> None:
        """Let TaskAborted be raised in the task on the top of the stack as soon as it may be."""
        task.struck = True
        task.follow_up = True

    def _strike(self, task: Task) -> TaskAborted:
        """Return what is to be raised in the task on the top of the stack, at once."""
        now_ns = self.now_ns()
        used_ns = now_ns - task.start_ns - self._stolen_ns - task.waited_ns
        task.struck = False
        if not task.over:
            task.strikes += 1
        if not task.resists:
            task.resists = True
            pause_ns = max(GRACE_NS, task.spec.budget_ns)
            task.limit_ns = used_ns + pause_ns
        else:
            pause_ns = STRIKE_AGAIN_NS
            task.limit_ns = STRIKE_ALWAYS_NS
            drop_context()
        self._look_at(now_ns + pause_ns)
        why = ''
        if self._stopping and now_ns >= self._stop_ns:
            why = (f'was ended {(now_ns - self._stop_ns + self.stop_grace_ns) // NS_PER_MS} ms '
                   f'after the kernel was told to stop ({self._stop_reason})')
            if task.name not in self.ended:
                self.ended.append(task.name)
        elif task.waited_ns >= WAITING_LIMITS * task.budget_ns:
            why = f'waited for {task.waited_ns // NS_PER_MS} ms, {WAITING_LIMITS} times its budget'
        elif not task.aborts or used_ns < task.budget_ns:
            why = f'was ended near the recursion limit, after {used_ns // NS_PER_US} us'
        return TaskAborted(task.name, used_ns, task.spec.budget_ns, why)

    def _contain(self, task: Task, error: BaseException) -> FailureReport:
        """
        Describe what came out of the job that runs, within a computing time of its own.

        Not locked: whatever the exception does when it is looked at is preemptible, and ended.
        """
        self.locked = True
        now_ns = self.now_ns()
        task.over = True
        task.struck = task.resists = False  # too late
        used_ns = now_ns - task.start_ns - self._stolen_ns - task.waited_ns
        task.limit_ns = used_ns + CONTAIN_NS
        task.computed_ns = self.clock.computed_ns() - used_ns
        self._look_at(now_ns + CONTAIN_NS)
        self.locked = False
        if self.pending:
            self.settle()
        return describe(task.name, now_ns, error)

    # ---- recursion ---------------------------------------------------------------------------

    def _narrow(self, limit: int) -> None:
        """Take back the room that the handler of a signal was given."""
        try:
            sys.setrecursionlimit(limit)
        except RecursionError:
            try:
                force_recursion_limit(limit)
            except RecursionError:  # of a handler that found no room any more: the limit is set
                pass

    def _look_at_depth(self, task: Task, limit: int) -> None:
        """Have a job struck that is about to reach its recursion limit."""
        try:
            sys.setrecursionlimit(limit - _RECURSION_EDGE)
        except RecursionError:
            if not task.strikes:  # later its time counts
                self._have_struck(task)
        sys.setrecursionlimit(limit + RECURSION_ROOM)
