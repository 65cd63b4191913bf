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
When tasks are released together, and phases that spread them.

Two timers of periods S and T meet if, and only if, their phases are equal modulo gcd(S, T); any
number of them meet in one instant if every two of them do (Chinese remainder theorem). So the
worst instant is found without walking through the hyper-period.
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
import math

from rt_robot_os.tools.plan.task import PlannedTask

HYPER_PERIOD_MAXIMUM_NS = 10 ** 18
STEP_NS = 1000
# Phases tried for a task: its period in this many parts, and halfway between others.
PARTS = 40
# The search for the worst instant examines this many sets of tasks.
SETS_MAXIMUM = 5_000


@dataclass(frozen=True, slots=True)
class Peak:
    """
    The worst instant of release.

    :ivar work_ns: execution time that becomes due in it.
    :ivar tasks: whose.
    """

    work_ns: int
    tasks: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class PhasePlan:
    """
    Phases, and what they are good for.

    :ivar phases_ns: by task; only of those whose phase may be set.
    """

    before: Peak
    after: Peak
    phases_ns: Mapping[str, int]

    @property
    def better(self) -> bool:
        """Whether the plan gains anything."""
        return (self.after.work_ns, len(self.after.tasks)) < (
            self.before.work_ns, len(self.before.tasks))


def hyper_period_ns(tasks: Sequence[PlannedTask]) -> int | None:
    """
    Return the time after which all timers repeat together.

    :return: nanoseconds; 0 without timers; None when it is above ``HYPER_PERIOD_MAXIMUM_NS``.
    """
    common = 1
    for task in tasks:
        if task.period_ns:
            common = math.lcm(common, task.period_ns)
            if common > HYPER_PERIOD_MAXIMUM_NS:
                return None
    return common if any(task.period_ns for task in tasks) else 0


def _work_ns(task: PlannedTask) -> int:
    return task.execution_ns or 0


def peak(tasks: Sequence[PlannedTask], phases_ns: Mapping[str, int] | None = None) -> Peak:
    """
    Find the instant at which most work is released, over all time.

    :param phases_ns: instead of the tasks' own.
    """
    given = phases_ns or {}
    timed = [task for task in tasks if task.period_ns]
    return _peak_among(timed, [given.get(task.name, task.phase_ns) for task in timed])


def _peak_among(timed: Sequence[PlannedTask], phases: Sequence[int]) -> Peak:
    best: list[int] = []
    best_key = (-1, 0)
    left = SETS_MAXIMUM

    def grow(chosen: list[int], candidates: list[int], work: int) -> None:
        nonlocal best, best_key, left
        left -= 1
        key = (work, len(chosen))
        if key > best_key:
            best, best_key = list(chosen), key
        for place, index in enumerate(candidates):
            rest = candidates[place:]
            most = work + sum(_work_ns(timed[i]) for i in rest)
            if (most, len(chosen) + len(rest)) <= best_key or left <= 0:
                return
            grow([*chosen, index],
                 [i for i in rest[1:] if _meet(timed, phases, index, i)],
                 work + _work_ns(timed[index]))

    grow([], sorted(range(len(timed)), key=lambda i: (-_work_ns(timed[i]), i)), 0)
    return Peak(max(best_key[0], 0), tuple(timed[i].name for i in sorted(best)))


def _meet(timed: Sequence[PlannedTask], phases: Sequence[int], a: int, b: int) -> bool:
    return (phases[a] - phases[b]) % math.gcd(timed[a].period_ns, timed[b].period_ns) == 0


def lowest_peak(tasks: Sequence[PlannedTask], fixed: Sequence[str] = ()) -> PhasePlan:
    """
    Choose phases so that little work is released at one instant; the same every time.

    Task by task, the one with most work first, each is given the phase with the lowest peak so
    far, and of those the one farthest from the others.

    :param fixed: tasks whose phase does not change.
    """
    timed = [task for task in tasks if task.period_ns]
    placed = [task for task in timed if task.name in fixed]
    phases = {task.name: task.phase_ns for task in placed}
    chosen: dict[str, int] = {}
    free = [task for task in timed if task.name not in fixed]
    for task in sorted(free, key=lambda t: (-_work_ns(t), -t.priority, t.name)):
        options = [(*_cost(task, phase, placed, phases),
                    -_distance(task, phase, placed, phases), phase)
                   for phase in _options(task, placed, phases)]
        chosen[task.name] = phases[task.name] = min(options)[-1]
        placed.append(task)
    names = {task.name: chosen[task.name] for task in free}
    return PhasePlan(peak(tasks), peak(tasks, names), names)


def _cost(task: PlannedTask, phase: int, placed: Sequence[PlannedTask],
          phases: Mapping[str, int]) -> tuple[int, int]:
    """Weigh the worst instant that a task takes part in: work, and how many tasks."""
    meeting = [other for other in placed if (phase - phases[other.name]) % math.gcd(
        task.period_ns, other.period_ns) == 0]
    found = _peak_among(meeting, [phases[other.name] for other in meeting])
    return found.work_ns + _work_ns(task), len(found.tasks) + 1


def _options(task: PlannedTask, placed: Sequence[PlannedTask], phases: Mapping[str, int]
             ) -> list[int]:
    period = task.period_ns
    found = {0, *(period * k // PARTS // STEP_NS * STEP_NS for k in range(PARTS))}
    for other in placed:
        common = math.gcd(period, other.period_ns)
        found.add((phases[other.name] + common // 2) % period // STEP_NS * STEP_NS)
    return sorted(found)


def _distance(task: PlannedTask, phase: int, placed: Sequence[PlannedTask],
              phases: Mapping[str, int]) -> int:
    """Return the shortest time between a release of this task and of another."""
    nearest = task.period_ns
    for other in placed:
        common = math.gcd(task.period_ns, other.period_ns)
        apart = (phase - phases[other.name]) % common
        nearest = min(nearest, apart, common - apart)
    return nearest
