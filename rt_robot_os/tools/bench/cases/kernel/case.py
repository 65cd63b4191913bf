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

"""The case `kernel`: what its mechanisms cost, and how soon they act."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.cases import common
from rt_robot_os.tools.bench.plot import Plot
from rt_robot_os.tools.bench.plot import tail
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Column
from rt_robot_os.tools.bench.result import Metric
from rt_robot_os.tools.bench.result import Row
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.result import Target

_WARMUP_NS = 200 * NS_PER_MS
_PERIOD_NS = NS_PER_MS
_ABORT_PERIOD_NS, _ABORT_BUDGET_NS = 4 * NS_PER_MS, NS_PER_MS
_GARBAGE_PERIOD_NS = 4 * NS_PER_MS
_DISPATCH_TASKS = 100
_PS_PER_US = 1e6
_LATE = ('floor', 'interrupt', 'own', 'abort', 'strike', 'python', 'slack')
_LOOP = 'rt_robot_os.tools.bench.cases.wakeup.subjects:floor'
_SUBJECTS = f'{__package__}.subjects'

_COST_COLUMNS = common.cost_columns('cost', 'range')
_COST_NOTES = (
    'Means of blocks of 500 calls inside a job, the empty call taken off. The black box is always',
    'on; what it adds to a dispatch is the cost of its one record over that of a job without it',
    '(CPU time of a job, 100 tasks released together).')
_LATE_COLUMNS = (
    Column('p50', 'p50', 'us', 'delay'), Column('p99', 'p99', 'us', 'delay'),
    Column('p99', 'p99 range', 'us', 'delay', spread=True),
    Column('p999', 'p99.9', 'us', 'delay'), Column('maximum', 'max', 'us', 'delay'),
    Column('collections', 'count', '', 'collected'))
_LATE_NOTES = (
    'Abort: a task that computes for ever, budget 1 ms; from the end of the budget to',
    'TaskAborted in the task. Bare handler: the same with setitimer and a function of Python',
    'that raises; the kernel asks first whose budget it was, what of it the host or an interrupt',
    'took, and what the task wants. Interrupt: from just before the write to a pipe, 1 kHz, by a',
    'process on another CPU that wakes an idle kernel, or by a less important task that is',
    'thereby preempted, to the first line of the task. clock_nanosleep: a bare loop, 1 kHz.',
    'Garbage: a 250 Hz task over one that makes 100,000 objects in cycles a second, beside',
    '100,000 live dictionaries; Python collects when it likes, the core in idle time that is',
    'long enough (it needs a gap of 2 ms: beside a 1 kHz task nothing would be collected).')


def _plan(options: BenchOptions) -> Sequence[Run]:
    measure_ns = options.measure_ns

    def run(key: str, label: str, subject: str, **more: int | bool) -> Run:
        return Run(key, label, subject, {
            'warmup_ns': _WARMUP_NS, 'measure_ns': measure_ns, 'period_ns': _PERIOD_NS, **more},
            common.START_S + _WARMUP_NS / NS_PER_S + options.seconds)

    return (
        run('operations', 'operations', f'{_SUBJECTS}:operations'),
        run('dispatch', 'CPU time of a job', f'{_SUBJECTS}:dispatch',
            tasks=_DISPATCH_TASKS, rate_hz=200),
        run('floor', 'clock_nanosleep loop', _LOOP),
        run('interrupt', 'interrupt: another process writes', f'{_SUBJECTS}:interrupt', own=False),
        run('own', 'interrupt: a lower task writes', f'{_SUBJECTS}:interrupt', own=True),
        run('abort', 'abort at the end of a budget', f'{_SUBJECTS}:abort',
            period_ns=_ABORT_PERIOD_NS, budget_ns=_ABORT_BUDGET_NS),
        run('strike', '  exception of a bare handler',
            f'{_SUBJECTS}:strike', period_ns=_ABORT_PERIOD_NS,
            budget_ns=_ABORT_BUDGET_NS),
        run('python', "250 Hz, Python's garbage collector", f'{_SUBJECTS}:garbage',
            period_ns=_GARBAGE_PERIOD_NS, slack=False),
        run('slack', '250 Hz, garbage collected in slack', f'{_SUBJECTS}:garbage',
            period_ns=_GARBAGE_PERIOD_NS, slack=True),
    )


def _share(outcomes: Outcomes) -> Metric | None:
    """Return how much a record adds to a job without it, in per cent, repeat by repeat."""
    values = []
    for one, two in zip(outcomes.measured('operations'), outcomes.measured('dispatch')):
        record_us = common.part_of('record', 0.5, _PS_PER_US)(one)
        job_us = common.part_of('cpu_ns', 0.5)(two)
        if record_us is not None and job_us is not None and job_us > record_us:
            values.append(100.0 * record_us / (job_us - record_us))
    return Metric(tuple(values)) if values else None


def _cost(name: str, scale: float) -> dict[str, common.Of]:
    return {'p50': common.part_of(name, 0.5, scale), 'p10': common.part_of(name, 0.1, scale),
            'p90': common.part_of(name, 0.9, scale)}


def _evaluate(options: BenchOptions, outcomes: Outcomes) -> CaseResult:
    costs: list[Row] = [
        outcomes.row('operations', _cost('resource', _PS_PER_US), 'enter and leave a resource'),
        outcomes.row('operations', _cost('with', _PS_PER_US),
                     '  "with" an object that does nothing'),
        outcomes.row('operations', _cost('record', _PS_PER_US), 'a record of the black box'),
        outcomes.row('dispatch', _cost('cpu_ns', 1e3), 'beside: CPU time of a job')]
    late = common.tails_of('late_ns')
    lates = [outcomes.row(key, {**late, 'collections': common.figure('collections')})
             for key in _LATE]
    p99 = late['p99']
    targets = (
        Target('enter and leave a resource / an empty "with"', 5.0, outcomes.between(
            'operations', common.part_of('resource', 0.5), 'operations',
            common.part_of('with', 0.5)),
               why=common.disturbances(outcomes, 'operations')),
        Target('a black box record, part of a job without it', 15.0, _share(outcomes), '%',
               why=common.disturbances(outcomes, 'operations')),
        Target('abort after a budget, p99 / bare handler', 4.0,
               outcomes.ratio('abort', 'strike', p99),
               why=common.disturbances(outcomes, 'abort')),
        Target('interrupt by a lower task: p99 / clock_nanosleep', 2.0,
               outcomes.ratio('own', 'floor', p99), why=common.disturbances(outcomes, 'own')),
        Target('by another process: p99 / clock_nanosleep', 2.0,
               outcomes.ratio('interrupt', 'floor', p99),
               why='the write itself, in the other process, is in the delay; '
               + common.disturbances(outcomes, 'interrupt')))
    series = [tail(outcomes.runs[key].label, np.concatenate(
        [o.samples['late_ns'] for o in outcomes.measured(key)]), 1e3)
        for key in _LATE
        if outcomes.measured(key)]
    plot = Plot('late', 'How soon the mechanisms of the kernel act', 'delay, us',
                'part of the events that is later', series, 'Further left and lower is better.',
                True, True)
    return CaseResult(CASE.name, CASE.title, (
        Table('Costs', _COST_COLUMNS, costs, _COST_NOTES),
        Table('Delays', _LATE_COLUMNS, lates, _LATE_NOTES)), targets, (plot,))


CASE = Case('kernel', 'resources, aborts, interrupts, black box, garbage: costs and delays',
            _plan, _evaluate, docs_repeats=3)
