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

"""
The routing to a moving sink in the flat of the shipped scenarios.

Half an hour with three seeds is run when RT_ROBOT_OS_BROAD is set, else a minute.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from rt_robot_os.features.wsn.cli.scenario_file import load_scenario
from rt_robot_os.features.wsn.simulator.results import Results
from rt_robot_os.features.wsn.simulator.simulation import Simulation

SCENARIOS = Path(__file__).resolve().parents[2] / 'config/scenarios'
BROAD = bool(os.environ.get('RT_ROBOT_OS_BROAD'))
SECONDS = 1800 if BROAD else 60
SEEDS = (1, 2, 3) if BROAD else (1,)
#: After a break data flow again within two beacon periods.
TWO_PERIODS_S = 8.2


def run(name: str, *assignments: str) -> Results:
    """Run a shipped scenario in the paper's mode."""
    loaded = load_scenario(SCENARIOS / name, assignments=(
        'protocol=paper', f'seconds={SECONDS}', *assignments))
    simulation = Simulation(*loaded)
    simulation.run()
    return simulation.results()


@pytest.mark.parametrize('seed', SEEDS)
def test_a_sink_that_stands_still(seed: int) -> None:
    results = run('home12.yaml', f'seed={seed}')
    assert results.delivery >= 0.99
    assert results.duplicates == 0
    assert max(results.gap_s, default=0.0) <= TWO_PERIODS_S


@pytest.mark.parametrize('seed', SEEDS)
def test_a_sink_that_drives_through_four_rooms(seed: int) -> None:
    results = run('home12_moving.yaml', f'seed={seed}')
    assert results.delivery >= 0.98
    assert results.duplicates == 0
    assert max(results.gap_s, default=0.0) <= TWO_PERIODS_S


def test_no_copy_reaches_the_application_however_bad_the_air() -> None:
    results = run('home12_moving.yaml', 'radio.noise=heavy', 'radio.wall_db=14', 'seconds=40')
    assert 0.5 < results.delivery < 1
    assert results.counters['duplicates'] > 0
    assert results.duplicates == 0


@pytest.mark.parametrize('dead', [4, 8])
def test_the_others_send_on_when_one_dies(dead: int) -> None:
    results = run('home12.yaml', f'faults=["kill {dead} at 20"]')
    rest = [node for node in results.generated if node != dead]
    delivered = sum(results.delivered[node] for node in rest)
    assert delivered >= 0.99 * sum(results.generated[node] for node in rest)
