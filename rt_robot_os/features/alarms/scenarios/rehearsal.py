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
The scenarios of ``alarms rehearse``: thousands of emergencies while everything that can fail does.

Each emergency must end acknowledged, or exhaust its escalation; no recipient may be shown the same
notification twice. The same seed gives the same run.
"""

from __future__ import annotations

from functools import partial
import hashlib
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.alarms.scenarios.fixture import AlarmFixture
from rt_robot_os.features.alarms.scenarios.result import RehearsalResult
from rt_robot_os.sim.scenarios.runner import run_scenarios

#: Emergencies of one robot; then another scenario begins, with a seed of its own.
EMERGENCIES: Final = 40
_SEEDS: Final = 1_000_003


class _Scenario(NamedTuple):
    number: int
    fixture: AlarmFixture
    settled: bool


def rehearse(alarms: int, seed: int, first: int = 0) -> RehearsalResult:
    """
    Run scenarios with this number of emergencies in all.

    :param first: the number of the scenario to begin with, to repeat that one.
    """
    result = RehearsalResult()
    digest = hashlib.sha256()
    numbers = range(first, first - (-alarms // EMERGENCIES))
    for scenario in run_scenarios(partial(_run, alarms, seed, first), numbers):
        _count(scenario, result)
        digest.update(scenario.fixture.digest.digest())
    result.virtual_hours = round(result.virtual_hours, 2)
    result.digest = digest.hexdigest()[:16]
    return result


def _run(alarms: int, seed: int, first: int, number: int) -> _Scenario:
    left = alarms - (number - first) * EMERGENCIES
    fixture = AlarmFixture(seed * _SEEDS + number, min(EMERGENCIES, left))
    return _Scenario(number, fixture, fixture.run())


def _count(scenario: _Scenario, result: RehearsalResult) -> None:
    """Add what became of a scenario."""
    fixture = scenario.fixture
    if not scenario.settled:
        result.scenes_lost.append(scenario.number)
    found = list(fixture.emergencies.values())
    result.alarms += len(found)
    result.acknowledged += sum(each.acknowledged for each in found)
    result.top += sum(each.exhausted and not each.acknowledged for each in found)
    result.lost += sum(not each.settled for each in found)
    for recipient in fixture.recipients.values():
        result.shown += len(recipient.shown)
        result.shown_twice += recipient.twice
        result.folded += recipient.folded
    result.told_anew += fixture.renumbered
    result.forgotten += fixture.forgotten
    result.virtual_hours += fixture.elapsed_ns / (3600 * NS_PER_S)
    result.went_wrong += fixture.faults.counts
