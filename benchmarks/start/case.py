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

"""The cases `start` and `memory`: how soon the robot delivers, and how large its core is."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence

import numpy as np

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.case import UNPINNED
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Column
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.result import Target

_SUBJECT = f'{__package__}.peers:robot'
_START_S = 6.0
_LIMIT_S = 1.5
_LIMIT_MB = 80.0
_BYTES_PER_MB = 1e6
_LABEL = 'robot, default configuration'

_START_COLUMNS = (
    Column('sample_s', 'in the core', 's', 'first sample'),
    Column('sample_s', 'range', 's', 'first sample', spread=True),
    Column('first_s', '/imu/data', 's', 'first message'),
    Column('first_s', 'range', 's', 'first message', spread=True))
_START_NOTES = (
    'From starting the program `robot` with simulated devices to the first sample of imu/data at',
    'a client of the link, and to the first message on /imu/data in a node of another process,',
    'which waited for it. The latter includes DDS discovery: nodes announce themselves some times',
    'at once and then every 3 s, so that what is between the two is mostly waiting for that.')
_MEMORY_COLUMNS = (
    Column('resident', 'resident', 'MB', 'core'),
    Column('resident', 'range', 'MB', 'core', spread=True),
    Column('proportional', 'proportional', 'MB', 'core'),
    Column('growth', 'watched', 'KB', 'growth'), Column('rate', 'a minute', 'KB', 'growth'),
    Column('node', 'resident', 'MB', 'node'))
_MEMORY_NOTES = (
    'Two seconds after the first message; then watched for the time that --seconds gives. Growth:',
    'last size less the first; a minute: the slope of a line through all. Proportional: shared',
    'pages divided among the processes that share them.')


def _plan_start(options: BenchOptions) -> Sequence[Run]:
    return (Run('robot', _LABEL, _SUBJECT, {'watch_ns': 0}, _START_S, UNPINNED, 0),)


def _plan_memory(options: BenchOptions) -> Sequence[Run]:
    return (Run('robot', _LABEL, _SUBJECT, {'watch_ns': options.measure_ns},
                _START_S + options.seconds, UNPINNED, 0),)


def _figure(name: str, scale: float) -> Callable[[RunOutcome], float | None]:
    def of(outcome: RunOutcome) -> float | None:
        value = outcome.figures.get(name)
        return None if value is None else value / scale

    return of


def _growth(outcome: RunOutcome) -> float:
    sizes = outcome.samples['core_resident']
    return float(sizes[-1] - sizes[0]) / 1e3


def _rate(outcome: RunOutcome) -> float | None:
    sizes, moments = outcome.samples['core_resident'], outcome.samples['moments']
    if len(sizes) < 3:
        return None
    slope = np.polyfit((moments - moments[0]) / NS_PER_S, sizes.astype(float), 1)[0]
    return float(slope) * 60 / 1e3


def _evaluate_start(options: BenchOptions, outcomes: Outcomes) -> CaseResult:
    first = _figure('first_message_ns', NS_PER_S)
    rows = [outcomes.row('robot', {
        'first_s': first, 'sample_s': _figure('first_sample_ns', NS_PER_S)})]
    targets = [Target('from the start to the first /imu/data', _LIMIT_S,
                      outcomes.metric('robot', first), 's',
                      why='most of it is the start of two interpreters and DDS discovery, which '
                      'takes the longer the busier the machine is')]
    return CaseResult(START.name, START.title,
                      (Table('', _START_COLUMNS, rows, _START_NOTES),), targets)


def _evaluate_memory(options: BenchOptions, outcomes: Outcomes) -> CaseResult:
    resident = _figure('core_resident', _BYTES_PER_MB)
    rows = [outcomes.row('robot', {
        'resident': resident, 'proportional': _figure('core_proportional', _BYTES_PER_MB),
        'node': _figure('node_resident', _BYTES_PER_MB), 'growth': _growth, 'rate': _rate})]
    size = outcomes.metric('robot', resident)
    targets = [Target('resident size of the core', _LIMIT_MB, size, 'MB',
                      why='the modules and topics of the configuration')]
    return CaseResult(MEMORY.name, MEMORY.title,
                      (Table('', _MEMORY_COLUMNS, rows, _MEMORY_NOTES),), targets)


START = Case('start', 'from starting `robot` to its first message', _plan_start, _evaluate_start)
MEMORY = Case('memory', 'resident size of the core, and its growth', _plan_memory,
              _evaluate_memory)
