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

"""The case `reaction`: the whole way over real ptys, and what is made of its samples."""

from __future__ import annotations

from pathlib import Path

from benchmarks.reaction import subjects as reaction
from benchmarks.reaction.case import CASE
import numpy as np
import pytest

from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.case import UNPINNED
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.result import RunStatus
from rt_robot_os.tools.bench.result import TargetVerdict

MS = 1_000_000


class _Here(Harness):
    """Leaves this process as it is."""

    def prepare(self, freeze: bool = False) -> None:
        """Do nothing."""


@pytest.mark.parametrize('subject', [reaction.realtime, reaction.plain])
def test_every_obstacle_on_the_wire_stops_the_motors_on_theirs(
        subject: reaction.Worker, tmp_path: Path) -> None:
    pytest.importorskip('sensor_msgs', reason='ROS 2 messages are not installed')
    measured = subject(_Here({'busy': 1, 'alone': False, 'count': 4, 'measure_ns': 600 * MS},
                             UNPINNED, 0, tmp_path))
    assert len(measured.samples['reaction_ns']) > 0
    assert (measured.samples['reaction_ns'] > 0).all()


def test_the_verdict_goes_by_the_99th_of_100() -> None:
    options = BenchOptions(1.0, 1)
    outcomes = Outcomes(CASE.plan(options))
    for key in outcomes.runs:
        slow = 6 * MS if key == 'rt alone' else MS
        outcomes.add(key, RunOutcome(RunStatus.OK, '', {
            'reaction_ns': np.array([MS] * 480 + [slow] * 20)}, {'answered_percent': 100.0}))
    result = CASE.evaluate(options, outcomes)
    assert [target.verdict for target in result.targets] == [
        TargetVerdict.MISSED, TargetVerdict.REACHED, TargetVerdict.MISSED]
    assert len(result.tables[0].rows) == 6
