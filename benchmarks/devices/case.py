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

"""The case `devices`: what a frame costs to read, and whether real devices are understood."""

from __future__ import annotations

from collections.abc import Sequence

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
_STEPS, _RECORDED = 'steps', 'recording'
_START_S = 1.5
_PS_PER_US = 1e6
# Twenty sentences or fifty counts a second are then at most 0.1 % of a CPU.
_FRAME_LIMIT_US = 20.0
_FRAMES = (('stargazer old', 'StarGazer, old form: one mark'),
           ('stargazer single', 'StarGazer, single form: one mark'),
           ('stargazer multi', 'StarGazer, multi form: two marks'),
           ('arduino_bridge', 'ros_arduino_bridge: two counts'))
_SENTENCES = ('sentences', 'marks', 'wrong', 'wrong in noise')
_TRANSCRIPT = ('orders', 'answers', 'unread', 'unlike', 'counts', 'counts off', 'voltage off')


def _plan(options: BenchOptions) -> Sequence[Run]:
    runs = [Run(_STEPS, 'steps', f'{_SUBJECTS}:steps', {'measure_ns': options.measure_ns},
                _START_S + options.seconds, once=options.quick)]
    if options.data:
        runs.insert(0, Run(_RECORDED, 'recording', f'{_SUBJECTS}:recorded', {
            'data': options.data}, 10.0, UNPINNED, 0, once=True))
    return runs


def _steps(outcomes: Outcomes) -> Table:
    return Table('time of a frame', common.cost_columns('cost'), [outcomes.row(_STEPS, {
        column: common.part_of(name, share, _PS_PER_US)
        for column, share in (('p10', 0.1), ('p50', 0.5), ('p90', 0.9))}, label)
        for name, label in _FRAMES],
        ('Means of blocks of 500 calls, the empty loop taken off: from bytes to numbers.',))


def _figure(name: str) -> common.Of:
    return lambda outcome: outcome.figures.get(name)


def _recorded(outcomes: Outcomes) -> Table:
    if any('sentences' in outcome.figures for outcome in outcomes.measured(_RECORDED)):
        marks = (Column('sentences', 'sentences', '', ''), Column('marks', 'marks', '', ''),
                 Column('wrong', 'read wrongly', '', ''),
                 Column('wrong in noise', 'after noise', '', 'read wrongly'))
        return Table('sentences', marks, [outcomes.row(_RECORDED, {
            name: _figure(name) for name in _SENTENCES}, 'StarGazer')],
            ('Each as the driver reads it, in one piece and byte by byte after noise.',))
    columns = (Column('orders', 'orders', '', ''), Column('answers', 'answers', '', ''),
               Column('unread', 'bytes not read', '', ''),
               Column('unlike', 'other answers', '', 'twin'),
               Column('counts', 'answers with counts', '', ''),
               Column('counts off', 'counts', 'ticks', 'twin, off at most'),
               Column('voltage off', 'voltage', '%', 'twin, off p50'))
    return Table('transcript', columns, [outcomes.row(_RECORDED, {
        name: _figure(name) for name in _TRANSCRIPT}, 'ros_arduino_bridge')], (
        'The answers of the board as the driver reads them, byte by byte; the twin is given the',
        'same orders at the same times, on motors like those of the recording.'))


def _targets(outcomes: Outcomes) -> Sequence[Target]:
    named = {'wrong': 'sentences read wrongly', 'wrong in noise': 'sentences read wrongly, noise',
             'unread': 'bytes of the board not understood',
             'unlike': 'answers of the twin that differ'}
    known = {name for outcome in outcomes.measured(_RECORDED) for name in outcome.figures}
    return [Target(text, 0.0, outcomes.metric(_RECORDED, _figure(name)), '')
            for name, text in named.items() if name in known] + [
        Target(f'frame of {label}', _FRAME_LIMIT_US,
               outcomes.metric(_STEPS, common.part_of(name, 0.5, _PS_PER_US)), 'us',
               why=common.disturbances(outcomes, _STEPS)) for name, label in _FRAMES]


def _evaluate(options: BenchOptions, outcomes: Outcomes) -> CaseResult:
    tables = [_steps(outcomes)]
    if _RECORDED in outcomes.runs:
        tables.insert(0, _recorded(outcomes))
    return CaseResult(CASE.name, CASE.title, tables, _targets(outcomes))


CASE = Case('devices', 'StarGazer and motor board: time of a frame, recordings (--data)', _plan,
            _evaluate, takes_data=True)
