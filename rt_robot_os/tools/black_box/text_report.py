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


"""Text report of a dump: its tasks, its last events, and those before the last fault."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from collections.abc import Iterator
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.kernel.black_box import ABORT
from rt_robot_os.kernel.black_box import INTERRUPT
from rt_robot_os.kernel.black_box import MISS
from rt_robot_os.kernel.black_box import OVERRUN
from rt_robot_os.kernel.black_box import PUBLISH
from rt_robot_os.tools.black_box.history import History
from rt_robot_os.tools.black_box.history import Job
from rt_robot_os.tools.black_box.history import Moment
from rt_robot_os.tools.black_box.history import Outcome

BEFORE_FAULT_NS = 50 * NS_PER_MS
# Less is the latency of the interrupt handler, not blocking by a task; the limit of the kernel.
BLOCKED_NS = 50 * NS_PER_US
_FAULTS = (Outcome.FAILED, Outcome.ABORTED)


def show(history: History, last: int = 40, facts: dict[str, str | int] | None = None) -> str:
    """
    Format the whole report.

    :param last: number of last events.
    """
    parts = [_head(history, facts or {}), _tasks(history), _blockers(history),
             _before_fault(history), _events(history, last)]
    return '\n\n'.join(part for part in parts if part) + '\n'


def duration(time_ns: int) -> str:
    """Format a duration in a suitable unit."""
    if abs(time_ns) < NS_PER_MS:
        return f'{time_ns / NS_PER_US:.0f} us'
    if abs(time_ns) < NS_PER_S:
        return f'{time_ns / NS_PER_MS:.1f} ms'
    return f'{time_ns / NS_PER_S:.2f} s'


def _head(history: History, facts: dict[str, str | int]) -> str:
    dump = history.dump
    lines = [f'black box: {dump.reason}']
    known = ', '.join(f'{key} {value}' for key, value in facts.items())
    if known:
        lines.append(f'  {known}')
    lines.append(f'  {len(dump.records)} records, {len(history.jobs)} jobs in '
                 f'{duration(history.to_ns - history.from_ns)}, until '
                 f'{duration(dump.at_ns - dump.start_ns)} after the start'
                 f'{", older ones overwritten" if dump.full else ""}')
    if history.unknown:
        lines.append('  left out, not known to this release: ' + ', '.join(
            f'{count} x {kind}' for kind, count in history.unknown.items()))
    running = [history.tasks[task].name for task, _, _ in dump.running]
    if running:
        lines.append(f'  running at that moment: {" < ".join(running)}')
    return '\n'.join(lines)


# ---- tasks -----------------------------------------------------------------------------------


@dataclass
class _Sum:
    jobs: int = 0
    latency_ns: int = 0
    response_ns: int = 0
    used_ns: int = 0
    late: int = 0
    faults: int = 0
    blocked: Counter[int] = field(default_factory=Counter)


def _sums(history: History) -> list[_Sum]:
    sums = [_Sum() for _ in history.tasks]
    for job in history.jobs:
        one = sums[job.task]
        one.jobs += 1
        one.latency_ns = max(one.latency_ns, job.latency_ns)
        one.response_ns = max(one.response_ns, job.response_ns)
        one.used_ns += job.execution_ns
        one.late += job.late_ns > 0
        one.faults += job.outcome in _FAULTS
        for task, time_ns in _blockers_of(history, job):
            one.blocked[task] = max(one.blocked[task], time_ns)
    return sums


def _tasks(history: History) -> str:
    span_ns = max(1, history.to_ns - history.from_ns)
    rows = [('prio', 'task', 'jobs', 'CPU', 'latency max', 'response max', 'late', 'faults',
             'blocked at most by')]
    for task, one in sorted(zip(history.tasks, _sums(history)), key=lambda p: -p[0].priority):
        who = ', '.join(f'{history.tasks[t].name} {duration(ns)}'
                        for t, ns in one.blocked.most_common(2))
        rows.append((
            str(task.priority), task.name, str(one.jobs), f'{100 * one.used_ns / span_ns:.1f} %',
            duration(one.latency_ns) if one.jobs else '-',
            duration(one.response_ns) if one.jobs else '-',
            str(one.late or '-'), str(one.faults or '-'), who or '-'))
    return '\n'.join(_table(rows, '>< >>>>>>'.replace(' ', '')))


def _blockers(history: History) -> str:
    found = sorted(history.blocked, key=lambda b: b.from_ns - b.at_ns)[:10]
    if not found:
        return ''
    lines = [f'native calls that held up others: {len(history.blocked)}, the longest:']
    for blocked in found:
        victims = history.held_up_by(blocked)
        lines.append(f'  {_at(history, blocked.at_ns)}  {history.tasks[blocked.task].name} for '
                     f'{duration(blocked.at_ns - blocked.from_ns)}: {victims}')
    return '\n'.join(lines)


# ---- events ----------------------------------------------------------------------------------


def _at(history: History, at_ns: int) -> str:
    return f'{(at_ns - history.to_ns) / NS_PER_MS:12.3f} ms'


def _lines(history: History, jobs: Iterable[Job], moments: Iterable[Moment],
           from_ns: int) -> list[str]:
    """Format events in order of time; a job has a start and an end."""
    found: list[tuple[int, int, str]] = []
    for job in jobs:
        name = history.tasks[job.task].name
        indent = '  ' * job.depth
        if job.start_ns >= from_ns:
            found.append((job.start_ns, job.depth, f'{indent}{name} starts{_wait(history, job)}'))
        if job.outcome != Outcome.RUNNING:
            found.append((job.end_ns, 1000 - job.depth, f'{indent}{name} {_end(job)}'))
    for moment in moments:
        found.append((moment.at_ns, 500, f'    * {_moment(history, moment)}'))
    for hold in history.holds:
        if hold.leave_ns >= from_ns:
            found.append((hold.leave_ns, 500, f'    * {history.tasks[hold.task].name} leaves '
                          f'{hold.resource} after {duration(hold.leave_ns - hold.enter_ns)}'))
    for blocked in history.blocked:
        if blocked.at_ns >= from_ns:
            victims = history.held_up_by(blocked)
            found.append((blocked.at_ns, 500, f'    * native call of '
                          f'{history.tasks[blocked.task].name} blocked {victims} for '
                          f'{duration(blocked.at_ns - blocked.from_ns)}'))
    return [f'{_at(history, at_ns)}  {text}' for at_ns, _, text in sorted(found)
            if at_ns >= from_ns]


def _wait(history: History, job: Job) -> str:
    text = f', {duration(job.latency_ns)} after its release'
    waits = _blockers_of(history, job)
    if waits:
        text += ' (blocked by ' + ', '.join(
            f'{history.tasks[task].name} {duration(time_ns)}' for task, time_ns in waits) + ')'
    return text


def _blockers_of(history: History, job: Job) -> list[tuple[int, int]]:
    """Return the tasks of lower priority that blocked a job, with the time, longest first."""
    return [(task, time_ns) for task, time_ns in history.blocked_by(job).most_common()
            if time_ns >= BLOCKED_NS]


def _end(job: Job) -> str:
    text = {Outcome.OK: 'ends', Outcome.FAILED: 'FAILS', Outcome.ABORTED: 'is ABORTED',
            }.get(job.outcome, 'ends')
    text += f', response {duration(job.response_ns)}'
    if len(job.slices) > 1:
        text += f', preempted {len(job.slices) - 1} x'
    if job.late_ns:
        text += f', LATE by {duration(job.late_ns)}'
    return text


def _moment(history: History, moment: Moment) -> str:
    who = history.tasks[moment.task].name if moment.task >= 0 else 'no task'
    if moment.kind == PUBLISH:
        return f'{who} publishes {moment.text} #{moment.value}'
    if moment.kind == INTERRUPT:
        return f'interrupt {moment.text} releases {who}'
    if moment.kind == OVERRUN:
        releases = 'release' if moment.value == 1 else 'releases'
        return f'{who} OVERRUN: {moment.value} {releases} found the job before unfinished'
    if moment.kind == ABORT:
        return f'{who} ABORTED after {duration(moment.value)} of computing'
    if moment.kind == MISS:
        return f'{who} MISSED its deadline by {duration(moment.value)}'
    return f'mark: {moment.text}'


def _events(history: History, last: int) -> str:
    lines = _lines(history, history.jobs, history.moments, history.from_ns)
    shown = lines[max(0, len(lines) - last):]
    if not shown:
        return ''
    return '\n'.join([f'last {len(shown)} of {len(lines)} events, in ms before the dump:', *shown])


def fault_ns(history: History) -> int | None:
    """Return the time of the last fault: a failure, an abort or a missed deadline."""
    times = [job.end_ns for job in history.jobs if job.outcome in _FAULTS]
    times += [m.at_ns for m in history.moments if m.kind in (ABORT, MISS)]
    return max(times, default=None)


def _before_fault(history: History) -> str:
    """Describe which tasks had the CPU before the last fault, and which waited."""
    at_ns = fault_ns(history)
    if at_ns is None:
        return ''
    from_ns = max(history.from_ns, at_ns - BEFORE_FAULT_NS)
    jobs = history.between(from_ns, at_ns)
    last = max((j for j in jobs if j.end_ns <= at_ns), key=lambda j: j.end_ns, default=None)
    lines = [f'the last {duration(at_ns - from_ns)} before the last fault'
             f' ({history.tasks[last.task].name if last else "?"}, '
             f'{_at(history, at_ns).strip()}):']
    for task, time_ns in history.who_ran(from_ns, at_ns).most_common():
        of_task = [job for job in jobs if job.task == task]
        lines.append(f'  {history.tasks[task].name}: {duration(time_ns)} of CPU in '
                     f'{len(of_task)} jobs')
    lines += [f'  {_at(history, ns)}  {text}'
              for ns, text in sorted(_remarkable(history, jobs, from_ns, at_ns))]
    return '\n'.join(lines)


def _remarkable(history: History, jobs: Sequence[Job], from_ns: int, at_ns: int
                ) -> Iterator[tuple[int, str]]:
    chosen = [job for job in jobs if job.outcome in _FAULTS or job.late_ns
              or sum(history.blocked_by(job).values()) >= 2 * BLOCKED_NS]
    for job in chosen[-20:]:
        yield job.end_ns, (f'{history.tasks[job.task].name} {_end(job)}; '
                           f'started{_wait(history, job)[1:]}')
    for moment in history.moments:
        if from_ns <= moment.at_ns <= at_ns and moment.kind in (OVERRUN, ABORT):
            yield moment.at_ns, _moment(history, moment)


def _table(rows: Sequence[Sequence[str]], align: str) -> Iterator[str]:
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    for row in rows:
        yield '  '.join(f'{cell:{side}{width}}' for cell, side, width
                        in zip(row, f'{align}<', widths)).rstrip()
