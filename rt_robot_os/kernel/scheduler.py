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
Ending jobs: by their budgets, by what they raise, and when the kernel stops; and interrupts.

What runs with every job is in :class:`rt_robot_os.kernel.core.Core`; what is here is rare.
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
from rt_robot_os.kernel.core import Core
from rt_robot_os.kernel.core import LATE_NS
from rt_robot_os.kernel.core import RECURSION_ROOM
from rt_robot_os.kernel.failure import describe
from rt_robot_os.kernel.failure import drop_context
from rt_robot_os.kernel.failure import FailureReport
from rt_robot_os.kernel.failure import TaskAborted
from rt_robot_os.kernel.fault_handling import FaultHandling
from rt_robot_os.kernel.fault_handling import WAITING_LIMITS
from rt_robot_os.kernel.interrupts import InterruptSources
from rt_robot_os.kernel.interrupts import Source
from rt_robot_os.kernel.releases import IDLE_LEVEL
from rt_robot_os.kernel.resource import Resource
from rt_robot_os.kernel.steal_time import StealTime
from rt_robot_os.kernel.task import Task

# Computing time for ``finally`` clauses between the first TaskAborted and the second, at least.
# After that the job resists: TaskAborted is raised wherever Python runs handlers of signals, until
# the job has ended. The interrupt comes as well, where the stack had no room for that.
GRACE_NS: Final = 20 * NS_PER_MS
ABORT_AGAIN_NS: Final = 50 * NS_PER_US
# Computing time for describing an exception and for dropping it: both may run its author's code.
CONTAIN_NS: Final = 10 * NS_PER_MS
# Before Python 3.12 a job that comes so close to its limit is ended: where it is deeper still
# there is no room for the handler of the interrupt, and it would hold up everybody.
_RECURSION_EDGE: Final = 50
_FAILURES_KEPT: Final = 32

Observer = Callable[[Record], None]


class Scheduler(Core):
    """
    What the core asks for when something rare happened.

    :ivar failures: the last reports; ``failures_total`` counts all.
    :ivar stop_grace_ns: jobs that run so long after :meth:`stop` are ended; by default never.
    :ivar ended: the tasks whose jobs were, since the kernel was started.
    """

    __slots__ = ('failures', 'failures_total', 'stop_grace_ns', 'ended', '_stop_reason',
                 '_stop_ns', '_leaving', '_resources', '_sources', '_observers')

    faults: FaultHandling
    steal_time: StealTime

    def __init__(self, clock: Clock, spin_ns: int = 0, records: int = RECORDS_DEFAULT) -> None:
        super().__init__(clock, BlackBox(records), spin_ns)
        self.steal_time = StealTime(clock)
        self.failures: deque[FailureReport] = deque(maxlen=_FAILURES_KEPT)
        self.failures_total = 0
        self.stop_grace_ns = NEVER_NS
        self.ended: list[str] = []
        self._stop_reason = ''
        self._stop_ns = NEVER_NS
        self._leaving: BaseException | None = None  # what run() is to end with
        self._resources: dict[str, Resource] = {}
        self._sources = InterruptSources(clock)
        self._observers: tuple[Observer, ...] = ()
        self.faults = FaultHandling(self, self._resources)

    # ---- reports -----------------------------------------------------------------------------

    def add_observer(self, observer: Observer) -> None:
        """
        Let something be given all that the kernel and the topics record, besides the black box.

        :param observer: gets the record, see :mod:`rt_robot_os.kernel.black_box`, within a
            critical section: it must be quick. One that raises is reported, and dropped.
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
        """Store a report, and count it."""
        self.failures_total += 1
        self.failures.append(failure)

    # ---- the end -----------------------------------------------------------------------------

    def stop(self, reason: str = 'stop') -> None:
        """
        End :meth:`run` when the jobs that run now have ended; safe in the real-time loop.

        Those that have not ended after ``stop_grace_ns`` get a TaskAborted, whatever their budget.
        Before :meth:`run`, for instance by a signal while the robot starts, it ends it at once.
        """
        if not self.stopping:
            self._stop_ns = min(NEVER_NS, self.now_ns() + self.stop_grace_ns)
        self.stopping = True
        self._stop_reason = reason
        if self.current is not None and self._stop_ns < NEVER_NS:
            if self.locked:
                self.pending = True
            else:
                self.settle()  # which sets the timer
        elif self.level == IDLE_LEVEL:
            self.pending = True  # it may be about to wait

    def fail(self, error: Exception) -> bool:
        """
        Let :meth:`Kernel.run` end with a defect of the kernel.

        :return: False when it is to end in such a way already.
        """
        if self._leaving is not None:
            return False
        described = describe('kernel', self.now_ns(), error, outermost=True).told
        self._leaving = KernelError(
            f'the kernel itself has failed; please report it with this: {described}')
        self._leaving.__cause__ = error
        self.stop('KernelError')
        return True

    # ---- ending jobs -------------------------------------------------------------------------

    def check_budget(self, task: Task, used_ns: int) -> int:
        """
        Have the interrupted task aborted if it has used what it may, or the kernel stops.

        :param used_ns: its computing time at the interrupt.
        :return: when to check again.
        """
        now_ns = self.now_ns()
        check_ns = NEVER_NS
        if task.limit_ns:
            left_ns = task.limit_ns - used_ns
            if left_ns > 0 and task.waited_ns:  # while it waits that does not become less
                left_ns = max(left_ns, LATE_NS)
            check_ns = now_ns + left_ns
        if self.stopping and not (task.aborts_raised or task.over) and self._stop_ns < check_ns:
            check_ns = self._stop_ns
        if now_ns < check_ns:
            return check_ns
        if not task.abort_pending:
            self._request_abort(task)
            if not (task.over or task.limit_ns == ABORT_ALWAYS_NS):  # two records say it
                self.record((ABORT, task, now_ns, used_ns))
        return NEVER_NS  # when it is raised, the timer is set anew

    def _request_abort(self, task: Task) -> None:
        """Let TaskAborted be raised in the task on the top of the stack as soon as it may be."""
        task.abort_pending = True
        task.follow_up = True

    def make_abort(self, task: Task) -> tuple[TaskAborted, Iterable[object]]:
        """
        Return what is to be raised in the task on the top of the stack, at once.

        :return: and an iterable: to iterate it raises the same, with another interrupt on its way,
            for jobs that swallow every exception; empty for others.
        """
        now_ns = self.now_ns()
        used_ns = now_ns - task.start_ns - self.stolen_ns - task.waited_ns
        task.abort_pending = False
        if not task.over:
            task.aborts_raised += 1
        if not task.resists:
            task.resists = True
            pause_ns = max(GRACE_NS, task.spec.budget_ns)
            task.limit_ns = used_ns + pause_ns
        else:
            pause_ns = ABORT_AGAIN_NS
            task.limit_ns = ABORT_ALWAYS_NS
            drop_context()
        self._interrupt_by(now_ns + pause_ns)
        why = ''
        if self.stopping and now_ns >= self._stop_ns:
            why = (f'was ended {(now_ns - self._stop_ns + self.stop_grace_ns) // NS_PER_MS} ms '
                   f'after the kernel was told to stop ({self._stop_reason})')
            if task.name not in self.ended:
                self.ended.append(task.name)
        elif task.waited_ns >= WAITING_LIMITS * task.budget_ns:
            why = f'waited for {task.waited_ns // NS_PER_MS} ms, {WAITING_LIMITS} times its budget'
        elif not task.aborts or used_ns < task.budget_ns:
            why = f'was ended near the recursion limit, after {used_ns // NS_PER_US} us'
        abort = TaskAborted(task.name, used_ns, task.spec.budget_ns, why)
        return abort, self.clock.raising(abort) if task.limit_ns == ABORT_ALWAYS_NS else ()

    def contain(self, task: Task, error: BaseException) -> FailureReport:
        """
        Describe what came out of the job that runs, within a computing time of its own.

        Not locked: whatever the exception does when it is looked at is preemptible, and ended.
        """
        self.locked = True
        now_ns = self.now_ns()
        task.over = True
        task.abort_pending = task.resists = False  # too late
        used_ns = now_ns - task.start_ns - self.stolen_ns - task.waited_ns
        task.limit_ns = used_ns + CONTAIN_NS
        task.computed_ns = self.clock.computed_ns() - used_ns
        self._interrupt_by(now_ns + CONTAIN_NS)
        self.locked = False
        if self.pending:
            self.settle()
        # The outermost call is the dispatcher's own, unless that is C.
        return describe(task.name, now_ns, error, outermost=NATIVE is not None)

    def undescribed(self, task: Task) -> FailureReport:
        """Return the report of an exception that raised another when it was described."""
        return FailureReport(
            task.name, 0, 'an exception that raised another when it was looked at', ())

    def check_depth(self, task: Task, limit: int) -> None:
        """Have a job aborted that is about to reach its recursion limit."""
        try:
            sys.setrecursionlimit(limit - _RECURSION_EDGE)
        except RecursionError:
            if not task.aborts_raised:  # later its time counts
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
            if waits:  # its job will read all: do not listen before it has
                sources.defer(source)
                task.follow_up = True
        for source in sources.early():
            self._listen_at(source)

    def rearm_sources(self, task: Task) -> None:
        """Listen again to the sources that were ignored while a job of their task waited."""
        for source in self._sources.waiting_for(task):
            self._listen_at(source)

    def _listen_at(self, source: Source) -> None:
        self.schedule(source.open_ns, functools.partial(self._listen, source),
                      source.task.priority)

    def _listen(self, source: Source, now_ns: int) -> None:
        if self._sources.reopen(source):
            self.interrupted = self.pending = True
