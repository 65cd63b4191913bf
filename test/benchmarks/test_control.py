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

"""The case control: vectors that a user brings, and what steps cost."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from benchmarks.control import subjects as subject
from benchmarks.control.case import CASE
from benchmarks.control.vectors import compare
from benchmarks.control.vectors import VectorsError
import pytest

from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.result import RunStatus
from rt_robot_os.tools.bench.result import TargetVerdict

LAW = {'target': [0, 5, 0], 'current': [0, 0, 0], 'gains': [1, 10, 0.2, 2, 0.1, 2.5, 1, 1],
       'kappa': 5.407042, 'v': 0.1460446, 'w': 0.7896695}


def written(path: Path, content: Any) -> Path:
    path.write_text(json.dumps(content))
    return path


def test_the_vectors_of_nav2_hold(data_dir: Path) -> None:
    path = data_dir / 'control' / 'nav2_vectors.json'
    if not path.is_file():
        pytest.skip(f'no vectors {path}')
    found = {each.group: each for each in compare(path)}
    assert sum(each.cases for each in found.values()) == 19
    assert max(each.worst for each in found.values()) < 1e-7  # some are of single precision


def test_vectors_of_ones_own_are_compared(tmp_path: Path) -> None:
    path = written(tmp_path / 'own.json', {
        'smooth_control_law': [LAW],
        'egopolar': [{'target': [3, 4, 0.8], 'current': [1, 1, -0.2], 'r': math.sqrt(13),
                      'phi': 0.8 - math.atan2(3, 2), 'delta': -0.2 - math.atan2(3, 2)}],
        'circle_segment': [[[0, 0], [6, 8], 5, [3, 4.5]]]})
    graceful, polar, circle = compare(path)
    assert (graceful.group, graceful.cases) == ('smooth_control_law', 1)
    assert graceful.worst < 1e-6
    assert polar.worst < 1e-12
    assert circle.worst == pytest.approx(0.5)


@pytest.mark.parametrize(('text', 'says'), [
    ('', 'cannot be read'), ('[]', 'must be a JSON object'), ('{}', 'must be a JSON object'),
    ('{"dwa": []}', "'dwa' is no group of vectors"),
    ('{"egopolar": 3}', 'egopolar, case 0'), ('{"egopolar": [{"target": [1]}]}', 'case 0'),
    ('{"lookahead": {"cases": [[1, 2]]}}', "lookahead, case 0: lookahead has no field 'defaults'"),
    ('{"circle_segment": [[[0, 0], [1, "a"], 1, [1, 0]]]}', 'circle_segment, case 0'),
    ('{"circle_segment": [[[0, 0], [2, 0], 1, [1, 0]], [[0, 0]]]}', 'circle_segment, case 1'),
    ('{"odometry": [[1, 2]]}', 'odometry is a list: it must be an object'),
    ('{"rotate_to_heading": {"cases": 3}}', 'cases is a number: it must be a list'),
    ('{"egopolar": [{"target": [3, 4], "current": {"x": 1}}]}',
     r'egopolar\[0\].current is an object: it must be a list'),
    ('{"smooth_control_law": [{"gains": [1, 2]}]}', 'gains has 2 entries: it must have 8'),
    ('{"circle_segment": [[[0, 0], [2, 0], [1], [1, 0]]]}',
     r'circle_segment\[0\]\[2\] is a list: it must be a number'),
    ('{"circle_segment": [[0, [2, 0], 1, [1, 0]]]}', 'case 0'),
    ('{"lookahead": null}', 'lookahead is null: it must be an object'),
    ('[' * 100000, 'cannot be read')])
def test_vectors_that_are_none_are_told_with_their_place(text: str, says: str, tmp_path: Path
                                                         ) -> None:
    path = tmp_path / 'vectors.json'
    path.write_text(text)
    with pytest.raises(VectorsError, match=says):
        compare(path)


@pytest.mark.parametrize('number', ['NaN', 'Infinity', '1e400'])
def test_a_vector_that_is_no_number_is_told(number: str, tmp_path: Path) -> None:
    path = tmp_path / 'vectors.json'
    path.write_text(f'{{"lookahead": {{"defaults": {{"dist": 0.6, "time": 1.5, "min": 0.3, '
                    f'"max": 0.9}}, "cases": [[1.0, {number}]]}}}}')
    with pytest.raises(VectorsError, match='lookahead, case 0: cannot be computed: .* finite'):
        compare(path)


def test_differences_become_a_verdict(tmp_path: Path) -> None:
    options = BenchOptions(0.1, 1, data=str(written(tmp_path / 'v.json', {
        'smooth_control_law': [{**LAW, 'v': 0.2}]})))
    runs = {run.key: run for run in CASE.plan(options)}
    outcomes = Outcomes(tuple(runs.values()))
    measured = subject.vectors(Harness(runs['vectors'].arguments, -2, 0, tmp_path))
    outcomes.add('vectors', RunOutcome(RunStatus.OK, '', measured.samples, measured.figures))
    result = CASE.evaluate(options, outcomes)
    assert result.targets[0].verdict is TargetVerdict.MISSED
    assert 'smooth_control_law' in [row.label for row in result.tables[0].rows]


def test_without_vectors_the_case_says_nothing_of_them() -> None:
    assert [run.key for run in CASE.plan(BenchOptions(0.1, 1))] == ['steps']


@pytest.mark.parametrize('law', ['kanayama', 'park_kuipers'])
def test_what_is_measured_drives(law: str) -> None:
    """A job that does nothing would be cheap."""
    pytest.importorskip('nav_msgs', reason='ROS 2 messages are not installed')
    for step in (subject.FollowerStep(law), subject.ModuleStep(law)):
        for _ in range(300):
            step()
        assert math.hypot(*step.pose[:2]) > 0.5
