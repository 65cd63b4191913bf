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

"""The parts of scenario tests: the timeline, injected faults, and the runner of many seeds."""

from __future__ import annotations

from functools import partial
from random import Random

import pytest

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.sim.scenarios.faults import FaultInjector
from rt_robot_os.sim.scenarios.runner import run_scenarios
from rt_robot_os.sim.scenarios.timeline import seconds
from rt_robot_os.sim.scenarios.timeline import VirtualTimeline


def test_actions_run_in_the_order_of_their_times_and_then_of_their_addition() -> None:
    timeline, seen = VirtualTimeline(100), list[tuple[str, int]]()

    def note(name: str) -> None:
        seen.append((name, timeline.now_ns))

    timeline.after(20, partial(note, 'later'))
    timeline.at(110, partial(note, 'first'))
    timeline.after(10, partial(note, 'second'))
    timeline.after(-5, partial(note, 'now'))
    while timeline.step():
        pass
    assert seen == [('now', 100), ('first', 110), ('second', 110), ('later', 120)]


def test_what_is_due_sees_the_time_to_which_it_is_run_and_may_add_more() -> None:
    timeline, seen = VirtualTimeline(), list[int]()
    timeline.at(10, lambda: timeline.after(0, lambda: seen.append(timeline.now_ns)))
    timeline.at(60, lambda: seen.append(-1))
    timeline.run_until(50)
    assert seen == [50]
    timeline.clear()
    timeline.run_until(100)
    assert seen == [50] and not timeline.step()


def test_a_fault_begins_and_ends_and_one_without_a_duration_does_not_end() -> None:
    timeline, seen = VirtualTimeline(), list[tuple[str, int]]()
    injector = FaultInjector(timeline, Random(1))

    def note(what: str) -> None:
        seen.append((what, timeline.now_ns // NS_PER_S))

    injector.once(2.0, 3.0, partial(note, 'begins'), partial(note, 'ends'))
    injector.once(4.0, 0.0, partial(note, 'lasts'), partial(note, 'never'))
    while timeline.step():
        pass
    assert seen == [('begins', 2), ('lasts', 4), ('ends', 5)]


def test_a_recurring_fault_comes_about_as_often_as_its_mean_says() -> None:
    timeline, seen = VirtualTimeline(), list[str]()
    FaultInjector(timeline, Random(1)).recurring('power', 10.0, seen.append)
    while timeline.now_ns < seconds(10_000.0):
        timeline.step()
    assert {*seen} == {'power'} and 900 < len(seen) < 1100


@pytest.mark.parametrize('jobs', [1, 2])
def test_outcomes_come_in_the_order_of_the_numbers(jobs: int) -> None:
    assert list(run_scenarios(partial(pow, 2), range(10), jobs)) == [2 ** n for n in range(10)]
