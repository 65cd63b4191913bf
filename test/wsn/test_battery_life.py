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

"""The rest of a battery's life, from its volts over a day."""

import math
import random

import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.wsn.battery_life import ALKALINE
from rt_robot_os.features.wsn.battery_life import BatteryLife
from rt_robot_os.features.wsn.battery_life import Curve


def volts_at(share: float) -> float:
    """Return the volts of a battery with so much left."""
    for (low_v, low), (high_v, high) in zip(ALKALINE, ALKALINE[1:]):
        if share <= high:
            return low_v + (high_v - low_v) * (share - low) / (high - low)
    return ALKALINE[-1][0]


def drained(begin: float, per_day: float, hours: float, noise_v: float = 0.004) -> BatteryLife:
    """Drain a battery at a steady rate, measured each minute by a noisy ADC."""
    life, chance = BatteryLife(Curve()), random.Random(1)
    for minute in range(round(hours * 60)):
        share = max(0.0, begin - per_day * minute / 1440)
        life.add(volts_at(share) + chance.gauss(0.0, noise_v), minute * 60 * NS_PER_S)
    return life


@pytest.mark.parametrize(('begin', 'per_day'), [(0.9, 0.2), (0.5, 0.1), (0.3, 0.05), (0.11, 0.05)])
def test_days_are_told_on_the_plateau_and_at_the_knee(begin: float, per_day: float) -> None:
    left = begin / per_day - 1.0
    assert drained(begin, per_day, 24.0).days_left() == pytest.approx(left, rel=0.1, abs=0.15)


def test_nothing_is_told_before_three_hours_or_from_noise() -> None:
    assert math.isnan(drained(0.5, 0.1, 2.5).days_left())
    assert math.isnan(drained(0.5, 0.0, 24.0).days_left())
    assert not math.isnan(drained(0.5, 0.1, 6.0).days_left())


def test_new_cells_begin_anew() -> None:
    life = drained(0.2, 0.1, 24.0)
    life.add(3.2, 86_400 * NS_PER_S)
    assert math.isnan(life.days_left()) and life.volts == 3.2 and life.share == 1.0


def test_a_day_is_all_that_is_kept() -> None:
    life = drained(0.9, 0.4, 30.0)
    assert len(life._spans) <= 96


def test_a_curve_must_rise() -> None:
    with pytest.raises(ConfigError, match='both rising'):
        Curve(((2.1, 0.0), (2.1, 1.0)))
