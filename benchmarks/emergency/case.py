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

"""The case `emergency`: from an alarm on the sink's wire to a command on the motors' wire."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

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
from rt_robot_os.tools.bench.result import RunStatus
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.result import Target

_SAMPLE = 'delay_ns'
_LIMIT_US = 10_000.0
_RATIO = 1.3
_LOADS = (0, 5, 7, 20)
_MOST = _LOADS[-1]
# An emergency every 130 ms or so, and 99 of 100 takes more than a hundred of them, in each round.
_SHORTEST_S = 20.0
_EMERGENCY_S = 0.08
_START_S = 0.5
_COLUMNS = (
    Column('p50', 'p50', 'us', 'last byte to motors'),
    Column('p99', 'p99', 'us', 'last byte to motors'),
    Column('maximum', 'max', 'us', 'last byte to motors'),
    Column('ratio', 'p99', '', 'of none computing'),
    Column('ratio', 'range', '', 'of none computing', spread=True),
    Column('answered', 'of sent', '%', 'turned'))
_NOTES = (
    'A process that plays the world is the sink mote of a sensor network on one pty and a motor',
    'board (Arduino) on another. While the robot stands a smoke detector tells of smoke, byte',
    'by byte at 57,600 bps; the time counts from its last byte until the board is told to turn.',
    'rt_robot_os: a core with the modules that ship with it. The sink sorts the packet, a',
    'reading comes of it, a rule finds it to be smoke, the alarm is raised, the agent turns',
    'towards the place, multiplexer and collision guard let it pass, the driver of the board',
    'sends it; eight tasks with priorities of their own. The journal writes the alarm to the',
    'disk beside it, and somebody resolves it 30 ms later. Threads: one thread reads the sink',
    'and turns the wheels itself, without any of that; nothing can be shorter. "Computing": so',
    'many tasks of the lowest priority, or threads, compute 4 ms of every 97 ms each; 20 ask',
    'for 80 % of a CPU. Linux hands serial bytes on by threads of its work queues, twice on',
    'this way; they wait behind what computes on their CPU, so they are kept off it, as the',
    'program doctor advises. "Queues here": they are not.')
_SUBJECTS = f'{__package__}.subjects'
_RT = ('rt', 'rt_robot_os', 'realtime', FIFO_PRIORITY)
_PLAIN = ('plain', 'threads', 'plain', 0)


def _plan(options: BenchOptions) -> Sequence[Run]:
    seconds = options.seconds if options.quick else max(_SHORTEST_S, options.seconds)

    def run(path: tuple[str, str, str, int], busy: int, alone: bool) -> Run:
        key, label, subject, priority = path
        here = '' if alone else ', queues here'
        return Run(
            f'{key} {busy}{" here" if here else ""}', f'{label}, {busy} computing{here}',
            f'{_SUBJECTS}:{subject}', {
                'busy': busy, 'alone': alone, 'count': int(seconds / _EMERGENCY_S) + 1,
                'start_ns': round(_START_S * NS_PER_S), 'measure_ns': round(seconds * NS_PER_S)},
            2.0 + _START_S + seconds, priority=priority)

    if options.quick:
        return [run(_RT, busy, True) for busy in (0, _MOST)]
    return [*(run(_RT, busy, True) for busy in _LOADS), run(_RT, _MOST, False),
            *(run(_PLAIN, busy, True) for busy in (0, _MOST))]


def _evaluate(options: BenchOptions, outcomes: Outcomes) -> CaseResult:
    tails = common.tails_of(_SAMPLE)
    p99 = tails['p99']
    rows: list[Row] = [outcomes.row(key, {
        'p50': tails['p50'], 'p99': p99, 'maximum': tails['maximum'],
        'answered': common.figure('answered_percent')}) for key in outcomes.runs]
    rows = [_with_ratio(row, outcomes, p99) for row in rows]
    loaded, plain = f'rt {_MOST}', f'plain {_MOST}'
    loads = [busy for busy in _LOADS if f'rt {busy}' in outcomes.runs]
    targets = (
        *(Target(f'alarm to motors, {busy} computing, p99', _LIMIT_US,
                 outcomes.metric(f'rt {busy}', p99), 'us',
                 why=common.disturbances(outcomes, f'rt {busy}')) for busy in loads),
        *(Target(f'p99, {busy} computing / none', _RATIO,
                 outcomes.ratio(f'rt {busy}', _none(f'rt {busy}'), p99),
                 why=common.disturbances(outcomes, f'rt {busy}')) for busy in loads if busy),
        Target(f'alarms that moved the robot, {_MOST} computing', 100.0,
               outcomes.metric(loaded, common.figure('answered_percent')), '%', at_most=False))
    requirements = (Requirement(
        'the robot turned towards an emergency within 10 ms (p99) of the last byte of '
        'its alarm, while the program computes', _LIMIT_US, 'us', {
            'rt_robot_os': outcomes.metric(loaded, p99),
            'threads': outcomes.metric(plain, p99) if plain in outcomes.runs else None,
        }, case=CASE.name),)
    return CaseResult(CASE.name, CASE.title, (Table('', _COLUMNS, rows, _NOTES),), targets,
                      (_plot(outcomes),), requirements)


def _none(key: str) -> str:
    """Return the run of the same program in which nothing computes."""
    return f'{key.split()[0]} {_LOADS[0]}'


def _with_ratio(row: Row, outcomes: Outcomes, p99: common.Of) -> Row:
    """Add how much longer it takes than with nothing computing, round by round."""
    if row.status is not RunStatus.OK or row.run == _none(row.run):
        return row
    ratio = outcomes.ratio(row.run, _none(row.run), p99)
    return replace(row, metrics={**row.metrics, 'ratio': ratio})


def _plot(outcomes: Outcomes) -> Plot:
    series = [tail(outcomes.runs[key].label, np.concatenate(
        [o.samples[_SAMPLE] for o in outcomes.measured(key)]), 1e3)
        for key in outcomes.runs if outcomes.measured(key)]
    return Plot('tail', 'From the last byte of an alarm to the motors', 'delay, us',
                'part of the alarms that is answered later', series,
                'Further left and lower is better.', True, True)


CASE = Case('emergency', "from an alarm on the sink's wire to a command on the motors' wire",
            _plan, _evaluate)
