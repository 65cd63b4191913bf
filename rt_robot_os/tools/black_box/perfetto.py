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
Export of a dump for ui.perfetto.dev and chrome://tracing: Chrome's trace event format, JSON.

Each priority has a track with the slices in which its tasks had the CPU, so idle time is a gap.
One track has the releases; arrows lead from them through all slices of the job. Each resource has
a track, and one track has the native calls that blocked other tasks.
"""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping
from typing import Any

from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.kernel.black_box import ABORT
from rt_robot_os.kernel.black_box import INTERRUPT
from rt_robot_os.kernel.black_box import MARK
from rt_robot_os.kernel.black_box import MISS
from rt_robot_os.kernel.black_box import OVERRUN
from rt_robot_os.kernel.black_box import PUBLISH
from rt_robot_os.tools.black_box.history import History
from rt_robot_os.tools.black_box.history import Job
from rt_robot_os.tools.black_box.history import Moment

PROCESS = 1
# Tracks are ordered by these numbers; 1..99 is 100 minus the priority.
_RELEASES, _RESOURCES, _BLOCKED, _MARKS = 0, 100, 1000, 1001
_RELEASE_NS = NS_PER_US

Event = dict[str, Any]


def perfetto_document(history: History, robot: str = 'robot',
                      facts: Mapping[str, str | int] | None = None) -> dict[str, Any]:
    """
    Create the document; times are in microseconds, relative to the oldest event.

    :param facts: metadata of the dump.
    """
    return _Document(history, robot).document(facts or {})


class _Document:
    def __init__(self, history: History, robot: str) -> None:
        self._history = history
        self._robot = robot
        self._names: dict[int, str] = {}
        self._base_ns = min([history.from_ns, *(j.release_ns for j in history.jobs),
                             *(m.at_ns for m in history.moments),
                             *(b.from_ns for b in history.blocked),
                             *(h.enter_ns for h in history.holds)])

    def document(self, facts: Mapping[str, str | int]) -> dict[str, Any]:
        history = self._history
        events = [*self._jobs(), *self._moments(), *self._holds(), *self._blocked()]
        # Events of the same time stay in this order: an arrow belongs to the slice before it.
        events.sort(key=lambda event: float(event['ts']))
        return {
            'traceEvents': [*self._metadata(), *events], 'displayTimeUnit': 'ns',
            'otherData': {
                **{key: str(value) for key, value in facts.items()},
                'reason': history.dump.reason, 'clock': 'CLOCK_MONOTONIC',
                'zero_ns': str(self._base_ns), 'complete_from_us': self._us(history.from_ns)}}

    # ---- tracks ------------------------------------------------------------------------------

    def _us(self, at_ns: int) -> float:
        return (at_ns - self._base_ns) / NS_PER_US

    def _track(self, task: int) -> int:
        """Return the track of a task's priority."""
        if task < 0:
            return self._named(_MARKS, 'events of no task')
        priority = self._history.tasks[task].priority
        return self._named(100 - priority, f'prio {priority}')

    def _named(self, track: int, name: str) -> int:
        self._names[track] = name
        return track

    def _metadata(self) -> Iterator[Event]:
        yield {'ph': 'M', 'pid': PROCESS, 'name': 'process_name',
               'args': {'name': f'core of {self._robot}'}}
        for track, name in sorted(self._names.items()):
            for key, value in (('thread_name', {'name': name}),
                               ('thread_sort_index', {'sort_index': track})):
                yield {'ph': 'M', 'pid': PROCESS, 'tid': track, 'name': key, 'args': value}

    def _slice(self, name: str, category: str, track: int, from_ns: int, to_ns: int,
               args: dict[str, Any]) -> Event:
        return {'ph': 'X', 'name': name, 'cat': category, 'pid': PROCESS, 'tid': track,
                'ts': self._us(from_ns), 'dur': (to_ns - from_ns) / NS_PER_US, 'args': args}

    # ---- jobs --------------------------------------------------------------------------------

    def _jobs(self) -> Iterator[Event]:
        by_release = sorted(self._history.jobs, key=lambda job: job.release_ns)
        for number, job in enumerate(by_release):
            following = by_release[number + 1:number + 2]
            yield from self._job(number, job, following[0].release_ns if following else None)

    def _job(self, number: int, job: Job, next_ns: int | None) -> Iterator[Event]:
        name = self._history.tasks[job.task].name
        track = self._track(job.task)
        args: dict[str, Any] = {
            'release_us': self._us(job.release_ns), 'latency_us': job.latency_ns / NS_PER_US,
            'response_us': job.response_ns / NS_PER_US,
            'execution_us': job.execution_ns / NS_PER_US, 'outcome': job.outcome.name.lower()}
        if job.late_ns:
            args['deadline_missed_by_us'] = job.late_ns / NS_PER_US
        tasks = self._history.tasks
        waits = self._history.blocked_by(job)
        if waits:
            args['blocked_by'] = ', '.join(
                f'{tasks[task].name} {time_ns / NS_PER_US:.1f} us'
                for task, time_ns in waits.most_common())
        # A short slice as the start of the arrow; the next one must not overlap it.
        room_ns = _RELEASE_NS if next_ns is None else min(_RELEASE_NS, next_ns - job.release_ns)
        releases = self._named(_RELEASES, 'releases')
        yield self._slice(name, 'release', releases, job.release_ns, job.release_ns + room_ns,
                          {'priority': self._history.tasks[job.task].priority})
        yield self._arrow('s', number, releases, job.release_ns)
        parts = job.slices or ((job.start_ns, job.start_ns),)
        for part, (from_ns, to_ns) in enumerate(parts, 1):
            shown = {**args, 'slice': f'{part} of {len(parts)}'} if len(parts) > 1 else args
            yield self._slice(name, 'job', track, from_ns, to_ns, shown)
            yield self._arrow('f' if part == len(parts) else 't', number, track, from_ns)

    def _arrow(self, phase: str, number: int, track: int, at_ns: int) -> Event:
        event: Event = {'ph': phase, 'name': 'job', 'cat': 'job', 'id': number, 'pid': PROCESS,
                        'tid': track, 'ts': self._us(at_ns)}
        if phase == 'f':
            event['bp'] = 'e'  # to the slice that encloses it, not to the next one
        return event

    # ---- the rest ----------------------------------------------------------------------------

    def _moments(self) -> Iterator[Event]:
        for moment in self._history.moments:
            name, args = _moment(moment)
            yield {'ph': 'i', 's': 't', 'name': name, 'cat': name.split(' ')[0], 'pid': PROCESS,
                   'tid': self._track(moment.task), 'ts': self._us(moment.at_ns),
                   'args': args if moment.task < 0 else
                   {'task': self._history.tasks[moment.task].name, **args}}

    def _holds(self) -> Iterator[Event]:
        names = sorted({hold.resource for hold in self._history.holds})
        for hold in self._history.holds:
            task = self._history.tasks[hold.task]
            track = self._named(_RESOURCES + names.index(hold.resource),
                                f'resource {hold.resource}')
            yield self._slice(task.name, 'resource', track, hold.enter_ns, hold.leave_ns,
                              {'resource': hold.resource, 'priority': task.priority})

    def _blocked(self) -> Iterator[Event]:
        end_ns = 0
        for blocked in self._history.blocked:
            tasks = self._history.tasks
            from_ns = max(blocked.from_ns, end_ns)
            end_ns = max(end_ns, blocked.at_ns)
            victims = self._history.held_up_by(blocked)
            time_us = (blocked.at_ns - blocked.from_ns) / NS_PER_US
            yield self._slice(
                f'native call of {tasks[blocked.task].name} blocked {victims} for '
                f'{time_us:.0f} us', 'blocked',
                self._named(_BLOCKED, 'native calls that blocked'),
                min(from_ns, blocked.at_ns), blocked.at_ns,
                {'task': tasks[blocked.task].name, 'victims': victims, 'blocked_us': time_us})


def _moment(moment: Moment) -> tuple[str, dict[str, Any]]:
    if moment.kind == PUBLISH:
        return f'publish {moment.text}', {'number': moment.value}
    if moment.kind == INTERRUPT:
        return f'interrupt {moment.text}', {}
    if moment.kind == OVERRUN:
        return 'overrun', {'count': moment.value}
    if moment.kind == ABORT:
        return 'abort', {'used_us': moment.value / NS_PER_US}
    if moment.kind == MISS:
        return 'deadline missed', {'late_us': moment.value / NS_PER_US}
    return (f'mark {moment.text}' if moment.kind == MARK else 'event'), {}
