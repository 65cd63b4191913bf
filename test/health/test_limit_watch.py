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

"""Personal limits: how long a value must be beyond one, and how long it must be well again."""

from __future__ import annotations

import pytest

from rt_robot_os.features.health.assessment.limit_watch import LimitWatch
from rt_robot_os.features.health.assessment.limits import Limit
from rt_robot_os.messages.cause import Level
from rt_robot_os.messages.signs import SIGNS

S = 10**9
SIGN = next(iter(SIGNS))
TOO_MUCH, BETWEEN, WELL = 130.0, 117.0, 90.0


def limit(for_s: int, level: Level = Level.WARNING, value: float = 120.0) -> Limit:
    return Limit(SIGN, True, value, for_s * S, value - 5.0, level)


def findings(limits: list[Limit], values: list[tuple[int, float | None]], until_s: int
             ) -> list[tuple[int, Level | None]]:
    """Return when which level began, in s; None when it is over."""
    watch, found = LimitWatch(limits), []
    for at_s, value in values:
        found += watch.advance(at_s * S - 1)
        found += watch.put(SIGN, value, at_s * S)
    found += watch.advance(until_s * S)
    assert all(each.stamp_ns % S == 0 for each in found)
    return [(each.stamp_ns // S, each.level) for each in found]


@pytest.mark.parametrize(('for_s', 'clear_s'), [(0, 10), (2, 10), (10, 10), (30, 30)])
def test_it_is_over_after_its_own_time_and_after_ten_seconds_at_least(
        for_s: int, clear_s: int) -> None:
    values: list[tuple[int, float | None]] = [(1, TOO_MUCH), (100, WELL)]
    assert findings([limit(for_s)], values, 200) == [
        (1 + for_s, Level.WARNING), (100 + clear_s, None)]


def test_a_short_dip_below_the_limit_ends_nothing() -> None:
    values: list[tuple[int, float | None]] = [
        (1, TOO_MUCH), (10, WELL), (19, TOO_MUCH), (30, WELL)]
    assert findings([limit(2)], values, 100) == [(3, Level.WARNING), (40, None)]


def test_a_short_peak_begins_nothing() -> None:
    values: list[tuple[int, float | None]] = [(1, TOO_MUCH), (5, WELL), (6, TOO_MUCH), (10, WELL)]
    assert findings([limit(5)], values, 100) == []


def test_between_the_limit_and_where_it_clears_it_stays_as_it_was() -> None:
    assert findings([limit(0)], [(1, BETWEEN)], 100) == []
    assert findings([limit(0)], [(1, TOO_MUCH), (10, BETWEEN)], 100) == [(1, Level.WARNING)]


def test_the_limit_itself_is_allowed() -> None:
    assert findings([limit(0)], [(1, 120.0)], 100) == []
    assert findings([limit(0)], [(1, 120.5)], 100) == [(1, Level.WARNING)]


def test_a_time_without_good_values_neither_begins_nor_ends_anything() -> None:
    assert findings([limit(5)], [(1, TOO_MUCH), (4, None)], 100) == []
    assert findings([limit(5)], [(1, TOO_MUCH), (4, None), (6, TOO_MUCH)], 100) == [
        (11, Level.WARNING)]
    assert findings([limit(0)], [(1, TOO_MUCH), (10, WELL), (15, None)], 100) == [
        (1, Level.WARNING)]


def test_of_two_levels_the_worse_is_told_and_then_the_lesser_again() -> None:
    limits = [limit(0), limit(0, Level.CRITICAL, 150.0)]
    values: list[tuple[int, float | None]] = [(1, TOO_MUCH), (5, 160.0), (20, TOO_MUCH),
                                              (50, WELL)]
    assert findings(limits, values, 100) == [
        (1, Level.WARNING), (5, Level.CRITICAL), (30, Level.WARNING), (60, None)]
