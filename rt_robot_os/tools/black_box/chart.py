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


"""The content of a plot of a dump, as boxes and marks; ``chart_drawing`` draws it."""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import field

from rt_robot_os.base.errors import BlackBoxError
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.kernel.black_box import ABORT
from rt_robot_os.kernel.black_box import INTERRUPT
from rt_robot_os.kernel.black_box import MARK
from rt_robot_os.kernel.black_box import OVERRUN
from rt_robot_os.kernel.black_box import PUBLISH
from rt_robot_os.tools.black_box.history import History
from rt_robot_os.tools.black_box.history import Job
from rt_robot_os.tools.black_box.history import Outcome
from rt_robot_os.tools.black_box.text_report import duration
from rt_robot_os.tools.black_box.text_report import fault_ns

DEFAULT_NS = 50 * NS_PER_MS
_AFTER_FAULT_NS = 10 * NS_PER_MS
_RECENT_NS = NS_PER_S

Box = tuple[float, float]  # start and length in ms; before the dump the start is negative


@dataclass
class Row:
    """One task, or one resource."""

    label: str
    running: list[Box] = field(default_factory=list)
    late: list[Box] = field(default_factory=list)
    preempted: list[Box] = field(default_factory=list)
    waiting: list[Box] = field(default_factory=list)
    blocking: list[Box] = field(default_factory=list)
    held: list[Box] = field(default_factory=list)
    releases: list[float] = field(default_factory=list)
    publications: list[float] = field(default_factory=list)
    interrupts: list[float] = field(default_factory=list)
    overruns: list[float] = field(default_factory=list)
    faults: list[tuple[float, str]] = field(default_factory=list)
    notes: list[tuple[float, str]] = field(default_factory=list)


@dataclass(frozen=True)
class Chart:
    """
    The content of a plot.

    :ivar from_ms: its left edge, relative to the dump.
    :ivar rows: from top to bottom: tasks by priority, then resources.
    :ivar quiet: tasks without activity in this time.
    """

    title: str
    from_ms: float
    to_ms: float
    rows: tuple[Row, ...]
    quiet: tuple[str, ...]
    marks: tuple[tuple[float, str], ...]


def window(history: History) -> tuple[int, int]:
    """Choose the time to show: around a fault in the last second, else the end."""
    at_ns = fault_ns(history)
    to_ns = history.to_ns
    if at_ns is not None and to_ns - at_ns < _RECENT_NS:
        to_ns = min(to_ns, at_ns + _AFTER_FAULT_NS)
    return max(history.from_ns, to_ns - DEFAULT_NS), to_ns


def chart_of(history: History, from_ns: int, to_ns: int) -> Chart:
    """
    Select the activity between two times.

    :raises BlackBoxError: there is none.
    """
    return _Chart(history, from_ns, to_ns).chart()


class _Chart:
    def __init__(self, history: History, from_ns: int, to_ns: int) -> None:
        self._history = history
        self._from_ns = from_ns
        self._to_ns = to_ns
        self._rows = {index: Row(f'{task.name}\n{task.priority}')
                      for index, task in enumerate(history.tasks)}
        self._busy: set[int] = set()

    def chart(self) -> Chart:
        history = self._history
        for job in history.between(self._from_ns, self._to_ns):
            self._busy.add(job.task)
            self._job(self._rows[job.task], job)
        marks = self._moments()
        for blocked in history.blocked:
            row = self._rows[blocked.task]
            self._box(row.blocking, blocked.from_ns, blocked.at_ns)
            if self._inside(blocked.from_ns):
                row.notes.append((self._ms(blocked.from_ns), 'native call blocks '
                                  + history.held_up_by(blocked) + ' '
                                  + duration(blocked.at_ns - blocked.from_ns)))
        order = sorted(self._busy, key=lambda i: (-history.tasks[i].priority, i))
        if not order:
            raise BlackBoxError(
                f'nothing ran from {self._ms(self._from_ns):.3f} to {self._ms(self._to_ns):.3f} '
                f'ms; the dump covers {self._ms(history.from_ns):.3f} to 0 ms')
        return Chart(
            title=history.dump.reason, from_ms=self._ms(self._from_ns),
            to_ms=self._ms(self._to_ns),
            rows=(*(self._rows[index] for index in order), *self._resources()),
            quiet=tuple(task.name for index, task in enumerate(history.tasks)
                        if index not in self._busy), marks=tuple(marks))

    def _ms(self, at_ns: int) -> float:
        return (at_ns - self._history.to_ns) / NS_PER_MS

    def _inside(self, at_ns: int) -> bool:
        return self._from_ns <= at_ns <= self._to_ns

    def _box(self, boxes: list[Box], from_ns: int, to_ns: int) -> None:
        """Add the part of a box inside the plot."""
        first_ns, last_ns = max(from_ns, self._from_ns), min(to_ns, self._to_ns)
        if first_ns < last_ns:
            boxes.append((self._ms(first_ns), (last_ns - first_ns) / NS_PER_MS))

    def _job(self, row: Row, job: Job) -> None:
        if self._inside(job.release_ns):
            row.releases.append(self._ms(job.release_ns))
        self._box(row.waiting, job.release_ns, job.start_ns)
        bad = job.late_ns > 0 or job.outcome in (Outcome.FAILED, Outcome.ABORTED)
        for from_ns, to_ns in job.slices:
            self._box(row.late if bad else row.running, from_ns, to_ns)
        for (_, from_ns), (to_ns, _) in zip(job.slices, job.slices[1:]):
            self._box(row.preempted, from_ns, to_ns)
        if not self._inside(job.end_ns):
            return
        if job.outcome == Outcome.FAILED:
            row.faults.append((self._ms(job.end_ns), 'failed'))
        if job.outcome == Outcome.ABORTED:
            row.faults.append((self._ms(job.end_ns), 'aborted'))
        elif job.late_ns:
            row.faults.append((self._ms(job.end_ns), f'{duration(job.late_ns)} late'))

    def _moments(self) -> list[tuple[float, str]]:
        marks = []
        for moment in self._history.moments:
            if not self._inside(moment.at_ns):
                continue
            at_ms = self._ms(moment.at_ns)
            if moment.kind == MARK:
                marks.append((at_ms, moment.text))
            if moment.task < 0:
                continue
            row = self._rows[moment.task]
            known = {PUBLISH: row.publications, INTERRUPT: row.interrupts, OVERRUN: row.overruns}
            if moment.kind in known:
                known[moment.kind].append(at_ms)
            if moment.kind in (ABORT, OVERRUN):
                self._busy.add(moment.task)
        return marks

    def _resources(self) -> list[Row]:
        rows: dict[str, Row] = {}
        for hold in self._history.holds:
            if hold.enter_ns < self._to_ns and hold.leave_ns > self._from_ns:
                row = rows.setdefault(hold.resource, Row(f'{hold.resource}\nresource'))
                self._box(row.held, hold.enter_ns, hold.leave_ns)
                name = self._history.tasks[hold.task].name
                if self._inside(hold.enter_ns):
                    row.notes.append((self._ms(hold.enter_ns), name))
        return [rows[name] for name in sorted(rows)]
