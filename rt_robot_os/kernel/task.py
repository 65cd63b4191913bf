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


"""A task: what its author declares, what the kernel remembers of it, what it tells of itself."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from typing import TYPE_CHECKING

from rt_robot_os.errors import TaskError
from rt_robot_os.kernel.clock import NEVER_NS
from rt_robot_os.kernel.histogram import Histogram
from rt_robot_os.kernel.policy import BudgetPolicy
from rt_robot_os.kernel.policy import FailurePolicy
from rt_robot_os.kernel.policy import OverrunPolicy
from rt_robot_os.kernel.policy import problems
from rt_robot_os.kernel.policy import TaskState
from rt_robot_os.kernel.statistics import DeadlineMiss
from rt_robot_os.kernel.statistics import TaskStatistics
from rt_robot_os.units import NS_PER_MS
from rt_robot_os.units import NS_PER_S
from rt_robot_os.units import period_from_rate

if TYPE_CHECKING:
    from rt_robot_os.kernel.coroutine import AsyncBody
    from rt_robot_os.kernel.logical import Logical

RATE_MINIMUM_HZ = 1e-6
RATE_MAXIMUM_HZ = 100_000.0

HELD = (1 << 16) - 1
FOLLOW = 1 << 16


@dataclass(frozen=True)
class TaskSpec:
    """
    The declaration of a task; :func:`rt_robot_os.kernel.policy.problems` says what is refused.

    :ivar name: unique in its kernel.
    :ivar priority: 1..99, higher runs first.
    :ivar period_ns: releases lie on the grid ``start + phase_ns + n * period_ns``; 0 means that
        only events release it (a publication, an interrupt, a timer, another task).
    :ivar phase_ns: from 0; where on the grid it begins.
    :ivar deadline_ns: from a release to the end of its job; 0 means the period.
    :ivar budget_ns: computing time of a job, what preempts it taken off; 0 means no limit.
    :ivar on_budget: what happens to a job that exceeds it.
    :ivar overrun: what happens to a release that finds the last job unfinished.
    :ivar catch_up: releases that wait at most, with that overrun policy.
    :ivar overrun_limit: a leaky bucket: each overrun puts one in, ``overrun_leak`` jobs without
        any take one out; above the limit the failure policy is applied. 0 means never.
    :ivar failure: what happens after an exception, an abort, or too many overruns.
    :ivar restart_ns: pause before the first restart; doubled each time, up to
        ``restart_maximum_ns``, until as long as that passes without a failure.
    :ivar critical: the watchdog watches it.
    :ivar logical: logical execution time: inputs as of the release, outputs at the deadline.
    """

    name: str
    priority: int
    period_ns: int = 0
    phase_ns: int = 0
    deadline_ns: int = 0
    budget_ns: int = 0
    on_budget: BudgetPolicy = BudgetPolicy.WARN
    overrun: OverrunPolicy = OverrunPolicy.SKIP
    catch_up: int = 1
    overrun_limit: int = 0
    overrun_leak: int = 100
    failure: FailurePolicy = FailurePolicy.CONTINUE
    restart_ns: int = 100 * NS_PER_MS
    restart_maximum_ns: int = 10 * NS_PER_S
    critical: bool = False
    logical: bool = False

    def __post_init__(self) -> None:
        found = problems(self)
        if found:
            raise TaskError('\n'.join(f'task {self.name!r}: {problem}' for problem in found))


def checked_period_ns(name: str, rate_hz: float) -> int:
    """
    Turn a task's rate into its period.

    :raises TaskError: the rate is not a number from 1e-6 Hz (11 days) to 100 kHz.
    """
    if isinstance(rate_hz, bool) or not isinstance(rate_hz, int | float) or not (
            RATE_MINIMUM_HZ <= rate_hz <= RATE_MAXIMUM_HZ):
        raise TaskError(f'task {name!r}: rate_hz {rate_hz!r} must be above 0 ({RATE_MINIMUM_HZ:g} '
                        f'or more) and at most {RATE_MAXIMUM_HZ:g} Hz')
    return period_from_rate(rate_hz)


class Task:
    """
    A task in its kernel; made by :meth:`rt_robot_os.kernel.Kernel.add_task`.

    The public attributes are for reading.

    :ivar pending: it waits for its turn, or is held (``state``).
    :ivar timer: for its next release, while a job of it waits or runs, or it is held; else None.
    :ivar busy: a job of it is on the stack.
    :ivar follow: not 0: something is to be looked at when the job that runs now has ended. The
        bits of ``HELD`` count the resources that it is inside of.
    :ivar aborts: a job that exceeds the budget is struck.
    :ivar limit_ns: computing time at which the job that runs is struck; 0 means never.
    :ivar strikes: times that it was; one more waits to be delivered while ``struck``.
    :ivar over: its function has ended by an exception, which is being described and dropped.
    :ivar miss: job, release_ns and late_ns of ``last_miss``.
    :ivar suspects: its ``ran_instead``; looked for every 10 ms at most.
    :ivar skips: an overrun is counted, and nothing else.
    :ivar execution_limit_ns: longer jobs are looked at: the longest so far, or the budget.
    :ivar response_limit_ns: the same for the time from release to end, with the deadline.
    :ivar logical: what publishes its outputs at the deadline, if that was declared.
    :ivar coroutine: what it is made of when it is written as one.
    """

    __slots__ = (
        'spec', 'name', 'priority', 'function', 'body', 'index', 'period_ns',
        'interval_ns', 'deadline_ns', 'budget_ns', 'limit_ns', 'aborts', 'pending', 'timer',
        'busy', 'follow', 'strikes', 'struck', 'over', 'backlog', 'rephasing', 'state', 'wanted',
        'bucket', 'bucket_runs', 'restart_ns', 'resume_ns', 'on_restart', 'on_safe_state',
        'successors', 'logical', 'coroutine', 'release_ns', 'start_ns', 'releases',
        'runs', 'missed', 'coalesced', 'failures', 'overruns', 'aborted',
        'budget_exceeded', 'deadline_missed', 'miss', 'suspects', 'skips', 'latency',
        'execution', 'jitter', 'gap_maximum_ns', 'blocked_maximum_ns',
        'response_maximum_ns', 'response_limit_ns', 'execution_limit_ns',
        'latency_counts', 'execution_counts', 'jitter_counts', 'execution_total_ns',
        '_rearm', '_account')

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
        self.coroutine: AsyncBody | None = None
        self.latency = Histogram()
        self.execution = Histogram()
        self.jitter = Histogram()
        # The dispatcher's short ways to them.
        self.latency_counts = self.latency.counts
        self.execution_counts = self.execution.counts
        self.jitter_counts = self.jitter.counts
        self.backlog: deque[int] = deque()  # times of releases that catch_up keeps
        self._rearm = rearm
        self._account = account
        self.rest()
        self.reset_statistics()

    def rest(self) -> None:
        """Forget a job that was waiting, and any trouble; the kernel calls it before it starts."""
        self.function: Callable[[], object] = self.body
        self.pending = False
        self.timer: tuple[int, int, Any, int] | None = None
        self.busy = False
        self.follow = FOLLOW if self.successors else 0
        self.aborts = self.spec.on_budget is BudgetPolicy.ABORT
        self.limit_ns = 0
        self.strikes = 0
        self.struck = False
        self.over = False
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

    def set_rate_hz(self, rate_hz: float) -> None:
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
            self._check_period(period_ns)
        if not self.spec.deadline_ns:
            self.deadline_ns = period_ns
            self.response_limit_ns = min(self.response_maximum_ns, period_ns)
        self.period_ns = period_ns

    def _check_period(self, period_ns: int) -> None:
        values: dict[str, Any] = {**vars(self.spec), 'period_ns': period_ns}
        TaskSpec(**values)

    @property
    def rate_hz(self) -> float:
        """Give the rate in force; 0 when only events release the task."""
        return NS_PER_S / self.period_ns if self.period_ns else 0.0

    @property
    def last_miss(self) -> DeadlineMiss | None:
        """Give the latest job that ended after its deadline; not for the real-time loop."""
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
        for histogram in (self.latency, self.execution, self.jitter):
            histogram.clear()

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
