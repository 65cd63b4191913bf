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

"""A rule whose values become too old: when they do so, what counts anew, and what stays."""

from __future__ import annotations

import pytest
from rt_robot_os.features.health.rule.evaluation import RuleState
from rt_robot_os.features.health.rule.parser import read_rule

S = 10**9


def transitions(text: str, samples: list[tuple[int, float]], until_s: int, stale_s: int = 10
                ) -> list[tuple[int, bool]]:
    """Return what a rule about topic ``a`` did, in seconds."""
    state = RuleState(read_rule(text), stale_s * S)
    state.start(0)
    found = []
    for at_s, value in samples:
        found += state.advance(at_s * S, through=False)
        state.update(0, value, at_s * S)
        found += state.advance(at_s * S)
    found += state.advance(until_s * S)
    return [(each.time_ns // S, each.active) for each in found]


def every(seconds: int, begin_s: int, end_s: int, value: float = 1.0) -> list[tuple[int, float]]:
    return [(at_s, value) for at_s in range(begin_s, end_s, seconds)]


@pytest.mark.parametrize(('gap_s', 'raised_s'), [(9, 21), (10, 21), (11, 32), (14, 35)])
def test_a_duration_begins_anew_after_a_gap_in_which_nothing_was_known(
        gap_s: int, raised_s: int) -> None:
    samples = [(1, 1.0), *every(5, 1 + gap_s, 60)]
    assert transitions('a.x > 0.5 for 20 s', samples, 60) == [(raised_s, True)]


def test_a_value_is_known_until_it_is_as_old_as_it_may_be() -> None:
    state = RuleState(read_rule('a.x > 0.5'), 10 * S)
    state.start(0)
    state.update(0, 1.0, S)
    state.advance(11 * S - 1)
    assert state.known is True and state.due_ns == 11 * S
    state.advance(11 * S)
    assert state.known is None and state.active


def test_what_is_too_old_neither_ends_a_cause_nor_lets_its_end_be_counted() -> None:
    samples = [(1, 1.0), (20, 1.0), (25, 0.0)]
    assert transitions('a.x > 0.5', samples, 100) == [(1, True), (25, False)]


def test_without_an_age_a_value_holds_for_ever() -> None:
    assert transitions('a.x > 0.5 for 20 s', [(1, 1.0)], 100, stale_s=0) == [(21, True)]


def test_the_contrary_of_what_is_not_known_is_not_known() -> None:
    assert transitions('not a.x > 0.5', [(1, 1.0)], 100) == []
    assert transitions('not a.x > 0.5', [(1, 1.0), (30, 0.0)], 100) == [(30, True)]
