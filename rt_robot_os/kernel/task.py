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

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from rt_robot_os.errors import TaskError
from rt_robot_os.kernel.histogram import Histogram
from rt_robot_os.kernel.histogram import Summary
from rt_robot_os.units import NS_PER_S
from rt_robot_os.units import period_from_rate

PRIORITY_MINIMUM = 1
PRIORITY_MAXIMUM = 99
RATE_MINIMUM_HZ = 1e-6
RATE_MAXIMUM_HZ = 100_000.0


class OverrunPolicy(Enum):
    """What happens to a release that comes while the job before it is not finished."""

    SKIP = 'skip'


@dataclass(frozen=True)
class TaskSpec:
    """
    The declaration of a task.

    :ivar name: unique in its kernel.
    :ivar priority: 1..99, higher runs first.
    :ivar period_ns: releases lie on the grid ``start + phase_ns + n * period_ns``; 0 means that
        only events release it (a publication, an interrupt, another task).
    :ivar phase_ns: from 0; where on the grid it begins.
    :ivar overrun: what happens to a release that finds the last job unfinished.
    """

    name: str
    priority: int
    period_ns: int = 0
    phase_ns: int = 0
    overrun: OverrunPolicy = OverrunPolicy.SKIP

    def __post_init__(self) -> None:
        if isinstance(self.priority, bool) or not isinstance(self.priority, int) or not (
                PRIORITY_MINIMUM <= self.priority <= PRIORITY_MAXIMUM):
            raise TaskError(f'task {self.name!r}: priority {self.priority!r} must be a whole '
                            f'number from {PRIORITY_MINIMUM} to {PRIORITY_MAXIMUM}; '
                            'the higher runs first')
        for key in ('period_ns', 'phase_ns'):
            value = getattr(self, key)
            if isinstance(value, bool) or not isinstance(value, int) or value < 0:
                raise TaskError(f'task {self.name!r}: {key} {value!r} must be a whole number of '
                                'nanoseconds, 0 or more')


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


@dataclass(frozen=True)
class TaskStatistics:
    """
    What a task did since it was added or since the statistics were reset.

    releases = runs + missed + coalesced, plus the jobs that wait or run at this moment.

    :ivar releases: times that it became due.
    :ivar runs: jobs that ran to their end, failed ones included.
    :ivar missed: releases that found the job before unfinished and were skipped, or that the
        kernel was stopped before it could serve.
    :ivar coalesced: events that came while one was waiting already; the job serves them all.
    :ivar failures: jobs that ended with an exception.
    :ivar latency: from release to start.
    :ivar execution: computing time, with what preempted it taken off.
    :ivar jitter: how far the interval between two starts was from the period.
    :ivar gap_maximum_ns: longest time from one start to the next.
    :ivar blocked_maximum_ns: longest time that its code (a native call) held up an alarm.
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


@dataclass(frozen=True)
class FailureReport:
    """
    An exception that was contained.

    :ivar task: where it came from.
    :ivar error: type and message.
    :ivar trace: innermost calls, last one last: file, line, function.
    """

    task: str
    at_ns: int
    error: str
    trace: tuple[tuple[str, int, str], ...]

    def __str__(self) -> str:
        calls = ''.join(f'\n  {path}:{line} in {name}' for path, line, name in self.trace)
        return f'task {self.task!r}: {self.error}{calls}'


class Task:
    """
    A task in its kernel; made by :meth:`rt_robot_os.kernel.Kernel.add_task`.

    The public attributes are for reading.
    """

    __slots__ = (
        'spec', 'name', 'priority', 'function', 'index', 'period_ns', 'interval_ns', 'pending',
        'busy', 'release_ns', 'start_ns', 'releases', 'runs', 'missed', 'coalesced', 'failures',
        'latency', 'execution', 'jitter', 'gap_maximum_ns', 'blocked_maximum_ns',
        'execution_total_ns')

    def __init__(self, spec: TaskSpec, function: Callable[[], object], index: int) -> None:
        self.spec = spec
        self.name = spec.name
        self.priority = spec.priority
        self.function = function
        self.index = index
        self.period_ns = spec.period_ns
        self.latency = Histogram()
        self.execution = Histogram()
        self.jitter = Histogram()
        self.rest()
        self.reset_statistics()

    def rest(self) -> None:
        """Forget a job that was waiting; the kernel calls it before it starts."""
        self.pending = False
        self.busy = False
        self.release_ns = 0
        self.start_ns = -1
        self.interval_ns = self.period_ns

    def set_rate_hz(self, rate_hz: float) -> None:
        """
        Change the rate from the next release on; safe in the real-time loop.

        :raises TaskError: the rate is out of range, or the task is not periodic.
        """
        if not self.period_ns:
            raise TaskError(f'task {self.name!r} has no period: events release it; '
                            'give it a rate_hz when it is added')
        self.period_ns = checked_period_ns(self.name, rate_hz)

    @property
    def rate_hz(self) -> float:
        """Give the rate in force; 0 when only events release the task."""
        return NS_PER_S / self.period_ns if self.period_ns else 0.0

    def reset_statistics(self) -> None:
        """Begin to count anew; a job that waits or runs now counts as released."""
        self.releases = int(self.pending) + int(self.busy)
        self.runs = self.missed = self.coalesced = self.failures = 0
        self.gap_maximum_ns = self.blocked_maximum_ns = self.execution_total_ns = 0
        for histogram in (self.latency, self.execution, self.jitter):
            histogram.clear()

    def statistics(self) -> TaskStatistics:
        """Take the statistics; costs about 100 us, so not for the real-time loop."""
        return TaskStatistics(
            name=self.name, priority=self.priority, period_ns=self.period_ns,
            releases=self.releases, runs=self.runs, missed=self.missed, coalesced=self.coalesced,
            failures=self.failures, latency=self.latency.summary(),
            execution=self.execution.summary(), jitter=self.jitter.summary(),
            gap_maximum_ns=self.gap_maximum_ns, blocked_maximum_ns=self.blocked_maximum_ns,
            execution_total_ns=self.execution_total_ns)
