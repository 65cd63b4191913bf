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

"""The case `frequency` (paper 1, test 1): do four modules reach 2000, 1000, 500 and 200 Hz."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.case import FIFO_PRIORITY
from rt_robot_os.tools.bench.case import LAST_CPU
from rt_robot_os.tools.bench.case import Options
from rt_robot_os.tools.bench.case import Outcome
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.case import Samples
from rt_robot_os.tools.bench.case import UNPINNED
from rt_robot_os.tools.bench.cases import common
from rt_robot_os.tools.bench.plot import Plot
from rt_robot_os.tools.bench.plot import Series
from rt_robot_os.tools.bench.result import Aim
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Column
from rt_robot_os.tools.bench.result import Need
from rt_robot_os.tools.bench.result import quoted
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.stats import frequencies
from rt_robot_os.units import NS_PER_MS
from rt_robot_os.units import NS_PER_S

RATES_HZ = (2000, 1000, 500, 200)
_FLOOR_PERCENT = 1e-4
_WINDOW_NS = 3 * NS_PER_S
_WARMUP_NS = 300 * NS_PER_MS
_LIMIT_PERCENT = 0.05
_NEED_PERCENT = 0.5
# As in the paper: 500 Hz before 200 Hz before 1000 Hz before 2000 Hz.
_AS_PAPER = {2000: 20, 1000: 30, 500: 50, 200: 40}
_MONOTONIC = {2000: 50, 1000: 40, 500: 30, 200: 20}
_KERNELS = ('kernel', 'monotonic')

_COLUMNS = (
    *(Column(f'hz{rate}', f'{rate} Hz', 'Hz', 'worst window') for rate in RATES_HZ),
    Column('error', 'worst', '%', 'error'), Column('error', 'range', '%', 'error', spread=True),
    Column('cpu', 'process', '%', 'CPU'))
_NOTES = (
    'Four modules do an addition, each at its rate. The actual frequency is taken every 3 s (or',
    'over the whole run, where that is shorter); worst window: the lowest of them. Error: the',
    'largest of all modules and windows. The paper: priorities 500 > 200 > 1000 > 2000 Hz; the',
    'lowest of its samples, and its averages. In rclpy the order of timers cannot be chosen.',
    'One CPU, SCHED_FIFO (MultiThreadedExecutor: all CPUs, without; HORUS: all CPUs).')


def _plan(options: Options) -> Sequence[Run]:
    # Room for a whole window of 3 s in all but the quickest look.
    seconds = options.seconds if options.quick else max(options.seconds, 3.5)

    def run(key: str, label: str, worker: str, priorities: dict[int, int] | None = None,
            start_s: float = common.START_S, cpu: int = LAST_CPU,
            priority: int = FIFO_PRIORITY, **more: str) -> Run:
        chosen = priorities or _MONOTONIC
        return Run(key, label, f'rt_robot_os.tools.bench.{worker}', {
            'modules': [(rate, chosen[rate]) for rate in RATES_HZ], 'every': 1, 'receive': False,
            'warmup_ns': _WARMUP_NS, 'measure_ns': round(seconds * NS_PER_S), **more},
            start_s + _WARMUP_NS / NS_PER_S + seconds, cpu, priority)

    return (
        run('kernel', "rt_robot_os, the paper's order", 'workers.modules:kernel',
            _AS_PAPER),
        run('monotonic', 'rt_robot_os, rate-monotonic', 'workers.modules:kernel'),
        *(run(name, common.RCLPY_LABELS[name], 'peers.modules:executor', None,
              common.START_PEER_S, *common.RCLPY_PLACES[name], executor=name)
          for name in common.rclpy(options)),
        run('threads', common.THREADS_LABEL, 'workers.threads:modules'),
        run('horus', common.HORUS_LABEL, 'peers.horus:modules', cpu=UNPINNED),
    )


def by_module(outcome: Outcome) -> Sequence[Samples]:
    """Split the stamps of a run by module."""
    return np.split(outcome.samples['starts'], np.cumsum(outcome.samples['counts'])[:-1])


def _actual(outcome: Outcome) -> Sequence[tuple[int, np.ndarray]]:
    begin_ns = int(outcome.figures['begin_ns'])
    end_ns = begin_ns + int(outcome.figures['measure_ns'])
    return [(rate, frequencies(starts, 1, begin_ns, end_ns, _WINDOW_NS))
            for rate, starts in zip(RATES_HZ, by_module(outcome))]


def _worst_hz(index: int) -> common.Of:
    return lambda outcome: float(_actual(outcome)[index][1].min())


def _error(outcome: Outcome) -> float:
    return max(float(np.max(np.abs(found - rate))) * 100 / rate
               for rate, found in _actual(outcome))


def _evaluate(options: Options, outcomes: Outcomes) -> CaseResult:
    columns: dict[str, common.Of] = {
        **{f'hz{rate}': _worst_hz(i) for i, rate in enumerate(RATES_HZ)},
        'error': _error, 'cpu': common.figure('cpu_percent')}
    rows = [
        quoted('paper (STM32F4), lowest', hz2000=1894, hz1000=976, hz500=491,
               hz200=195, error=5.3),
        quoted('paper, average', hz2000=1907, hz1000=988, hz500=495, hz200=196, error=4.7),
        *(outcomes.row(key, columns) for key in outcomes.runs)]
    aims = [Aim(f'worst frequency error, {name}', _LIMIT_PERCENT, outcomes.metric(key, _error),
                '%', why=common.disturbances(outcomes, key), paper='4.7 % at 2000 Hz')
            for key, name in zip(_KERNELS, ("the paper's order", 'rate-monotonic'))]
    needs = (Need('four modules up to 2 kHz, nothing computes long: worst frequency error 0.5 %',
                  _NEED_PERCENT, '%', common.systems(outcomes, _error, 'monotonic'),
                  case=CASE.name),)
    return CaseResult(CASE.name, CASE.title, (Table('', _COLUMNS, rows, _NOTES),), aims,
                      (_plot(outcomes),), needs)


def _plot(outcomes: Outcomes) -> Plot:
    series = [Series('paper', RATES_HZ, [100 * abs(hz - rate) / rate for hz, rate in zip(
        (1907, 988, 495, 196), RATES_HZ)], 'marks')]
    for key, run in outcomes.runs.items():
        errors = []
        for i, rate in enumerate(RATES_HZ):
            metric = outcomes.metric(key, _worst_hz(i))
            if metric is not None:
                errors.append(max(_FLOOR_PERCENT, 100 * abs(metric.median - rate) / rate))
        if errors:
            series.append(Series(run.label, RATES_HZ,
                                 errors, 'marks'))
    return Plot('error', 'Frequency error of the four modules', 'frequency asked for, Hz',
                'frequency error, %', series,
                'Lower is better. Of the 3 s window with the lowest frequency.', True, True,
                x_ticks=[(rate, f'{rate:,}') for rate in RATES_HZ],
                y_floor=(_FLOOR_PERCENT, '0.0001 or less'))


CASE = Case('frequency', 'four modules at 2000, 1000, 500 and 200 Hz (paper 1, test 1)', _plan,
            _evaluate)
