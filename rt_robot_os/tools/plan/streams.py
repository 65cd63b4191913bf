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
Every source that releases a task, as a stream of its own.

A task that three sources release is three streams of one priority, in the order of their arrival:
that is what the kernel does with it, but for releases that coincide, of which it makes one.
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence

from rt_robot_os.tools.plan.task import Event
from rt_robot_os.tools.plan.task import PlannedTask

# A task may be reached from another along several chains; this many streams are followed.
STREAMS_MAXIMUM = 256


class Stream:
    """
    Releases of one task from one source.

    :ivar period_ns: the mean distance of two.
    :ivar jitter_ns: how much later than on the regular grid one may come, but for what the
        parents are late.
    :ivar parents: the streams of the task that releases; empty for a timer or the world outside.
    :ivar timer: the task's own timer makes it.
    :ivar ticks: it comes with a signal of its own: from a timer or from outside.
    :ivar waits: its releases do not come within the job of a parent.
    :ivar promiser: whose job makes it, no oftener than promised, whatever makes that run.
    :ivar chain_ns: bound from the first release of the chain to the end of the job; it grows
        while the analysis iterates.
    """

    __slots__ = ('task', 'period_ns', 'jitter_ns', 'parents', 'timer', 'ticks', 'waits',
                 'promiser', 'chain_ns')

    def __init__(self, task: PlannedTask, period_ns: int, jitter_ns: int,
                 parents: Sequence[Stream] = (), timer: bool = False) -> None:
        self.task = task
        self.period_ns = period_ns
        self.jitter_ns = jitter_ns
        self.parents = tuple(parents)
        self.timer = timer
        self.ticks = not self.parents
        self.waits = False
        self.promiser: PlannedTask | None = None
        self.chain_ns = 0

    @property
    def late_ns(self) -> int:
        """Return how late its releases may come, counted from the first one of the chain."""
        return self.jitter_ns + max((p.chain_ns for p in self.parents), default=0)

    def inside(self, level: int) -> bool:
        """
        Return whether the whole chain up to here runs at a level or above.

        Such a chain is within a busy period of that level. What a logical parent publishes at
        its deadline may come long after its job.
        """
        return not self.waits and all(
            p.task.priority >= level and not p.task.logical and p.inside(level)
            for p in self.parents)

    def chains(self, level: int) -> frozenset[tuple[str, ...]]:
        """
        Return the chains by which tasks below a level release it, when nothing else does.

        Of each chain: the tasks from the first of that level. Empty when another event releases
        it, or when the releases do not come within the job of a parent.
        """
        if self.promiser is not None and not self.promiser.logical and (
                self.promiser.priority < level):
            return frozenset({(self.task.name,)})
        if not self.parents or self.waits or any(p.task.logical for p in self.parents):
            return frozenset()
        if self.parents[0].task.priority < level:
            return frozenset({(self.task.name,)})
        found = [p.chains(level) for p in self.parents]
        if not all(found):
            return frozenset()
        return frozenset((*chain, self.task.name) for each in found for chain in each)

    def jitter_at(self, level: int, known: dict[Stream, int]) -> int:
        """
        Return how late releases may come, seen from a busy period of a level.

        :param known: what was found of others, at this level and with these chains.

        A task of that level or above that waits when the period begins would have begun it: so
        its jobs of the period, and with them what they release, were all released in it.
        """
        if not self.parents:
            return self.jitter_ns
        found = known.get(self)
        if found is None:
            found = known[self] = self.jitter_ns + max(
                p.jitter_at(level, known) if p.task.priority >= level and not p.task.logical
                else p.chain_ns for p in self.parents)
        return found


class StreamTable:
    """
    The streams of a set of tasks.

    :ivar streams: by task.
    :ivar problems: by task, why its releases cannot be known.
    """

    def __init__(self, tasks: Sequence[PlannedTask]) -> None:
        self.streams: dict[str, tuple[Stream, ...]] = {}
        self.problems: dict[str, str] = {}
        self._tasks: Mapping[str, PlannedTask] = {task.name: task for task in tasks}
        for task in tasks:
            self._of(task, ())

    def _of(self, task: PlannedTask, path: tuple[str, ...]) -> tuple[Stream, ...]:
        known = self.streams.get(task.name)
        if known is not None:
            return known
        if task.name in path:
            circle = ' -> '.join([*path[path.index(task.name):], task.name])
            for name in path[path.index(task.name):]:
                self.problems.setdefault(name, f'it is released in a circle: {circle}')
            return ()
        found: list[Stream] = []
        if task.period_ns:
            found.append(Stream(task, task.period_ns, task.jitter_ns, timer=True))
        for event in task.events:
            found += self._event(task, event, (*path, task.name))
        if task.unknown:
            self.problems.setdefault(task.name, task.unknown)
        if len(found) > STREAMS_MAXIMUM:
            self.problems.setdefault(task.name, f'it is released in {len(found)} ways; at most '
                                     f'{STREAMS_MAXIMUM} are followed')
            del found[STREAMS_MAXIMUM:]
        self.streams[task.name] = tuple(found)
        return self.streams[task.name]

    def _event(self, task: PlannedTask, event: Event, path: tuple[str, ...]) -> list[Stream]:
        if not event.source:
            return [Stream(task, event.period_ns, event.jitter_ns)]
        if event.promised:
            # Whatever makes its source run, it comes no oftener; two may come together.
            stream = Stream(task, event.period_ns, event.jitter_ns + event.period_ns)
            stream.ticks = False
            stream.promiser = self._tasks[event.source] if not event.waits else None
            return [stream]
        parents = self._of(self._tasks[event.source], path)
        if event.source in self.problems and task.name not in self.problems:
            self.problems[task.name] = (f'{event.source} releases it, and '
                                        f'{self.problems[event.source]}')
        if event.period_ns:
            found = [Stream(task, event.period_ns, event.jitter_ns, parents)] if parents else []
        else:
            found = [Stream(task, parent.period_ns * event.every, event.jitter_ns, [parent])
                     for parent in parents]
        if event.waits:
            for stream in found:
                stream.waits = True
                stream.jitter_ns += 2 * stream.period_ns
        return found
