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

"""The case `control`: what a step of trajectory control costs, and the vectors of others."""

from __future__ import annotations

from collections.abc import Sequence

from rt_robot_os.motion.controllers import CONTROLLERS
from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.case import UNPINNED
from rt_robot_os.tools.bench.cases import common
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Column
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.result import Target

_SUBJECTS = f'{__package__}.subjects'
_VECTORS, _STEPS = 'vectors', 'steps'
_START_S = 1.5
_PS_PER_US = 1e6
_STEP_LIMIT_US = 40.0
# The vectors are written with so many digits.
_VECTOR_LIMIT = 1e-3
_PARTS = (('law', 'law'), ('follower', 'with all checks'),
          ('module', 'job of the module'))


def _plan(options: BenchOptions) -> Sequence[Run]:
    runs = [Run(_STEPS, 'steps', f'{_SUBJECTS}:steps', {
        'measure_ns': options.measure_ns, 'laws': tuple(CONTROLLERS)},
        _START_S + options.seconds, once=options.quick)]
    if options.data:
        runs.insert(0, Run(_VECTORS, 'vectors', f'{_SUBJECTS}:vectors', {'data': options.data},
                           _START_S, UNPINNED, 0, once=True))
    return runs


def _steps(outcomes: Outcomes) -> Table:
    rows = [outcomes.row(_STEPS, {
        column: common.part_of(f'{law} {part}', share, _PS_PER_US)
        for column, share in (('p10', 0.1), ('p50', 0.5), ('p90', 0.9))}, f'{law}: {label}')
        for law in CONTROLLERS for part, label in _PARTS]
    rows.append(outcomes.row(_STEPS, {
        column: common.part_of('path', share, _PS_PER_US)
        for column, share in (('p10', 0.1), ('p50', 0.5), ('p90', 0.9))},
        'once for a path: 400 poses, 18 m'))
    return Table('time of a step', common.cost_columns('cost'), rows, (
        'Means of blocks of 500 calls, the empty loop taken off. The checks are those of a robot',
        'that is held, astray or there, with turns in place and limits. The module takes odometry',
        'and a pose, which are published within that time, and publishes three topics.'))


def _groups(outcomes: Outcomes) -> Sequence[str]:
    return [name.removesuffix(' worst') for outcome in outcomes.measured(_VECTORS)
            for name in outcome.figures if name.endswith(' worst')]


def _figure(name: str) -> common.Of:
    return lambda outcome: outcome.figures.get(name)


def _worst(outcomes: Outcomes) -> common.Of:
    return lambda outcome: max(
        (outcome.figures[f'{group} worst'] for group in _groups(outcomes)), default=None)


def _vectors(outcomes: Outcomes) -> Table:
    columns = (Column('cases', 'vectors', '', ''), Column('worst', 'worst', '', 'difference'))
    rows = [outcomes.row(_VECTORS, {
        'cases': _figure(f'{group} cases'), 'worst': _figure(f'{group} worst')}, group)
        for group in _groups(outcomes)]
    return Table('vectors', columns, rows or [outcomes.row(_VECTORS, {}, 'vectors')], (
        'Difference of the worst number: m, rad, m/s, rad/s.',))


def _evaluate(options: BenchOptions, outcomes: Outcomes) -> CaseResult:
    targets = [Target(f'step of {law}, with all checks', _STEP_LIMIT_US,
                      outcomes.metric(_STEPS, common.part_of(
                           f'{law} follower', 0.5, _PS_PER_US)), 'us',
                      why=common.disturbances(outcomes, _STEPS)) for law in CONTROLLERS]
    tables = [_steps(outcomes)]
    if _VECTORS in outcomes.runs:
        tables.insert(0, _vectors(outcomes))
        targets.insert(0, Target('worst difference from the vectors', _VECTOR_LIMIT,
                                 outcomes.metric(_VECTORS, _worst(outcomes)), ''))
    return CaseResult(CASE.name, CASE.title, tables, targets)


CASE = Case('control', 'trajectory control: step times, vectors of others (--data)', _plan,
            _evaluate, takes_data=True)
