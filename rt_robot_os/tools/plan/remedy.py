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

"""What to do first about a set of tasks that is not schedulable."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from rt_robot_os.tools.plan.analysis import judge
from rt_robot_os.tools.plan.blocking import NATIVE
from rt_robot_os.tools.plan.blocking import WHOLE_JOB
from rt_robot_os.tools.plan.result import Analysis
from rt_robot_os.tools.plan.sensitivity import FACTOR_MAXIMUM
from rt_robot_os.tools.plan.sensitivity import largest
from rt_robot_os.tools.plan.sensitivity import largest_factor
from rt_robot_os.tools.plan.sensitivity import scaled
from rt_robot_os.tools.plan.task import Overhead
from rt_robot_os.tools.plan.task import PlannedTask


def remedy(tasks: Sequence[PlannedTask], overhead: Overhead, analysis: Analysis) -> str:
    """
    Return what to do first about a set that is not schedulable; empty when nothing simple helps.

    Tried in this order: timers that are on time, another priority for one task, other priorities,
    less blocking, one task that computes less.
    """
    if not analysis.failed:
        return ''
    for attempt in (_by_jitter, _by_one_priority, _by_priorities, _by_blocking, _by_execution):
        found = attempt(tasks, overhead, analysis)
        if found:
            return found
    factor = largest_factor(
        lambda f: not judge([scaled(task, f) for task in tasks], overhead).failed)
    if factor:
        return (f'no single change is enough: all together must take {1 - factor:.0%} less, or '
                'rates must come down')
    return 'even tasks that compute nothing would be late: give them longer deadlines or periods'


def _by_jitter(tasks: Sequence[PlannedTask], overhead: Overhead, analysis: Analysis) -> str:
    """Try timers that are on time."""
    worst_ns = max(task.jitter_ns for task in tasks)
    shortest_ns = min((task.limit_ns for task in tasks if task.limit_ns), default=0)
    enough = worst_ns and not judge(
        [replace(task, jitter_ns=0) for task in tasks], overhead).failed
    if not enough and worst_ns < shortest_ns:
        return ''
    why = ('without that all would be in time' if enough
           else f'which a deadline of {shortest_ns / 1e6:.3f} ms cannot bear')
    return (f'timers of this machine were up to {worst_ns / 1e6:.3f} ms late, {why}: give the '
            'core real-time priority (see the program doctor), or plan for another machine with '
            '--jitter-us')


def _by_one_priority(
    tasks: Sequence[PlannedTask], overhead: Overhead, analysis: Analysis,
) -> str:
    """Try to put one task below all that have shorter deadlines."""
    for index, task in enumerate(tasks):
        shorter = [other.priority for other in tasks
                   if other.limit_ns and other.limit_ns < task.limit_ns]
        wanted = min(shorter, default=task.priority + 1) - 1
        if not 1 <= wanted < task.priority:
            continue
        changed = [*tasks[:index], replace(task, priority=wanted), *tasks[index + 1:]]
        if not judge(changed, overhead).failed:
            return (f'give {task.name!r} a lower priority, since its deadline is longer than that '
                    f'of others below it: {task.name}.priority: {wanted} (was {task.priority})')
    return ''


def _by_priorities(
    tasks: Sequence[PlannedTask], overhead: Overhead, analysis: Analysis,
) -> str:
    """Try the order of deadlines among the tasks that have one, with the priorities they use."""
    movable = [task for task in tasks if task.limit_ns]
    levels = sorted((task.priority for task in movable), reverse=True)
    if len(set(levels)) < 2:
        return ''
    order = sorted(movable, key=lambda task: (task.limit_ns, -task.priority))
    wanted = {task.name: level for task, level in zip(order, levels)}
    changed = [replace(task, priority=wanted.get(task.name, task.priority)) for task in tasks]
    moves = [f'{new.name}.priority: {new.priority} (was {old.priority})'
             for old, new in zip(tasks, changed) if old.priority != new.priority]
    if not moves or judge(changed, overhead).failed:
        return ''
    return 'give the shorter deadline the higher priority: ' + ', '.join(moves)


def _by_blocking(tasks: Sequence[PlannedTask], overhead: Overhead, analysis: Analysis) -> str:
    """Try to shorten the one stretch that blocks the task that is late."""
    for result in analysis.failed:
        blocking = result.blocking
        if not blocking.length_ns:
            continue
        if blocking.what == WHOLE_JOB:
            preemptible = [replace(task, preemptible=True) for task in tasks]
            if not judge(preemptible, overhead).failed:
                return 'set core.dispatcher to preemptive'
            continue

        def shortened(length_ns: float, by: str = blocking.by, what: str = blocking.what
                      ) -> list[PlannedTask]:
            return [_shortened(t, what, round(length_ns)) if t.name == by else t for t in tasks]

        if judge(shortened(0), overhead).failed:
            continue
        most = largest(0, blocking.length_ns, lambda ns: not judge(
            shortened(ns), overhead).failed)
        what = ('longest native call' if blocking.what == NATIVE
                else f'critical section on {blocking.what!r}')
        return (f'shorten the {what} of {blocking.by!r} from {blocking.length_ns / 1e6:.3f} ms '
                f'to {most / 1e6:.3f} ms')
    return ''


def _shortened(task: PlannedTask, what: str, length_ns: int) -> PlannedTask:
    if what == NATIVE:
        return replace(task, native_ns=length_ns)
    return replace(task, sections={**task.sections, what: length_ns})


def _by_execution(tasks: Sequence[PlannedTask], overhead: Overhead, analysis: Analysis) -> str:
    """Find the one task that has to give the least part of its execution time."""
    best = (0.0, '')
    for index, task in enumerate(tasks):
        if not task.execution_ns:
            continue

        def fits(factor: float, at: int = index) -> bool:
            changed = list(tasks)
            changed[at] = scaled(changed[at], factor)
            return not judge(changed, overhead).failed

        if not fits(1 / FACTOR_MAXIMUM):
            continue
        factor = largest(1 / FACTOR_MAXIMUM, 1.0, fits)
        if factor > best[0]:
            best = (factor, f'make {task.name!r} compute at most '
                    f'{task.execution_ns * factor / 1e6:.3f} ms instead of '
                    f'{task.execution_ns / 1e6:.3f} ms')
    return best[1]
