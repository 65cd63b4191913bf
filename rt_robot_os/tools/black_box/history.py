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


"""The history of a dump as typed values, for all commands of this folder."""

from __future__ import annotations

from bisect import bisect_left
from bisect import bisect_right
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field
from enum import IntEnum
from operator import attrgetter
from typing import Any

from rt_robot_os.core.dumps.dump_parts import kind_name
from rt_robot_os.core.dumps.dump_parts import KINDS
from rt_robot_os.kernel.black_box import ABORT
from rt_robot_os.kernel.black_box import BlackBoxDump
from rt_robot_os.kernel.black_box import BLOCKED
from rt_robot_os.kernel.black_box import CEILING
from rt_robot_os.kernel.black_box import INTERRUPT
from rt_robot_os.kernel.black_box import JOB
from rt_robot_os.kernel.black_box import MARK
from rt_robot_os.kernel.black_box import MISS
from rt_robot_os.kernel.black_box import OVERRUN
from rt_robot_os.kernel.black_box import PUBLISH
from rt_robot_os.kernel.black_box import TaskFacts
from rt_robot_os.tools.black_box.slices import slices
from rt_robot_os.tools.black_box.slices import Span


class Outcome(IntEnum):
    """The end of a job; the first three are the kernel's numbers."""

    OK = 0
    FAILED = 1
    ABORTED = 2
    RUNNING = 3


@dataclass(frozen=True)
class Job:
    """
    A job.

    :ivar task: index of its task in ``History.tasks``.
    :ivar end_ns: end of the job, or the time of the dump if it is running.
    :ivar slices: intervals in which it had the CPU.
    :ivar depth: number of preempted jobs below it.
    :ivar late_ns: time by which it missed its deadline; 0: it met it.
    """

    task: int
    release_ns: int
    start_ns: int
    end_ns: int
    outcome: Outcome
    slices: tuple[tuple[int, int], ...]
    depth: int
    late_ns: int = 0

    @property
    def latency_ns(self) -> int:
        """Return the time from release to start."""
        return self.start_ns - self.release_ns

    @property
    def response_ns(self) -> int:
        """Return the time from release to end."""
        return self.end_ns - self.release_ns

    @property
    def execution_ns(self) -> int:
        """Return the CPU time, as far as it is known."""
        return sum(end - start for start, end in self.slices)


@dataclass(frozen=True)
class Moment:
    """
    An event without a duration.

    :ivar kind: of :mod:`rt_robot_os.kernel.black_box`.
    :ivar task: index in ``History.tasks``; -1: none.
    :ivar text: a topic, a source, a mark.
    :ivar value: the number of a sample or of overruns, or a duration in nanoseconds.
    """

    kind: int
    task: int
    at_ns: int
    text: str = ''
    value: int = 0


@dataclass(frozen=True)
class Hold:
    """The interval in which a task held a resource."""

    resource: str
    task: int
    enter_ns: int
    leave_ns: int


@dataclass(frozen=True)
class Blocked:
    """
    A native call that blocked other tasks.

    :ivar victims: tasks of higher priority that were released during the call.
    """

    task: int
    from_ns: int
    at_ns: int
    victims: tuple[int, ...]


@dataclass(frozen=True)
class History:
    """
    The content of a dump, decoded.

    :ivar from_ns: the history is complete from this time on.
    :ivar jobs: in order of their starts, including running ones.
    :ivar moments: events without a duration, in order of time.
    :ivar unknown: number of records of unknown kinds, by name.
    """

    dump: BlackBoxDump
    tasks: tuple[TaskFacts, ...]
    from_ns: int
    to_ns: int
    jobs: tuple[Job, ...]
    moments: tuple[Moment, ...]
    holds: tuple[Hold, ...]
    blocked: tuple[Blocked, ...]
    unknown: dict[str, int]
    _slices: tuple[tuple[int, int, int], ...] = field(repr=False)

    def who_ran(self, from_ns: int, to_ns: int) -> Counter[int]:
        """Return the CPU time of each task between two times, in nanoseconds."""
        used: Counter[int] = Counter()
        at = max(0, bisect_right(self._slices, (from_ns,)) - 1)
        for start_ns, end_ns, task in self._slices[at:]:
            if start_ns >= to_ns:
                break
            time_ns = min(end_ns, to_ns) - max(start_ns, from_ns)
            if time_ns > 0:
                used[task] += time_ns
        return used

    def blocked_by(self, job: Job) -> Counter[int]:
        """Return the CPU time of tasks of lower priority while a job waited for its start."""
        priority = self.tasks[job.task].priority
        return Counter({
            task: time_ns for task, time_ns in self.who_ran(job.release_ns, job.start_ns).items()
            if self.tasks[task].priority < priority})

    def held_up_by(self, blocked: Blocked) -> str:
        """Return the names of the tasks that a native call blocked."""
        # The call has a record because it blocked a job; the job has one only after its end.
        return ', '.join(self.tasks[v].name for v in blocked.victims) or 'one that did not end yet'

    def between(self, from_ns: int, to_ns: int) -> tuple[Job, ...]:
        """Return the jobs that were released, waited or ran between two times."""
        return tuple(j for j in self.jobs if j.end_ns >= from_ns and j.release_ns <= to_ns)


def understand(dump: BlackBoxDump, kinds: Sequence[str] = KINDS) -> History:
    """
    Decode the records of a dump.

    :param kinds: names of the kinds in the dump, also of those unknown to this release.
    """
    jobs = _jobs(dump)
    moments, unknown = _moments(dump, kinds)
    runs = sorted((start, end, job.task) for job in jobs for start, end in job.slices)
    return History(
        dump=dump, tasks=dump.tasks, from_ns=_begin_ns(dump), to_ns=dump.at_ns, jobs=jobs,
        moments=moments,
        holds=tuple(sorted((Hold(r[4], r[1], r[2], r[3]) for r in dump.records
                            if r[0] == CEILING), key=attrgetter('enter_ns'))),
        blocked=_blocked(dump, jobs), unknown=unknown, _slices=tuple(runs))


def _ended_ns(record: tuple[Any, ...]) -> int | None:
    kind = record[0]
    if kind == JOB:
        return int(record[4])
    if kind == CEILING:
        return int(record[3])
    return int(record[2]) if kind < len(KINDS) else None


def _begun_ns(record: tuple[Any, ...]) -> int | None:
    return int(record[2]) if record[0] < len(KINDS) else None


def _begin_ns(dump: BlackBoxDump) -> int:
    """Return the time from which the records are complete."""
    if dump.full:
        # Dropped records ended before the oldest one left.
        return next((ns for ns in map(_ended_ns, dump.records) if ns is not None), dump.at_ns)
    times = [ns for ns in map(_begun_ns, dump.records) if ns is not None]
    return min([*times, *(release_ns for _, release_ns, _ in dump.running), dump.at_ns])


def _jobs(dump: BlackBoxDump) -> tuple[Job, ...]:
    raw = [(r[1], r[2], r[3], r[4], r[5]) for r in dump.records if r[0] == JOB]
    # The innermost ends first.
    raw += [(task, release_ns, start_ns, dump.at_ns, Outcome.RUNNING)
            for task, release_ns, start_ns in reversed(dump.running)]
    found, depths = slices([Span(start_ns, end_ns) for _, _, start_ns, end_ns, _ in raw],
                           _begin_ns(dump) if dump.full else None)
    late = _late(dump, raw)
    # If an event releases a running task again, its first release time is overwritten.
    jobs = [Job(task, min(release_ns, start_ns), start_ns, end_ns,
                Outcome(outcome) if 0 <= outcome <= Outcome.RUNNING else Outcome.FAILED,
                tuple(found[index]), depths[index], late.get(index, 0))
            for index, (task, release_ns, start_ns, end_ns, outcome) in enumerate(raw)]
    return tuple(sorted(jobs, key=lambda job: (job.start_ns, job.depth)))


def _late(dump: BlackBoxDump, raw: Sequence[tuple[int, int, int, int, int]]) -> dict[int, int]:
    """Return the jobs that missed their deadlines: the last one released before each miss."""
    of_task: dict[int, list[tuple[int, int]]] = {}
    for index, (task, release_ns, *_) in enumerate(raw):
        of_task.setdefault(task, []).append((release_ns, index))
    for releases in of_task.values():
        releases.sort()
    late: dict[int, int] = {}
    for record in dump.records:
        if record[0] == MISS:
            releases = of_task.get(record[1], [])
            at = bisect_left(releases, (record[2],)) - 1
            if at >= 0 and raw[releases[at][1]][3] >= record[2] - record[3]:
                index = releases[at][1]
                late[index] = max(late.get(index, 0), record[3])
    return late


def _moments(dump: BlackBoxDump, kinds: Sequence[str]) -> tuple[tuple[Moment, ...],
                                                                dict[str, int]]:
    moments: list[Moment] = []
    unknown: Counter[str] = Counter()
    for record in dump.records:
        kind = record[0]
        if kind == PUBLISH:
            moments.append(Moment(kind, record[1], record[2], record[3], record[4]))
        elif kind in (INTERRUPT, MARK):
            moments.append(Moment(kind, record[1], record[2], record[3]))
        elif kind in (OVERRUN, ABORT, MISS):
            moments.append(Moment(kind, record[1], record[2], '', record[3]))
        elif kind >= len(KINDS):
            unknown[kind_name(kind, kinds)] += 1
    return tuple(sorted(moments, key=attrgetter('at_ns'))), dict(unknown)


def _blocked(dump: BlackBoxDump, jobs: Sequence[Job]) -> tuple[Blocked, ...]:
    by_release = sorted(jobs, key=attrgetter('release_ns'))
    releases = [job.release_ns for job in by_release]
    found = []
    for record in dump.records:
        if record[0] != BLOCKED:
            continue
        _, task, at_ns, late_ns = record
        first = bisect_left(releases, at_ns - late_ns)
        last = bisect_right(releases, at_ns)
        victims = {job.task for job in by_release[first:last]
                   if dump.tasks[job.task].priority > dump.tasks[task].priority}
        found.append(Blocked(task, at_ns - late_ns, at_ns, tuple(sorted(
            victims, key=lambda index: -dump.tasks[index].priority))))
    return tuple(sorted(found, key=attrgetter('at_ns')))
