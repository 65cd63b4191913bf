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

"""The case `slam`: how right, how fast and how small mapping is, and what it costs the core."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from pathlib import Path

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.case import LAST_CPU
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.cases import common
from rt_robot_os.tools.bench.cases import punctual
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Column
from rt_robot_os.tools.bench.result import Metric
from rt_robot_os.tools.bench.result import Row
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.result import Target

_SUBJECTS = f'{__package__}.subjects'
_PEERS = f'{__package__}.peers'
_PROGRAMS = f'{__package__}.peer_programs'
_WARMUP_NS = 2000 * NS_PER_MS
# What the libraries take to load, and scans a second as they are expected to be mapped.
_START_S, _PACE = 0.6, 100.0
# Scans of the drives: of the flat in a first look, the flat, the ring.
_LOOK, _FLAT, _RING = 60, 1616, 2089
_HOUR_S: Mapping[bool, float] = {False: 400.0, True: 3600.0}
_TRIALS: Mapping[bool, int] = {False: 20, True: 200}
_TRIAL_S = 0.3
_LOG_S = 60.0
_SAME_MB = 10.0
_CLOSE_M = 0.05

_WAY_COLUMNS = (
    Column('rms', 'rms', 'm', 'way'), Column('turn', 'rms turn', 'deg', 'way'),
    Column('fitted', 'fitted', 'm', 'way'), Column('closing', 'end', 'm', 'way'),
    Column('agreement', 'right', '%', 'cells'), Column('pace', 'of 360 beams', '/s', 'scans'),
    Column('add_p99', 'scan p99', 'ms', 'CPU time'), Column('add', 'scan max', 'ms', 'CPU time'),
    Column('update', 'map max', 'ms', 'CPU time'))
_WAY: dict[str, common.Of] = {
    'rms': common.figure('rms_m'), 'turn': common.figure('rms_deg'),
    'fitted': common.figure('fitted_m'), 'closing': common.figure('closing_m'),
    'agreement': common.figure('agreement'), 'pace': common.figure('scans_per_s'),
    'add_p99': common.part_of('adds', 0.99, NS_PER_MS),
    'add': common.part_of('adds', 1.0, NS_PER_MS),
    'update': common.part_of('updates', 1.0, NS_PER_MS)}
_WAY_NOTES = (
    'Simulated drives at 0.3 m/s, scans at 10 Hz with 1 cm of noise, wheels that slip by 3 % and',
    'of which one is 0.5 % larger than configured. rms: of all poses, seen from the first one;',
    'fitted: with the whole way laid on the true one. end: of the last pose, seen from the first.',
    'right: cells, free and occupied, within 10 cm of the true map. On one core, with loops.')
_LOG_COLUMNS = (
    Column('mean', 'mean', 'm', 'relations'), Column('turn', 'mean turn', 'rad', 'relations'),
    Column('largest', 'largest', 'm', 'relations'), Column('loops', 'loops', 'm', 'relations'),
    Column('cpu', 'time', 's', 'CPU'), Column('pace', 'mapped', '/s', 'scans'))
_LOG_NOTES = (
    'CPU time of all threads, without starting and reading. Karto and GMapping: with the settings',
    'that they ship, where the programs of benchmarks/slam/peer_sources are on PATH.')
_LOG: dict[str, common.Of] = {
    'mean': common.figure('mean_m'), 'turn': common.figure('mean_rad'),
    'largest': common.figure('largest_m'), 'loops': common.figure('loops_mean_m'),
    'cpu': common.figure('cpu_s'), 'pace': common.figure('scans_per_s')}
_MEMORY_COLUMNS = (
    Column('begin', 'empty', 'MB', 'resident'), Column('known', 'a quarter', 'MB', 'resident'),
    Column('end', 'end', 'MB', 'resident'), Column('keyframes', 'kept', '', 'keyframes'),
    Column('pace', 'mapped', '/s', 'scans'))
_MEMORY: dict[str, common.Of] = {
    'begin': common.figure('begin_mb'), 'known': common.figure('known_mb'),
    'end': common.figure('end_mb'), 'keyframes': common.figure('keyframes'),
    'pace': common.figure('scans_per_s')}
_RESTART_COLUMNS = (
    Column('right', 'found', '%', 'starts'), Column('wrong', 'wrong', '', 'starts'),
    Column('p50', 'p50', 's', 'time'), Column('maximum', 'max', 's', 'time'))
_RESTART: dict[str, common.Of] = {
    'right': common.figure('right'), 'wrong': common.figure('wrong'),
    'p50': common.part_of('times', 0.5, 1e6), 'maximum': common.part_of('times', 1.0, 1e6)}


def _plan(options: BenchOptions) -> Sequence[Run]:
    def run(key: str, label: str, subject: str, seconds: float, **arguments: object) -> Run:
        took_s = common.START_S + _START_S + seconds
        return Run(key, label, subject, arguments, took_s, LAST_CPU, 0,
                   once=True)

    if options.quick:
        return (run('flat', 'flat, the beginning', f'{_SUBJECTS}:drive', _LOOK / _PACE,
                    drive='flat', scans=_LOOK),)
    trials, simulated_s = _TRIALS[options.full], _HOUR_S[options.full and options.hours >= 1.0]
    return (
        run('flat', 'the flat', f'{_SUBJECTS}:drive', _FLAT / _PACE, drive='flat', scans=0),
        run('ring', 'a loop of 60 m', f'{_SUBJECTS}:drive', _RING / _PACE, drive='ring', scans=0),
        *(run(name, label, f'{_PEERS}:{name}', 4.0, drive='flat', scans=0)
          for name, label in (('breezy', 'BreezySLAM, the flat'), ('kiss', 'KISS-ICP, the flat'))),
        run('memory', f'{simulated_s:g} s in the flat', f'{_SUBJECTS}:hour',
            simulated_s * 10 / _PACE, simulated_s=simulated_s),
        run('restart', f'{trials} starts in the flat', f'{_SUBJECTS}:restarts', trials * _TRIAL_S,
            count=trials),
        *_logs(options), *_cores(options))


def _logs(options: BenchOptions) -> Sequence[Run]:
    if not options.data:
        return ()
    name = Path(options.data).name.removesuffix('.gz').removesuffix('.csv')
    beside = Path(options.data).with_name(f'{name}.relations.csv')
    relations = options.expected or (str(beside) if beside.exists() else '')
    arguments = {'data': options.data, 'relations': relations}
    return tuple(Run(key, f'{label}, {name}', subject, arguments, _LOG_S, LAST_CPU, 0, once=True)
                 for key, label, subject in (
                     ('log', 'mapping', f'{_SUBJECTS}:log'),
                     ('log karto', 'Karto', f'{_PROGRAMS}:karto'),
                     ('log gmapping', 'GMapping', f'{_PROGRAMS}:gmapping'),
                     ('log breezy', 'BreezySLAM', f'{_PEERS}:breezy'),
                     ('log kiss', 'KISS-ICP', f'{_PEERS}:kiss')))


def _cores(options: BenchOptions) -> Sequence[Run]:
    seconds = common.START_S + _START_S + _WARMUP_NS / NS_PER_S + options.seconds
    return tuple(Run(key, label, f'{_SUBJECTS}:core', {
        'mapped': mapped, 'period_ns': punctual.PERIOD_NS, 'warmup_ns': _WARMUP_NS,
        'measure_ns': options.measure_ns}, seconds)
        for key, label, mapped in (('alone', 'nothing maps', 0), ('beside', 'mapping beside', 1)))


def _evaluate(options: BenchOptions, outcomes: Outcomes) -> CaseResult:
    def rows(keys: Sequence[str], of: Mapping[str, common.Of]) -> list[Row]:
        return [outcomes.row(key, of) for key in keys if key in outcomes.runs]

    tables = [
        Table(title, columns, found, notes) for title, columns, found, notes in (
            ('Simulated drives', _WAY_COLUMNS, rows(('flat', 'ring', 'breezy', 'kiss'), _WAY),
             _WAY_NOTES),
            ('A log', _LOG_COLUMNS, rows(
                ('log', 'log karto', 'log gmapping', 'log breezy', 'log kiss'), _LOG),
             _LOG_NOTES),
            ('Memory', _MEMORY_COLUMNS, rows(('memory',), _MEMORY), ()),
            ('Finding oneself in a saved map', _RESTART_COLUMNS, rows(('restart',), _RESTART), ()),
            ('The core beside mapping', punctual.COLUMNS, rows(('alone', 'beside'),
                                                               punctual.METRICS), ()))
        if found]
    return CaseResult(CASE.name, CASE.title, tables, _targets(options, outcomes))


def _targets(options: BenchOptions, outcomes: Outcomes) -> list[Target]:
    def one(key: str, of: common.Of) -> Metric | None:
        return outcomes.metric(key, of) if key in outcomes.runs else None

    targets = [
        Target('scans mapped on one core', 20.0, one('flat', _WAY['pace']), '/s', at_most=False),
        Target('longest map update', 10.0, one('flat', _WAY['update']), 'ms')]
    if options.quick:
        return targets
    return [
        *targets,
        Target('way in the flat, rms', 0.03, one('flat', _WAY['rms']), 'm'),
        Target('way in the flat, rms turn', 0.5, one('flat', _WAY['turn']), 'deg'),
        Target('end of a loop of 60 m', _CLOSE_M, one('ring', _WAY['closing']), 'm'),
        Target('map of the flat, right within 10 cm', 97.0, one('flat', _WAY['agreement']), '%',
               at_most=False),
        Target('starts that are found within 10 s', 95.0, one('restart', _RESTART['right']), '%',
               at_most=False),
        Target('memory after the flat is known', _SAME_MB,
               one('memory', common.figure('growth_mb')),
               'MB more'),
        Target('p99 with mapping / alone', 1.1, outcomes.ratio('beside', 'alone',
                                                               punctual.latency(0.99)),
               why='the core sends the scans, and both share the caches and the host; '
               + common.disturbances(outcomes, 'beside'))]


CASE = Case('slam', 'mapping: accuracy, speed, memory; the core beside it', _plan, _evaluate,
            takes_data=True)
