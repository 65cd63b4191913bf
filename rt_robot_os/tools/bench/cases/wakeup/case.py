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

"""The case `wakeup`: how late an idle process wakes, beside a bare loop and cyclictest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.tools.bench import facts
from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.cases import common
from rt_robot_os.tools.bench.plot import Plot
from rt_robot_os.tools.bench.plot import tail
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Column
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.result import Target

_PERIOD_NS = NS_PER_MS
_WARMUP_NS = 300 * NS_PER_MS
_SPIN_NS = 100 * NS_PER_US
_SUBJECTS = f'{__package__}.subjects'

_COLUMNS = (
    Column('p50', 'p50', 'us', 'late'), Column('p50', 'p50 range', 'us', 'late', spread=True),
    Column('p99', 'p99', 'us', 'late'), Column('p99', 'p99 range', 'us', 'late', spread=True),
    Column('p999', 'p99.9', 'us', 'late'), Column('maximum', 'max', 'us', 'late'),
    Column('cpu', 'process', '%', 'CPU'))
_NOTES = (
    'Period 1 ms, one CPU, SCHED_FIFO 80, nothing else to do. Late: from the point on the grid',
    'to the first line after waking. The kernel: sigwaitinfo, release, statistics, dispatch.',
    'spin: it wakes 100 us early and waits awake for the release, so that it is to be half as',
    'late as the loop that sleeps; its p99 only no later: when the host has the CPU, being awake',
    'does not help, and the plain loop that spins is late as well. cpu_dma_latency 0:',
    '/dev/cpu_dma_latency held at 0: the CPU does not idle deeply (often without effect in a',
    'virtual machine). cyclictest (rt-tests) is C; its CPU time is not taken.')


def _plan(options: BenchOptions) -> Sequence[Run]:
    def run(key: str, label: str, subject: str, spin_ns: int = 0, dma_latency_us: int = -1) -> Run:
        return Run(key, label, f'{_SUBJECTS}:{subject}', {
            'period_ns': _PERIOD_NS, 'warmup_ns': _WARMUP_NS, 'spin_ns': spin_ns,
            'dma_latency_us': dma_latency_us, 'measure_ns': options.measure_ns},
            common.START_S + _WARMUP_NS / NS_PER_S + options.seconds)

    return (
        run('floor', 'clock_nanosleep loop', 'floor'),
        run('cyclictest', 'cyclictest', 'cyclictest'),
        run('kernel', common.KERNEL_LABEL, 'kernel'),
        run('spin', '  spin 100 us', 'kernel', _SPIN_NS),
        run('floor spin', 'plain loop, spin 100 us', 'spin', _SPIN_NS),
        *(() if options.quick else (run('power', '  cpu_dma_latency 0', 'kernel', 0, 0),)),
    )


def _evaluate(options: BenchOptions, outcomes: Outcomes) -> CaseResult:
    late = common.tails_of('late_ns')
    rows = [outcomes.row(key, {**late, 'cpu': common.figure('cpu_percent')})
            for key in outcomes.runs]
    targets = (
        Target('p99 / p99 of the clock_nanosleep loop', 1.3,
               outcomes.ratio('kernel', 'floor', late['p99']),
               why=common.disturbances(outcomes, 'kernel')),
        Target('p50 with spin / p50 of the loop', 0.5,
               outcomes.ratio('spin', 'floor', late['p50']),
               why=common.disturbances(outcomes, 'spin')),
        Target('p99 with spin / p99 of the loop', 1.0,
               outcomes.ratio('spin', 'floor', late['p99']),
               why='the host or another process takes the CPU while it spins; '
               + common.disturbances(outcomes, 'spin')))
    series = [tail(run.label.strip() if run.label[0] != ' ' else f'rt_robot_os,{run.label[1:]}',
                   np.concatenate([o.samples['late_ns'] for o in outcomes.measured(key)]), 1e3)
              for key, run in outcomes.runs.items() if outcomes.measured(key)]
    plot = Plot('late', 'How late a sleeping process wakes', 'late, us',
                'part of the wake-ups that is later', series,
                'Further left and lower is better.', True, True)
    found = {facts.LATE: ('kernel', 'p50'), facts.LATE_P99: ('kernel', 'p99'),
             facts.WAKE_LATE: ('floor', 'p50'), facts.WAKE_LATE_P99: ('floor', 'p99')}
    return CaseResult(
        CASE.name, CASE.title, (Table('', _COLUMNS, rows, _NOTES),), targets, (plot,),
        facts={name: outcomes.metric(key, late[part]) for name, (key, part) in found.items()})


CASE = Case('wakeup', 'waking from idle, beside clock_nanosleep and cyclictest', _plan,
            _evaluate, docs_repeats=3)
