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

"""The case `localization`: how far off, how sure, how soon found again; on a recording as well."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
import math
from pathlib import Path
from typing import Any

import numpy as np

from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.case import Samples
from rt_robot_os.tools.bench.case import UNPINNED
from rt_robot_os.tools.bench.cases import common
from rt_robot_os.tools.bench.plot import Plot
from rt_robot_os.tools.bench.plot import Series
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Column
from rt_robot_os.tools.bench.result import Row
from rt_robot_os.tools.bench.result import RunStatus
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.result import Target

_SUBJECTS = f'{__package__}.subjects'
_START_S = 1.0
_DRIVE_S = 0.12
_SEEDS = {'quick': 3, 'usual': 10, 'full': 40}
_BYTES_A_SECOND = 40_000
_SIMULATED = 'simulation'
_RECORDED = 'recording'
_STEPS = 'steps'

_SCENARIOS: Sequence[tuple[str, str, Mapping[str, Any]]] = (
    ('gyro', 'wheels and gyroscope', {}),
    ('wheels', 'wheels alone', {'gyro': False}),
    ('outliers', '10 % false marks', {'outliers': 0.1}),
    ('outliers wheels', '10 % false marks, wheels alone', {'outliers': 0.1, 'gyro': False}),
    ('late', '10 % false marks, all 0.4 s late', {'outliers': 0.1, 'delay_s': 0.4}),
    ('blind', '10 s without a mark', {'blind': (30.0, 40.0)}),
    ('blind wheels', '10 s without a mark, wheels alone', {'blind': (30.0, 40.0), 'gyro': False}),
    ('kidnapped', 'carried away, 10 % false marks', {'kidnapped_s': 30.0, 'outliers': 0.1}))
_OPERATIONS = (
    ('predict', 'prediction of the filter'), ('correct', 'correction by a measured pose'),
    ('step', 'step: odometry and a measured pose, put in its place'),
    ('late', 'step: the same, the measured pose 0.5 s late'),
    ('odometry', 'module odometry: wheels to odom and transform, with the topics'),
    ('localization', 'module localization: odom and a mark to pose, with the topics'))
_SHOWN_MM = 500
_STEP_LIMIT_US = 60.0
_PS_PER_US = 1e6
_GRAVITY_DEG = 15.0
_NOTES = (
    'An eight at 0.3 m/s for 60 s; the right wheel is 1 % larger than it is said to be, both',
    'slip by 5 mm after 1 m, the gyroscope has a bias of 1.1 degrees/s. Ten measured poses a',
    'second, of 1 cm and 1 degree; false ones are anywhere, or within 0.3 m and 0.3 rad.',
    'The worst of all seeds. NIS, the innovation squared over its variance, is 3 in the mean when',
    'the covariances are right; the band holds the means of 95 % of such drives. NEES is the same',
    'of the errors themselves, which are known here.')


def _seconds_for(data: str) -> float:
    """Return how long a recording may take, packed or not."""
    path = Path(data)
    return _START_S + (path.stat().st_size / _BYTES_A_SECOND if path.is_file() else 0.0)


def _plan(options: BenchOptions) -> Sequence[Run]:
    seeds = _SEEDS['quick' if options.quick else 'full' if options.full else 'usual']
    scenarios = {key: dict(scenario) for key, _, scenario in _SCENARIOS}
    runs = [Run(_SIMULATED, 'simulation', f'{_SUBJECTS}:simulated', {
        'seeds': seeds, 'scenarios': scenarios},
        _START_S + seeds * len(scenarios) * _DRIVE_S, UNPINNED, 0, once=True)]
    if options.data:
        runs.append(Run(_RECORDED, 'recording', f'{_SUBJECTS}:recorded', {
            'data': options.data, 'expected': options.expected,
            'imu_mounting': list(options.imu_mounting)}, _seconds_for(options.data),
            UNPINNED, 0, once=True))
    return (*runs, Run(_STEPS, 'steps', f'{_SUBJECTS}:steps', {'measure_ns': options.measure_ns},
                       _START_S + options.seconds, once=options.quick))


def _worst(name: str, scale: float) -> common.Of:
    def of(outcome: RunOutcome) -> float | None:
        values = outcome.samples.get(name)
        return None if values is None or not len(values) else float(values.max()) / scale

    return of


def _degrees(name: str) -> common.Of:
    """Return the worst of microradians."""
    return _worst(name, math.radians(1.0) * 1e6)


def _mean(name: str) -> common.Of:
    """Return the mean of thousandths."""
    return lambda outcome: float(outcome.samples[name].mean()) / 1000


def _nis(key: str) -> common.Of:
    return _mean(f'{key} nis_milli')


def _chance(key: str) -> common.Of:
    """Return how far the mean of one drive may be from 3; chi^2 of 3 has a variance of 6."""
    return lambda outcome: 1.96 * math.sqrt(
        6 / float(outcome.samples[f'{key} innovations'].mean()))


def _inside(key: str) -> common.Of:
    """Return of how many drives, in per cent, the mean is within that."""
    def of(outcome: RunOutcome) -> float:
        off = abs(outcome.samples[f'{key} nis_milli'] / 1000 - 3)
        band = 1.96 * (6 / outcome.samples[f'{key} innovations']) ** 0.5
        return 100 * float((off <= band).mean())

    return of


def _off(key: str) -> common.Of:
    """Return how far the mean of all drives is from 3, as a part of the band of one."""
    def of(outcome: RunOutcome) -> float:
        return abs((_nis(key)(outcome) or 0.0) - 3) / (_chance(key)(outcome) or 1.0)

    return of


def _simulated(outcomes: Outcomes) -> Table:
    columns = (
        Column('rms', 'position', 'cm', 'RMS error'),
        Column('turn', 'heading', 'degrees', 'RMS error'),
        Column('most', 'most', 'cm', 'error'), Column('nis', 'mean', '', 'NIS'),
        Column('chance', 'band +-', '', 'NIS'), Column('inside', 'drives inside', '%', 'NIS'),
        Column('nees', 'mean', '', 'NEES'),
        Column('leap', 'by a false mark', 'sigma', 'moved'),
        Column('blind', 'added blind', 'cm', 'error'),
        Column('found', 'found after', 's', 'carried away'))
    return Table('simulation', columns, [outcomes.row(_SIMULATED, {
        'rms': _worst(f'{key} rms_um', 1e4), 'turn': _degrees(f'{key} rms_urad'),
        'most': _worst(f'{key} most_um', 1e4), 'nis': _nis(key), 'chance': _chance(key),
        'inside': _inside(key), 'nees': _mean(f'{key} nees_milli'),
        'leap': _worst(f'{key} leap_milli', 1e3),
        'blind': _worst(f'{key} blind_um', 1e4), 'found': _worst(f'{key} found_ms', 1e3)}, label)
        for key, label, _ in _SCENARIOS], _NOTES)


def _figure(name: str) -> common.Of:
    return lambda outcome: outcome.figures.get(name)


def _distance(name: str) -> common.Of:
    """Return how far our end is from that of another filter, in m."""
    def of(outcome: RunOutcome) -> float | None:
        figures = outcome.figures
        x, y = figures.get(f'expected {name} x_m'), figures.get(f'expected {name} y_m')
        if x is None or y is None or 'estimate x_m' not in figures:
            return None
        return math.hypot(figures['estimate x_m'] - x, figures['estimate y_m'] - y)

    return of


def _others(outcomes: Outcomes) -> Sequence[str]:
    return sorted({key.split()[1] for outcome in outcomes.measured(_RECORDED)
                   for key in outcome.figures if key.startswith('expected ')})


def _recorded(outcomes: Outcomes) -> Table:
    columns = (Column('x', 'x', 'm', 'end'), Column('y', 'y', 'm', 'end'),
               Column('away', 'from ours', 'm', 'end'),
               Column('rms', 'position', 'm', 'RMS error'),
               Column('turn', 'heading', 'rad', 'RMS error'),
               Column('refused', 'refused', '', 'IMU headings'),
               Column('reopened', 'reopened', '', 'IMU headings'),
               Column('gravity', 'off', 'degrees', 'gravity'))
    rows = [outcomes.row(_RECORDED, {
        'x': _figure('estimate x_m'), 'y': _figure('estimate y_m'), 'rms': _figure('rms_m'),
        'turn': _figure('rms_rad'), 'refused': _figure('headings_refused'),
        'reopened': _figure('headings_reopened'),
        'gravity': _figure('gyro_gravity_off_deg')}, 'rt_robot_os, module localization')]
    if rows[0].status is RunStatus.OK:
        rows.append(outcomes.row(_RECORDED, {
            'x': _figure('odometry x_m'), 'y': _figure('odometry y_m')}, 'wheel odometry alone'))
        rows += [Row(f'expected: {name}', {
            'x': outcomes.metric(_RECORDED, _figure(f'expected {name} x_m')),
            'y': outcomes.metric(_RECORDED, _figure(f'expected {name} y_m')),
            'away': outcomes.metric(_RECORDED, _distance(name))}, published=True)
            for name in _others(outcomes)]
    return Table('recording', columns, rows, (
        'The module itself on the recording, on the virtual clock; expected: what stands in the',
        'file beside it, or that of --expected. IMU headings are refused where they do not fit',
        'the estimate. Gravity is the mean acceleration against the vertical of the robot: where',
        'it is off by more than 15 degrees the IMU is mounted otherwise; see --imu-mounting.'))


def _steps(outcomes: Outcomes) -> Table:
    return Table('time of a step', common.cost_columns('cost'), [outcomes.row(_STEPS, {
        column: common.part_of(name, part, _PS_PER_US)
        for column, part in (('p10', 0.1), ('p50', 0.5), ('p90', 0.9))}, label)
        for name, label in _OPERATIONS],
        ('Means of blocks of 500 calls, the empty loop taken off. The filter is plain Python in',
         'every build; what is late by n steps costs n predictions more.'))


def _targets(outcomes: Outcomes) -> Sequence[Target]:
    def simulated(text: str, limit: float, of: common.Of, unit: str) -> Target:
        return Target(text, limit, outcomes.metric(_SIMULATED, of), unit)

    targets = [
        simulated('mean NIS off 3, of its 95 % band: gyroscope', 1.0, _off('gyro'), ''),
        simulated('mean NIS off 3, of its 95 % band: wheels', 1.0, _off('wheels'), ''),
        simulated('position RMS, 10 % false marks', 5.0, _worst('outliers rms_um', 1e4), 'cm'),
        simulated('heading RMS, 10 % false marks', 2.0, _degrees('outliers rms_urad'), 'degrees'),
        simulated('moved by a false mark', 3.0, _worst('outliers leap_milli', 1e3), 'sigma'),
        simulated('position RMS, all marks 0.4 s late', 5.0, _worst('late rms_um', 1e4), 'cm'),
        simulated('added by 10 s without a mark, gyroscope', 15.0, _worst('blind blind_um', 1e4),
                  'cm'),
        simulated('added by 10 s without a mark, wheels', 15.0,
                  _worst('blind wheels blind_um', 1e4), 'cm'),
        simulated('found after it was carried away', 5.0, _worst('kidnapped found_ms', 1e3), 's'),
        Target('step of odometry with a measured pose', _STEP_LIMIT_US,
               outcomes.metric(_STEPS, common.part_of('step', 0.5, _PS_PER_US)), 'us',
               why=common.disturbances(outcomes, _STEPS))]
    for outcome in outcomes.measured(_RECORDED)[:1]:
        if 'gyro_gravity_off_deg' in outcome.figures:
            targets.append(Target('gravity off the vertical (mounting of the IMU)', _GRAVITY_DEG,
                                  outcomes.metric(_RECORDED, _figure('gyro_gravity_off_deg')),
                                  'degrees'))
    if 'ekf' in _others(outcomes):
        targets.append(Target('end on the recording, from the EKF expected', 0.10,
                              outcomes.metric(_RECORDED, _distance('ekf')), 'm'))
    return targets


def _series(label: str, samples: Mapping[str, Samples], x: str, y: str, scale_x: float = 1e3,
            scale_y: float = 1e3, style: str = 'line') -> Series:
    return Series(label, (samples[x] / scale_x).tolist(), (samples[y] / scale_y).tolist(), style)


def _of(key: str, outcome: RunOutcome) -> dict[str, Samples]:
    """Return the samples of a scenario."""
    return {name.removeprefix(f'{key} '): values for name, values in outcome.samples.items()
            if name.rpartition(' ')[0] == key}


def _near(samples: dict[str, Samples]) -> dict[str, Samples]:
    """Leave out measured poses that are too far away to be shown."""
    inside = np.ones(len(samples['fixes_x_mm']), np.bool_)
    for axis in ('x_mm', 'y_mm'):
        fixes, truth = samples[f'fixes_{axis}'], samples[f'truth_{axis}']
        inside &= (fixes > truth.min() - _SHOWN_MM) & (fixes < truth.max() + _SHOWN_MM)
    return {**samples, **{f'fixes_{axis}': samples[f'fixes_{axis}'][inside]
                          for axis in ('x_mm', 'y_mm')}}


def _way(name: str, title: str, samples: Mapping[str, Samples], curves: Mapping[str, str],
         caption: str) -> Plot:
    return Plot(name, title, 'x, m', 'y, m', [
        _series(label, samples, f'{key}_x_mm', f'{key}_y_mm',
                style='points' if key == 'fixes' else 'line')
        for key, label in curves.items() if len(samples.get(f'{key}_x_mm', ()))], caption,
        equal=True)


def _plots(outcomes: Outcomes) -> Sequence[Plot]:
    plots: list[Plot] = []
    for outcome in outcomes.measured(_SIMULATED)[:1]:
        plots.append(_way('way', 'Where the robot was, and where it believed to be',
                          _near(_of('outliers', outcome)), {
                              'fixes': 'measured poses', 'truth': 'the robot',
                              'estimate': 'estimate'},
                          'One drive with 10 % false marks, of which half are out of the picture: '
                          'none of them moves the estimate.'))
        plots.append(Plot('errors', 'Error of the position', 'time, s', 'error, cm', [
            _series(label, _of(key, outcome), 'time_ms', 'error_um', scale_y=1e4)
            for key, label, _ in _SCENARIOS if key in ('outliers', 'blind', 'blind wheels')],
            'The drives of the first seed; from 30 s to 40 s two of them see no mark.',
            y_from_zero=True))
    for outcome in outcomes.measured(_RECORDED)[:1]:
        plots.append(_way('recording', 'The recording', outcome.samples, {
            'odometry': 'wheel odometry alone', 'fixes': 'measured poses', 'truth': 'the robot',
            'estimate': 'estimate'},
            'What the same wheels give with and without the filter.'))
    return plots


def _evaluate(options: BenchOptions, outcomes: Outcomes) -> CaseResult:
    tables = [_simulated(outcomes), _steps(outcomes)]
    if _RECORDED in outcomes.runs:
        tables.insert(0, _recorded(outcomes))
    return CaseResult(CASE.name, CASE.title, tables, _targets(outcomes), _plots(outcomes))


CASE = Case('localization', 'simulated drives, a recording (--data), times of a step',
            _plan, _evaluate, takes_data=True)
