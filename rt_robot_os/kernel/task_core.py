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
The part of a task that each of its jobs uses, and the counting of a job.

This is the specification; where the C core is built, its type of the same name is used.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from typing import Final
from typing import Protocol
from typing import TYPE_CHECKING

from rt_robot_os.base.compiled import NATIVE
from rt_robot_os.kernel.histogram import BUCKETS

LATENCY: Final = 0
EXECUTION: Final = 1
JITTER: Final = 2
_KINDS: Final = 3


class LimitHandler(Protocol):
    """Called when a time is longer than any so far; see FaultHandling."""

    def long_execution(self, task: Any, execution_ns: int) -> int:
        """Return the computing time without steal time."""

    def long_response(self, task: Any, release_ns: int, end_ns: int) -> None:
        """Record the longest response time so far, or one above the deadline."""


class TaskCore:
    """
    The part of a task that its kernel reads and writes with each job.

    Declared:

    :ivar name: unique in its kernel.
    :ivar index: its number in its kernel; among equal priorities that are due at the same time the
        lower one runs first.
    :ivar priority: the higher runs first.
    :ivar period_ns: 0 when only events release it.
    :ivar budget_ns: computing time that a job may use.
    :ivar function: called by the next job.
    :ivar aborts: a job that exceeds the budget is aborted.
    :ivar skips: an overrun is only counted.

    Its releases and its job:

    :ivar pending: a job of it waits, or it is held.
    :ivar held: its releases make no jobs.
    :ivar next_ns: its next release, while it has no timer at its level because a job of it waits
        or runs, or it is held; else 0.
    :ivar next_period_ns: the period before that release.
    :ivar release_ns: release time of the last job.
    :ivar interval_ns: the period before that release.
    :ivar busy: a job of it is on the stack.
    :ivar start_ns: start of its last job; -1 before the first.
    :ivar inside: number of resources that this job is inside of.
    :ivar follow_up: FaultHandling is called at the end of this job.

    Its budget:

    :ivar limit_ns: computing time at which the running job is aborted; 0 means never.
    :ivar computed_ns: CPU time of the thread at the start of the job, plus that of preempting jobs
        since; valid while there is a limit.
    :ivar waited_ns: with ``on_budget: abort``: how long the job did not compute, steal time
        excluded, as far as that is known: it waited in a system call.
    :ivar abort_pending: TaskAborted is to be raised in it.
    :ivar grace_used: TaskAborted was raised and the time for ``finally`` clauses granted; from now
        on it is raised repeatedly.
    :ivar containing: its function raised an exception, which is being described and released.

    Counters, see :class:`~rt_robot_os.kernel.TaskStatistics`; and two limits:

    :ivar execution_limit_ns: a longer job is checked: the longest so far, or the budget.
    :ivar response_limit_ns: the same for the time from release to end, with the deadline.
    """

    __slots__ = (
        'name', 'index', 'priority', 'period_ns', 'budget_ns', 'function', 'aborts', 'skips',
        # Its releases and its job
        'pending', 'held', 'next_ns', 'next_period_ns', 'release_ns', 'interval_ns', 'busy',
        'start_ns', 'inside', 'follow_up',
        # Its budget
        'limit_ns', 'computed_ns', 'waited_ns', 'abort_pending', 'grace_used', 'containing',
        # Counters
        'releases', 'runs', 'missed', 'coalesced', 'overruns', 'execution_total_ns',
        'execution_limit_ns', 'execution_maximum_ns', 'latency_maximum_ns', 'response_limit_ns',
        'gap_maximum_ns', 'jitter_maximum_ns', 'blocked_maximum_ns', '_counts')

    def __init__(self) -> None:
        self.name = ''
        self.index = self.priority = self.period_ns = self.budget_ns = 0
        self.function: Callable[[], object] = _nothing
        self.aborts = self.skips = False
        self.pending = self.held = self.busy = self.follow_up = False
        self.next_ns = self.next_period_ns = self.release_ns = self.interval_ns = 0
        self.start_ns = -1
        self.inside = self.limit_ns = self.computed_ns = self.waited_ns = 0
        self.abort_pending = self.grace_used = self.containing = False
        self.clear_counts()

    def clear_counts(self) -> None:
        """Reset the counters."""
        self.releases = self.runs = self.missed = self.coalesced = self.overruns = 0
        self.execution_total_ns = self.execution_limit_ns = self.execution_maximum_ns = 0
        self.latency_maximum_ns = self.response_limit_ns = 0
        self.gap_maximum_ns = self.jitter_maximum_ns = self.blocked_maximum_ns = 0
        self._counts = [[0] * BUCKETS for _ in range(_KINDS)]

    def counts(self, kind: int) -> list[int]:
        """
        Copy a histogram of this task: the number of durations in each bucket.

        :param kind: LATENCY, EXECUTION or JITTER.
        """
        return self._counts[kind].copy()

    def count(self, release_ns: int, previous_ns: int, end_ns: int, stolen_ns: int,
              handler: LimitHandler) -> None:
        """
        Count a job that has ended: its computing time, latency, response time and jitter.

        :param release_ns: of this job; the attribute may be that of the next job already.
        :param previous_ns: start of the previous job; -1 without one.
        :param stolen_ns: the time within the job that was not its own.
        """
        start_ns = self.start_ns
        self.runs += 1
        latency_ns = start_ns - release_ns
        execution_ns = end_ns - start_ns - stolen_ns
        self.execution_total_ns += execution_ns
        if execution_ns > self.execution_limit_ns:
            execution_ns = handler.long_execution(self, execution_ns)
        if latency_ns > self.latency_maximum_ns:
            self.latency_maximum_ns = latency_ns
        if end_ns - release_ns > self.response_limit_ns:
            handler.long_response(self, release_ns, end_ns)
        # histogram.bucket() inlined: three calls would add half of the cost of this method.
        latencies, executions, jitters = self._counts
        shift = latency_ns.bit_length() - 4
        latencies[latency_ns if shift <= 0 else (shift << 3) + (latency_ns >> shift)] += 1
        shift = execution_ns.bit_length() - 4
        executions[execution_ns if shift <= 0 else (shift << 3) + (execution_ns >> shift)] += 1
        if previous_ns < 0:
            return
        gap_ns = start_ns - previous_ns
        if gap_ns > self.gap_maximum_ns:
            self.gap_maximum_ns = gap_ns
        if self.period_ns:
            jitter_ns = abs(gap_ns - self.interval_ns)
            if jitter_ns > self.jitter_maximum_ns:
                self.jitter_maximum_ns = jitter_ns
            shift = jitter_ns.bit_length() - 4
            jitters[jitter_ns if shift <= 0 else (shift << 3) + (jitter_ns >> shift)] += 1


def _nothing() -> None:
    """Do nothing: the function of a task before it has one."""


if not TYPE_CHECKING and NATIVE is not None:
    TaskCore = NATIVE.TaskCore  # noqa: F811
