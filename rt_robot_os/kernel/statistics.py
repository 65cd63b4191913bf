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


"""Statistics of tasks and of the kernel."""

from __future__ import annotations

from dataclasses import dataclass

from rt_robot_os.kernel.histogram import Summary
from rt_robot_os.kernel.spec import TaskState


@dataclass(frozen=True)
class DeadlineMiss:
    """
    A job that ended after its deadline.

    :ivar job: its number, from 1.
    :ivar late_ns: how long after the deadline it ended.
    :ivar ran_instead: tasks that used the most CPU time between its release and its end.
    """

    job: int
    release_ns: int
    late_ns: int
    ran_instead: tuple[str, ...]


@dataclass(frozen=True)
class TaskStatistics:
    """
    The counters of a task since it was added or since they were reset.

    releases = runs + missed + coalesced, plus the jobs that currently wait or run.

    :ivar releases: number of releases.
    :ivar runs: jobs that have ended, failed and aborted ones included.
    :ivar missed: releases without a job: the previous job was unfinished, the task was held (see
        ``state``), or the kernel stopped before.
    :ivar coalesced: events that came while one was waiting already; one job serves them all.
    :ivar failures: jobs that ended with an exception, without aborted ones.
    :ivar latency: from release to start.
    :ivar execution: computing time without preemption.
    :ivar jitter: difference between the interval of two starts and the period.
    :ivar gap_maximum_ns: longest time from one start to the next.
    :ivar blocked_maximum_ns: longest time that its code (a native call) delayed an interrupt.
    :ivar state: whether its releases make jobs.
    :ivar overruns: releases that found the previous job unfinished, under any policy.
    :ivar aborted: jobs that TaskAborted ended.
    :ivar budget_exceeded: jobs that computed for longer than the budget.
    :ivar deadline_missed: jobs that ended after their deadline.
    :ivar last_miss: the last of these.
    :ivar response_maximum_ns: longest time from release to end.
    """

    name: str
    priority: int
    period_ns: int
    releases: int
    runs: int
    missed: int
    coalesced: int
    failures: int
    latency: Summary
    execution: Summary
    jitter: Summary
    gap_maximum_ns: int
    blocked_maximum_ns: int
    execution_total_ns: int
    state: TaskState = TaskState.ACTIVE
    overruns: int = 0
    aborted: int = 0
    budget_exceeded: int = 0
    deadline_missed: int = 0
    last_miss: DeadlineMiss | None = None
    response_maximum_ns: int = 0


@dataclass(frozen=True)
class ResourceStatistics:
    """
    The counters of a resource.

    :ivar ceiling: the highest priority among its users; 0 without users.
    :ivar users: the tasks that declared it.
    :ivar entries: number of times that it was entered.
    :ivar held_maximum_ns: longest time from entering to leaving, preemption included.
    """

    name: str
    ceiling: int
    users: tuple[str, ...]
    entries: int
    held_maximum_ns: int


@dataclass(frozen=True)
class SourceStatistics:
    """
    The counters of a source of interrupts.

    :ivar arrivals: number of times that it was found readable.
    :ivar deferred: those that came too early and had to wait.
    """

    name: str
    task: str
    arrivals: int
    deferred: int


@dataclass(frozen=True)
class KernelStatistics:
    """
    The counters of the kernel and of everything in it.

    :ivar elapsed_ns: time since the last start of the kernel.
    :ivar wakeups: number of wake-ups from idling.
    :ivar stolen: steal time: Linux took the CPU while the kernel was ready to run. It is detected
        where an interrupt or a job was late by 0.2 ms or more.
    :ivar failures_dropped: failure reports that were dropped for newer ones.
    :ivar overhead_ns: computing time of the kernel itself since it was made: releasing,
        dispatching, setting timers. The delivery of signals by Linux and Python is not included.
    :ivar polled_ns: how long it polled the clock, since it was made, because an interrupt would
        have cost more.
    :ivar interrupt_ns: cost of a timer interrupt, as measured at the start; 0 where it costs
        nothing.
    """

    elapsed_ns: int
    wakeups: int
    failures_total: int
    failures_dropped: int
    tasks: tuple[TaskStatistics, ...]
    resources: tuple[ResourceStatistics, ...] = ()
    sources: tuple[SourceStatistics, ...] = ()
    overhead_ns: int = 0
    stolen: Summary = Summary()
    stolen_total_ns: int = 0
    polled_ns: int = 0
    interrupt_ns: int = 0
