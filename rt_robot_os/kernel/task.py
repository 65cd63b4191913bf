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


"""A task: what its author declared, what the kernel remembers of it, what it tells of itself."""

from __future__ import annotations

from abc import ABC
from abc import abstractmethod
from collections import deque
from collections.abc import Callable
from collections.abc import Sequence
from dataclasses import replace
from typing import Final
from typing import SupportsFloat

from rt_robot_os.errors import TaskError
from rt_robot_os.kernel.clock import NEVER_NS
from rt_robot_os.kernel.histogram import BUCKETS
from rt_robot_os.kernel.histogram import Histogram
from rt_robot_os.kernel.logical import Logical
from rt_robot_os.kernel.spec import BudgetPolicy
from rt_robot_os.kernel.spec import checked_period_ns
from rt_robot_os.kernel.spec import FailurePolicy
from rt_robot_os.kernel.spec import OverrunPolicy
from rt_robot_os.kernel.spec import TaskSpec
from rt_robot_os.kernel.spec import TaskState
from rt_robot_os.kernel.statistics import DeadlineMiss
from rt_robot_os.kernel.statistics import TaskStatistics
from rt_robot_os.kernel.timers import Timer
from rt_robot_os.units import NS_PER_S

# The histograms of a task, in one list: bucket b of kind k is number b * KINDS + k.
LATENCY: Final = 0
EXECUTION: Final = 1
JITTER: Final = 2
KINDS: Final = 3
_COUNTS: Final = KINDS * BUCKETS
# The first count that is carried: Python keeps the integers up to 256.
CARRY: Final = 256


class Coroutine(ABC):
    """
    What a task is made of that is written as one: :class:`rt_robot_os.kernel.coroutine.AsyncBody`.

    :ivar finished: it returned; the task makes no more jobs.
    :ivar on_going_on: called each time that what it awaited is over; None when nobody asks.
    :ivar by_schedule: None, or what a replay sets, which alone releases the task then: no timer
        and no sample does. It is asked whether the task goes on, and calls what it is given when
        the moment is there at which the real one looked.
    """

    __slots__ = ('finished', 'on_going_on', 'by_schedule')

    def __init__(self) -> None:
        self.finished = False
        self.on_going_on: Callable[[], object] | None = None
        self.by_schedule: Callable[[Callable[[], bool]], bool] | None = None

    @abstractmethod
    def close(self) -> None:
        """Drop the coroutine; its ``finally`` clauses run."""


class Task:
    """
    A task in its kernel; made by :meth:`rt_robot_os.kernel.Kernel.add_task`.

    The public attributes are for reading. What was declared:

    :ivar logical: what publishes its outputs at the deadline, if that was declared.
    :ivar coroutine: what it is made of when it is written as one.
    :ivar aborts: a job that exceeds the budget is struck.
    :ivar skips: an overrun is counted, and nothing else.

    Its releases and its job:

    :ivar pending: it waits for its turn, or is held (``state``).
    :ivar timer: for its next release, once that is no longer among the kernel's timers, because a
        job of it waits, runs or is late, or it is held; else None.
    :ivar busy: a job of it is on the stack.
    :ivar inside: number of resources that this job is inside of.
    :ivar follow_up: something is to be looked at when this job has ended.

    What became of its budget:

    :ivar limit_ns: computing time at which the job that runs is struck; 0 means never.
    :ivar computed_ns: computing time of the thread when the job began, and of what preempted it
        since; counts while there is a limit.
    :ivar waited_ns: time of the job with a budget to abort in which it did not compute, although
        Linux took nothing, as far as that is known: waiting in a system call.
    :ivar strikes: times that it was; one more waits to be delivered while ``struck``.
    :ivar resists: it had its time for ``finally`` clauses: TaskAborted is raised until it ends.
    :ivar over: its function has ended by an exception, which is being described and dropped.

    What went wrong:

    :ivar miss: job, release_ns and late_ns of ``last_miss``.
    :ivar suspects: its ``ran_instead``; looked for every 10 ms at most.
    :ivar execution_limit_ns: longer jobs are looked at: the longest so far, or the budget.
    :ivar response_limit_ns: the same for the time from release to end, with the deadline.

    How long its jobs took:

    :ivar counts: of the histograms ``latency``, ``execution`` and ``jitter``, bucket by bucket
        side by side. All of them are below ``CARRY``, so that Python has them ready made and
        counting touches nothing but this list; what is more has been carried elsewhere.
    """

    __slots__ = (
        # What each job touches, side by side: in the compiled build these are few cache lines.
        'pending', 'busy', 'aborts', 'follow_up', 'struck', 'over', 'timer', 'function', 'counts',
        'priority', 'period_ns', 'inside', 'start_ns', 'release_ns', 'interval_ns', 'releases',
        'runs', 'execution_total_ns', 'execution_limit_ns', 'latency_maximum_ns',
        'response_limit_ns', 'gap_maximum_ns', 'jitter_maximum_ns',
        # What was declared
        'spec', 'name', 'index', 'body', 'on_restart', 'on_safe_state', 'successors',
        'logical', 'coroutine', 'deadline_ns', 'budget_ns', 'skips',
        # Its releases and its job
        'backlog', 'rephasing',
        # Its budget
        'limit_ns', 'computed_ns', 'waited_ns', 'strikes', 'resists',
        # Trouble, and what is done about it
        'state', 'wanted', 'bucket', 'bucket_runs', 'restart_ns', 'resume_ns',
        # Counters
        'missed', 'coalesced', 'failures', 'overruns', 'aborted', 'budget_exceeded',
        'deadline_missed', 'miss', 'suspects', 'execution_maximum_ns', 'blocked_maximum_ns',
        'response_maximum_ns', '_carried', '_carries',
        # Its kernel
        '_rearm', '_account')

    # In the order in which the compiled build lays them out.
    pending: bool
    busy: bool
    aborts: bool
    follow_up: bool
    struck: bool
    over: bool
    timer: Timer | None
    function: Callable[[], object]
    counts: list[int]
    priority: int
    period_ns: int
    inside: int
    start_ns: int
    release_ns: int
    interval_ns: int
    releases: int
    runs: int
    execution_total_ns: int
    execution_limit_ns: int
    latency_maximum_ns: int
    response_limit_ns: int
    gap_maximum_ns: int
    jitter_maximum_ns: int

    def __init__(self, spec: TaskSpec, function: Callable[[], object], index: int, *,
                 on_restart: Callable[[], object] | None = None,
                 on_safe_state: Callable[[], object] | None = None,
                 rearm: Callable[[Task], None] | None = None,
                 account: Callable[[Task], None] | None = None) -> None:
        self.spec = spec
        self.name = spec.name
        self.priority = spec.priority
        self.body = function
        self.index = index
        self.period_ns = spec.period_ns
        self.deadline_ns = spec.deadline_ns or spec.period_ns or NEVER_NS
        self.budget_ns = spec.budget_ns or NEVER_NS
        self.skips = spec.overrun is OverrunPolicy.SKIP and not spec.overrun_limit
        self.on_restart = on_restart
        self.on_safe_state = on_safe_state
        self.successors: Sequence[Task] = ()
        self.logical: Logical | None = None
        self.coroutine: Coroutine | None = None
        self.counts = [0] * _COUNTS
        self._carried: dict[int, int] = {}
        self._carries = 0
        self.backlog: deque[int] = deque()  # times of releases that catch_up keeps
        self._rearm = rearm
        self._account = account
        self.rest()
        self.reset_statistics()

    def rest(self) -> None:
        """Forget a job that was waiting, and any trouble; the kernel calls it before it starts."""
        self.function = self.body
        self.pending = False
        self.timer = None
        self.busy = False
        self.inside = 0
        self.follow_up = bool(self.successors)
        self.aborts = self.spec.on_budget is BudgetPolicy.ABORT
        self.limit_ns = 0
        self.computed_ns = 0
        self.waited_ns = 0
        self.strikes = 0
        self.struck = False
        self.over = False
        self.resists = False
        self.backlog.clear()
        self.rephasing = False
        self.state = TaskState.ACTIVE
        self.wanted: FailurePolicy | None = None
        self.bucket = 0
        self.bucket_runs = 0
        self.restart_ns = self.spec.restart_ns
        self.resume_ns = 0
        self.release_ns = 0
        self.start_ns = -1
        self.interval_ns = self.period_ns

    def rearm(self) -> None:
        """
        Let a task that is held make jobs again, beginning with its ``on_restart``.

        Nothing happens to an active one. Safe in the real-time loop.
        """
        if self._rearm is not None:
            self._rearm(self)

    def account(self) -> None:
        """
        Bring the counters up to date.

        The releases that pass while a job waits or runs are counted when it has ended, or here.
        """
        if self._account is not None:
            self._account(self)

    def set_rate_hz(self, rate_hz: SupportsFloat) -> None:
        """
        Change the rate from the next release on; safe in the real-time loop.

        :raises TaskError: the rate is out of range, contradicts the budget or the deadline, or
            the task is not periodic.
        """
        if not self.period_ns:
            raise TaskError(f'task {self.name!r} has no period: events release it; '
                            'give it a rate_hz when it is added')
        period_ns = checked_period_ns(self.name, rate_hz)
        if period_ns != self.period_ns and (self.spec.budget_ns or self.spec.deadline_ns):
            replace(self.spec, period_ns=period_ns)  # which checks it
        if not self.spec.deadline_ns:
            self.deadline_ns = period_ns
            self.response_limit_ns = min(self.response_maximum_ns, period_ns)
        self.period_ns = period_ns

    @property
    def rate_hz(self) -> float:
        """Return the rate in force; 0 when only events release the task."""
        return NS_PER_S / self.period_ns if self.period_ns else 0.0

    @property
    def latency(self) -> Histogram:
        """Return a copy of the histogram from release to start; not for the real-time loop."""
        return self._histogram(LATENCY, self.latency_maximum_ns)

    @property
    def execution(self) -> Histogram:
        """Return a copy of that of computing times; not for the real-time loop."""
        return self._histogram(EXECUTION, self.execution_maximum_ns)

    @property
    def jitter(self) -> Histogram:
        """Return a copy of that of the jitter; not for the real-time loop."""
        return self._histogram(JITTER, self.jitter_maximum_ns)

    def carry(self, place: int) -> None:
        """Put aside a count that has become ``CARRY``; called locked."""
        self.counts[place] -= CARRY
        self._carried[place] = self._carried.get(place, 0) + CARRY
        self._carries += 1

    def _histogram(self, kind: int, maximum_ns: int) -> Histogram:
        found = Histogram()
        found.maximum_ns = maximum_ns
        while True:
            carries = self._carries
            counts, carried = self.counts[kind::KINDS], self._carried.copy()
            if carries == self._carries:  # no job of it came in between and carried
                break
        for place, number in carried.items():
            if place % KINDS == kind:
                counts[place // KINDS] += number
        found.counts = counts
        return found

    @property
    def last_miss(self) -> DeadlineMiss | None:
        """Return the latest job that ended after its deadline; not for the real-time loop."""
        return None if self.miss is None else DeadlineMiss(*self.miss, self.suspects)

    def reset_statistics(self) -> None:
        """Begin to count anew; a job that waits or runs now counts as released."""
        self.account()
        waits = self.pending and self.state is TaskState.ACTIVE
        self.releases = int(waits) + int(self.busy) + len(self.backlog) + int(
            self.rephasing)
        self.runs = self.missed = self.coalesced = self.failures = 0
        self.overruns = self.aborted = self.budget_exceeded = self.deadline_missed = 0
        self.bucket_runs = 0
        self.miss: tuple[int, int, int] | None = None
        self.suspects: tuple[str, ...] = ()
        self.gap_maximum_ns = self.blocked_maximum_ns = self.execution_total_ns = 0
        self.response_maximum_ns = self.response_limit_ns = self.execution_limit_ns = 0
        self.latency_maximum_ns = self.execution_maximum_ns = self.jitter_maximum_ns = 0
        self.counts[:] = [0] * _COUNTS
        self._carried = {}
        self._carries += 1

    def statistics(self) -> TaskStatistics:
        """Take the statistics; costs about 100 us, so not for the real-time loop."""
        self.account()
        return TaskStatistics(
            name=self.name, priority=self.priority, period_ns=self.period_ns,
            releases=self.releases, runs=self.runs, missed=self.missed, coalesced=self.coalesced,
            failures=self.failures, latency=self.latency.summary(),
            execution=self.execution.summary(), jitter=self.jitter.summary(),
            gap_maximum_ns=self.gap_maximum_ns, blocked_maximum_ns=self.blocked_maximum_ns,
            execution_total_ns=self.execution_total_ns, state=self.state, overruns=self.overruns,
            aborted=self.aborted, budget_exceeded=self.budget_exceeded,
            deadline_missed=self.deadline_missed, last_miss=self.last_miss,
            response_maximum_ns=self.response_maximum_ns)
