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

"""The case `stability` (paper 1, test 4): three modules for hours, a row a minute."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from pathlib import Path

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
from rt_robot_os.tools.bench.case import Samples
from rt_robot_os.tools.bench.cases import common
from rt_robot_os.tools.bench.cases.stability.subjects import measured_s
from rt_robot_os.tools.bench.cases.stability.subjects import read_csv
from rt_robot_os.tools.bench.machine_state import away
from rt_robot_os.tools.bench.plot import Plot
from rt_robot_os.tools.bench.plot import Series
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Column
from rt_robot_os.tools.bench.result import published_values
from rt_robot_os.tools.bench.result import RunStatus
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.result import Target

_WARMUP_NS = 600 * NS_PER_MS
_QUICK_S = 3.0
_PEER_S = 20.0
_ROW_S = 60.0
_FLOOR = 'floor'
_MISSED_PERCENT = 0.01
_RATES = (('acquire_hz', 1000), ('attitude_hz', 400), ('receive_hz', 200))
# Those that are released by time, and so can miss a release.
_PERIODIC = _RATES[:2]

_COLUMNS = (
    *(Column(name, f'{rate} Hz', 'Hz', 'worst row') for name, rate in _RATES),
    Column('delay_mean', 'mean', 'us', 'delay'), Column('delay_max', 'max', 'us', 'delay'),
    Column('error', 'max', 'deg', 'error'), Column('missed', 'all', '', 'missed'),
    Column('growth', 'growth', 'KB', 'memory'))
_NOTES = (
    'A 1000 Hz module acquires an Imu (simulated motion with noise), a 400 Hz module solves the',
    'attitude and publishes every second one, a receiver at 200 Hz compares it with the truth:',
    'delay from publishing to it. A row of figures a minute (a tenth of the time where that is',
    'shorter). Worst row: the frequency furthest from what was asked for. Growth: resident size,',
    'last row less the first (the black box fills in the first seconds). The paper: 24 h. An',
    'interrupted run goes on after its last row; the time between is not in the figures. Plain',
    'loop: for 20 s at the most. While the host of a virtual machine has the CPU, every program',
    'misses what is due; Linux counts that time, and the target is about the releases beside it.')


def _measure_s(options: BenchOptions) -> float:
    return _QUICK_S if options.quick and options.hours < 0.02 else options.hours * 3600


def _csv(options: BenchOptions, key: str) -> str:
    return str(Path(options.out) / f'stability-{key}.csv') if options.out else ''


def _plan(options: BenchOptions) -> Sequence[Run]:
    def run(key: str, label: str, subject: str, seconds: float, start_s: float,
            **more: str) -> Run:
        row_s = min(_ROW_S, seconds / 10)
        csv = _csv(options, key)
        before_s = measured_s(Path(csv)) if csv else 0.0
        # Less than a row is no more worth starting for.
        left_s = seconds - before_s if seconds - before_s > row_s / 2 else 0.0
        return Run(key, label, f'{__package__}.{subject}', {
            'warmup_ns': _WARMUP_NS, 'measure_ns': round(left_s * NS_PER_S), 'from_s': before_s,
            'row_ns': round(row_s * NS_PER_S), 'csv': csv, **more},
            start_s + (_WARMUP_NS / NS_PER_S + left_s) * 1.01,
            *common.RCLPY_PLACES.get(key, (LAST_CPU, FIFO_PRIORITY)), once=True)

    total_s = _measure_s(options)
    peers = ('events',) if options.quick else common.RCLPY
    return (
        run('kernel', common.KERNEL_LABEL, 'subjects:kernel', total_s, common.START_S),
        run(_FLOOR, f'{common.LOOP_LABEL} of 1 kHz', 'subjects:rows',
            min(_PEER_S, total_s), common.START_S),
        *(run(name, common.RCLPY_LABELS[name], 'peers:executor', min(_PEER_S, total_s),
              common.START_PEER_S, executor=name) for name in peers))


def _partial(options: BenchOptions) -> Outcomes | None:
    """Take the rows that were written before the run ended."""
    outcomes = Outcomes(_plan(options))
    found = False
    for key in outcomes.runs:
        try:
            outcomes.add(key, RunOutcome(RunStatus.OK, '', read_csv(Path(_csv(options, key)))))
            found = True
        except (OSError, ValueError):
            outcomes.add(key, RunOutcome(RunStatus.MISSING, 'interrupted before it'))
    return outcomes if found else None


def _rows_of(name: str, of: Callable[[Samples], float]) -> common.Of:
    def take(outcome: RunOutcome) -> float | None:
        values = outcome.samples.get(name)
        return None if values is None or not len(values) else float(of(values))

    return take


def _worst_hz(name: str, rate: int) -> common.Of:
    def of(outcome: RunOutcome) -> float | None:
        values = outcome.samples.get(name)
        if values is None or not len(values):
            return None
        return float(values[np.argmax(np.abs(values - rate))])

    return of


def _missed(outcome: RunOutcome) -> float | None:
    """Return which part of the releases was missed while the CPU was there, in per cent."""
    samples, away_ms = outcome.samples, away(outcome.figures)
    if away_ms is None or not len(samples['missed']):
        return None
    releases_ms = sum(rate for _, rate in _PERIODIC) / 1000
    due = float(samples['time_s'][-1]) * 1000 * releases_ms
    return 100.0 * max(0.0, float(np.sum(samples['missed'])) - away_ms * releases_ms) / due


def _growth(outcome: RunOutcome) -> float | None:
    sizes = outcome.samples.get('resident_kb')
    return None if sizes is None or not len(sizes) else float(sizes[-1] - sizes[0])


_METRICS: Mapping[str, common.Of] = {
    **{name: _worst_hz(name, rate) for name, rate in _RATES},
    'delay_mean': _rows_of('delay_mean_us', np.mean),
    'delay_max': _rows_of('delay_max_us', np.max),
    'error': _rows_of('attitude_error_deg', np.max), 'missed': _rows_of('missed', np.sum),
    'growth': _growth}


def _evaluate(options: BenchOptions, outcomes: Outcomes) -> CaseResult:
    rows = [published_values('paper (STM32F4), 24 h', acquire_hz=999, attitude_hz=400,
                             receive_hz=194, delay_mean=30, delay_max=36)]
    for key in outcomes.runs:
        metrics = dict(_METRICS)
        if key not in ('kernel', _FLOOR):
            del metrics['missed']  # rclpy does not count them
        rows.append(outcomes.row(key, metrics))
    why = common.disturbances(outcomes, 'kernel')
    targets = (
        Target('mean delay', 30.0, outcomes.metric('kernel', _METRICS['delay_mean']), 'us',
               why=why,
               paper='28 to 32 us'),
        Target('releases missed while the CPU was there', _MISSED_PERCENT,
               outcomes.metric('kernel', _missed), '%', why=why, paper='3 % (200 Hz module)'))
    return CaseResult(CASE.name, CASE.title, (Table('', _COLUMNS, rows, _NOTES),), targets,
                      _plots(outcomes))


def _plots(outcomes: Outcomes) -> Sequence[Plot]:
    delays: dict[str, list[Series]] = {'mean': [], 'max': []}
    memory = []
    unit, unit_s = _time_unit(outcomes)
    for key, run in outcomes.runs.items():
        for outcome in outcomes.measured(key)[:1] if key != _FLOOR else ():
            moments = (outcome.samples['time_s'] / unit_s).tolist()
            for name, series in delays.items():
                series.append(Series(
                    run.label, moments,
                    np.maximum(outcome.samples[f'delay_{name}_us'], 0.1).tolist(), 'marks'))
            if key == 'kernel':
                memory.append(Series(run.label, moments,
                                     (outcome.samples['resident_kb'] / 1000).tolist(), 'marks'))
    return (Plot('delay', 'Mean delay of the attitude over time', f'time, {unit}', 'delay, us',
                 delays['mean'], 'Lower and flatter is better. A point is a row.', False, True),
            Plot('delay-max', 'Largest delay of the attitude over time', f'time, {unit}',
                 'delay, us', delays['max'], 'Lower is better. A point is a row.', False, True),
            Plot('memory', 'Memory of the process over time', f'time, {unit}', 'resident size, MB',
                 memory, 'Flat is right.', y_from_zero=True))


def _time_unit(outcomes: Outcomes) -> tuple[str, float]:
    longest_s = max((float(outcome.samples['time_s'][-1]) for key in outcomes.runs
                     for outcome in outcomes.measured(key) if len(outcome.samples['time_s'])),
                    default=0.0)
    return ('s', 1.0) if longest_s < 200 else ('min', 60.0) if longest_s < 12_000 else (
        'h', 3600.0)


CASE = Case('stability', 'three modules for a minute or --hours (paper 1, test 4)', _plan,
            _evaluate, _partial)
