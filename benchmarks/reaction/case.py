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

"""The case `reaction`: from an obstacle on a sensor's wire to the stop on the motors' wire."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.case import FIFO_PRIORITY
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.cases import common
from rt_robot_os.tools.bench.plot import Plot
from rt_robot_os.tools.bench.plot import tail
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Column
from rt_robot_os.tools.bench.result import Requirement
from rt_robot_os.tools.bench.result import Row
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.result import Target

_SAMPLE = 'reaction_ns'
_LIMIT_US = 5000.0
# An obstacle every 60 ms or so; 99 of 100 takes hundreds.
_SHORTEST_S = 15.0
_OBSTACLE_S = 0.05
_COLUMNS = (
    Column('p50', 'p50', 'us', 'obstacle to stop'), Column('p99', 'p99', 'us', 'obstacle to stop'),
    Column('maximum', 'max', 'us', 'obstacle to stop'),
    Column('answered', 'of sent', '%', 'stopped'))
_NOTES = (
    'A process that plays the world is an ultrasonic sensor (MaxBotix) on one pty and a motor',
    'board on another. While the board is told to drive it sends "R0300": something is right',
    'before the sensor; the time counts until it reads the stop. rt_robot_os: driver, collision',
    'guard, driver of the board, and beside them the multiplexer with commands at 50 Hz, all',
    'tasks of one core. Threads: the thread that reads the sensor writes the stop itself; another',
    'one commands. "Computing": a task of the lowest priority, or another thread, computes 20 ms',
    'of plain Python every 27 ms. "Queues elsewhere": Linux hands serial bytes on by threads of',
    'its work queues, which wait behind what computes on their CPU; here they are kept off it,',
    'as the program doctor advises. Each obstacle passes two such queues.')
_PATHS = (('rt', 'rt_robot_os', 'realtime', FIFO_PRIORITY), ('plain', 'threads', 'plain', 0))
_LOADS = (('idle', 'nothing computes', 0, False), ('busy', 'computing', 1, False),
          ('alone', 'computing, queues elsewhere', 1, True))


def _plan(options: BenchOptions) -> Sequence[Run]:
    seconds = options.seconds if options.quick else max(_SHORTEST_S, options.seconds)
    return [Run(f'{key} {load}', f'{label}, {what}',
                f'{__package__}.subjects:{subject}',
                {'busy': busy, 'alone': alone, 'count': int(seconds / _OBSTACLE_S) + 1,
                 'measure_ns': round(seconds * NS_PER_S)}, 2.0 + seconds, priority=priority)
            for load, what, busy, alone in (_LOADS[:2] if options.quick else _LOADS)
            for key, label, subject, priority in _PATHS]


def _evaluate(options: BenchOptions, outcomes: Outcomes) -> CaseResult:
    tails = common.tails_of(_SAMPLE)
    rows: list[Row] = [outcomes.row(key, {
        'p50': tails['p50'], 'p99': tails['p99'], 'maximum': tails['maximum'],
        'answered': common.figure('answered_percent')}) for key in outcomes.runs]
    key = 'rt alone' if 'rt alone' in outcomes.runs else 'rt busy'
    plain = key.replace('rt', 'plain')
    targets = (
        Target('obstacle to stop, p99, computing', _LIMIT_US,
               outcomes.metric(key, tails['p99']), 'us', why=common.disturbances(outcomes, key)),
        Target('p50, computing / nothing computes', 1.5,
               outcomes.ratio(key, 'rt idle', tails['p50']),
               why=common.disturbances(outcomes, key)),
        Target('p99 of threads / of the core, computing', 1.0,
               outcomes.ratio(plain, key, tails['p99']), at_most=False,
               why=common.disturbances(outcomes, key)))
    requirements = (Requirement(
        'motors stopped within 5 ms (p99) of an obstacle while the program computes',
        _LIMIT_US, 'us', {'rt_robot_os': outcomes.metric(key, tails['p99']),
                          'threads': outcomes.metric(plain, tails['p99'])},
        case=CASE.name),)
    series = [tail(outcomes.runs[run].label, np.concatenate(
        [o.samples[_SAMPLE] for o in outcomes.measured(run)]), 1e3)
        for run in outcomes.runs if outcomes.measured(run)]
    plot = Plot('tail', 'From an obstacle to the stop', 'delay, us',
                'part of the obstacles that is answered later', series,
                'Further left and lower is better.', True, True)
    return CaseResult(CASE.name, CASE.title, (Table('', _COLUMNS, rows, _NOTES),), targets,
                      (plot,),
                      requirements)


CASE = Case('reaction', "from an obstacle on a sensor's wire to the stop on the motors' wire",
            _plan, _evaluate)
