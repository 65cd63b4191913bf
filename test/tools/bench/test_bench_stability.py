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

"""The long test: its rows, and what is left of them when it is interrupted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.cases.stability.case import CASE
from rt_robot_os.tools.bench.cases.stability.motion import Filter
from rt_robot_os.tools.bench.cases.stability.motion import ImuModel
from rt_robot_os.tools.bench.cases.stability.motion import truth
from rt_robot_os.tools.bench.cases.stability.subjects import COLUMNS
from rt_robot_os.tools.bench.cases.stability.subjects import measured_s
from rt_robot_os.tools.bench.cases.stability.subjects import Notes
from rt_robot_os.tools.bench.cases.stability.subjects import read_csv
from rt_robot_os.tools.bench.result import RunStatus

ROW = ','.join(['6.0', '1000.0', '400.0', '200.0', '20.0', '55.0', '0.05', '1', '30000', '0', '0',
                '10', '0'])


def _written(folder: Path, *lines: str) -> BenchOptions:
    (folder / 'stability-kernel.csv').write_text('\n'.join((','.join(COLUMNS), *lines)))
    return BenchOptions(1.0, 1, out=str(folder))


def test_the_filter_finds_the_attitude() -> None:
    sensor, solver = ImuModel(), Filter()
    errors = []
    for i in range(4000):
        t = 100.0 + i / 1000
        solver.update(t, sensor.read(t))
        roll, pitch = truth(t)
        errors.append(max(abs(solver.roll - roll), abs(solver.pitch - pitch)))
    assert max(errors[1000:]) < 0.01


def test_rows_can_be_read_while_they_are_written(tmp_path: Path) -> None:
    path = tmp_path / 'rows.csv'
    notes = Notes(str(path), 10)
    notes.begin()
    notes.acquire.call()
    notes.row(missed=2)
    with open(path, 'a') as file:
        file.write('12.0,1000')  # half a row
    found = read_csv(path)
    assert set(found) == set(COLUMNS)
    assert found['missed'].tolist() == [2.0]
    assert notes.measured().samples['missed'].tolist() == [2.0]


def test_what_an_interrupted_run_has_written_is_evaluated(tmp_path: Path) -> None:
    assert CASE.partial is not None
    options = _written(tmp_path, ROW, ROW.replace('55.0', '77.0'), '12.0,1000')
    outcomes = CASE.partial(options)
    assert outcomes is not None
    assert len(outcomes.measured('kernel')[0].samples['time_s']) == 2
    assert outcomes.all('events')[0].status is RunStatus.MISSING
    result = CASE.evaluate(options, outcomes)
    ours = next(row for row in result.tables[0].rows if row.label == 'rt_robot_os kernel')
    known = {key: metric.median for key, metric in ours.metrics.items() if metric is not None}
    assert known['delay_max'] == 77.0
    assert known['missed'] == 2.0
    assert known['acquire_hz'] == 1000.0


def test_without_rows_there_is_nothing_to_evaluate(tmp_path: Path) -> None:
    assert CASE.partial is not None
    assert CASE.partial(BenchOptions(1.0, 1, out=str(tmp_path))) is None
    assert CASE.partial(BenchOptions(1.0, 1)) is None


def test_a_file_of_something_else_is_refused(tmp_path: Path) -> None:
    path = tmp_path / 'other.csv'
    path.write_text('a,b\n1,2\n')
    with pytest.raises(ValueError, match='other.csv'):
        read_csv(path)


def test_the_worst_row_counts(tmp_path: Path) -> None:
    options = _written(tmp_path, ROW, ROW.replace('1000.0', '997.0'), ROW)
    assert CASE.partial is not None
    outcomes = CASE.partial(replace(options))
    assert outcomes is not None
    metric = CASE.evaluate(options, outcomes).tables[0].rows[1].metrics['acquire_hz']
    assert metric is not None and metric.median == 997.0


@pytest.mark.parametrize('waited_ms, stolen_ms, percent', [
    (0.0, 0.0, 100 * 14 / (10_000 * 1.4)), (10.0, 0.0, 0.0), (0.0, 10.0, 0.0),
    (5.0, 0.0, 100 * 7 / (10_000 * 1.4))])
def test_what_is_missed_while_the_host_has_the_cpu_is_not_the_kernels(
        waited_ms: float, stolen_ms: float, percent: float) -> None:
    options = BenchOptions(1.0, 1)
    outcomes = Outcomes(CASE.plan(options))
    samples = {name: np.zeros(2) for name in COLUMNS}
    samples |= {'time_s': np.array([5.0, 10.0]), 'missed': np.array([0.0, 14.0])}
    outcomes.add('kernel', RunOutcome(RunStatus.OK, '', samples, {
        'env waited_ms': waited_ms, 'env stolen_ms': stolen_ms, 'env switches': 0.0}))
    target = next(each for each in CASE.evaluate(options, outcomes).targets
                  if 'missed' in each.text)
    assert target.measured is not None and target.measured.median == pytest.approx(percent)


def test_an_interrupted_run_goes_on_after_its_last_row(tmp_path: Path) -> None:
    options = replace(_written(tmp_path, ROW, '12.0,1000'), hours=0.01)
    fresh = {run.key: run for run in CASE.plan(BenchOptions(1.0, 1, hours=0.01))}
    runs = {run.key: run for run in CASE.plan(options)}
    assert runs['kernel'].arguments['from_s'] == 6.0
    assert runs['kernel'].arguments['measure_ns'] == 30 * 10**9
    assert runs['kernel'].arguments['row_ns'] == fresh['kernel'].arguments['row_ns']
    assert runs['events'].arguments['from_s'] == 0.0
    notes = Notes(runs['kernel'].arguments['csv'], 10, 6.0)
    notes.begin()
    notes.row(missed=0)
    rows = notes.measured().samples
    # The half row is gone, the one before it is not.
    assert len(rows['time_s']) == 2 and rows['time_s'][0] == 6.0 <= rows['time_s'][1]
    assert measured_s(tmp_path / 'stability-kernel.csv') >= 6.0


def test_what_was_complete_is_not_measured_again(tmp_path: Path) -> None:
    options = replace(_written(tmp_path, ROW), hours=6.0 / 3600)
    assert CASE.plan(options)[0].arguments['measure_ns'] == 0
    assert measured_s(tmp_path / 'none.csv') == 0.0
