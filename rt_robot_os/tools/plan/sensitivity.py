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

"""How far the load may grow, and what breaks first."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import replace

from rt_robot_os.tools.plan.analysis import fits
from rt_robot_os.tools.plan.analysis import judge
from rt_robot_os.tools.plan.result import Analysis
from rt_robot_os.tools.plan.task import check
from rt_robot_os.tools.plan.task import Overhead
from rt_robot_os.tools.plan.task import PlannedTask

# The factors are found to one part in this many.
RESOLUTION = 1000
FACTOR_MAXIMUM = 1000.0
# Of a robot with more tasks than the first only those are analysed one by one that use most of
# the processor: each takes dozens of analyses, and the others matter little.
TASKS_MANY = 24
TASKS_SHOWN = 12


@dataclass(frozen=True, slots=True)
class Growth:
    """
    How far one task's execution time may grow while all others stay.

    :ivar execution_ns: the longest with which the set is schedulable; None without a limit.
    :ivar breaks: the task that is late first beyond it; empty: there is more work than time.
    """

    task: str
    execution_ns: int | None
    breaks: str


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """
    What breaks first.

    :ivar factor: all execution times may be multiplied by it; below 1 they have to be.
    :ivar breaks: the task that is late first when they grow more; empty: as above.
    :ivar left_out: tasks that were not analysed one by one, because they are many and use little.
    """

    factor: float
    breaks: str
    growth: tuple[Growth, ...]
    left_out: int = 0


def scaled(task: PlannedTask, factor: float) -> PlannedTask:
    """Make a task that computes longer, everywhere alike."""
    def grow(length_ns: int) -> int:
        return max(1, round(length_ns * factor)) if length_ns else 0

    if task.execution_ns is None:
        return task
    execution_ns = grow(task.execution_ns)
    sections = {name: None if length is None else min(execution_ns, grow(length))
                for name, length in task.sections.items()}
    return replace(task, execution_ns=execution_ns, native_ns=grow(task.native_ns),
                   sections=sections)


def _stretched(task: PlannedTask, execution_ns: int) -> PlannedTask:
    """Make a task that computes longer outside of its sections and native calls."""
    sections = {name: None if length is None else min(execution_ns, length)
                for name, length in task.sections.items()}
    return replace(task, execution_ns=execution_ns, sections=sections)


def largest(low: float, high: float, fit: Callable[[float], bool]) -> float:
    """Find the largest number that fits, between one that does and one that does not."""
    while high - low > high / RESOLUTION:
        middle = (low + high) / 2
        low, high = (middle, high) if fit(middle) else (low, middle)
    return low


def load_margins(tasks: Sequence[PlannedTask], overhead: Overhead = Overhead()) -> Sensitivity:
    """
    Find how far the load may grow.

    Tasks whose execution time is not known are left unchanged.

    :raises ConfigError: as :func:`rt_robot_os.tools.plan.analysis.analyse`.
    """
    check(tasks, overhead)

    def all_times(factor: float) -> Analysis:
        return judge([scaled(task, factor) for task in tasks], overhead)

    factor = largest_factor(lambda f: fits([scaled(task, f) for task in tasks], overhead))
    breaks = _first(all_times(factor * (1 + 2 / RESOLUTION)))
    if factor < 1:
        return Sensitivity(factor, breaks, ())
    known = [index for index, task in enumerate(tasks) if task.execution_ns]
    chosen = known if len(known) <= TASKS_MANY else _busiest(tasks, known, all_times(1.0))
    return Sensitivity(factor, breaks, tuple(
        _growth(tasks, index, overhead) for index in chosen), len(known) - len(chosen))


def _busiest(tasks: Sequence[PlannedTask], known: Sequence[int], analysis: Analysis) -> list[int]:
    """Return those that use most of the processor, in the order in which they were given."""
    used = {result.task.name: result.utilisation or 0.0 for result in analysis.tasks}
    most = sorted(known, key=lambda index: -used[tasks[index].name])[:TASKS_SHOWN]
    return sorted(most)


def largest_factor(fit: Callable[[float], bool]) -> float:
    """Find the largest factor that fits, from 1 / ``FACTOR_MAXIMUM``; 0 when none does."""
    if fit(1.0):
        low, high = 1.0, 2.0
        while fit(high):
            low, high = high, high * 2
            if high > FACTOR_MAXIMUM:
                return FACTOR_MAXIMUM
    else:
        low, high = 0.5, 1.0
        while not fit(low):
            low, high = low / 2, low
            if low < 1 / FACTOR_MAXIMUM:
                return 0.0
    return largest(low, high, fit)


def _growth(tasks: Sequence[PlannedTask], index: int, overhead: Overhead) -> Growth:
    task = tasks[index]

    def with_time(execution_ns: float) -> list[PlannedTask]:
        changed = list(tasks)
        changed[index] = _stretched(task, round(execution_ns))
        return changed

    low = high = float(task.execution_ns or 1)
    # Nothing may compute longer than the longest time that anybody is given.
    limit = max((t.limit_ns or t.period_ns for t in tasks), default=0)
    while fits(with_time(high := min(2 * high, 2.0 * limit)), overhead):
        low = high
        if high >= 2 * limit:
            return Growth(task.name, None, '')
    longest = largest(low, high, lambda ns: fits(with_time(ns), overhead))
    return Growth(task.name, round(longest), _first(judge(with_time(
        high if longest == low else longest * (1 + 2 / RESOLUTION)), overhead)))


def _first(analysis: Analysis) -> str:
    """Name the task that is late; of several the one that it hits hardest."""
    late = [result for result in analysis.failed if result.response_ns is not None]
    return max(late, key=lambda r: r.late_ns / r.task.limit_ns).task.name if late else ''
