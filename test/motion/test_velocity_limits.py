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

"""Limits that keep the curvature of a command."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st
import pytest

from rt_robot_os.motion.controllers.turning import turning_rate
from rt_robot_os.motion.differential import wheel_speeds
from rt_robot_os.motion.velocity_limits import VelocityLimits
from rt_robot_os.motion.velocity_limits import within_reach
from rt_robot_os.motion.velocity_limits import within_speeds

LIMITS = VelocityLimits(linear_max_m_s=0.5, angular_max_rad_s=2.0, wheel_max_m_s=0.6,
                        wheel_separation_m=0.4, acceleration_m_s2=0.5, deceleration_m_s2=1.0,
                        angular_acceleration_rad_s2=2.0)
SPEEDS = st.floats(-3.0, 3.0)


@given(st.floats(-1e300, 1e300), st.floats(-1e300, 1e300))
def test_wheels_stay_within_their_speed_on_the_same_curve(linear: float, angular: float) -> None:
    v, w = within_speeds(linear, angular, LIMITS)
    assert abs(v) <= 0.5 + 1e-9 and abs(w) <= 2.0 + 1e-9
    assert max(map(abs, wheel_speeds(v, w, 0.4))) <= 0.6 + 1e-9
    assert v * (angular / max(abs(linear), abs(angular), 1.0)) == pytest.approx(
        w * (linear / max(abs(linear), abs(angular), 1.0)), abs=1e-9)


@pytest.mark.parametrize('bad', [math.nan, math.inf, -math.inf])
def test_what_is_not_a_number_is_a_standstill(bad: float) -> None:
    assert within_speeds(bad, 0.1, LIMITS) == within_speeds(0.1, bad, LIMITS) == (0.0, 0.0)


@given(SPEEDS, SPEEDS, SPEEDS, SPEEDS, st.sampled_from([0.01, 0.02, 0.3]))
def test_accelerations_are_kept_whatever_is_wanted(linear: float, angular: float, v0: float,
                                                   w0: float, period: float) -> None:
    v, w = within_reach(linear, angular, (v0, w0), LIMITS, period)
    assert abs(w - w0) <= 2.0 * period + 1e-9
    assert abs(v - v0) <= 1.0 * period + 1e-9
    if abs(v) > abs(v0):
        assert abs(v) - max(0.0, math.copysign(abs(v0), v0 * v)) <= 0.5 * period + 1e-9


@given(st.floats(0.0, 0.5), st.floats(0.0, 1.0), SPEEDS)
def test_a_stop_stays_on_the_curve_that_is_driven(v0: float, w0: float, _: float) -> None:
    v, w = within_reach(0.0, 0.0, (v0, w0), LIMITS, 0.02)
    assert v * w0 == pytest.approx(w * v0, abs=1e-9)
    for _ in range(200):
        v, w = within_reach(0.0, 0.0, (v, w), LIMITS, 0.02)
    assert (v, w) == (0.0, 0.0)


@given(st.floats(0.05, 1.0), st.floats(-3.0, 3.0), st.floats(0.0, 1.0))
def test_speeding_up_on_a_curve_keeps_the_curve(speed: float, bend: float, part: float) -> None:
    v, w = within_reach(speed, speed * bend, (speed * part, speed * part * bend), LIMITS, 0.02)
    assert w == pytest.approx(v * bend, abs=1e-9)
    assert v >= speed * part - 1e-9


@pytest.mark.parametrize('wanted', [(0.28, -1e-4), (0.28, 1e-9), (0.2, 0.0)])
def test_a_robot_that_has_to_slow_down_never_speeds_up(wanted: tuple[float, float]) -> None:
    v, _ = within_reach(*wanted, (0.4, 0.01), LIMITS, 0.02)
    assert v == pytest.approx(0.38)


@given(SPEEDS, SPEEDS, SPEEDS, SPEEDS, st.sampled_from([0.01, 0.1, 0.3]))
def test_what_is_reached_lies_between_what_is_and_what_is_wanted(
        linear: float, angular: float, v0: float, w0: float, period: float) -> None:
    v, w = within_reach(linear, angular, (v0, w0), LIMITS, period)
    assert min(v0, linear, 0.0) - 1e-9 <= v <= max(v0, linear, 0.0) + 1e-9
    if abs(w * linear - v * angular) > 1e-9:  # a robot that is too fast turns faster on its curve
        assert min(w0, angular, 0.0) - 1e-9 <= w <= max(w0, angular, 0.0) + 1e-9


@given(st.floats(0.0, 0.4), st.floats(-2.0, 2.0), st.floats(0.0, 0.4), st.floats(-2.0, 2.0),
       st.sampled_from([0.02, 0.1, 0.3]))
def test_what_is_wanted_is_reached_in_the_end(linear: float, angular: float, v0: float, w0: float,
                                              period: float) -> None:
    now = (v0, w0)
    for _ in range(round(8.0 / period)):
        now = within_reach(linear, angular, now, LIMITS, period)
        assert now[0] >= 0.0
    assert now == pytest.approx((linear, angular), abs=1e-6)


def test_a_curve_ahead_slows_down_while_the_turning_rate_grows() -> None:
    v, w = within_reach(0.5, 2.0, (0.5, 0.0), LIMITS, 0.1)
    assert v == pytest.approx(0.4)
    assert w == pytest.approx(0.2)


@given(st.floats(-3.1, 3.1), st.floats(0.005, 0.5), st.floats(0.5, 5.0))
def test_a_turn_in_place_ends_at_its_angle_without_overshoot(angle: float, period: float,
                                                             braking: float) -> None:
    limits = VelocityLimits(angular_max_rad_s=1.0, angular_acceleration_rad_s2=braking)
    left, rate = angle, 0.0
    for _ in range(round(60 / period)):
        rate = within_reach(0.0, turning_rate(left, limits, period), (0.0, rate), limits,
                            period)[1]
        left -= rate * period
        assert left * angle >= -1e-3 * abs(angle) - 1e-9
    assert abs(left) < 0.01
