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

"""How long a task may have to wait for one below it: critical sections and native calls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rt_robot_os.tools.plan.task import PlannedTask

NATIVE = 'native call'
WHOLE_JOB = 'whole job'


@dataclass(frozen=True, slots=True)
class Blocking:
    """
    The longest that a task waits for one below it; at most one stretch, of one task.

    :ivar by: the task below.
    :ivar what: the resource, ``NATIVE``, or ``WHOLE_JOB`` of one that nothing preempts.
    :ivar unknown: why it is not known; empty when it is.
    """

    length_ns: int = 0
    by: str = ''
    what: str = ''
    unknown: str = ''


def ceilings(tasks: Sequence[PlannedTask]) -> dict[str, int]:
    """Return the ceiling of each resource: the highest priority among the tasks that lock it."""
    found: dict[str, int] = {}
    for task in tasks:
        for resource in task.sections:
            found[resource] = max(found.get(resource, 0), task.priority)
    return found


def blocking_of(task: PlannedTask, tasks: Sequence[PlannedTask]) -> Blocking:
    """
    Find the longest stretch by which a task may be blocked.

    With immediate ceilings a job that has started is never blocked, and before it starts one
    task below may be inside a section whose ceiling is at or above the priority of the job, or
    inside a native call. Only one task can be there: it keeps the others from starting.
    """
    ceiling = ceilings(tasks)
    worst = Blocking()
    for other in tasks:
        if other.priority >= task.priority:
            continue
        if not other.preemptible:
            if other.execution_ns is None:
                return Blocking(0, other.name, WHOLE_JOB, (
                    f'{other.name!r} below it is not preempted, and its execution time is not '
                    'known'))
            if other.execution_ns > worst.length_ns:
                worst = Blocking(other.execution_ns, other.name, WHOLE_JOB)
        if other.native_ns > worst.length_ns:
            worst = Blocking(other.native_ns, other.name, NATIVE)
        for resource in other.sections:
            if ceiling[resource] < task.priority:
                continue
            length_ns = other.section_ns(resource)
            if length_ns is None:
                return Blocking(0, other.name, resource, (
                    f'{other.name!r} below it locks {resource!r} for an unknown time'))
            if length_ns > worst.length_ns:
                worst = Blocking(length_ns, other.name, resource)
    return worst
