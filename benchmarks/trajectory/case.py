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

"""The case `trajectory` (paper 2, section 5.4): a robot driven by a loop of 300 ms, under load."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from typing import Final

from benchmarks.trajectory import plots as trajectory_plots
from benchmarks.trajectory.drives import EIGHT_PERIOD_NS
from benchmarks.trajectory.drives import PAPER_M
from benchmarks.trajectory.drives import PAPER_PERIOD_NS
from benchmarks.trajectory.figures import control_us
from benchmarks.trajectory.figures import cross_cm
from benchmarks.trajectory.figures import cycle_ms
from benchmarks.trajectory.figures import deviation_ms
from benchmarks.trajectory.figures import distance_cm
from benchmarks.trajectory.figures import eight_cm
from benchmarks.trajectory.figures import heading_deg
from benchmarks.trajectory.figures import missed_cm
from benchmarks.trajectory.figures import off
from benchmarks.trajectory.subjects import law_key
from benchmarks.trajectory.subjects import WORK_NS
from benchmarks.trajectory.subjects import WORK_PERIOD_NS
import numpy as np

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.motion.controllers import CONTROLLERS
from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.case import FIFO_PRIORITY
from rt_robot_os.tools.bench.case import LAST_CPU
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.cases import common
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Column
from rt_robot_os.tools.bench.result import Metric
from rt_robot_os.tools.bench.result import published_values
from rt_robot_os.tools.bench.result import Requirement
from rt_robot_os.tools.bench.result import Row
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.result import Target

LOADS: Final = trajectory_plots.LOADS
PAPER: Final = trajectory_plots.PAPER
PERIOD_MS: Final = PAPER_PERIOD_NS / NS_PER_MS
REFERENCE_CM: Final = 100 * PAPER_M
_LIMIT_S, _DRIVE_S = 20.0, 6.6
_EIGHT_LIMIT_S, _EIGHT_S = 30.0, 23.0
_EIGHT_M_S, _SLOW_M_S = 0.6, 0.3
_SLIP: Final = 0.05
_SEED: Final = 1
_SUBJECTS: Final = f'{__package__}.subjects'
_PEERS: Final = f'{__package__}.peers'
_PROCESS_LABEL: Final = 'Process without real time'

_COLUMNS = (
    Column('way', 'way', 'cm', 'driven'), Column('over', 'off 130', 'cm', 'driven'),
    Column('missed', 'off goal', 'cm', 'driven'),
    Column('time', 'time', 'ms', 'until it stops'), Column('shortest', 'min', 'ms', 'cycle'),
    Column('longest', 'max', 'ms', 'cycle'), Column('cross', 'RMS', 'cm', 'off line'),
    Column('heading', 'off', 'deg', 'end heading'))
_NOTES = (
    'A simulated robot (two wheels with a lag of 60 ms, encoders, a StarGazer at 20 Hz with 1 cm',
    'and 1 degree of noise, 50 ms late) drives from (344, 100) to (344, 230) cm and turns from',
    '120 to 90 degrees on the way. It is brought up to the moment of each look and each command,',
    'and drives on as it was told in between: a late loop drives too far. The loop is the same',
    'object everywhere: localise, control (Kanayama), command; it takes for granted that it is',
    'called every 300 ms. Inside: so many tasks (threads, timers) of the same program, each of',
    f'{WORK_NS // NS_PER_MS} ms of CPU time every {WORK_PERIOD_NS // NS_PER_MS} ms, released',
    'together: 20 of them ask for 80 % of a CPU. Outside: so many other programs that compute all',
    'the time on the same CPU.',
    'Way: of the robot, 130 cm at best; it may come back when it drove too far. Off line: RMS',
    'after the first 30 cm. The paper: without real time; with it 300 ms at every load, the rest',
    'not told.')
_EIGHT_COLUMNS = (
    Column('rms', 'RMS', 'cm', 'off line'), Column('worst', 'max', 'cm', 'off line'),
    Column('late99', 'p99', 'ms', 'cycle off 20 ms'),
    Column('late999', 'p99.9', 'ms', 'cycle off 20 ms'),
    Column('latemax', 'max', 'ms', 'cycle off 20 ms'),
    Column('control', 'p50', 'us', 'controller'), Column('time', 'time', 's', 'until it stops'))
_EIGHT_NOTES = (
    f'The same robot on an eight of 4 m by 2 m, at 50 Hz and up to {_EIGHT_M_S:g} m/s, slower in',
    'its curves (0.5 m/s^2 across). Off line: how far from the eight, at each cycle.')
_LAW_COLUMNS = (
    Column('rms', 'RMS', 'cm', 'off line'), Column('worst', 'max', 'cm', 'off line'),
    Column('control', 'p50', 'us', 'controller'), Column('time', 'time', 's', 'until it stops'))
_LAW_NOTES = (
    'The eight again with each tracking law at 50 Hz, on a clock of its own: the seed decides,',
    'not the machine. regulated_pure_pursuit is written to the rules of Nav2, with its defaults.',
    'Controller: a step of the law with all its checks and limits, with warm caches; above, after',
    'the wait for the next cycle, they are cold.')


def _inside(options: BenchOptions) -> Sequence[int]:
    return LOADS[-1:] if options.quick else LOADS


def _plan(options: BenchOptions) -> Sequence[Run]:
    runs = [_paper_run(options, 'rt', count) for count in _inside(options)]
    for system in _peers(options):
        runs += [_paper_run(options, system, count) for count in _inside(options)]
    if not options.quick:
        outside = LOADS[1:] if options.full else LOADS[-1:]
        runs += [_paper_run(options, system, count, outside=True)
                 for system in ('rt', 'process') for count in outside]
        runs += [_paper_run(options, system, LOADS[-1], outside=True)
                 for system in _peers(options) if options.full and system != 'process']
        runs.append(_paper_run(options, 'rt', 7, slip=_SLIP))
        runs += [_eight_run(system, count) for system in _eight_systems(options)
                 for count in (0, 7)]
    speeds = (_SLOW_M_S,) if options.quick else (_SLOW_M_S, _EIGHT_M_S)
    runs.append(Run('laws', 'laws', f'{_SUBJECTS}:laws', {
        'laws': [(law, speed) for speed in speeds for law in CONTROLLERS], 'seed': _SEED},
        common.START_S + 2.5 * len(speeds), priority=0, once=True))
    return runs


def _peers(options: BenchOptions) -> Sequence[str]:
    if options.quick:
        return ('single',)
    return ('threads', 'process', 'single', 'multi', *(('events',) if options.full else ()))


def _eight_systems(options: BenchOptions) -> Sequence[str]:
    return ('rt', 'threads', 'process', 'single') if options.full else ('rt', 'threads', 'single')


def _place(system: str) -> tuple[str, str, int, int, float]:
    """Return label, subject, CPU, priority and the time it takes to start."""
    if system in common.RCLPY:
        return (common.RCLPY_LABELS[system], f'{_PEERS}:executor',
                *common.RCLPY_PLACES[system], common.START_PEER_S)
    label, subject, priority = {
        'rt': ('rt_robot_os', 'kernel', FIFO_PRIORITY),
        'threads': (common.THREADS_LABEL, 'threads', FIFO_PRIORITY),
        'process': (_PROCESS_LABEL, 'threads', 0)}[system]
    return label, f'{_SUBJECTS}:{subject}', LAST_CPU, priority, common.START_S


def _run(system: str, key: str, what: str, seconds: float, limit_s: float,
         **arguments: object) -> Run:
    label, subject, cpu, priority, start_s = _place(system)
    return Run(key, f'{label}, {what}', subject, {
        'eight': False, 'inside': 0, 'outside': 0, 'slip': 0.0, 'seed': _SEED, 'executor': system,
        'limit_ns': round(limit_s * NS_PER_S), **arguments},
        start_s + seconds, cpu, priority, once=True)


def _paper_run(options: BenchOptions, system: str, count: int, outside: bool = False,
               slip: float = 0.0) -> Run:
    where = 'outside' if outside else 'inside'
    seconds = _DRIVE_S
    if system in common.RCLPY and count > 4 and not outside:
        seconds = min(_LIMIT_S, _DRIVE_S * (1.0 + count / 7))
    what = f'{count} {where}' if count else 'no load'
    return _run(system, paper_key(system, count, where, slip),
                f'{what}, {slip:.0%} slip' if slip else what, seconds, _LIMIT_S,
                slip=slip, **{where: count})


def paper_key(system: str, count: int, where: str = 'inside', slip: float = 0.0) -> str:
    """Return the key of a run of the paper's experiment."""
    return f'{system} {count}' + (' outside' if where == 'outside' else '') + (
        ' slip' if slip else '')


def _eight_run(system: str, count: int) -> Run:
    return _run(system, f'eight {system} {count}', f'{count} inside' if count else 'no load',
                _EIGHT_S, _EIGHT_LIMIT_S, eight=True, inside=count, speed_m_s=_EIGHT_M_S,
                law='kanayama')


_METRICS: Mapping[str, common.Of] = {
    'way': distance_cm, 'over': off(distance_cm, REFERENCE_CM), 'missed': missed_cm,
    'time': common.figure('time_ms'),
    'shortest': cycle_ms(np.min), 'longest': cycle_ms(np.max), 'cross': cross_cm,
    'heading': heading_deg}
_EIGHT_METRICS: Mapping[str, common.Of] = {
    'rms': eight_cm(lambda away: np.sqrt(np.mean(away ** 2))), 'worst': eight_cm(np.max),
    'late99': deviation_ms(EIGHT_PERIOD_NS, 0.99), 'late999': deviation_ms(EIGHT_PERIOD_NS, 0.999),
    'latemax': deviation_ms(EIGHT_PERIOD_NS, 1.0), 'control': control_us,
    'time': common.figure('time_ms', 1000.0)}


def _evaluate(options: BenchOptions, outcomes: Outcomes) -> CaseResult:
    tables = [Table('', _COLUMNS, _rows(outcomes), _NOTES)]
    eights = [outcomes.row(key, _EIGHT_METRICS) for key in outcomes.runs
              if key.startswith('eight ')]
    if eights:
        tables.append(Table('An eight at 50 Hz', _EIGHT_COLUMNS, eights, _EIGHT_NOTES))
    tables.append(Table('Tracking laws on the eight', _LAW_COLUMNS, _law_rows(outcomes),
                        _LAW_NOTES))
    return CaseResult(CASE.name, CASE.title, tables, _targets(outcomes),
                      trajectory_plots.plots(outcomes), _requirements(outcomes))


def _rows(outcomes: Outcomes) -> list[Row]:
    rows = [published_values(f'paper, {count} tasks' if count else 'paper, no load', way=way,
                             over=way - REFERENCE_CM, time=time, shortest=shortest,
                             longest=longest)
            for count, (way, time, shortest, longest) in PAPER.items()]
    return rows + [outcomes.row(key, _METRICS) for key in outcomes.runs
                   if key != 'laws' and not key.startswith('eight ')]


def _law_rows(outcomes: Outcomes) -> list[Row]:
    rows = []
    for law, speed in outcomes.runs['laws'].arguments['laws']:
        key = law_key(law, speed)
        rows.append(outcomes.row('laws', {
            'rms': common.figure(f'{key} rms_m', 0.01),
            'worst': common.figure(f'{key} maximum_m', 0.01),
            'control': common.figure(f'{key} control_us'),
            'time': common.figure(f'{key} time_s')}, f'{law}, {speed:g} m/s'))
    return rows


def _worst(outcomes: Outcomes, keys: Sequence[str], of: common.Of) -> Metric | None:
    """Return the worst of some runs; None unless all that are planned were measured."""
    found = [outcomes.metric(key, of) for key in keys if key in outcomes.runs]
    known = [each for each in found if each is not None]
    return max(known, key=lambda each: each.median) if known and len(known) == len(found) else None


def _targets(outcomes: Outcomes) -> Sequence[Target]:
    keys = [key for key in outcomes.runs if key.startswith('rt ') and 'slip' not in key]
    slowest = _worst(outcomes, keys, deviation_ms(PAPER_PERIOD_NS, 1.0))
    why = common.disturbances(outcomes, next(
        (key for key in keys if outcomes.metric(key, deviation_ms(PAPER_PERIOD_NS, 1.0)) == slowest
         ), keys[0]))
    pursuit, ours = (law_key(law, _SLOW_M_S) for law in ('regulated_pure_pursuit', 'kanayama'))

    def law(name: str, scale: float) -> Metric | None:
        return outcomes.metric('laws', common.figure(f'{ours} {name}', scale))

    def over_pursuit(outcome: RunOutcome) -> float | None:
        mine, theirs = (outcome.figures.get(f'{key} rms_m') for key in (ours, pursuit))
        return mine / theirs if mine is not None and theirs else None

    targets = [
        Target('300 ms loop, any load: cycle off by', 1.0, slowest, 'ms', why=why,
               paper='300 ms kept with real time; up to 300 ms off without'),
        Target('way of 130 cm, any load: off by', 1.0,
               _worst(outcomes, keys, off(distance_cm, REFERENCE_CM)), 'cm', why=why,
               paper='2 to 13 cm without real time'),
        Target('time, any load: longest less shortest', PERIOD_MS,
               _spread(outcomes, keys), 'ms', why=why, paper='1660 ms without real time'),
        Target('off the line, RMS after 30 cm, any load', 1.5, _worst(outcomes, keys, cross_cm),
               'cm', why=why),
        Target('heading at the end, any load: off by', 1.0, _worst(outcomes, keys, heading_deg),
               'deg', why=why),
        Target('eight at 0.3 m/s, 50 Hz: RMS', 2.0, law('rms_m', 0.01), 'cm'),
        Target('eight at 0.3 m/s, 50 Hz: farthest', 5.0, law('maximum_m', 0.01), 'cm'),
        Target('eight at 0.3 m/s: RMS / of pure pursuit', 1.1,
               outcomes.metric('laws', over_pursuit)),
        Target('a step of the controller, p50, warm caches', 40.0, law('control_us', 1.0), 'us',
               why=common.disturbances(outcomes, 'laws'))]
    slip = paper_key('rt', 7, slip=_SLIP)
    if slip in outcomes.runs:
        targets.append(Target('way with 5 % slip, 7 tasks: off by', 2.0,
                              outcomes.metric(slip, off(distance_cm, REFERENCE_CM)), 'cm',
                              why=common.disturbances(outcomes, slip)))
    if 'eight rt 7' in outcomes.runs:
        targets.append(Target('eight, 7 tasks: cycle off 20 ms, p99.9', 1.0, outcomes.metric(
            'eight rt 7', deviation_ms(EIGHT_PERIOD_NS, 0.999)), 'ms',
            why=common.disturbances(outcomes, 'eight rt 7')))
    return targets


def _spread(outcomes: Outcomes, keys: Sequence[str]) -> Metric | None:
    """Return by how much the longest time of a run exceeds the shortest."""
    known = [outcomes.metric(key, common.figure('time_ms')) for key in keys]
    times = [each.median for each in known if each is not None]
    return Metric((max(times) - min(times),)) if times and len(times) == len(known) else None


def _requirements(outcomes: Outcomes) -> Sequence[Requirement]:
    of: Callable[[RunOutcome], float | None] = deviation_ms(PAPER_PERIOD_NS, 1.0)
    most = LOADS[-1]
    systems = {'rt_robot_os': f'rt {most}', 'threads': f'threads {most}'}
    found = {name: outcomes.metric(key, of) if key in outcomes.runs else None
             for name, key in systems.items()}
    found['best rclpy'] = common.best(outcomes, [f'{name} {most}' for name in common.RCLPY], of)
    return (Requirement(
        f'a control loop of 300 ms kept to 1 % while {most} tasks of the same program '
        'compute 45 ms each', PERIOD_MS / 100, 'ms', found, case=CASE.name),)


CASE = Case('trajectory', 'a robot driven by a loop of 300 ms, under load (paper 2, Table 1)',
            _plan, _evaluate)
