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


"""What tasks and the kernel tell of themselves."""

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
    :ivar ran_instead: tasks that took most of the time between its release and its end.
    """

    job: int
    release_ns: int
    late_ns: int
    ran_instead: tuple[str, ...]


@dataclass(frozen=True)
class TaskStatistics:
    """
    What a task did since it was added or since the statistics were reset.

    releases = runs + missed + coalesced, plus the jobs that wait or run at this moment.

    :ivar releases: times that it became due.
    :ivar runs: jobs that ran to their end, failed and aborted ones included.
    :ivar missed: releases that no job served: the job before was unfinished, the task was held
        (see ``state``), or the kernel was stopped before.
    :ivar coalesced: events that came while one was waiting already; the job serves them all.
    :ivar failures: jobs that ended with an exception, aborted ones not counted.
    :ivar latency: from release to start.
    :ivar execution: computing time, with what preempted it taken off.
    :ivar jitter: how far the interval between two starts was from the period.
    :ivar gap_maximum_ns: longest time from one start to the next.
    :ivar blocked_maximum_ns: longest time that its code (a native call) held up an interrupt.
    :ivar state: whether its releases make jobs.
    :ivar overruns: releases that found the job before unfinished, whatever became of them.
    :ivar aborted: jobs that TaskAborted ended.
    :ivar budget_exceeded: jobs that computed for longer than the budget.
    :ivar deadline_missed: jobs that ended after their deadline.
    :ivar last_miss: the latest of them.
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
    A resource.

    :ivar ceiling: the highest priority among its users; 0 without users.
    :ivar users: the tasks that declared it.
    :ivar entries: times that it was entered.
    :ivar held_maximum_ns: longest time from entering to leaving, what preempted it included.
    """

    name: str
    ceiling: int
    users: tuple[str, ...]
    entries: int
    held_maximum_ns: int


@dataclass(frozen=True)
class SourceStatistics:
    """
    A source of interrupts.

    :ivar arrivals: times that it was seen to be readable.
    :ivar deferred: those of them that came too soon and waited.
    """

    name: str
    task: str
    arrivals: int
    deferred: int


@dataclass(frozen=True)
class KernelStatistics:
    """
    The kernel as a whole.

    :ivar elapsed_ns: since the kernel was started last.
    :ivar wakeups: times that it woke from idling.
    :ivar stolen: times that Linux took the CPU while there was something to compute, as far as
        that was noticed: where an interrupt or a job was late by 0.2 ms or more.
    :ivar failures_dropped: failure reports that gave way to newer ones.
    :ivar overhead_ns: what the kernel itself computed for since it was made: releasing,
        dispatching, setting timers. What Linux and Python need to deliver a signal is not in it.
    :ivar polled_ns: how long it polled the clock, since it was made, where an interrupt would have
        cost more.
    :ivar interrupt_ns: what a timer interrupt costs here, as measured at the start; 0 where it
        costs nothing.
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
