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

"""The case `sink`: real frames over a real pty, the cost of a frame, and what is made of both."""

from __future__ import annotations

from pathlib import Path

from benchmarks.sink import host as sink_host
from benchmarks.sink import subjects as sink
from benchmarks.sink.case import CASE
import numpy as np
import pytest

from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.case import UNPINNED
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.result import RunStatus
from rt_robot_os.tools.bench.result import TargetVerdict

MS = 1_000_000
S = 1_000_000_000
pytest.importorskip('std_msgs', reason='ROS 2 messages are not installed')


class _Here(Harness):
    """Leaves this process as it is."""

    def prepare(self, freeze: bool = False) -> None:
        """Do nothing."""


def run(subject: sink.Worker, folder: Path, **arguments: float) -> Measurement:
    return subject(_Here({
        'busy': 0, 'processes': 0, 'alone': False, 'interval_ns': 0, 'measure_ns': 300 * MS,
        'start_ns': 200 * MS, 'more': 0, 'patience': 1.0, **arguments}, UNPINNED, 0, folder))


def test_alarms_reach_their_task_in_a_flood(tmp_path: Path) -> None:
    measured = run(sink.realtime, tmp_path)
    assert len(measured.samples['delay_ns']) > 0
    assert (measured.samples['delay_ns'] > 0).all()


def test_a_cycle_that_was_not_finished_is_measured_by_its_part() -> None:
    handled = np.zeros(sink.CYCLE + 1, np.int64)
    handled[10:60] = S + np.arange(50) * 20 * MS
    assert sink._cycle_s(handled) == pytest.approx(3.6)
    assert sink._cycle_s(S + np.arange(200) * 10 * MS) == pytest.approx(1.8)


def test_nothing_is_lost_at_full_line_rate() -> None:
    measured = sink_host.hour(_Here({'seconds': 3}, UNPINNED, 0, Path('.')))
    assert measured.figures['frames'] == 480
    assert measured.figures['lost'] == 0
    assert measured.figures['cpu_percent'] > 0


def test_the_cost_of_a_frame_is_taken_in_batches() -> None:
    measured = sink_host.frames(_Here({'count': 1000}, UNPINNED, 0, Path('.')))
    assert all((measured.samples[name] > 0).all() for name in ('decode_ns', 'sort_ns'))


def test_the_verdicts_go_by_their_limits() -> None:
    options = BenchOptions(1.0, 1)
    outcomes = Outcomes(CASE.plan(options))
    for key in outcomes.runs:
        slow = 2 * MS if key == 'flood 10' else MS // 2
        outcomes.add(key, RunOutcome(RunStatus.OK, '', {
            'delay_ns': np.array([MS // 2] * 480 + [slow] * 20),
            'decode_ns': np.array([9000] * 50), 'sort_ns': np.array([5000] * 50)}, {
                'arrived_percent': 100.0, 'cycle_s': 1.8, 'frames': 576_000.0, 'lost': 0.0,
                'cpu_percent': 6.0}))
    found = CASE.evaluate(options, outcomes)
    assert [target.verdict for target in found.targets] == [
        TargetVerdict.MISSED, TargetVerdict.MISSED, TargetVerdict.REACHED, TargetVerdict.REACHED,
        TargetVerdict.REACHED,
        TargetVerdict.REACHED, TargetVerdict.MISSED]
    assert [len(table.rows) for table in found.tables] == [8, 5, 3]
