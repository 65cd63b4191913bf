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

"""A task as the analysis sees it, and what is wrong with a set of them."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field
from types import MappingProxyType
from typing import Any

from rt_robot_os.base.errors import ConfigError


def _none() -> Mapping[str, int]:
    return MappingProxyType({})


@dataclass(frozen=True, slots=True)
class Event:
    """
    A stream of releases that no timer of the task itself makes.

    :ivar source: the task whose jobs release; empty for the world outside.
    :ivar period_ns: time between two releases, on average over a burst; 0: every job of the
        source makes one.
    :ivar jitter_ns: how much later than on a regular grid one may come, besides what the source
        itself is late.
    :ivar every: only every n-th job of the source makes one; without a ``period_ns``.
    :ivar waits: others have to publish as well before it comes: up to two periods later.
    :ivar promised: the period is what the source promises, whatever makes it run.
    """

    source: str = ''
    period_ns: int = 0
    jitter_ns: int = 0
    every: int = 1
    waits: bool = False
    promised: bool = False


@dataclass(frozen=True, slots=True)
class PlannedTask:
    """
    What is known of a task; times in nanoseconds.

    :ivar name: unique in its set.
    :ivar priority: higher runs first; equals run in the order of their release, each to its end.
    :ivar period_ns: of its timer; 0 when only events release it.
    :ivar phase_ns: of its timer. Response times hold for any phases and do not use it.
    :ivar deadline_ns: relative to the release; 0: the period, or none without a period.
    :ivar execution_ns: longest computing time of a job; None when unknown.
    :ivar jitter_ns: how late its timer may be.
    :ivar sections: resources that it locks, each with its longest critical section; None when
        that is unknown: then it may be as long as the job.
    :ivar native_ns: longest stretch in which nothing preempts it.
    :ivar preemptible: False when nothing interrupts its jobs (dispatcher ``cooperative``).
    :ivar events: what else releases it.
    :ivar backlog: releases that may wait while a job is not finished (``catch_up``); 0: such a
        release is skipped.
    :ivar logical: what it publishes comes out at its deadline (logical execution time).
    :ivar judged: False for a task that has no deadline, whatever its period.
    :ivar unknown: why its releases are not known; empty when they are.
    """

    name: str
    priority: int
    period_ns: int = 0
    phase_ns: int = 0
    deadline_ns: int = 0
    execution_ns: int | None = None
    jitter_ns: int = 0
    sections: Mapping[str, int | None] = field(default_factory=_none)
    native_ns: int = 0
    preemptible: bool = True
    events: tuple[Event, ...] = ()
    backlog: int = 0
    logical: bool = False
    judged: bool = True
    unknown: str = ''

    @property
    def limit_ns(self) -> int:
        """Return the active deadline; 0 when there is none."""
        if not self.judged:
            return 0
        return self.deadline_ns or self.period_ns

    def section_ns(self, resource: str) -> int | None:
        """Return the longest critical section on a resource; None when nothing bounds it."""
        declared = self.sections[resource]
        return self.execution_ns if declared is None else declared


@dataclass(frozen=True, slots=True)
class Overhead:
    """
    What the kernel itself takes.

    :ivar job_ns: for each job: to start it, to count it.
    :ivar tick_ns: for each release by a timer or from outside, whatever its priority: the signal,
        the handler, arming the timer again. It interrupts every task.
    """

    job_ns: int = 0
    tick_ns: int = 0


def check(tasks: Sequence[PlannedTask], overhead: Overhead = Overhead()) -> None:
    """
    Look for values that no analysis can use.

    :raises ConfigError: with one line for each.
    """
    problems = [*_names(tasks)]
    known = {task.name for task in tasks}
    for task in tasks:
        problems += (f'task {task.name!r}: {text}' for text in _task_problems(task, known))
    for name, value in (('job_ns', overhead.job_ns), ('tick_ns', overhead.tick_ns)):
        if not _whole(value, 0):
            problems.append(f'overhead: {name} {value!r} must be an integer, 0 or more')
    if problems:
        raise ConfigError(problems)


def _names(tasks: Iterable[PlannedTask]) -> Iterable[str]:
    seen: set[str] = set()
    for task in tasks:
        if task.name in seen:
            yield f'task {task.name!r} is there twice; names are unique'
        seen.add(task.name)


def _whole(value: Any, least: int) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= least


def _task_problems(task: PlannedTask, known: set[str]) -> Iterable[str]:
    if not _whole(task.priority, 1):
        yield f'priority {task.priority!r} must be an integer from 1; the higher runs first'
    for key in ('period_ns', 'phase_ns', 'deadline_ns', 'jitter_ns', 'native_ns', 'backlog'):
        value = getattr(task, key)
        if not _whole(value, 0):
            yield f'{key} {value!r} must be an integer, 0 or more'
    if task.execution_ns is not None and not _whole(task.execution_ns, 1):
        yield (f'execution_ns {task.execution_ns!r} must be an integer above '
               '0, or None when it is unknown')
    for resource, length in task.sections.items():
        if length is not None and not _whole(length, 0):
            yield f'section on {resource!r} of {length!r} ns must be an integer, 0 or more'
        elif length and task.execution_ns and length > task.execution_ns:
            yield (f'section on {resource!r} of {length} ns is longer than the whole job, '
                   f'{task.execution_ns} ns: correct one of them')
    yield from _release_problems(task, known)


def _release_problems(task: PlannedTask, known: set[str]) -> Iterable[str]:
    if not task.period_ns and not task.events and not task.unknown:
        yield 'nothing releases it: give it a period_ns or events'
    for event in task.events:
        if event.source and event.source not in known:
            yield f'is released by {event.source!r}, which is no task of this set'
        if not event.source and not event.period_ns:
            yield 'an event from outside needs a period_ns: the least time between two'
        if not (_whole(event.period_ns, 0) and _whole(event.jitter_ns, 0)
                and _whole(event.every, 1)):
            yield f'{event!r}: times must be whole numbers, 0 or more, and every 1 or more'
