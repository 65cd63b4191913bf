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
Chains of tasks that release one another: from the bytes of a device to the command of another.

While a chain is in progress, one of its stages is ready at each moment, since each is released
before the one before has ended. So nothing runs meanwhile but tasks of at least the lowest
priority in the chain, and, at its beginning, what blocks one of that priority. The chain has ended
at the latest when the longest busy period of that priority has; each job that comes in between
counts once, however many stages there are, and what tasks below release counts for one job. The
sum of the bounds of the stages is another bound, and the smaller one counts.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.settings.problems import did_you_mean
from rt_robot_os.tools.plan.analysis import busy_until_ns
from rt_robot_os.tools.plan.given import RobotTasks
from rt_robot_os.tools.plan.response import NoBoundError
from rt_robot_os.tools.plan.result import Analysis
from rt_robot_os.tools.plan.result import Verdict
from rt_robot_os.tools.plan.task import PlannedTask

ARRIVAL: Final = '/arrival'


class ChainRequest(NamedTuple):
    """
    What is asked of a chain.

    :ivar names: tasks of the path, in order, two or more; between two of them the shortest path
        counts. A device is meant by its name, whichever of its tasks it is.
    :ivar limit_ns: it has to have ended by then; 0: it need not.
    """

    names: tuple[str, ...]
    limit_ns: int = 0


class Stage(NamedTuple):
    """
    A task of a chain.

    :ivar response_ns: from its release to its end at most; None when that is not known.
    """

    task: str
    priority: int
    response_ns: int | None


@dataclass(frozen=True, slots=True)
class ChainResult:
    """
    A chain.

    :ivar bound_ns: from the release of its first stage to the end of its last, at most, with the
        wait for the next poll where the first is polled; None when there is none.
    :ivar limit_ns: that was requested; 0: none.
    :ivar reason: why there is no bound.
    """

    stages: tuple[Stage, ...]
    bound_ns: int | None
    limit_ns: int = 0
    reason: str = ''

    @property
    def late(self) -> bool:
        """Return whether it may take longer than it must."""
        return bool(self.limit_ns) and self.bound_ns is not None and self.bound_ns > self.limit_ns

    @property
    def unjudged(self) -> bool:
        """Return whether a limit was given and nothing is known about it."""
        return bool(self.limit_ns) and self.bound_ns is None


def chains_of(requests: Sequence[ChainRequest], robot: RobotTasks, analysis: Analysis
              ) -> tuple[ChainResult, ...]:
    """
    Find chains and bound them.

    :raises ConfigError: a task is not there, or does not release the next; it names all problems.
    """
    problems: list[str] = []
    found = []
    for request in requests:
        try:
            path = _path(request.names, robot.tasks)
        except ConfigError as error:
            problems += error.problems
            continue
        found.append(_bounded(path, request.limit_ns, robot, analysis))
    if problems:
        raise ConfigError(problems)
    return tuple(found)


def _path(names: Sequence[str], tasks: Sequence[PlannedTask]) -> list[PlannedTask]:
    by_name = {task.name: task for task in tasks}
    known = {_owner(name) for name in by_name}
    label = f'--chain {",".join(names)}'
    unknown = [name for name in names if _owner(name) not in known]
    if unknown:
        raise ConfigError([f'{label}: there is no task {name!r}, {did_you_mean(name, known)}'
                           for name in unknown])
    owners = [_owner(names[0])]
    readers = _readers(tasks)
    for first, last in zip(map(_owner, names), map(_owner, names[1:])):
        part = _shortest(first, last, readers)
        if not part:
            released = ', '.join(sorted(readers.get(first, ()))) or 'nothing'
            raise ConfigError([f'{label}: nothing that {first!r} publishes leads to {last!r}: it '
                               f'releases {released}; does each on the path wake on what the one '
                               'before publishes?'])
        owners += part
    path = []
    for place, owner in enumerate(owners):
        before = owners[place - 1] if place else ''
        path.append(_task_of(owner, before, by_name))
    return path


def _owner(name: str) -> str:
    return name.removesuffix(ARRIVAL)


def _readers(tasks: Sequence[PlannedTask]) -> Mapping[str, list[str]]:
    """Return whom each task releases, both by the names of devices and modules."""
    found: dict[str, list[str]] = {}
    for task in tasks:
        for event in task.events:
            # What waits for others as well, or counts, is not released by this alone.
            if event.source and event.every == 1 and not event.waits:
                found.setdefault(_owner(event.source), []).append(_owner(task.name))
    return {source: list(dict.fromkeys(names)) for source, names in found.items()}


def _shortest(first: str, last: str, readers: Mapping[str, list[str]]) -> list[str]:
    """Return the shortest path, without its beginning; empty when there is none."""
    paths: deque[list[str]] = deque([[first]])
    seen = {first}
    while paths:
        path = paths.popleft()
        for each in readers.get(path[-1], ()):
            if each == last:
                return [*path[1:], each]
            if each not in seen:
                seen.add(each)
                paths.append([*path, each])
    return []


def _task_of(owner: str, before: str, by_name: Mapping[str, PlannedTask]) -> PlannedTask:
    """Return which task of a device it is: that of its bytes, or of what wakes it, if there is."""
    arrival = by_name.get(owner + ARRIVAL)
    if arrival is None:
        return by_name[owner]
    wanted = before or ''
    if any(_owner(event.source) == wanted for event in arrival.events):
        return arrival
    return by_name.get(owner, arrival)


def _bounded(path: Sequence[PlannedTask], limit_ns: int, robot: RobotTasks,
             analysis: Analysis) -> ChainResult:
    results = [analysis.task(task.name) for task in path]
    stages = tuple(Stage(r.task.name, r.task.priority, r.response_ns) for r in results)
    for result in results:
        if result.response_ns is None:
            return ChainResult(stages, None, limit_ns, f'{result.task.name}: '
                               f'{result.reason or Verdict.UNBOUNDED.value}')
    # Of a task with logical execution what it publishes comes at its deadline: a pause.
    logical = [task for task in path[:-1] if task.logical]
    bound_ns = sum(max(stage.response_ns or 0, task.limit_ns if task in logical else 0)
                   for stage, task in zip(stages, path))
    if not logical:
        lowest = min(path, key=lambda task: task.priority)
        try:
            bound_ns = min(bound_ns, busy_until_ns(robot.tasks, robot.overhead, lowest))
        except NoBoundError:
            pass  # the sum is a bound as well
    # Bytes wait for the next poll where they do not release the first stage.
    first = path[0]
    is_polled = robot.owners[first.name] == 'device' and not first.name.endswith(ARRIVAL)
    polled_ns = first.period_ns if is_polled else 0
    return ChainResult(stages, bound_ns + polled_ns, limit_ns)
