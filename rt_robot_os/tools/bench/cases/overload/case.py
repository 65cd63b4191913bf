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
"""The case `overload`: what each of twenty callbacks gets when they ask for up to ten CPUs."""

from __future__ import annotations

from collections.abc import Sequence

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.case import FIFO_PRIORITY
from rt_robot_os.tools.bench.case import LAST_CPU
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.cases import common
from rt_robot_os.tools.bench.cases.overload.subjects import TASKS
from rt_robot_os.tools.bench.plot import Plot
from rt_robot_os.tools.bench.plot import Series
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Column
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.result import Target

LOADS = (20, 50, 80, 120, 200, 500, 1000)
_WORK_NS = 100 * NS_PER_US
# What is judged takes a whole period of Linux's limit for real-time processes.
_JUDGED, _JUDGED_NS = 1000, NS_PER_S
_QUICK_S = 0.2
_FULL_S = 0.5
_SHOWN = (80, 200, 1000)
# Of what the most important of Python's threads gets: they lose the same to Linux and the host.
_LEAST_RATIO = 0.98
_COLUMNS = (
    *(Column(f'{which}{load}', name, '%', f'{load} % load') for load in _SHOWN
      for which, name in (('first', 'first'), ('last', 'last'))),
    *(Column(f'jobs{load}', f'{load} %', '1/s', 'calls') for load in _SHOWN))
_NOTES = (
    'Twenty callbacks that compute for 100 us each, at the same rate, which rises until together',
    'they ask for ten times what one CPU has. First and last: the callback of the highest and of',
    'the lowest priority (of rclpy: made first and last), in percent of the calls asked for.',
    'Linux takes 5 % of the CPU from real-time processes that compute all the time: the target is',
    'what twenty threads reach, which are alone on the same CPU with falling priorities of',
    'SCHED_FIFO.')


def _plan(options: BenchOptions) -> Sequence[Run]:
    seconds = _QUICK_S if options.quick else _FULL_S
    arguments = {'loads': LOADS, 'work_ns': _WORK_NS, 'measure_ns': round(seconds * NS_PER_S),
                 'longer_ns': {str(_JUDGED): _JUDGED_NS}}
    total_s = (seconds * (len(LOADS) - 1) + _JUDGED_NS / NS_PER_S) * 1.1

    def run(key: str, label: str, subject: str, start_s: float, **more: str) -> Run:
        return Run(key, label, f'{__package__}.{subject}', {**arguments, **more},
                   start_s + total_s, *common.RCLPY_PLACES.get(key, (LAST_CPU, FIFO_PRIORITY)))

    return (run('kernel', common.KERNEL_LABEL, 'subjects:kernel', common.START_S),
            *(run(name, common.RCLPY_LABELS[name], 'peers:executor',
                  common.START_PEER_S, executor=name) for name in common.rclpy(options)),
            run('threads', common.THREADS_LABEL, 'subjects:threads', common.START_S))


def _served(load: int, number: int) -> common.Of:
    return common.figure(f'served {load} {number}')


def _evaluate(options: BenchOptions, outcomes: Outcomes) -> CaseResult:
    columns: dict[str, common.Of] = {}
    for load in _SHOWN:
        columns[f'first{load}'] = _served(load, 0)
        columns[f'last{load}'] = _served(load, TASKS - 1)
        columns[f'jobs{load}'] = common.figure(f'jobs {load}')
    rows = [outcomes.row(key, columns) for key in outcomes.runs]
    ratio = outcomes.ratio('kernel', 'threads', _served(_JUDGED, 0))
    targets = (Target(
        f'highest priority at {_JUDGED} % load / of threads', _LEAST_RATIO, ratio, at_most=False,
        why=common.disturbances(outcomes, 'kernel')),)
    return CaseResult(CASE.name, CASE.title, (Table('', _COLUMNS, rows, _NOTES),), targets,
                      (_by_priority(outcomes), _first(outcomes)))


def _curve(outcomes: Outcomes, key: str, label: str, number: int) -> list[Series]:
    known = [(load, metric.median) for load in LOADS
             if (metric := outcomes.metric(key, _served(load, number))) is not None]
    return [Series(label, [x for x, _ in known], [y for _, y in known], 'marks')] if known else []


_TICKS = [(load, f'{load}') for load in LOADS]


def _by_priority(outcomes: Outcomes) -> Plot:
    names = {0: 'highest', 4: 'fifth', 9: 'tenth', 14: 'fifteenth', 19: 'lowest'}
    series = [curve for number, name in names.items()
              for curve in _curve(outcomes, 'kernel', f'{name} priority', number)]
    return Plot('priority', 'Overload: what each priority gets in the kernel',
                'computing time asked for, % of one CPU', 'calls made, % of those asked for',
                series, 'The lowest give way first, one after the other.', True,
                y_from_zero=True, x_ticks=_TICKS)


def _first(outcomes: Outcomes) -> Plot:
    series = [curve for key, run in outcomes.runs.items()
              for curve in _curve(outcomes, key, run.label, 0)]
    return Plot('first', 'Overload: what the most important callback gets',
                'computing time asked for, % of one CPU', 'calls made, % of those asked for',
                series,
                'Higher is better. Alone, the most important asks for half a CPU at the most.',
                True, y_from_zero=True, x_ticks=_TICKS)


CASE = Case('overload', 'twenty callbacks that ask for 20 to 1000 % of one CPU', _plan, _evaluate,
            docs_repeats=5)
