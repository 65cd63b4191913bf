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

"""The case `emergency`: the whole chain over real ptys, and what is made of its samples."""

from __future__ import annotations

from pathlib import Path

from benchmarks.emergency import subjects as emergency
from benchmarks.emergency.case import CASE
import numpy as np
import pytest

from rt_robot_os.settings import load
from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.case import UNPINNED
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.result import RunStatus
from rt_robot_os.tools.bench.result import TargetVerdict
from rt_robot_os.tools.plan.analysis import analyse
from rt_robot_os.tools.plan.chains import ChainRequest
from rt_robot_os.tools.plan.chains import chains_of
from rt_robot_os.tools.plan.given import Given
from rt_robot_os.tools.plan.robot import robot_tasks
from rt_robot_os.tools.plan.typical import shipped

MS = 1_000_000
# Both end with the last alarm; only where the machine is very busy they need more than a second.
LONG_NS = 60_000 * MS


class _Here(Harness):
    """Leaves this process as it is."""

    def prepare(self, freeze: bool = False) -> None:
        """Do nothing."""


def test_every_alarm_on_the_wire_turns_the_wheels_on_theirs(tmp_path: Path) -> None:
    pytest.importorskip('sensor_msgs', reason='ROS 2 messages are not installed')
    measured = emergency.realtime(_Here({
        'busy': 1, 'alone': False, 'count': 3, 'start_ns': 300 * MS, 'measure_ns': LONG_NS},
        UNPINNED, 0, tmp_path))
    assert len(measured.samples['delay_ns']) == 3
    assert (measured.samples['delay_ns'] > 0).all()


def test_a_thread_that_does_it_alone_is_measured_the_same_way(tmp_path: Path) -> None:
    measured = emergency.plain(_Here({'busy': 1, 'alone': False, 'count': 2, 'start_ns': 10 * MS,
                                      'measure_ns': LONG_NS}, UNPINNED, 0, tmp_path))
    assert len(measured.samples['delay_ns']) == 2


def test_the_chain_that_is_measured_is_the_one_that_plan_bounds(tmp_path: Path) -> None:
    pytest.importorskip('sensor_msgs', reason='ROS 2 messages are not installed')
    settings = load([emergency.configuration(tmp_path)])
    robot = robot_tasks(settings, None, Given(
        typical=shipped(), execution_ns={'where': 100_000, 'operator': 100_000}))
    found, = chains_of([ChainRequest(('sink', 'alarms', 'base'))], robot, analyse(robot.tasks))
    assert tuple(stage.task.removesuffix('/arrival') for stage in found.stages) == emergency.CHAIN
    assert found.bound_ns is not None and found.bound_ns > 0


def test_the_verdict_goes_by_the_99th_of_100_of_each_load() -> None:
    options = BenchOptions(1.0, 1)
    outcomes = Outcomes(CASE.plan(options))
    for key in outcomes.runs:
        slow = 11 * MS if key == 'rt 20' else MS
        outcomes.add(key, RunOutcome(RunStatus.OK, '', {
            'delay_ns': np.array([MS] * 480 + [slow] * 20)}, {'answered_percent': 100.0}))
    result = CASE.evaluate(options, outcomes)
    assert {target.text: target.verdict for target in result.targets} == {
        'alarm to motors, 0 computing, p99': TargetVerdict.REACHED,
        'alarm to motors, 5 computing, p99': TargetVerdict.REACHED,
        'alarm to motors, 7 computing, p99': TargetVerdict.REACHED,
        'alarm to motors, 20 computing, p99': TargetVerdict.MISSED,
        'p99, 5 computing / none': TargetVerdict.REACHED,
        'p99, 7 computing / none': TargetVerdict.REACHED,
        'p99, 20 computing / none': TargetVerdict.MISSED,
        'alarms that moved the robot, 20 computing': TargetVerdict.REACHED}
    assert len(result.tables[0].rows) == 7


def test_the_ratio_is_that_of_each_round_and_the_median_of_the_rounds_is_shown() -> None:
    options = BenchOptions(1.0, 3, full=True)
    outcomes = Outcomes(CASE.plan(options))
    # The second round was disturbed, in all its runs alike; of the third one run alone.
    for own, others in ((2, 2), (30, 30), (6, 2)):
        for key in outcomes.runs:
            outcomes.add(key, RunOutcome(RunStatus.OK, '', {
                'delay_ns': np.full(200, (own if key == 'rt 7' else others) * MS)},
                {'answered_percent': 100.0}))
    result = CASE.evaluate(options, outcomes)
    ratio, = (each.measured for each in result.targets if each.text == 'p99, 7 computing / none')
    assert ratio is not None
    assert (ratio.values, ratio.median) == ((1.0, 1.0, 3.0), 1.0)
    rows = {row.run: row.metrics.get('ratio') for row in result.tables[0].rows}
    assert rows['rt 0'] is None and rows['plain 0'] is None  # they are what is compared with
    assert rows['rt 7'] == ratio and rows['plain 20'] is not None


def test_every_round_measures_every_load() -> None:
    for options in (BenchOptions(1.0, 3), BenchOptions(1.0, 3, full=True)):
        assert not any(run.once for run in CASE.plan(options))
