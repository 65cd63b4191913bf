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

"""The pace of the machine: measured with each run, and a reason of missed targets."""

from __future__ import annotations

import pytest

from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.cases.common import disturbances
from rt_robot_os.tools.bench.machine_state import LOOP
from rt_robot_os.tools.bench.machine_state import MachineState
from rt_robot_os.tools.bench.result import RunStatus


def outcomes_with(*paces: tuple[str, float]) -> Outcomes:
    made = Outcomes([Run(key, key, 'a:b', {}, 1.0) for key in dict.fromkeys(k for k, _ in paces)])
    for key, pace in paces:
        made.add(key, RunOutcome(RunStatus.OK, '', {}, {LOOP: pace, 'env waited_ms': 0.0}, []))
    return made


def test_each_measurement_brings_the_pace_of_a_plain_loop() -> None:
    figures = MachineState().figures()
    assert 0.1 < figures[LOOP] < 100_000


def test_a_slow_cpu_is_told_as_the_reason() -> None:
    known = outcomes_with(('ours', 20.0), ('peer', 10.0), ('ours', 22.0), ('peer', 19.0))
    assert '2.1 times slower' in disturbances(known, 'ours')
    assert '1.4 times slower' in disturbances(known, 'peer')


@pytest.mark.parametrize('pace', [10.0, 11.0])
def test_an_equal_pace_is_no_reason(pace: float) -> None:
    known = outcomes_with(('ours', pace), ('peer', 10.0))
    assert 'slower' not in disturbances(known, 'ours')
