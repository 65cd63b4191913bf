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

"""A report for people, 100 columns wide."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence

from rt_robot_os.tools.plan.blocking import NATIVE
from rt_robot_os.tools.plan.blocking import WHOLE_JOB
from rt_robot_os.tools.plan.chain_text import chain_lines
from rt_robot_os.tools.plan.chain_text import verdict_text
from rt_robot_os.tools.plan.phases import Peak
from rt_robot_os.tools.plan.report import Report
from rt_robot_os.tools.plan.result import TaskResult
from rt_robot_os.tools.plan.result import Verdict
from rt_robot_os.tools.plan.sensitivity import FACTOR_MAXIMUM
from rt_robot_os.tools.plan.sensitivity import Sensitivity
from rt_robot_os.tools.plan.text_table import ms
from rt_robot_os.tools.plan.text_table import percent
from rt_robot_os.tools.plan.text_table import table
from rt_robot_os.tools.plan.text_table import wrapped

THROTTLED = 0.95
_MARKS = {'declared': 'd', 'measured': 'm', 'budget': 'b', 'option': 'o',
          'typical': 't', 'unknown': ' '}
_NAMES_SHOWN = 8


def report_lines(report: Report) -> Iterator[str]:
    """Write everything: the table, what follows from it, what to do."""
    yield from _task_lines(report)
    yield ''
    yield from _blocking_lines(report)
    yield from _chain_lines(report)
    yield from _idle_lines(report)
    yield from wrapped(_utilisation(report))
    yield from wrapped(_hyper_period(report))
    if report.sensitivity is not None:
        yield from _sensitivity_lines(report.sensitivity, report)
    yield from _phase_lines(report)
    yield from _exceeded_lines(report)
    for chain in report.chains:
        yield from chain_lines(chain)
    for note in report.robot.notes:
        yield from wrapped(f'note: {note}')
    yield ''
    yield from verdict_lines(report)


# ---- tasks -------------------------------------------------------------------------------------

def _task_lines(report: Report) -> Iterator[str]:
    headings = ('task', 'prio', 'period\nms', 'C  \nms  ', 'U\n%', 'blocked\nms', 'jitter\nms',
                'response\nms', 'deadline\nms', 'margin\n%', 'verdict')
    rows = [_row(result, report.robot.origins[result.task.name])
            for result in report.analysis.tasks]
    yield from table(headings, rows, left=(0, 10))
    used = dict.fromkeys(report.robot.origins.values())
    legend = [f'{origin} ({mark})' for origin, mark in _MARKS.items()
              if origin in used and mark.strip()]
    origins = f' C is {", ".join(legend)}.' if legend else ''
    yield ''
    yield from wrapped(
        'C: longest computing time of a job. Blocked: by one task below. Jitter: how late it may '
        f'be released. Margin: of the deadline. ?: not known. -: none.{origins}')


def _row(result: TaskResult, origin: str) -> tuple[str, ...]:
    task = result.task
    limit_ns, response_ns = task.limit_ns, result.response_ns
    unknown = result.verdict is Verdict.UNKNOWN
    return (
        task.name, str(task.priority), ms(task.period_ns) if task.period_ns else 'event',
        '?  ' if task.execution_ns is None else f'{ms(task.execution_ns)} {_MARKS[origin]}',
        '?' if result.utilisation is None else percent(result.utilisation),
        '?' if result.blocking.unknown else (
            ms(result.blocking.length_ns) if result.blocking.length_ns else '-'),
        ms(result.jitter_ns) if result.jitter_ns else '-',
        ('?' if unknown else 'no end') if response_ns is None else ms(response_ns),
        ms(limit_ns) if limit_ns else '-',
        percent(-result.late_ns / limit_ns) if limit_ns and response_ns is not None else '-',
        result.verdict.value.upper() if result.verdict.bad and task.judged
        else result.verdict.value)


def _blocking_lines(report: Report) -> Iterator[str]:
    groups: dict[tuple[str, str, int], list[str]] = {}
    for result in report.analysis.tasks:
        b = result.blocking
        if b.length_ns:
            groups.setdefault((b.by, b.what, b.length_ns), []).append(result.task.name)
    for (by, what, length_ns), names in groups.items():
        how = {NATIVE: 'in a native call', WHOLE_JOB: 'in a job that nothing preempts'}.get(
            what, f'inside {what!r}')
        yield from wrapped(f'blocked by {by!r}, {ms(length_ns)} ms {how}: {_names(names)}')


def _idle_lines(report: Report) -> Iterator[str]:
    """Yield why tasks without a deadline have no bound; it does no harm."""
    reasons: dict[str, list[str]] = {}
    for result in report.analysis.tasks:
        if not result.task.limit_ns and result.response_ns is None and not result.verdict.bad:
            # Of those that wait for one another the first reason is enough.
            waits, _, root = result.reason.partition("': ")
            reason = root if waits.startswith('it may wait') and root else result.reason
            reasons.setdefault(reason, []).append(result.task.name)
    for reason, names in reasons.items():
        yield from wrapped(f'without a bound, and without a deadline: {_names(names)}: {reason}')


def _chain_lines(report: Report) -> Iterator[str]:
    for result in report.analysis.tasks:
        sources = [event.source for event in result.task.events if event.source]
        if result.chain_ns is not None and sources and result.task.judged:
            yield from wrapped(
                f'{result.task.name!r} has ended at most {ms(result.chain_ns)} ms after what '
                f'wakes it was due ({_names(list(dict.fromkeys(sources)))})')


def _names(names: Sequence[str]) -> str:
    shown = ', '.join(names[:_NAMES_SHOWN])
    more = len(names) - _NAMES_SHOWN
    return f'{shown} and {more} more' if more > 0 else shown


# ---- the whole ---------------------------------------------------------------------------------

def _utilisation(report: Report) -> str:
    analysis, overhead = report.analysis, report.robot.overhead
    unknown = [r.task.name for r in analysis.tasks if r.utilisation is None]
    without = f', without {_names(unknown)}' if unknown else ''
    text = (f'utilisation: {percent(analysis.utilisation)} % of one CPU{without}; '
            f'{percent(analysis.overhead)} % of it the kernel itself, at '
            f'{overhead.job_ns / 1000:g} us a job and {overhead.tick_ns / 1000:g} us a tick')
    if analysis.service:
        text += (f". The core's own tasks: {percent(analysis.service)} %, if each of their jobs "
                 'took its longest time')
    if analysis.utilisation > THROTTLED:
        text += ('. Linux holds a real-time process that computes more than 95 % of the time up '
                 'for 50 ms a second (kernel.sched_rt_runtime_us): compute less')
    return text


def _hyper_period(report: Report) -> str:
    if report.hyper_period_ns is None:
        return ('hyper-period: beyond 1e18 ns (31 years): the periods have no common multiple '
                'worth the name')
    return f'hyper-period: {report.hyper_period_ns / 1e9:g} s, then all releases repeat'


def _sensitivity_lines(found: Sensitivity, report: Report) -> Iterator[str]:
    if found.factor >= FACTOR_MAXIMUM:
        yield f'growth: all execution times may be {FACTOR_MAXIMUM:g} times as long'
    elif found.factor >= 1:
        what = (f'{found.breaks!r} is the first to be late' if found.breaks
                else 'there is more work than time')
        yield from wrapped(
            f'growth: all execution times together may grow by a factor of {found.factor:.2f}; '
            f'beyond that {what}. One alone may grow to'
            + (f' (of the {len(found.growth)} that use most):' if found.left_out else ':'))
    elif found.factor:
        yield f'growth: all execution times have to shrink to {found.factor:.0%}'
    known = {task.name: task.execution_ns for task in report.robot.tasks}
    rows = []
    for growth in found.growth:
        now_ns = known[growth.task] or 1
        if growth.execution_ns is not None:
            factor = growth.execution_ns / now_ns
            rows.append((f'  {growth.task}', ms(now_ns), ms(growth.execution_ns),
                         f'{factor:.1f}' if factor < FACTOR_MAXIMUM else f'> {FACTOR_MAXIMUM:g}',
                         growth.breaks or '(more work than time)'))
    if rows:
        yield ''
        yield from table(('  task', 'C, ms', 'up to, ms', 'factor', 'then late'), rows,
                         left=(0, 4))
        yield ''


def _phase_lines(report: Report) -> Iterator[str]:
    plan = report.phases
    yield from wrapped(f'released at one instant: {_peak(plan.before)}')
    if not plan.better:
        return
    changed = {task.name: plan.phases_ns[task.name] for task in report.robot.tasks
               if task.name in plan.phases_ns and plan.phases_ns[task.name] != task.phase_ns}
    yield from wrapped(
        f'with these phases: {_peak(plan.after)}. The bounds above hold for any phases; these '
        'lower what usually comes together:')
    for name, phase_ns in changed.items():
        yield f'    {name}: {{phase_us: {phase_ns / 1000:.1f}}}'


def _peak(peak: Peak) -> str:
    count = len(peak.tasks)
    work = f' with {ms(peak.work_ns)} ms of work' if peak.work_ns else ''
    return f'at most {count} task{"s" if count != 1 else ""}{work} ({_names(peak.tasks)})'


def _exceeded_lines(report: Report) -> Iterator[str]:
    """Compare with what was measured: a bound that was exceeded is wrong."""
    for result in report.analysis.tasks:
        measured_ns = report.robot.responses_ns.get(result.task.name, 0)
        if result.response_ns is not None and measured_ns > result.response_ns:
            yield from wrapped(
                f'note: {result.task.name}: a response of {ms(measured_ns)} ms was measured, more '
                f'than the bound of {ms(result.response_ns)} ms: other programs or the host took '
                'the CPU away, or a time is too low')


# ---- verdict -----------------------------------------------------------------------------------

def verdict_lines(report: Report) -> Iterator[str]:
    """Say in words whether the set is schedulable, and what to do first."""
    analysis = report.analysis
    overloaded = [r.task.name for r in analysis.failed if r.verdict is Verdict.OVERLOAD]
    for result in analysis.failed:
        if result.task.name in overloaded[1:]:
            continue
        below = f'; nothing is left for {_names(overloaded[1:])}' if (
            result.task.name in overloaded[:1] and overloaded[1:]) else ''
        yield from wrapped(f'not schedulable: {failure_text(result)}{below}')
    if report.remedy:
        yield from wrapped(f'first thing to do: {report.remedy}')
    if analysis.unjudged:
        yield from _unjudged_lines(report)
    for chain in report.chains:
        if chain.late or chain.unjudged:
            yield from wrapped(verdict_text(chain))
    if report.exit_code == 0:
        judged = [r for r in analysis.tasks if r.task.limit_ns and r.response_ns is not None]
        if not judged:
            yield 'nothing to judge: no task has a deadline'
            return
        least = min(judged, key=lambda r: -r.late_ns / r.task.limit_ns)
        yield from wrapped(
            f'schedulable: every task ends before its deadline; the least margin has '
            f'{least.task.name!r}: {ms(least.response_ns or 0)} ms of {ms(least.task.limit_ns)} '
            f'ms, {percent(-least.late_ns / least.task.limit_ns)} % left')


def failure_text(result: TaskResult) -> str:
    """Return what is wrong with a task, with its numbers."""
    name, limit_ns = result.task.name, result.task.limit_ns
    if result.response_ns is None or not limit_ns:
        return f'task {name!r}: {result.reason}'
    if result.verdict is Verdict.SKIPPED:
        return (f'task {name!r} may need {ms(result.response_ns)} ms, and its period is '
                f'{ms(result.task.period_ns)} ms: {result.reason}')
    return (f'task {name!r} may need {ms(result.response_ns)} ms of its {ms(limit_ns)} ms '
            f'deadline: {ms(result.late_ns)} ms too long')


def _unjudged_lines(report: Report) -> Iterator[str]:
    reasons: dict[str, list[str]] = {}
    for result in report.analysis.unjudged:
        reasons.setdefault(result.reason, []).append(result.task.name)
    for reason, names in reasons.items():
        yield from wrapped(f'not judged: {_names(names)}: {reason}')
    if any(origin == 'unknown' for origin in report.robot.origins.values()):
        yield from wrapped(
            'to know execution times: plan --measure 10, or execution_us in the section of the '
            'device or module, or budget_us with on_budget: abort, or --execution NAME=US')
