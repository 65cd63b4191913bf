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
The end of jobs by budgets, exceptions and the stop of the kernel; and interrupt sources.

The code of every job is in :class:`rt_robot_os.kernel.core.KernelCore`; the code here runs rarely.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from collections.abc import Iterable
import functools
import sys
from typing import Final

from rt_robot_os.base.compiled import NATIVE
from rt_robot_os.base.errors import KernelError
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.kernel.black_box import ABORT
from rt_robot_os.kernel.black_box import BlackBox
from rt_robot_os.kernel.black_box import INTERRUPT
from rt_robot_os.kernel.black_box import Record
from rt_robot_os.kernel.black_box import RECORDS_DEFAULT
from rt_robot_os.kernel.clock import Clock
from rt_robot_os.kernel.clock import NEVER_NS
from rt_robot_os.kernel.core import ABORT_ALWAYS_NS
from rt_robot_os.kernel.core import KernelCore
from rt_robot_os.kernel.core import LATE_NS
from rt_robot_os.kernel.core import RECURSION_ROOM
from rt_robot_os.kernel.failure import describe
from rt_robot_os.kernel.failure import drop_context
from rt_robot_os.kernel.failure import FailureReport
from rt_robot_os.kernel.failure import TaskAborted
from rt_robot_os.kernel.fault_handling import FaultHandling
from rt_robot_os.kernel.fault_handling import WAITING_LIMITS
from rt_robot_os.kernel.interrupts import InterruptSource
from rt_robot_os.kernel.interrupts import InterruptSources
from rt_robot_os.kernel.releases import IDLE_LEVEL
from rt_robot_os.kernel.resource import Resource
from rt_robot_os.kernel.steal_time import StealTime
from rt_robot_os.kernel.task import Task

# Minimum computing time for ``finally`` clauses between the first TaskAborted and the second.
# After that, TaskAborted is raised wherever Python runs handlers of signals, until the job ends.
# The timer interrupts as well, for the case that the stack had no room to raise it.
GRACE_NS: Final = 20 * NS_PER_MS
ABORT_AGAIN_NS: Final = 50 * NS_PER_US
# Computing time for describing and releasing an exception: both may run code of its author.
CONTAIN_NS: Final = 10 * NS_PER_MS
# Before Python 3.12 a job that comes this close to its recursion limit is ended: any deeper, the
# handler of the interrupt has no stack left, and the job would block all others.
_RECURSION_EDGE: Final = 50
_FAILURES_MAXIMUM: Final = 32

Observer = Callable[[Record], None]


class Scheduler(KernelCore):
    """
    The exceptional cases of the core.

    :ivar failures: the last reports; ``failures_total`` counts all.
    :ivar stop_grace_ns: jobs that still run this long after :meth:`stop` are aborted; by default
        never.
    :ivar ended: the tasks whose jobs were aborted so, since the kernel was started.
    """

    __slots__ = ('failures', 'failures_total', 'stop_grace_ns', 'ended', '_stop_reason',
                 '_stop_ns', '_exit_error', '_resources', '_sources', '_observers')

    faults: FaultHandling
    steal_time: StealTime

    def __init__(self, clock: Clock, spin_ns: int = 0, records: int = RECORDS_DEFAULT) -> None:
        super().__init__(clock, BlackBox(records), spin_ns)
        self.steal_time = StealTime(clock)
        self.failures: deque[FailureReport] = deque(maxlen=_FAILURES_MAXIMUM)
        self.failures_total = 0
        self.stop_grace_ns = NEVER_NS
        self.ended: list[str] = []
        self._stop_reason = ''
        self._stop_ns = NEVER_NS
        self._exit_error: BaseException | None = None  # to be raised by run()
        self._resources: dict[str, Resource] = {}
        self._sources = InterruptSources(clock)
        self._observers: tuple[Observer, ...] = ()
        self.faults = FaultHandling(self, self._resources)

    # ---- reports -----------------------------------------------------------------------------

    def add_observer(self, observer: Observer) -> None:
        """
        Call a function with every record that the kernel and the topics make.

        :param observer: called with the record, see :mod:`rt_robot_os.kernel.black_box`, in a
            critical section: it must be quick. One that raises is reported and removed.
        """
        self._observers = (*self._observers, observer)
        self.record = self._inform
        self.observed = True

    def _inform(self, record: Record) -> None:
        self.black_box.add(record)
        for observer in self._observers:
            try:
                observer(record)
            except Exception as error:
                self._observers = tuple(one for one in self._observers if one is not observer)
                self.note_failure(describe('observer', self.now_ns(), error))

    def note_failure(self, failure: FailureReport) -> None:
        """Store a failure report and count it."""
        self.failures_total += 1
        self.failures.append(failure)

    # ---- stopping ----------------------------------------------------------------------------

    def stop(self, reason: str = 'stop') -> None:
        """
        End :meth:`run` when the running jobs have ended; safe in the real-time loop.

        Jobs that have not ended after ``stop_grace_ns`` get a TaskAborted, whatever their budget.
        A stop before :meth:`run`, such as by a signal during start-up, ends it immediately.
        """
        if not self.stopping:
            self._stop_ns = min(NEVER_NS, self.now_ns() + self.stop_grace_ns)
        self.stopping = True
        self._stop_reason = reason
        if self.current is not None and self._stop_ns < NEVER_NS:
            if self.locked:
                self.pending = True
            else:
                self.settle()  # sets the timer
        elif self.level == IDLE_LEVEL:
            self.pending = True  # the kernel may be about to wait

    def fail(self, error: Exception) -> bool:
        """
        End :meth:`Kernel.run` with a :class:`KernelError`.

        :return: False when an earlier exception ends it already.
        """
        if self._exit_error is not None:
            return False
        described = describe('kernel', self.now_ns(), error, outermost=True).details
        self._exit_error = KernelError(
            f'the kernel itself has failed; please report it with this: {described}')
        self._exit_error.__cause__ = error
        self.stop('KernelError')
        return True

    # ---- ending jobs -------------------------------------------------------------------------

    def check_budget(self, task: Task, used_ns: int) -> int:
        """
        Request an abort of the interrupted job if its budget is used up or the kernel stops.

        :param used_ns: its computing time at the interrupt.
        :return: when to check again.
        """
        now_ns = self.now_ns()
        check_ns = NEVER_NS
        if task.limit_ns:
            left_ns = task.limit_ns - used_ns
            if left_ns > 0 and task.waited_ns:  # waiting does not use up the rest
                left_ns = max(left_ns, LATE_NS)
            check_ns = now_ns + left_ns
        if (self.stopping and not (task.aborts_raised or task.containing)
                and self._stop_ns < check_ns):
            check_ns = self._stop_ns
        if now_ns < check_ns:
            return check_ns
        if not task.abort_pending:
            self._request_abort(task)
            if not (task.containing or task.limit_ns == ABORT_ALWAYS_NS):  # two are enough
                self.record((ABORT, task, now_ns, used_ns))
        return NEVER_NS  # the timer is set again when the exception is raised

    def _request_abort(self, task: Task) -> None:
        """Have TaskAborted raised in the running job as soon as that is allowed."""
        task.abort_pending = True
        task.follow_up = True

    def make_abort(self, task: Task) -> tuple[TaskAborted, Iterable[object]]:
        """
        Return the exception to raise immediately in the running job.

        :return: and an iterable: iterating over it sends the next interrupt and raises the same
            exception, for jobs that catch every exception; empty for other jobs.
        """
        now_ns = self.now_ns()
        used_ns = now_ns - task.start_ns - self.stolen_ns - task.waited_ns
        task.abort_pending = False
        if not task.containing:
            task.aborts_raised += 1
        if not task.grace_used:
            task.grace_used = True
            pause_ns = max(GRACE_NS, task.spec.budget_ns)
            task.limit_ns = used_ns + pause_ns
        else:
            pause_ns = ABORT_AGAIN_NS
            task.limit_ns = ABORT_ALWAYS_NS
            drop_context()
        self._interrupt_by(now_ns + pause_ns)
        reason = ''
        if self.stopping and now_ns >= self._stop_ns:
            reason = (f'was ended {(now_ns - self._stop_ns + self.stop_grace_ns) // NS_PER_MS} ms '
                      f'after the kernel was told to stop ({self._stop_reason})')
            if task.name not in self.ended:
                self.ended.append(task.name)
        elif task.waited_ns >= WAITING_LIMITS * task.budget_ns:
            reason = (f'waited for {task.waited_ns // NS_PER_MS} ms, {WAITING_LIMITS} times its '
                      'budget')
        elif not task.aborts or used_ns < task.budget_ns:
            reason = f'was ended near the recursion limit, after {used_ns // NS_PER_US} us'
        abort = TaskAborted(task.name, used_ns, task.spec.budget_ns, reason)
        return abort, self.clock.raising(abort) if task.limit_ns == ABORT_ALWAYS_NS else ()

    def contain(self, task: Task, error: BaseException) -> FailureReport:
        """
        Describe the exception of the running job, with a budget of computing time.

        Not locked: code that the exception runs while it is described is preemptible, and aborted
        when it exceeds that budget.
        """
        self.locked = True
        now_ns = self.now_ns()
        task.containing = True
        task.abort_pending = task.grace_used = False  # an abort would be too late
        used_ns = now_ns - task.start_ns - self.stolen_ns - task.waited_ns
        task.limit_ns = used_ns + CONTAIN_NS
        task.computed_ns = self.clock.computed_ns() - used_ns
        self._interrupt_by(now_ns + CONTAIN_NS)
        self.locked = False
        if self.pending:
            self.settle()
        # The outermost call is that of the dispatcher, unless that is C.
        return describe(task.name, now_ns, error, outermost=NATIVE is not None)

    def minimal_report(self, task: Task) -> FailureReport:
        """Return the report of an exception whose description failed."""
        return FailureReport(
            task.name, 0, 'an exception that raised another when it was described', ())

    def check_depth(self, task: Task, limit: int) -> None:
        """Request an abort of a job that is about to reach its recursion limit."""
        try:
            sys.setrecursionlimit(limit - _RECURSION_EDGE)
        except RecursionError:
            if not task.aborts_raised:  # after that only its time counts
                self._request_abort(task)
        sys.setrecursionlimit(limit + RECURSION_ROOM)

    def account_missed_releases(self, task: Task, due_ns: int, now_ns: int) -> int:
        """Apply the overrun policy of a task to the points of its grid that passed."""
        return self.faults.account_missed_releases(task, due_ns, now_ns)

    # ---- interrupts --------------------------------------------------------------------------

    def poll_sources(self, now_ns: int) -> None:
        """Release the tasks whose descriptors are readable."""
        self.interrupted = False
        sources = self._sources
        for source in sources.ready(now_ns):
            task = source.task
            self.record((INTERRUPT, task, now_ns, source.name))
            waits = task.pending
            self.release_due(task.priority, min(now_ns, self.end_ns - 1))
            self.arrive(task, now_ns)
            if waits:  # its job will read everything: mask the source until then
                sources.defer(source)
                task.follow_up = True
        for source in sources.early():
            self._schedule_reopening(source)

    def rearm_sources(self, task: Task) -> None:
        """Enable the sources again that were masked while a job of their task waited."""
        for source in self._sources.waiting_for(task):
            self._schedule_reopening(source)

    def _schedule_reopening(self, source: InterruptSource) -> None:
        self.schedule(source.open_ns, functools.partial(self._reopen, source),
                      source.task.priority)

    def _reopen(self, source: InterruptSource, now_ns: int) -> None:
        if self._sources.reopen(source):
            self.interrupted = self.pending = True
