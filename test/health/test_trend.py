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

"""Trends: found through noise and wrong values, and none where nothing changes."""

from __future__ import annotations

import math
import random

import pytest
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.health.assessment.trend import Trend

WINDOW_S = 600


def change(values: list[tuple[float, float]]) -> float:
    """Return the change that a trend finds at the end of times in s and values."""
    trend = Trend(WINDOW_S * NS_PER_S)
    for time_s, value in values:
        trend.put(value, round(time_s * NS_PER_S))
    trend.put(values[-1][1], round((values[-1][0] + WINDOW_S / 30) * NS_PER_S))
    return trend.change


@pytest.mark.parametrize('period_s', [1, 5, 60, 120])
def test_a_steady_change_is_found_whatever_the_period(period_s: int) -> None:
    found = change([(time_s, 97.0 - time_s / 150) for time_s in range(0, 601, period_s)])
    assert found == pytest.approx(-4.0, rel=0.05)


def test_a_fifth_of_wrong_values_does_not_move_it() -> None:
    chance = random.Random(3)
    found = change([(float(time_s), 40.0 if chance.random() < 0.2 else
                     97.0 - time_s / 150 + chance.gauss(0.0, 1.0))
                    for time_s in range(0, 601, 20)])
    assert found == pytest.approx(-4.0, abs=1.5)


def test_a_number_that_scatters_does_not_change_however_few_there_are() -> None:
    wrong = 0
    for seed in range(300):
        chance = random.Random(seed)
        times = sorted(chance.sample(range(0, 600, 20), chance.randint(5, 12)))
        found = change([(float(time_s), chance.gauss(97.0, 1.0)) for time_s in times])
        wrong += abs(found) >= 2.0
    assert wrong <= 6, 'of 300'


@pytest.mark.parametrize('times', [[0], [0, 100, 200], range(0, 300, 20), [0, 580, 590, 600]])
def test_too_little_is_no_trend(times: list[int]) -> None:
    assert math.isnan(change([(float(time_s), 97.0 - time_s) for time_s in times]))
