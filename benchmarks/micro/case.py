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

"""The case `micro`: what single operations cost, in the compiled build and in pure Python."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.tools.bench import facts
from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import BUILDS
from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.case import COMPILED
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.cases import common
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Metric
from rt_robot_os.tools.bench.result import Row
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.result import Target

_WARMUP_NS = 300 * NS_PER_MS
_START_S = 1.0
_TASKS, _RATE_HZ = 100, 200
_WARM_RATE_HZ = 2000
_SUBJECTS = f'{__package__}.subjects'
_SPACING = 'rt_robot_os.tools.bench.cases.spacing.subjects'
_JOBS_FLOOR = 'rt_robot_os.tools.bench.cases.spacing.floor:jobs'
_PS_PER_US, _NS_PER_US = 1e6, 1e3
# The compiled build over pure Python, and over what the machine takes for the least of the kind:
# calls of an empty function, a bare wake-up, functions called in a row.
_TAKE_RATIO, _TO_TASK_RATIO = 0.2, 0.15
_TAKE_CALLS, _TO_TASK_CALLS = 6.0, 28.0
_ALONE_RATIO, _TOGETHER_RATIO = 1.5, 2.2

_BOTH, _TO_TASK = 'publish+take 64', 'publish to task 64'
_OPERATIONS = (
    ('publish 64', 'publish 64 B'), (_BOTH, 'publish, take and copy 64 B'),
    (_TO_TASK, 'publish 64 B to a task that takes it'),
    ('publish 2048', 'publish 2048 B'), ('publish+take 2048', 'publish, take and copy 2048 B'),
    ('field set', 'set one field of an Imu'), ('field get', 'get one field of an Imu'),
    ('pack ten', 'set ten numbers of an Imu, packed'),
    ('unpack ten', 'get ten numbers of an Imu, packed'),
    ('log three', 'log a line with three arguments'),
    ('log throttled', 'log a line that is held back'),
    ('log off', 'log a line below its level'),
)
# (key, label, tasks, rate)
_JOBS = (('alone', 'job of one task at 200 Hz', 1, _RATE_HZ),
         ('together', 'job, 100 tasks released together', _TASKS, _RATE_HZ),
         ('warm', '  the same at 2 kHz: warm caches', _TASKS, _WARM_RATE_HZ))
_WAKE_NS = NS_PER_S // _RATE_HZ
_FLOORS = (('call', 'call of an empty Python function'),
           ('system call', 'system call, os.getppid()'))
_COLUMNS = (*common.cost_columns('cost'), common.RATIO_COLUMN)
_NOTES = (
    'Operations: percentiles of the means of blocks of 500 calls, the empty loop taken off. Each',
    'in the compiled build and in pure Python, by processes that take turns; of pure: the ratio',
    'of the two. A task that takes it runs before publish returns: the delay without cold',
    'caches. Jobs: CPU time of the whole process divided by the jobs, stretches of 0.2 s; 100',
    'tasks of 200 Hz that do nothing, released together (the case spacing has others), and one',
    'that is alone. The floors are those of Python and Linux without this package: a bare',
    'wake-up is a loop of clock_nanosleep, called by ctypes, which takes less than 1 us more',
    'than one in C; a call in a row is one of 100 that such a loop makes when it woke up.',
    'Machines differ by the factor of three, as verdicts did: targets of the compiled build are',
    'ratios to these floors.')


def _jobs(options: BenchOptions) -> Sequence[tuple[str, str, int, int]]:
    return _JOBS[:2] if options.quick else _JOBS


def _plan(options: BenchOptions) -> Sequence[Run]:
    measure_ns = options.measure_ns
    seconds = _START_S + options.seconds
    operations = Run('operations', 'operations', f'{_SUBJECTS}:operations',
                     {'measure_ns': measure_ns}, seconds)
    jobs = [Run(key, label.strip(), 'rt_robot_os.tools.bench.cases.kernel.subjects:dispatch', {
        'tasks': tasks, 'rate_hz': rate_hz, 'warmup_ns': _WARMUP_NS, 'measure_ns': measure_ns},
        seconds) for key, label, tasks, rate_hz in _jobs(options)]
    return (*common.both_builds(operations, *jobs),
            Run('wake', 'bare wake-up, clock_nanosleep at 200 Hz', f'{_SPACING}:wakes',
                {'spacings_ns': [_WAKE_NS], 'measure_ns': measure_ns}, seconds),
            Run('row', 'call in a row of 100 at 200 Hz', _JOBS_FLOOR,
                {'tasks': _TASKS, 'rate_hz': _RATE_HZ, 'measure_ns': measure_ns}, seconds),
            Run('floor', 'floors', f'{_SUBJECTS}:floors', {'measure_ns': measure_ns // 4},
                _START_S + options.seconds / 4))


def _metrics(name: str, scale: float) -> Mapping[str, common.Of]:
    return {column: common.part_of(name, part, scale)
            for column, part in (('p10', 0.1), ('p50', 0.5), ('p90', 0.9))}


def _cold(outcomes: Outcomes) -> str:
    """Return what a job costs when its task is still in the caches."""
    warm = outcomes.metric(common.ours(outcomes, 'warm'),
                           common.part_of('cpu_ns', 0.5, _NS_PER_US))
    return '' if warm is None else (
        f'at 2 kHz, with warm caches, a job takes {warm.median:.1f} us; after 5 ms without it, '
        'what the CPU knew of 100 tasks has to come from memory again; ')


def _rows(options: BenchOptions, outcomes: Outcomes) -> list[Row]:
    rows: list[Row] = []
    for name, label in _OPERATIONS:
        rows += common.build_rows(outcomes, 'operations', label, _metrics(name, _PS_PER_US))
    for key, label, _, _ in _jobs(options):
        rows += common.build_rows(outcomes, key, label, _metrics('cpu_ns', _NS_PER_US))
    rows += [outcomes.row('wake', _metrics(str(_WAKE_NS), _NS_PER_US)),
             outcomes.row('row', _metrics('cpu_ns', _NS_PER_US))]
    return [*rows, *(outcomes.row('floor', _metrics(name, _PS_PER_US), label)
                     for name, label in _FLOORS)]


def _targets(outcomes: Outcomes) -> Sequence[Target]:
    operations, call = common.key_of('operations', COMPILED), common.part_of('call', 0.5)
    job, ours = common.part_of('cpu_ns', 0.5), common.ours(outcomes, 'operations')
    why = common.disturbances(outcomes, operations)

    def of_pure(text: str, name: str, limit: float) -> Target:
        return Target(f'{text}, compiled / pure', limit,
                      common.build_ratio(outcomes, 'operations', common.part_of(name, 0.5)),
                      why=why)

    def of_calls(text: str, name: str, limit: float) -> Target:
        return Target(f'{text}, compiled / empty call', limit, outcomes.between(
            operations, common.part_of(name, 0.5), 'floor', call), why=why)

    def of_floor(text: str, key: str, floor: str, name: str, limit: float) -> Target:
        compiled = common.key_of(key, COMPILED)
        return Target(text, limit, outcomes.between(
            compiled, job, floor, common.part_of(name, 0.5)),
            why=_cold(outcomes) + common.disturbances(outcomes, compiled))

    return (
        of_floor('job of one task, compiled / bare wake-up', 'alone', 'wake',
                 str(_WAKE_NS), _ALONE_RATIO),
        of_floor('job, 100 together, compiled / call in a row', 'together', 'row', 'cpu_ns',
                 _TOGETHER_RATIO),
        of_calls('publish and take 64 B', _BOTH, _TAKE_CALLS),
        of_calls('publish to a waiting task', _TO_TASK, _TO_TASK_CALLS),
        of_pure('publish and take', _BOTH, _TAKE_RATIO),
        of_pure('publish to a waiting task', _TO_TASK, _TO_TASK_RATIO),
        Target('log a line with three arguments', 2.0,
               outcomes.metric(ours, common.part_of('log three', 0.5, _PS_PER_US)), 'us',
               why=common.disturbances(outcomes, ours)))


def _facts(outcomes: Outcomes) -> Mapping[str, Metric | None]:
    def operation(name: str, key: str) -> Metric | None:
        return outcomes.metric(key, common.part_of(name, 0.5, _PS_PER_US))

    found = {facts.CALL: operation('call', 'floor'),
             facts.SYSTEM_CALL: operation('system call', 'floor')}
    for build in BUILDS:
        key = common.key_of('operations', build)
        found[facts.of_build(facts.TAKE, build)] = operation(_BOTH, key)
        found[facts.of_build(facts.TO_TASK, build)] = operation(_TO_TASK, key)
    return found


def _evaluate(options: BenchOptions, outcomes: Outcomes) -> CaseResult:
    table = Table('', _COLUMNS, _rows(options, outcomes), _NOTES)
    return CaseResult(CASE.name, CASE.title, (table,), _targets(outcomes), facts=_facts(outcomes))


CASE = Case('micro', 'costs of single operations: topics, layouts, dispatching', _plan, _evaluate,
            docs_repeats=5)
