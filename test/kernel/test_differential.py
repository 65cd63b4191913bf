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


"""The compiled kernel and the pure one are the same kernel: random scenarios, run on both."""

from __future__ import annotations

from collections.abc import Iterator
import os
from typing import Any

from differential_builds import Builds
from differential_builds import difference
from differential_regressions import REGRESSIONS
from differential_runner import Runner
from differential_scenario import PipeData
from differential_scenario import ReaderData
from differential_scenario import Scenario
from differential_scenario import TaskData
from differential_scenario import text_of
from differential_scenario import TopicData
from differential_strategies import scenarios
from differential_strategies import SIMPLE
from hypothesis import given
from hypothesis import HealthCheck
from hypothesis import Phase
from hypothesis import settings
from hypothesis import strategies as st
import pytest

from rt_robot_os.base.compiled import state
from rt_robot_os.kernel import VirtualClock

pytest.importorskip('std_msgs', reason='the ROS 2 message packages are not installed')

CASES = 200


@pytest.fixture(scope='module')
def builds() -> Iterator[Builds]:
    """Give the processes of both builds."""
    if not state().compiled:
        pytest.skip('nothing is compiled that could differ from the pure build')
    with Builds() as made:
        yield made


@settings(max_examples=CASES, suppress_health_check=list(HealthCheck))
@given(scenario=scenarios())
def test_both_builds_do_the_same(builds: Builds, scenario: Scenario) -> None:
    found = builds.difference(scenario)
    assert not found, f'{text_of(scenario)}\n{found}'


@pytest.mark.parametrize('name', REGRESSIONS)
def test_both_builds_do_the_same_where_they_once_did_not(builds: Builds, name: str) -> None:
    found = builds.difference(REGRESSIONS[name])
    assert not found, found


# ---- what makes these tests worth something --------------------------------------------------


def everything(programs: tuple[Any, ...], task: TaskData) -> Scenario:
    """Make a scenario in which there is one of each."""
    return Scenario(
        tasks=(task, TaskData(priority=5, period_ns=2_000_000, programs=programs)),
        resources=1, timers=(0,), events=1, topics=(TopicData(depth=2),),
        readers=(ReaderData(task=0, wakes=True),), pipes=(PipeData(),))


@pytest.mark.parametrize('kind', SIMPLE)
def test_each_operation_can_be_done(kind: str) -> None:
    @settings(max_examples=3, phases=[Phase.generate])
    @given(st.tuples(*SIMPLE[kind]))
    def do(arguments: tuple[Any, ...]) -> None:
        found = Runner(everything((((kind, *arguments),),), TaskData())).run()
        done = [entry for entry in found['timeline'] if entry[1] in ('did', 'raised')]
        assert [entry for entry in done if entry[3] == kind]
        assert not [entry for entry in done if entry[4] in ('AttributeError', 'TypeError')]

    do()


def test_a_scenario_gives_the_same_each_time() -> None:
    @settings(max_examples=20, suppress_health_check=list(HealthCheck))
    @given(scenarios())
    def run_twice(scenario: Scenario) -> None:
        assert not difference(Runner(scenario).run(), Runner(scenario).run())

    run_twice()


@pytest.mark.interpreted
def test_a_wrong_kernel_is_found_and_the_scenario_made_small(
        monkeypatch: pytest.MonkeyPatch) -> None:
    def spend_more(clock: VirtualClock, duration_ns: int) -> None:
        spend(clock, duration_ns + (duration_ns > 50_000))

    @settings(max_examples=100, suppress_health_check=list(HealthCheck), derandomize=True)
    @given(scenarios())
    def compare(scenario: Scenario) -> None:
        right = Runner(scenario).run()
        with monkeypatch.context() as patch:
            patch.setattr(VirtualClock, 'spend', spend_more)
            found = difference(right, Runner(scenario).run())
        failing.append((scenario, found))
        assert not found

    spend = VirtualClock.spend
    failing: list[tuple[Scenario, str]] = []
    with pytest.raises(AssertionError):
        compare()
    scenario, found = next(each for each in reversed(failing) if each[1])
    assert len(text_of(scenario).splitlines()) < 15, text_of(scenario)
    assert 'timeline, entry' in found


class _Crash:
    """What ends a process that reads it."""

    def __reduce__(self) -> Any:
        return os.abort, ()


def test_a_process_that_crashes_is_a_difference_and_is_started_again() -> None:
    with Builds(one=False, two=False) as builds:
        builds._two.send(_Crash())
        found = builds._two.receive()
        assert 'SIGABRT' in difference({}, found)
        assert not builds.difference(everything(((('spend', 1000),),), TaskData()))
