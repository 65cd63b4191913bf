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

"""The case `load` (paper 1, test 3): how many modules of 200 Hz, and what a dispatch costs."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.frequency.case import by_module
import numpy as np

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.case import FIFO_PRIORITY
from rt_robot_os.tools.bench.case import LAST_CPU
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.case import UNPINNED
from rt_robot_os.tools.bench.cases import common
from rt_robot_os.tools.bench.plot import Plot
from rt_robot_os.tools.bench.plot import Series
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Column
from rt_robot_os.tools.bench.result import Metric
from rt_robot_os.tools.bench.result import published_values
from rt_robot_os.tools.bench.result import Requirement
from rt_robot_os.tools.bench.result import Row
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.result import Target
from rt_robot_os.tools.bench.stats import frequencies

RATE_HZ = 200
_NOTHING_PERCENT = 0.01
_PAPER = {20: (200, 0.0), 50: (199, 0.5), 80: (196, 2.0), 100: (193, 3.5)}
_EVERY, _EVERY_OF_MANY, _MANY = 2, 20, 100
_WINDOW_NS = 3 * NS_PER_S
_WARMUP_NS = 400 * NS_PER_MS
_FLOORS = (100, 1000)
_DISPATCH_TASKS = (10, 30, 100, 300, 1000)
_REQUIRED_ERROR = 0.5
# Of what a plain loop reaches.
_LIMIT_RATIO = 0.9995

_COLUMNS = (
    Column('mean', 'mean', 'Hz', 'frequency'), Column('lowest', 'lowest', 'Hz', 'frequency'),
    Column('mean_error', 'mean', '%', 'error'), Column('error', 'worst', '%', 'error'),
    Column('cpu', 'process', '%', 'CPU'))
_NOTES = (
    'Each module of 200 Hz adds and takes the messages of one topic that is published at 200 Hz,',
    'with a read pointer of its own (in rclpy one subscription serves all; threads and HORUS',
    'only add). All have the same priority and are released together. Every 2nd (20th) is',
    'stamped. MultiThreadedExecutor: all CPUs, no SCHED_FIFO; with them its threads starve each',
    'other. Frequency: of each module every 3 s, or over the whole run where that is shorter.',
    'Plain loop: it wakes up 200 times a second, publishes, and calls all modules one after the',
    'other. It loses what the host of a virtual machine takes, as the kernel does: targets are',
    'ratios to it.')
_COST_COLUMNS = (
    Column('p50', 'p50', 'us', 'CPU time a job'),
    Column('p50', 'range', 'us', 'CPU time a job', spread=True))
_COST_NOTES = ('CPU time of the whole process divided by the jobs, in stretches of 0.2 s; tasks',
               'of 200 Hz that do nothing, released together.')


def _counts(options: BenchOptions) -> Sequence[int]:
    return (100, 1000) if options.quick else (20, 50, 80, 100, 200, 500, 1000)


def _peer_counts(options: BenchOptions) -> Sequence[int]:
    return (100,) if options.quick else (20, 100)


def _plan(options: BenchOptions) -> Sequence[Run]:
    measure_ns = options.measure_ns

    def run(system: str, count: int, label: str, subject: str, start_s: float = common.START_S,
            cpu: int = LAST_CPU, priority: int = FIFO_PRIORITY, **more: str) -> Run:
        return Run(f'{system} {count}', f'{label}, {count}', f'benchmarks.frequency.{subject}', {
            'modules': [(RATE_HZ, 50)] * count, 'every': _every(count), 'receive': True,
            'warmup_ns': _WARMUP_NS, 'measure_ns': measure_ns, **more},
            start_s + _WARMUP_NS / NS_PER_S + options.seconds, cpu, priority)

    runs = [run('kernel', count, 'rt_robot_os', 'subjects:kernel')
            for count in _counts(options)]
    runs += [run('floor', count, common.LOOP_LABEL, 'floor:modules') for count in _FLOORS]
    for count in _peer_counts(options):
        runs += [run(name, count, common.RCLPY_LABELS[name], 'peers:executor',
                     common.START_PEER_S, *common.RCLPY_PLACES[name], executor=name)
                 for name in common.rclpy(options)]
        runs += [run('threads', count, common.THREADS_LABEL, 'threads:modules'),
                 run('horus', count, common.HORUS_LABEL, 'horus:modules', cpu=UNPINNED)]
    cost_s = max(0.4, options.seconds / 4)
    return (*runs, Run(
        'cost', 'cost of a dispatch', f'{__package__}.subjects:dispatch_curve',
        {'tasks': _DISPATCH_TASKS, 'rate_hz': RATE_HZ, 'warmup_ns': _WARMUP_NS // 4,
         'measure_ns': round(cost_s * NS_PER_S)},
        common.START_S + len(_DISPATCH_TASKS) * (_WARMUP_NS / 4 / NS_PER_S + cost_s)))


def _every(count: int) -> int:
    return _EVERY if count <= _MANY else _EVERY_OF_MANY


def _actual(outcome: RunOutcome) -> np.ndarray:
    """Return a row for each module and a column for each window."""
    begin_ns = int(outcome.figures['begin_ns'])
    end_ns = begin_ns + int(outcome.figures['measure_ns'])
    modules = by_module(outcome)
    return np.array([frequencies(starts, _every(len(modules)), begin_ns, end_ns, _WINDOW_NS)
                     for starts in modules])


def _mean(outcome: RunOutcome) -> float:
    return float(_actual(outcome).mean())


def _error(outcome: RunOutcome) -> float:
    return float(np.abs(_actual(outcome) - RATE_HZ).max()) * 100 / RATE_HZ


_METRICS: dict[str, common.Of] = {
    'mean': _mean, 'lowest': lambda outcome: float(_actual(outcome).min()),
    'mean_error': lambda o: float(np.abs(_actual(o) - RATE_HZ).mean()) * 100 / RATE_HZ,
    'error': _error, 'cpu': common.figure('cpu_percent')}


def _evaluate(options: BenchOptions, outcomes: Outcomes) -> CaseResult:
    rows: list[Row] = []
    for count in _counts(options):
        if count in _PAPER:
            mean, error = _PAPER[count]
            rows.append(published_values(f'paper (FreeRTOS on STM32F4), {count}', mean=mean,
                                         mean_error=error))
        rows += [outcomes.row(key, _METRICS) for key in outcomes.runs
                 if key.endswith(f' {count}')]
    costs = [outcomes.row('cost', {'p50': common.part_of(f'{tasks}', 0.5)}, f'{tasks} tasks')
             for tasks in _DISPATCH_TASKS]
    targets = [Target(f'{count} modules: {which} frequency / plain loop', _LIMIT_RATIO,
                      outcomes.ratio(f'kernel {count}', f'floor {count}', of), at_most=False,
                      why=common.disturbances(outcomes, f'kernel {count}'), paper=paper)
               for count, which, of, paper in (
                (1000, 'mean', _mean, '193 of 200 Hz with 100 modules'),
                (1000, 'lowest', _METRICS['lowest'], ''),
                (100, 'lowest', _METRICS['lowest'], '3.5 % less in the mean'))]
    return CaseResult(
        CASE.name, CASE.title,
        (Table('', _COLUMNS, rows, _NOTES),
         Table('Cost of a dispatch', _COST_COLUMNS, costs, _COST_NOTES)), targets,
        (_plot(options, outcomes), _cost_plot(outcomes)), _requirements(outcomes))


def _requirements(outcomes: Outcomes) -> Sequence[Requirement]:
    requirements = []
    for count in (20, 100):
        systems = {
            'rt_robot_os': _metric(outcomes, f'kernel {count}'),
            'best rclpy': common.best(outcomes, [f'{name} {count}' for name in common.RCLPY],
                                      _error),
            'HORUS': _metric(outcomes, f'horus {count}'),
            'threads': _metric(outcomes, f'threads {count}')}
        requirements.append(Requirement(
            f'{count} modules of 200 Hz: worst frequency error 0.5 %', _REQUIRED_ERROR,
            '%', systems, case=CASE.name))
    return requirements


def _metric(outcomes: Outcomes, key: str) -> Metric | None:
    return outcomes.metric(key, _error) if key in outcomes.runs else None


def _plot(options: BenchOptions, outcomes: Outcomes) -> Plot:
    series = [Series('paper', list(_PAPER), [_lacking(mean) for mean, _ in _PAPER.values()],
                     'marks')]
    for system in ('kernel', 'floor', *common.RCLPY, 'threads', 'horus'):
        known = [(count, metric.median) for count in _counts(options)
                 if f'{system} {count}' in outcomes.runs
                 and (metric := outcomes.metric(f'{system} {count}', _mean)) is not None]
        if known:
            label = outcomes.runs[f'{system} {known[0][0]}'].label.rpartition(',')[0]
            series.append(Series(label, [x for x, _ in known],
                                 [_lacking(y) for _, y in known], 'marks'))
    return Plot('frequency', 'What modules of 200 Hz lack of their frequency', 'modules',
                'lacking frequency, %', series, 'Lower is better: the mean of all modules.', True,
                True, y_floor=(_NOTHING_PERCENT, '0.01 or less'),
                x_ticks=[(count, str(count)) for count in (20, 50, 100, 200, 500, 1000)])


def _lacking(mean_hz: float) -> float:
    """Return which part of the frequency is not reached, in per cent."""
    return max(_NOTHING_PERCENT, 100.0 * (1.0 - mean_hz / RATE_HZ))


def _cost_plot(outcomes: Outcomes) -> Plot:
    known = [(tasks, metric.median) for tasks in _DISPATCH_TASKS
             if (metric := outcomes.metric('cost', common.part_of(f'{tasks}', 0.5)))]
    return Plot('dispatch', 'Cost of a dispatch', 'tasks', 'CPU time a job, us',
                (Series('rt_robot_os', [x for x, _ in known], [y for _, y in known], 'marks'),),
                'Lower is better. All tasks are released together: one wake-up of the CPU is '
                'shared by all of them.', True, y_from_zero=True,
                x_ticks=[(tasks, str(tasks)) for tasks in _DISPATCH_TASKS])


CASE = Case('load', '20 to 1000 modules of 200 Hz, cost of a dispatch (paper 1, test 3)', _plan,
            _evaluate, docs_repeats=3)
