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

"""The case `micro`: what single operations of topics, layouts and the kernel cost."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence

from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.case import Options
from rt_robot_os.tools.bench.case import Outcome
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.cases import common
from rt_robot_os.tools.bench.result import Aim
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.stats import percentile
from rt_robot_os.units import NS_PER_MS

_WARMUP_NS = 300 * NS_PER_MS
_START_S = 1.0
_TASKS, _RATE_HZ = 100, 200
_WARM_RATE_HZ = 2000
_WORKERS = 'rt_robot_os.tools.bench.workers.micro'
_PS_PER_US, _NS_PER_US = 1e6, 1e3

_OPERATIONS = (
    ('publish 64', 'publish 64 B'), ('publish+take 64', 'publish, take and copy 64 B'),
    ('publish to task 64', 'publish 64 B to a task that takes it'),
    ('publish 2048', 'publish 2048 B'), ('publish+take 2048', 'publish, take and copy 2048 B'),
    ('field set', 'set one field of an Imu'), ('field get', 'get one field of an Imu'),
    ('pack ten', 'set ten numbers of an Imu, packed'),
    ('unpack ten', 'get ten numbers of an Imu, packed'),
    ('log three', 'log a line with three arguments'),
    ('log throttled', 'log a line that is held back'),
    ('log off', 'log a line below its level'),
)
_COLUMNS = common.cost_columns('cost')
_NOTES = (
    'Operations: percentiles of the means of blocks of 500 calls, the empty loop taken off.',
    'A task that takes it runs before publish returns: the delay without cold caches.',
    'Jobs: CPU time of the whole process divided by the jobs, stretches of 0.2 s; 100 tasks of',
    '200 Hz that do nothing, released together, or each by a timer signal of its own; a bare',
    'loop that sleeps and wakes as often as those is the least that the latter can cost.')


def _plan(options: Options) -> Sequence[Run]:
    measure_ns = options.measure_ns
    seconds = _START_S + options.seconds
    dispatch = {'tasks': _TASKS, 'rate_hz': _RATE_HZ, 'warmup_ns': _WARMUP_NS,
                'measure_ns': measure_ns}
    return (
        Run('operations', 'operations', f'{_WORKERS}:operations', {'measure_ns': measure_ns},
            seconds),
        Run('together', 'job, 100 tasks released together', f'{_WORKERS}:dispatch',
            {**dispatch, 'spread': 0}, seconds),
        Run('warm', '  the same at 2 kHz: warm caches', f'{_WORKERS}:dispatch',
            {**dispatch, 'spread': 0, 'rate_hz': _WARM_RATE_HZ}, seconds),
        Run('spread', 'job, 100 tasks, each its own timer', f'{_WORKERS}:dispatch',
            {**dispatch, 'spread': 1}, seconds),
        Run('wake', '  of which: a clock_nanosleep wake-up', f'{_WORKERS}:wake',
            {'rate_hz': _TASKS * _RATE_HZ, 'measure_ns': measure_ns}, seconds),
    )


def _cost(name: str, scale: float, part: float) -> Callable[[Outcome], float | None]:
    def of(outcome: Outcome) -> float | None:
        value = percentile(outcome.samples[name], part)
        return None if value is None else value / scale

    return of


def _metrics(name: str, scale: float) -> dict[str, Callable[[Outcome], float | None]]:
    return {column: _cost(name, scale, part)
            for column, part in (('p10', 0.1), ('p50', 0.5), ('p90', 0.9))}


def _cold(outcomes: Outcomes) -> str:
    """Return what a job costs when its task is still in the caches."""
    warm = outcomes.metric('warm', _cost('cpu_ns', _NS_PER_US, 0.5))
    return '' if warm is None else (
        f'at 2 kHz, with warm caches, a job takes {warm.median:.1f} us; after 5 ms without it, '
        'what the CPU knew of 100 tasks has to come from memory again; ')


def _evaluate(options: Options, outcomes: Outcomes) -> CaseResult:
    rows = [outcomes.row('operations', _metrics(name, _PS_PER_US), label)
            for name, label in _OPERATIONS]
    rows += [outcomes.row(key, _metrics('cpu_ns', _NS_PER_US))
             for key in ('together', 'warm', 'spread', 'wake')]
    aims = (
        Aim('publish, take and copy 64 B', 0.5,
            outcomes.metric('operations', _cost('publish+take 64', _PS_PER_US, 0.5)), 'us',
            why=common.disturbances(outcomes, 'operations')),
        Aim('log a line with three arguments', 2.0,
            outcomes.metric('operations', _cost('log three', _PS_PER_US, 0.5)), 'us',
            why=common.disturbances(outcomes, 'operations')),
        Aim('CPU time of a job, 100 tasks released together', 2.0,
            outcomes.metric('together', _cost('cpu_ns', _NS_PER_US, 0.5)), 'us',
            why=_cold(outcomes) + common.disturbances(outcomes, 'together')),
    )
    return CaseResult(CASE.name, CASE.title, (Table('', _COLUMNS, rows, _NOTES),), aims)


CASE = Case('micro', 'costs of single operations: topics, layouts, dispatching', _plan, _evaluate)
