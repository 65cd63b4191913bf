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


"""A task: its declaration, its state in the kernel, and its statistics."""

from __future__ import annotations

from abc import ABC
from abc import abstractmethod
from collections import deque
from collections.abc import Callable
from collections.abc import Sequence
from dataclasses import replace
from typing import SupportsFloat

from rt_robot_os.base.errors import TaskError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.kernel.clock import NEVER_NS
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
from rt_robot_os.kernel.task_core import EXECUTION
from rt_robot_os.kernel.task_core import JITTER
from rt_robot_os.kernel.task_core import LATENCY
from rt_robot_os.kernel.task_core import TaskCore


class Coroutine(ABC):
    """
    The coroutine of a task: the base of :class:`rt_robot_os.kernel.coroutine.AsyncBody`.

    :ivar finished: it returned; the task makes no more jobs.
    :ivar on_resume: None, or called each time that an awaited event is ready.
    :ivar replay_gate: None, or set by a replay, which alone releases the task then; timers and
        samples do not. It is called with the check of the awaited event and returns whether the
        task continues. It calls the check at the times at which the recorded task did.
    """

    __slots__ = ('finished', 'on_resume', 'replay_gate')

    def __init__(self) -> None:
        self.finished = False
        self.on_resume: Callable[[], object] | None = None
        self.replay_gate: Callable[[Callable[[], bool]], bool] | None = None

    @abstractmethod
    def close(self) -> None:
        """Drop the coroutine; its ``finally`` clauses run."""


class Task(TaskCore):
    """
    A task in its kernel; made by :meth:`rt_robot_os.kernel.Kernel.add_task`.

    The public attributes are read-only. Declared, in addition to those of the base class:

    :ivar spec: the declaration.
    :ivar body: its function; ``function`` may be another one for the next job.
    :ivar successors: tasks that the end of each job releases.
    :ivar logical: its logical execution time, if that was declared.
    :ivar coroutine: its coroutine, if it is one.

    Failures and policies:

    :ivar state: whether its releases make jobs.
    :ivar backlog: times of releases that the overrun policy catch_up stores.
    :ivar rephasing: its grid restarts when the running job has ended.
    :ivar requested_policy: the policy to apply at the end of the job.
    :ivar aborts_raised: number of times that TaskAborted was raised in the running job.
    :ivar bucket: of overruns, see ``overrun_limit``; ``bucket_runs`` is ``runs`` at the last one.
    :ivar restart_ns: the next pause before a restart.
    :ivar resume_ns: end of the current or last pause.
    :ivar miss: job, release_ns and late_ns of ``last_miss``.
    :ivar suspects: its ``ran_instead``; determined at most every 10 ms.
    """

    __slots__ = (
        'spec', 'body', 'on_restart', 'on_safe_state', 'successors', 'logical', 'coroutine',
        'deadline_ns',
        # Failures and policies
        '_state', 'backlog', 'rephasing', 'requested_policy', 'aborts_raised', 'bucket',
        'bucket_runs', 'restart_ns', 'resume_ns', 'miss', 'suspects',
        # Counters
        'failures', 'aborted', 'budget_exceeded', 'deadline_missed', 'response_maximum_ns',
        # Its kernel
        '_rearm', '_account')

    def __init__(self, spec: TaskSpec, function: Callable[[], object], index: int, *,
                 on_restart: Callable[[], object] | None = None,
                 on_safe_state: Callable[[], object] | None = None,
                 rearm: Callable[[Task], None] | None = None,
                 account: Callable[[Task], None] | None = None) -> None:
        super().__init__()
        self.spec = spec
        self.name = spec.name
        self.priority = spec.priority
        self.body = function
        self.index = index
        self.period_ns = spec.period_ns
        self.deadline_ns = spec.deadline_ns or spec.period_ns or NEVER_NS
        self.budget_ns = spec.budget_ns or NEVER_NS
        self.aborts = spec.on_budget is BudgetPolicy.ABORT
        self.skips = spec.overrun is OverrunPolicy.SKIP and not spec.overrun_limit
        self.on_restart = on_restart
        self.on_safe_state = on_safe_state
        self.successors: Sequence[Task] = ()
        self.logical: Logical | None = None
        self.coroutine: Coroutine | None = None
        self.backlog: deque[int] = deque()
        self._rearm = rearm
        self._account = account
        self.reset()
        self.reset_statistics()

    @property
    def state(self) -> TaskState:
        """Return whether its releases make jobs."""
        return self._state

    @state.setter
    def state(self, state: TaskState) -> None:
        self._state = state
        self.held = state is not TaskState.ACTIVE

    def reset(self) -> None:
        """Reset the state of jobs and failures; the kernel calls it before it starts."""
        self.function = self.body
        self.pending = self.busy = False
        self.next_ns = self.next_period_ns = 0
        self.inside = 0
        self.follow_up = bool(self.successors)
        self.limit_ns = self.computed_ns = self.waited_ns = 0
        self.aborts_raised = 0
        self.abort_pending = self.containing = self.grace_used = False
        self.backlog.clear()
        self.rephasing = False
        self.state = TaskState.ACTIVE
        self.requested_policy: FailurePolicy | None = None
        self.bucket = self.bucket_runs = 0
        self.restart_ns = self.spec.restart_ns
        self.resume_ns = 0
        self.release_ns = 0
        self.start_ns = -1
        self.interval_ns = self.period_ns

    def rearm(self) -> None:
        """
        Re-arm a held task: it makes jobs again, beginning with its ``on_restart``.

        Does nothing for an active task. Safe in the real-time loop.
        """
        if self._rearm is not None:
            self._rearm(self)

    def account(self) -> None:
        """
        Update the counters.

        Releases that pass while a job waits or runs are counted at its end, or here.
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
            replace(self.spec, period_ns=period_ns)  # checks the new value
        if not self.spec.deadline_ns:
            self.deadline_ns = period_ns
            self.response_limit_ns = min(self.response_maximum_ns, period_ns)
        self.period_ns = period_ns

    @property
    def rate_hz(self) -> float:
        """Return the current rate; 0 when only events release the task."""
        return NS_PER_S / self.period_ns if self.period_ns else 0.0

    @property
    def latency(self) -> Histogram:
        """Return a copy of the histogram from release to start; not for the real-time loop."""
        return Histogram(self.counts(LATENCY), self.latency_maximum_ns)

    @property
    def execution(self) -> Histogram:
        """Return a copy of the histogram of computing times; not for the real-time loop."""
        return Histogram(self.counts(EXECUTION), self.execution_maximum_ns)

    @property
    def jitter(self) -> Histogram:
        """Return a copy of the histogram of the jitter; not for the real-time loop."""
        return Histogram(self.counts(JITTER), self.jitter_maximum_ns)

    @property
    def last_miss(self) -> DeadlineMiss | None:
        """Return the last job that ended after its deadline; not for the real-time loop."""
        return None if self.miss is None else DeadlineMiss(*self.miss, self.suspects)

    def reset_statistics(self) -> None:
        """Reset the counters; a job that currently waits or runs counts as released."""
        self.account()
        self.clear_counts()
        waits = self.pending and not self.held
        self.releases = waits + self.busy + len(self.backlog) + self.rephasing
        self.failures = self.aborted = self.budget_exceeded = self.deadline_missed = 0
        self.bucket_runs = 0
        self.miss: tuple[int, int, int] | None = None
        self.suspects: tuple[str, ...] = ()
        self.response_maximum_ns = 0

    def statistics(self) -> TaskStatistics:
        """Return the statistics; takes about 100 us, so not for the real-time loop."""
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
