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

"""Wheel odometry without topics: arcs, covariances, the gyroscope, and what cannot be true."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st
import pytest
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.motion.differential import moved
from rt_robot_os.motion.gyro_turn import GyroTurn
from rt_robot_os.motion.gyro_turn import RestBias
from rt_robot_os.motion.wheel_odometry import WheelOdometry
from rt_robot_os.motion.wheel_odometry import WheelParameters

WHEELS = WheelParameters(0.05, 0.05, 0.3)
STEP_NS = 20_000_000
DT_S = STEP_NS / NS_PER_S
SPEEDS = st.floats(-1.5, 1.5)


def driven(odometry: WheelOdometry, steps: int, left_m_s: float, right_m_s: float,
           gyro_rad_s: float = math.nan) -> None:
    """Go on from where the wheels are."""
    stamp_ns = odometry.stamp_ns or STEP_NS
    left, right = getattr(odometry, 'wheels_now', (0.0, 0.0))
    if not odometry.stamp_ns:
        assert odometry.update(stamp_ns, left, right)
    for _ in range(steps):
        stamp_ns += STEP_NS
        left += left_m_s * DT_S / 0.05
        right += right_m_s * DT_S / 0.05
        assert odometry.update(stamp_ns, left, right, gyro_rad_s * DT_S)
    odometry.wheels_now = left, right  # type: ignore[attr-defined]


@given(st.lists(st.tuples(SPEEDS, SPEEDS), min_size=1, max_size=20))
def test_the_pose_is_the_sum_of_exact_arcs(steps: list[tuple[float, float]]) -> None:
    odometry = WheelOdometry(WHEELS)
    pose = (0.0, 0.0, 0.0)
    for left, right in steps:
        driven(odometry, 1, left, right)
        pose = moved(pose, (left + right) / 2 * DT_S, (right - left) / 0.3 * DT_S)
    x, y, heading = odometry.pose
    assert (x, y) == pytest.approx(pose[:2], abs=1e-9)
    assert math.remainder(heading - pose[2], math.tau) == pytest.approx(0.0, abs=1e-9)


@given(st.lists(st.tuples(SPEEDS, SPEEDS), min_size=1, max_size=30))
def test_the_covariance_grows_and_stays_one(steps: list[tuple[float, float]]) -> None:
    odometry = WheelOdometry(WHEELS)
    before = -1.0
    for left, right in steps:
        driven(odometry, 1, left, right)
        xx, xy, xh, yy, yh, hh = odometry.covariance
        assert hh > before
        before = hh
        assert xx >= 0 and yy >= 0
        assert xx * yy - xy * xy >= -1e-15
        determinant = (xx * (yy * hh - yh * yh) - xy * (xy * hh - yh * xh)
                       + xh * (xy * yh - yy * xh))
        assert determinant >= -1e-18


def test_the_covariance_of_a_straight_way_is_that_of_the_formula() -> None:
    odometry = WheelOdometry(WHEELS)
    driven(odometry, 250, 0.4, 0.4)  # 2 m
    xx, _, _, yy, _, hh = odometry.covariance
    k = 0.005 ** 2
    assert math.sqrt(xx) == pytest.approx(math.sqrt(k * 2 * 2 / 4), rel=0.05)
    assert math.sqrt(hh) == pytest.approx(math.sqrt(k * 2 * 2) / 0.3, rel=0.05)
    # A heading that walks at random for L takes the end aside by its deviation times L/sqrt(3).
    assert math.sqrt(yy) == pytest.approx(math.sqrt(hh) * 2 / math.sqrt(3), rel=0.1)


def test_a_robot_that_stands_is_as_sure_as_before() -> None:
    odometry = WheelOdometry(WHEELS)
    driven(odometry, 3600 * 50, 0.0, 0.0)
    assert math.sqrt(odometry.covariance[0]) < 0.01
    assert odometry.pose == (0.0, 0.0, 0.0)


@pytest.mark.parametrize('position', [math.nan, math.inf, -math.inf])
def test_a_position_that_is_no_number_costs_nothing(position: float) -> None:
    odometry = WheelOdometry(WHEELS)
    driven(odometry, 10, 0.5, 0.5)
    left, right = odometry.wheels_now  # type: ignore[attr-defined]
    assert not odometry.update(odometry.stamp_ns + STEP_NS, position, right)
    assert not odometry.update(odometry.stamp_ns + STEP_NS, left, position)
    assert odometry.counters.not_finite == 2
    # The next good one has the whole way, in twice the time.
    assert odometry.update(odometry.stamp_ns + 2 * STEP_NS, left + 0.4, right + 0.4)
    assert odometry.pose[0] == pytest.approx(0.12)
    assert odometry.counters.implausible == 0


def test_encoders_that_jump_are_counted_and_the_robot_goes_on_as_before() -> None:
    odometry = WheelOdometry(WHEELS)
    driven(odometry, 50, 0.5, 0.5)
    before = odometry.covariance[0]
    odometry.wheels_now = 1234.5, -6789.0  # type: ignore[attr-defined]
    driven(odometry, 1, 0.5, 0.5)
    assert odometry.counters.implausible == 1
    assert odometry.pose[0] == pytest.approx(0.51)
    assert odometry.covariance[0] > before + 1e-6
    driven(odometry, 50, 0.5, 0.5)
    assert odometry.counters.implausible == 1
    assert odometry.pose == pytest.approx((1.01, 0.0, 0.0), abs=1e-9)


def test_a_speed_that_is_always_too_high_stops_the_pose_and_its_certainty() -> None:
    odometry = WheelOdometry(WheelParameters(0.05, 0.05, 0.3, speed_most_m_s=0.1))
    driven(odometry, 100, 0.5, 0.5)
    assert odometry.in_row == 100
    assert odometry.pose[0] == pytest.approx(0.0, abs=1e-9)
    assert math.sqrt(odometry.covariance[0]) > 0.01


def test_stamps_that_stand_still_or_go_back_move_nothing() -> None:
    odometry = WheelOdometry(WHEELS)
    driven(odometry, 10, 0.5, 0.5)
    stamp_ns, (left, right) = odometry.stamp_ns, odometry.wheels_now  # type: ignore[attr-defined]
    pose = odometry.pose
    assert not odometry.update(stamp_ns, left, right)
    assert not odometry.update(stamp_ns, left + 0.1, right + 0.1)
    assert not odometry.update(stamp_ns - STEP_NS, left, right)
    assert odometry.pose == pose
    counters = odometry.counters
    assert (counters.duplicates, counters.stopped, counters.backwards) == (1, 1, 1)
    # What was driven meanwhile is not lost.
    assert odometry.update(stamp_ns + STEP_NS, left + 0.2, right + 0.2)
    assert odometry.pose[0] == pytest.approx(pose[0] + 0.01)


def test_a_clock_that_begins_anew_is_followed_from_there() -> None:
    odometry = WheelOdometry(WHEELS)
    driven(odometry, 200, 0.5, 0.5)
    left, right = odometry.wheels_now  # type: ignore[attr-defined]
    pose = odometry.pose
    assert not odometry.update(STEP_NS, left, right)
    assert odometry.counters.restarts == 1
    assert odometry.update(2 * STEP_NS, left + 0.2, right + 0.2)
    assert odometry.pose[0] == pytest.approx(pose[0] + 0.01)


# ---- with a gyroscope ------------------------------------------------------------------------


def test_the_bias_is_learned_at_rest_and_taken_off() -> None:
    odometry = WheelOdometry(WHEELS)
    driven(odometry, 100, 0.0, 0.0, 0.03)
    assert odometry.bias.known
    assert odometry.bias.rad_s == pytest.approx(0.03)
    assert odometry.pose[2] == pytest.approx(0.0, abs=0.04)
    before = odometry.pose[2]
    driven(odometry, 500, 0.5, 0.5, 0.03)
    assert odometry.pose[2] == pytest.approx(before, abs=1e-6)
    assert odometry.by_gyro


def test_before_the_bias_is_known_the_turn_is_that_of_the_wheels() -> None:
    odometry = WheelOdometry(WHEELS)
    driven(odometry, 100, 0.4, 0.4, 0.05)
    assert not odometry.by_gyro
    assert odometry.pose[2] == 0.0


def test_wheels_that_slip_do_not_turn_the_pose_but_make_it_less_sure() -> None:
    sure, slipped = WheelOdometry(WHEELS), WheelOdometry(WHEELS)
    for odometry in (sure, slipped):
        driven(odometry, 100, 0.0, 0.0, 0.0)
        driven(odometry, 50, 0.3, 0.3, 0.0)
    driven(sure, 50, 0.3, 0.3, 0.0)
    driven(slipped, 50, 0.3, 0.45, 0.0)  # the right wheel spins
    assert sure.counters.slips == 0
    assert slipped.counters.slips == 1
    assert slipped.slipping
    assert slipped.pose[2] == pytest.approx(0.0, abs=1e-6)
    # It spun 0.15 m, so the robot is 0.075 m less far than the wheels say: within the covariance.
    missed = slipped.pose[0] - 0.6
    assert missed == pytest.approx(0.075, rel=0.05)
    assert missed < 2 * math.sqrt(slipped.covariance[0])
    assert math.sqrt(sure.covariance[0]) < 0.01
    driven(slipped, 50, 0.3, 0.3, 0.0)
    assert not slipped.slipping
    assert slipped.counters.slips == 1


@pytest.mark.parametrize('broken', ['left', 'right'])
def test_an_encoder_that_stands_still_is_named_within_half_a_second(broken: str) -> None:
    odometry = WheelOdometry(WHEELS)
    driven(odometry, 100, 0.0, 0.0, 0.0)
    speeds = (0.0, 0.3) if broken == 'left' else (0.3, 0.0)
    driven(odometry, 25, *speeds, 0.0)
    assert odometry.stuck == broken


def test_a_robot_that_is_pushed_round_with_wheels_that_stand_turns() -> None:
    odometry = WheelOdometry(WHEELS)
    driven(odometry, 100, 0.0, 0.0, 0.01)
    driven(odometry, 50, 0.0, 0.0, 1.01)
    assert odometry.pose[2] == pytest.approx(1.0, abs=0.05)
    assert odometry.bias.rad_s == pytest.approx(0.01)


def test_a_bias_is_not_learned_from_what_moves() -> None:
    bias = RestBias(0.1)
    for index in range(500):
        bias.update(0.2 * math.sin(index / 20) * DT_S, DT_S, True)
    assert not bias.known
    for _ in range(100):
        bias.update(0.5 * DT_S, DT_S, True)
    assert not bias.known
    for _ in range(100):
        bias.update(0.05 * DT_S, DT_S, False)
    assert not bias.known
    for _ in range(49):
        bias.update(0.05 * DT_S, DT_S, True)
    bias.update(math.nan, DT_S, True)
    for _ in range(49):
        bias.update(0.05 * DT_S, DT_S, True)
    assert not bias.known


def test_a_bias_that_jumped_is_believed_when_it_stays() -> None:
    bias = RestBias(0.1)
    for _ in range(60):
        bias.update(0.01 * DT_S, DT_S, True)
    for _ in range(2 * 51):
        bias.update(0.06 * DT_S, DT_S, True)
    assert bias.rad_s == pytest.approx(0.01)
    for _ in range(12 * 51):
        bias.update(0.06 * DT_S, DT_S, True)
    assert bias.rad_s == pytest.approx(0.06)


@given(st.lists(st.integers(1_000_000, 90_000_000), min_size=3, max_size=20),
       st.floats(-3.0, 3.0), st.integers(0, 50_000_000))
def test_the_turn_between_any_two_moments_is_that_of_a_steady_rate(
        gaps: list[int], rate: float, later_ns: int) -> None:
    gyro = GyroTurn(0.1)
    stamp_ns = NS_PER_S
    asked_ns = 0
    for gap_ns in gaps:
        gyro.add(stamp_ns, rate)
        moment_ns = stamp_ns + min(gap_ns, later_ns)
        turn = gyro.until(moment_ns)
        if asked_ns:
            assert turn == pytest.approx(rate * (moment_ns - asked_ns) / NS_PER_S, abs=1e-9)
        asked_ns = moment_ns
        stamp_ns += gap_ns


def test_a_gyroscope_with_gaps_says_so() -> None:
    gyro = GyroTurn(0.1)
    assert math.isnan(gyro.until(NS_PER_S))
    assert gyro.add(NS_PER_S, 0.5)
    assert math.isnan(gyro.until(NS_PER_S))  # nothing before it to count from
    assert gyro.until(NS_PER_S + 50_000_000) == pytest.approx(0.025)
    assert math.isnan(gyro.until(NS_PER_S + 150_000_000))
    assert gyro.add(2 * NS_PER_S, 0.5)
    assert math.isnan(gyro.until(2 * NS_PER_S + 1000))
    assert gyro.until(2 * NS_PER_S + 2000) == pytest.approx(0.5e-6)
    assert gyro.counters.gaps == 1


def test_bad_samples_of_a_gyroscope_are_dropped_and_counted() -> None:
    gyro = GyroTurn(0.1)
    assert gyro.add(NS_PER_S, 0.5)
    for rate in (math.nan, math.inf, -1e300):
        assert not gyro.add(NS_PER_S + 1000, rate)
    assert not gyro.add(NS_PER_S, 0.5)
    assert not gyro.add(NS_PER_S, 0.6)
    assert not gyro.add(NS_PER_S - 1000, 0.5)
    counters = gyro.counters
    assert (counters.not_finite, counters.backwards, counters.stopped) == (3, 3, 1)
    assert gyro.until(NS_PER_S + 1000) != 0.0
