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

"""The measures of mapping, and the case that shows them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('scipy', reason='scipy is not installed')

from benchmarks.slam import peer_programs as slam_programs  # noqa: E402, I100
from benchmarks.slam.case import CASE  # noqa: E402
from benchmarks.slam.measures import agreement  # noqa: E402
from benchmarks.slam.measures import closing_error  # noqa: E402
from benchmarks.slam.measures import fitted_error  # noqa: E402
from benchmarks.slam.measures import way_errors  # noqa: E402
from rt_robot_os.features.mapping.slam.transforms import composed  # noqa: E402
from rt_robot_os.motion.grid_map import GridMap  # noqa: E402
from rt_robot_os.tools.bench.case import BenchOptions  # noqa: E402
from rt_robot_os.tools.bench.case import Outcomes  # noqa: E402
from rt_robot_os.tools.bench.case import RunOutcome  # noqa: E402
from rt_robot_os.tools.bench.case import UNPINNED  # noqa: E402
from rt_robot_os.tools.bench.harness import Harness  # noqa: E402
from rt_robot_os.tools.bench.harness import Unavailable  # noqa: E402
from rt_robot_os.tools.bench.result import RunStatus  # noqa: E402
from rt_robot_os.tools.bench.result import TargetVerdict  # noqa: E402


def circle() -> np.ndarray:
    turns = np.linspace(0.0, math.tau, 50, endpoint=False)
    return np.stack((3 * np.cos(turns), 3 * np.sin(turns), turns + math.pi / 2), -1)


def test_a_way_is_measured_from_its_first_pose_or_laid_on_the_true_one() -> None:
    truth = circle()
    moved = composed(np.broadcast_to(np.array((5.0, -2.0, 0.7)), truth.shape), truth)
    assert way_errors(truth, moved) == pytest.approx((0.0, 0.0), abs=1e-6)
    turned = truth.copy()
    turned[0, 2] += math.radians(1.0)  # the first pose alone is wrong
    rms_m, rms_deg = way_errors(truth, turned)
    assert rms_m == pytest.approx(math.radians(1.0) * 3 * math.sqrt(2), rel=0.05)
    assert rms_deg == pytest.approx(0.99, abs=0.02)
    assert fitted_error(truth, turned) == pytest.approx(0.0, abs=1e-9)
    ended = truth.copy()
    ended[-1, 0] += 0.05
    assert closing_error(truth, ended) == pytest.approx(0.05)


def test_cells_agree_within_ten_centimetres_and_no_further() -> None:
    cells = np.zeros((60, 60), np.int8)
    cells[20, 10:50] = 100
    true = GridMap(cells, 0.05, (-1.0, 2.0, 0.0))

    def made(rows: int) -> float:
        found = np.zeros((40, 40), np.int8)
        found[10 + rows, :] = 100
        # Its origin is at the fifth column and the tenth row of the true one.
        return agreement(GridMap(found, 0.05, (0.0, 0.0, 0.0)), np.array((-0.5, 2.5, 0.0)), true)

    assert made(0) == made(2) == 1.0
    assert made(3) == pytest.approx(1.0 - 40 / 1600)


def test_the_aims_follow_the_figures_and_a_missing_peer_is_a_line() -> None:
    options = BenchOptions(2.0, 1)
    outcomes = Outcomes(CASE.plan(options))
    samples = {'adds': np.full(100, 5_000_000), 'updates': np.full(100, 12_000_000)}
    for key, off in (('flat', 0.02), ('ring', 0.06)):
        outcomes.add(key, RunOutcome(RunStatus.OK, '', samples, {
            'scans_per_s': 100.0, 'rms_m': off, 'rms_deg': 0.1, 'fitted_m': off,
            'closing_m': off, 'agreement': 99.0}))
    outcomes.add('kiss', RunOutcome(RunStatus.MISSING, 'pip install kiss-icp'))
    result = CASE.evaluate(options, outcomes)
    known = {target.text: target.verdict for target in result.targets}
    assert known['way in the flat, rms'] is TargetVerdict.REACHED
    assert known['scans mapped on one core'] is TargetVerdict.REACHED
    assert known['longest map update'] is known['end of a loop of 60 m'] is TargetVerdict.MISSED
    assert known['p99 with mapping / alone'] is TargetVerdict.UNKNOWN
    assert all(len(text) <= 48 for text in known)
    row = next(row for row in result.tables[0].rows if row.run == 'kiss')
    assert (row.status, row.reason) == (RunStatus.MISSING, 'pip install kiss-icp')


def test_a_log_is_compared_with_the_relations_beside_it(tmp_path: object) -> None:
    options = BenchOptions(2.0, 1, data='/somewhere/intel.csv.gz', expected='/there/intel.csv')
    runs = {run.key: run for run in CASE.plan(options)}
    assert runs['log'].arguments == runs['log kiss'].arguments == runs['log karto'].arguments == {
        'data': '/somewhere/intel.csv.gz', 'relations': '/there/intel.csv'}
    assert [run.key for run in CASE.plan(BenchOptions(0.5, 1, quick=True))] == ['flat']


#: It answers with the odometry that it is given, 1.5 CPU seconds later, as it says.
_STAND_IN = """#!/bin/sh
echo 1.5
read beams start step reach
while read seconds x y yaw ranges; do echo "$x $y $yaw"; done
"""


def test_a_program_gets_each_scan_and_its_poses_are_compared(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log, relations = tmp_path / 'way.csv', tmp_path / 'way.relations.csv'
    log.write_text('# t, odometry x y yaw, reference x y yaw, then 3 ranges in m, first beam at '
                   '-90.0 deg, step 90.0000 deg\n' + ''.join(
                       f'{at},{0.5 * at},0,0,0,0,0,1.0,,2.0\n' for at in range(4)))
    relations.write_text('i,j,dx,dy,dyaw\n0,1,0.5,0.0,0.0\n0,3,1.3,0.0,0.0\n')
    harness = Harness({'data': str(log), 'relations': str(relations)}, UNPINNED, 0, tmp_path)
    monkeypatch.setenv('PATH', str(tmp_path), prepend=':')
    monkeypatch.setattr(Harness, 'prepare', lambda *_: None)
    program = tmp_path / 'slam_peer_karto'
    with pytest.raises(Unavailable, match='slam_peer_karto is not on PATH: build it'):
        slam_programs.karto(harness)
    program.write_text(_STAND_IN)
    program.chmod(0o755)
    figures = slam_programs.karto(harness).figures
    assert figures['cpu_s'] == 1.5 and figures['scans_per_s'] == pytest.approx(4 / 1.5)
    assert figures['loops_mean_m'] == pytest.approx(0.2)
    program.write_text('#!/bin/sh\necho no settings >&2\nexit 2\n')
    with pytest.raises(RuntimeError, match='slam_peer_karto ended with 2: no settings'):
        slam_programs.karto(harness)
