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

"""The result of an analysis, task by task."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from rt_robot_os.tools.plan.blocking import Blocking
from rt_robot_os.tools.plan.task import PlannedTask


class Verdict(Enum):
    """The verdict on a task."""

    OK = 'ok'
    LATE = 'late'            # it may end after its deadline
    SKIPPED = 'skipped'      # a release may find the job before unfinished
    OVERLOAD = 'overload'    # there is more work than time: no bound exists
    UNBOUNDED = 'no bound'   # none was found
    UNKNOWN = 'unknown'      # something that it depends on is not known
    FREE = 'free'            # bounded, and it has no deadline

    @property
    def bad(self) -> bool:
        """Whether it makes the whole not schedulable."""
        return self in (Verdict.LATE, Verdict.SKIPPED, Verdict.OVERLOAD)


@dataclass(frozen=True, slots=True)
class TaskResult:
    """
    What is known of a task now.

    :ivar utilisation: its part of the processor; None when unknown.
    :ivar level: the part of all of its priority and above, with the kernel's own time.
    :ivar blocking: by one task below it.
    :ivar jitter_ns: how late it may be released.
    :ivar response_ns: longest time from its release to its end: of a timer from the moment on the
        grid, of an event from its arrival. None when there is no bound or it is unknown.
    :ivar chain_ns: of a task that others release: from the first release of the chain to its end.
    :ivar reason: why the verdict is not ``ok``.
    """

    task: PlannedTask
    verdict: Verdict
    utilisation: float | None
    level: float | None
    blocking: Blocking
    jitter_ns: int = 0
    response_ns: int | None = None
    chain_ns: int | None = None
    reason: str = ''

    @property
    def late_ns(self) -> int:
        """Return how much too long it may take; negative when there is time left."""
        if self.response_ns is None or not self.task.limit_ns:
            return 0
        return self.response_ns - self.task.limit_ns


@dataclass(frozen=True, slots=True)
class Analysis:
    """
    What came out.

    :ivar tasks: by priority, the highest first, then as they were given.
    :ivar utilisation: of the tasks that are judged and known, with the kernel's own time.
    :ivar service: of the others that are known, if each of their jobs took its longest time.
    :ivar overhead: the kernel's own time alone.
    """

    tasks: tuple[TaskResult, ...]
    utilisation: float
    service: float
    overhead: float

    @property
    def failed(self) -> tuple[TaskResult, ...]:
        """Return the tasks that may miss their deadline: they make the set not schedulable."""
        return tuple(r for r in self.tasks if r.verdict.bad and r.task.judged)

    @property
    def unjudged(self) -> tuple[TaskResult, ...]:
        """Return the tasks with a deadline that cannot be judged."""
        return tuple(r for r in self.tasks if r.task.judged and r.verdict in (
            Verdict.UNKNOWN, Verdict.UNBOUNDED))

    def task(self, name: str) -> TaskResult:
        """Find a task's result; KeyError when there is none."""
        return {r.task.name: r for r in self.tasks}[name]
