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

"""Localisation without topics: the promises in simulation, late measurements, kidnapping."""

from __future__ import annotations

import math
import random

from benchmarks.localization.simulation import rms
from benchmarks.localization.simulation import Scenario
from benchmarks.localization.simulation import simulate
from benchmarks.localization.simulation import Trace
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.motion.ekf import UNKNOWN_VARIANCE
from rt_robot_os.motion.localizer import fix_covariance
from rt_robot_os.motion.localizer import Localizer
from rt_robot_os.motion.localizer import LocalizerTuning
from rt_robot_os.motion.pose_history import OdometryStep
from rt_robot_os.motion.pose_history import PoseFix
from rt_robot_os.motion.poses import composed

SEEDS = range(1, 6)
MS = 1_000_000
SURE = (1e-4, 0.0, 0.0, 1e-4, 0.0, 3e-4)


def mean_band(count: int, numbers: int) -> tuple[float, float]:
    """Return in which 95 per cent of the means of so many chi^2 lie, of each number."""
    half = 1.96 * math.sqrt(2 / (count * numbers))
    return 1 - half, 1 + half


# ---- the promises, in simulation -------------------------------------------------------------


@pytest.mark.parametrize('gyro', [True, False], ids=['gyro', 'wheels'])
def test_the_innovations_are_as_large_as_the_covariance_says(gyro: bool) -> None:
    found: list[float] = []
    for seed in range(1, 9):
        found += simulate(Scenario(seed, seconds=40.0, gyro=gyro)).innovations
    low, high = mean_band(len(found), 3)
    assert low < sum(found) / len(found) / 3 < high


@pytest.mark.parametrize('gyro', [True, False], ids=['gyro', 'wheels'])
def test_the_errors_are_as_large_as_the_covariance_says(gyro: bool) -> None:
    found = [simulate(Scenario(seed, seconds=40.0, gyro=gyro)).nees() for seed in range(1, 9)]
    assert 2.0 < sum(found) / len(found) < 3.5


@pytest.mark.parametrize('seed', SEEDS)
@pytest.mark.parametrize('gyro', [True, False], ids=['gyro', 'wheels'])
def test_one_mark_in_ten_is_false_and_the_pose_stays_right(seed: int, gyro: bool) -> None:
    trace = simulate(Scenario(seed, outliers=0.1, gyro=gyro))
    assert rms(trace.errors_m()) < 0.01
    assert math.degrees(rms(trace.turns_rad())) < 1.0
    assert max(trace.errors_m()) < 0.03
    assert trace.leaps <= 3.0
    assert trace.recovered == 0


@pytest.mark.parametrize('seed', SEEDS)
@pytest.mark.parametrize('gyro', [True, False], ids=['gyro', 'wheels'])
def test_ten_seconds_without_a_landmark_add_little(seed: int, gyro: bool) -> None:
    trace = simulate(Scenario(seed, seconds=45.0, gyro=gyro, blind=(30.0, 40.0)))
    assert max(trace.errors_m(30.0, 40.0)) < 0.15
    # The covariance knows of it, and the first landmark is believed at once.
    index = max(i for i, time_s in enumerate(trace.time_s) if time_s < 40.0)
    covariance = trace.covariance[index]
    assert trace.errors_m(30.0, 40.0)[-1] < 3 * math.sqrt(covariance[0] + covariance[3])
    assert max(trace.errors_m(40.5)) < 0.03
    assert trace.recovered == 0


@pytest.mark.parametrize('seed', SEEDS)
@pytest.mark.parametrize('outliers', [0.0, 0.1])
def test_a_robot_that_is_carried_away_is_found_within_five_seconds(seed: int, outliers: float
                                                                   ) -> None:
    trace = simulate(Scenario(seed, seconds=40.0, kidnapped_s=20.0, outliers=outliers))
    assert trace.recovered == 1
    assert max(trace.errors_m(20.1, 21.5)) > 1.0
    assert max(trace.errors_m(25.0)) < 0.05


def same(one: Trace, other: Trace) -> float:
    """Return the largest difference of two estimates of the same moments."""
    others = dict(zip(other.time_s, other.estimate))
    return max(math.hypot(a[0] - others[t][0], a[1] - others[t][1])
               for t, a in zip(one.time_s, one.estimate) if t in others)


@pytest.mark.parametrize('seed', SEEDS)
def test_marks_that_are_late_are_put_in_their_place(seed: int) -> None:
    late = simulate(Scenario(seed, delay_s=0.4))
    assert rms(late.errors_m()) < 0.01
    assert max(late.errors_m(5.0)) < 0.03
    assert late.replayed > 10000
    innovations = late.innovations
    assert 0.85 < sum(innovations) / len(innovations) / 3 < 1.15


# ---- late, early and bad measurements --------------------------------------------------------


def step(index: int, speed: float = 0.4, rate: float = 0.3) -> OdometryStep:
    return OdometryStep((index + 1) * 20 * MS, speed * 0.02, rate * 0.02, 0.02, 1e-6, 1e-6, 0.0,
                        1e-10)


def located(**tuning: float) -> Localizer:
    localizer = Localizer(LocalizerTuning(**tuning))  # type: ignore[arg-type]
    localizer.begin((0.0, 0.0, 0.0), (0.01, 0.0, 0.0, 0.01, 0.0, 0.01))
    return localizer


@given(st.lists(st.tuples(st.integers(1, 95), st.integers(0, 90)), min_size=1, max_size=8),
       st.randoms(use_true_random=False))
@settings(max_examples=60)
def test_the_order_in_which_measurements_come_does_not_matter(
        marks: list[tuple[int, int]], order: random.Random) -> None:
    fixes = [((at + 1) * 20 * MS - 7 * MS, late) for at, late in
             {at: late for at, late in marks}.items()]
    poses = {stamp_ns: (0.4 * stamp_ns / NS_PER_S + order.gauss(0, 0.01), order.gauss(0, 0.01),
                        order.gauss(0, 0.01)) for stamp_ns, _ in fixes}
    at_once, later = located(), located()
    for index in range(98):
        now_ns = (index + 1) * 20 * MS
        for localizer, delayed in ((at_once, 0), (later, 1)):
            assert localizer.move(step(index, rate=0.0))
            for stamp_ns, late in fixes:
                due_ns = stamp_ns + delayed * late * 20 * MS
                if due_ns <= now_ns < due_ns + 20 * MS or (
                        index == 97 and due_ns > now_ns):
                    localizer.add_fix(PoseFix(stamp_ns, poses[stamp_ns], SURE))
    assert later.counters.accepted == at_once.counters.accepted
    assert later.state.state() == pytest.approx(at_once.state.state(), abs=1e-12)


def test_a_measurement_from_ahead_waits_for_the_odometry_of_its_moment() -> None:
    early, exact = located(), located()
    for index in range(10):
        if index == 5:
            fix = PoseFix(5 * 20 * MS + 13 * MS, (0.05, 0.01, 0.0), SURE)
            early.add_fix(fix)
            assert not fix.judged and early.waiting == 1
        early.move(step(index))
        exact.move(step(index))
        if index == 5:
            assert fix.judged and early.waiting == 0
            exact.add_fix(PoseFix(5 * 20 * MS + 13 * MS, (0.05, 0.01, 0.0), SURE))
    assert early.state.state() == pytest.approx(exact.state.state(), abs=1e-15)
    assert early.counters.accepted == 1


def test_a_measurement_of_long_ago_is_dropped_and_counted() -> None:
    localizer = located()
    for index in range(200):
        localizer.move(step(index))
    before = localizer.state.state()
    localizer.add_fix(PoseFix(200 * 20 * MS - 2100 * MS, (0.0, 0.0, 0.0), SURE))
    assert localizer.counters.too_late == 1
    assert localizer.state.state() == before
    localizer.add_fix(PoseFix(200 * 20 * MS - 1900 * MS, localizer.state.pose, SURE))
    assert localizer.counters.too_late == 1
    assert localizer.late == 1 and localizer.latest_ns == 1900 * MS


def test_what_waits_is_bounded() -> None:
    localizer = located()
    localizer.move(step(0))
    for index in range(100):
        localizer.add_fix(PoseFix(NS_PER_S + index, (0.0, 0.0, 0.0), SURE))
    assert localizer.waiting == 16
    assert localizer.counters.overflow == 84


def test_a_source_that_floods_costs_only_so_much() -> None:
    localizer = located()
    for index in range(3):
        localizer.move(step(index, speed=0.0, rate=0.0))
    for index in range(100):
        localizer.add_fix(PoseFix(localizer.stamp_ns - index * 1000, (0.0, 0.0, 0.0), SURE))
    assert localizer.counters.accepted == 16
    assert localizer.counters.overflow == 84


def test_a_step_that_is_not_newer_is_left_out() -> None:
    localizer = located()
    assert localizer.move(step(5))
    assert localizer.move(step(6))
    before = localizer.state.state()
    assert not localizer.move(step(6))
    assert not localizer.move(step(3))
    assert localizer.state.state() == before
    localizer.restart(4 * 20 * MS)
    assert localizer.move(step(4))


# ---- where the robot is at first, and when nothing fits --------------------------------------


def test_the_first_measurements_that_agree_say_where_the_robot_is() -> None:
    localizer = Localizer()
    for index in range(30):
        localizer.move(step(index, rate=0.0))
        x = 3.0 + 0.008 * index
        if index == 5:
            localizer.add_fix(PoseFix(localizer.stamp_ns, (-4.0, 2.0, 1.0), SURE))  # a false mark
        if index in (10, 15, 20, 25):
            assert localizer.located == (index == 25)
            localizer.add_fix(PoseFix(localizer.stamp_ns, (x, 1.0, 0.0), SURE))
    assert localizer.located
    assert localizer.state.pose == pytest.approx((3.0 + 0.008 * 29, 1.0, 0.0), abs=0.01)


def test_false_marks_that_agree_with_each_other_are_not_believed_among_right_ones() -> None:
    localizer = located()
    for index in range(500):
        localizer.move(step(index, rate=0.0))
        x = 0.008 * index
        if index % 5 == 0:
            localizer.add_fix(PoseFix(localizer.stamp_ns, (x, 0.0, 0.0), SURE))
        if index % 5 == 2:  # the same wrong landmark, again and again
            localizer.add_fix(PoseFix(localizer.stamp_ns, (x + 1.0, 0.5, 0.0), SURE))
    assert localizer.counters.recovered == 0
    assert localizer.counters.rejected == 100
    assert localizer.state.pose == pytest.approx((0.008 * 499, 0.0, 0.0), abs=0.02)


def test_a_landmark_that_is_always_wrong_is_believed_unless_that_is_off() -> None:
    for kidnapped_s, recovered in ((2.0, 1), (0.0, 0)):
        localizer = located(kidnapped_s=kidnapped_s)
        for index in range(200):
            localizer.move(step(index, rate=0.0))
            if index % 5 == 0:
                seen = composed((0.0, 1.0, 0.5), (0.008 * index, 0.0, 0.0))
                localizer.add_fix(PoseFix(localizer.stamp_ns, seen, SURE))
        assert localizer.counters.recovered == recovered
        if recovered:
            assert localizer.jump[1] == pytest.approx(0.5, abs=0.05)


def test_false_marks_that_do_not_agree_are_never_believed() -> None:
    localizer, lots = located(), random.Random(3)
    for index in range(3000):
        localizer.move(step(index))
        if index % 5 == 0:
            localizer.add_fix(PoseFix(localizer.stamp_ns, (
                lots.uniform(2, 50), lots.uniform(2, 50), lots.uniform(-3, 3)), SURE))
    assert localizer.counters.recovered == 0
    assert localizer.counters.rejected == 600


def test_a_position_without_heading_corrects_the_position() -> None:
    localizer = located()
    fix = None
    for index in range(100):
        localizer.move(step(index, rate=0.0))
        fix = PoseFix(localizer.stamp_ns, (0.008 * index + 0.05, 0.05, 1.0),
                      (1e-4, 0.0, 0.0, 1e-4, 0.0, UNKNOWN_VARIANCE))
        localizer.add_fix(fix)
    assert fix is not None and fix.dimensions == 2
    assert localizer.counters.accepted == 100
    assert localizer.state.pose == pytest.approx((0.008 * 99 + 0.05, 0.05, 0.0), abs=0.02)


# ---- covariances -----------------------------------------------------------------------------


@pytest.mark.parametrize('bad', [
    (math.nan, 0, 0, 1, 0, 1), (1, math.inf, 0, 1, 0, 1), (-1, 0, 0, 1, 0, 1),
    (1, 0, 0, -1, 0, 1), (1, 0, 0, 1, 0, -2), (1e7, 0, 0, 1, 0, 1)])
def test_a_covariance_that_is_none_is_refused(
        bad: tuple[float, float, float, float, float, float]) -> None:
    assert fix_covariance(bad, 0.01, 0.01) is None


def test_a_covariance_of_zeros_is_no_certainty() -> None:
    found = fix_covariance((0.0,) * 6, 0.01, 0.02)
    assert found == pytest.approx((1e-4, 0.0, 0.0, 1e-4, 0.0, 4e-4))


def test_a_heading_that_is_not_known_is_none() -> None:
    found = fix_covariance((0.01, 0.0, 5.0, 0.01, 0.0, -1.0), 0.01, 0.02)
    assert found == (0.01, 0.0, 0.0, 0.01, 0.0, UNKNOWN_VARIANCE)


@given(st.lists(st.floats(-10.0, 10.0), min_size=6, max_size=6))
def test_whatever_is_accepted_is_a_covariance(values: list[float]) -> None:
    given_ = values[0], values[1], values[2], values[3], values[4], values[5]
    found = fix_covariance(given_, 0.01, 0.01)
    if found is None:
        return
    xx, xy, xh, yy, yh, hh = found
    assert xx > 0 and xx * yy - xy * xy >= 0
    assert xx * (yy * hh - yh * yh) - xy * (xy * hh - yh * xh) + xh * (xy * yh - yy * xh) >= -1e-9
