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

"""A map that moves under the robot, sources whose errors last, sources that disagree."""

from __future__ import annotations

import math
import random

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import numpy as np
import pytest
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.motion.differential import moved
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.ekf import displaced
from rt_robot_os.motion.ekf import displaced_covariance
from rt_robot_os.motion.ekf import PoseCovariance
from rt_robot_os.motion.fix_statistics import disagreement
from rt_robot_os.motion.localizer import Localizer
from rt_robot_os.motion.localizer import LocalizerTuning
from rt_robot_os.motion.pose_history import OdometryStep
from rt_robot_os.motion.pose_history import PoseFix
from rt_robot_os.motion.poses import composed

MS = 1_000_000
PERIOD_NS = 20 * MS
SURE: PoseCovariance = (1e-4, 2e-5, 0.0, 3e-4, -1e-5, 3e-4)
MOVEMENTS = st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(-1.5, 1.5))


def step(index: int, speed: float = 0.4, rate: float = 0.3) -> OdometryStep:
    return OdometryStep((index + 1) * PERIOD_NS, speed * 0.02, rate * 0.02, 0.02, 1e-6, 1e-6, 0.0,
                        1e-10)


def located(start: Pose = (0.0, 0.0, 0.0)) -> Localizer:
    localizer = Localizer(LocalizerTuning())
    localizer.begin(start, (0.01, 0.0, 0.0, 0.01, 0.0, 0.01))
    return localizer


# ---- the map moves ---------------------------------------------------------------------------


@given(st.lists(st.tuples(st.integers(2, 90), st.integers(0, 60)), min_size=1, max_size=6,
                unique_by=lambda each: each[0]),
       MOVEMENTS, st.integers(2, 60), st.integers(0, 30), st.integers(0, 1000))
@settings(max_examples=40)
def test_a_correction_and_what_fits_it_come_in_any_order(
        marks: list[tuple[int, int]], movement: Pose, moved_at: int, delay: int,
        seed: int) -> None:
    """Poses of before the correction are of the old map, the others of the new one."""
    noise = random.Random(seed)
    moved_ns = moved_at * PERIOD_NS + 5 * MS
    truth: list[Pose] = [(0.0, 0.0, 0.0)]
    for _ in range(100):
        truth.append(moved(truth[-1], 0.008, 0.006))
    fixes = [(at * PERIOD_NS - 7 * MS, late, (
        truth[at][0] + noise.gauss(0, 0.01), truth[at][1] + noise.gauss(0, 0.01),
        truth[at][2] + noise.gauss(0, 0.01))) for at, late in marks]
    still, moving = located(), located()
    for index in range(98):
        now_ns = (index + 1) * PERIOD_NS
        for localizer in still, moving:
            localizer.move(step(index))
        if index == min(97, moved_at + delay):
            assert moving.displace(moved_ns, movement)
        for stamp_ns, late, pose in fixes:
            due_ns = stamp_ns + late * PERIOD_NS
            if due_ns <= now_ns < due_ns + PERIOD_NS or (index == 97 and due_ns > now_ns):
                still.add_fix(PoseFix(stamp_ns, pose, SURE))
                moving.add_fix(PoseFix(stamp_ns, pose, SURE) if stamp_ns < moved_ns else PoseFix(
                    stamp_ns, composed(movement, pose), displaced_covariance(SURE, movement)))
    assert moving.counters.corrected == 1
    assert moving.state.state() == pytest.approx(displaced(still.state.state(), movement),
                                                 abs=1e-9)


def test_after_a_loop_nothing_is_refused_when_the_correction_comes_first() -> None:
    found = {}
    for follows in True, False:
        localizer, pose = located(), (0.0, 0.0, 0.0)
        loop = (0.3, -0.4, 0.1)
        for index in range(200):
            localizer.move(step(index))
            pose = moved(pose, 0.008, 0.006)
            if index == 100 and follows:
                localizer.displace(localizer.stamp_ns - 150 * MS, loop)
            if index % 5 == 0:
                seen = pose if index < 100 else composed(loop, pose)
                localizer.add_fix(PoseFix(localizer.stamp_ns, seen, SURE))
        found[follows] = localizer.counters
    assert (found[True].rejected, found[True].recovered) == (0, 0)
    assert found[False].rejected > 10


def test_the_doubt_turns_with_the_map_and_grows_by_nothing() -> None:
    localizer = located()
    for index in range(50):
        localizer.move(step(index))
    before = np.array(localizer.state.covariance)
    localizer.displace(localizer.stamp_ns, (1.0, 2.0, math.pi / 2))
    xx, xy, xh, yy, yh, hh = before
    assert localizer.state.covariance == pytest.approx((yy, -xy, -yh, xx, xh, hh))
    assert localizer.jump[1] == pytest.approx(math.pi / 2)


def test_a_place_that_is_being_considered_moves_too() -> None:
    localizer, movement = Localizer(LocalizerTuning(start_fixes=3)), (3.0, 1.0, 0.4)
    for index in range(20):
        localizer.move(step(index, speed=0.0, rate=0.0))
        if index == 10:
            localizer.displace(localizer.stamp_ns, movement)
        if index in (4, 8, 12):
            here = (1.0, 2.0, 0.5)
            localizer.add_fix(PoseFix(localizer.stamp_ns, here if index < 10
                                      else composed(movement, here),
                                      SURE))
    assert localizer.located
    assert localizer.state.pose == pytest.approx(composed(movement, (1.0, 2.0, 0.5)))


def test_a_correction_from_before_the_robot_was_found_again_moves_nothing() -> None:
    localizer = located()
    for index in range(50):
        localizer.move(step(index))
    localizer.begin((5.0, 5.0, 0.0), SURE)
    before = localizer.state.state()
    assert not localizer.displace(localizer.stamp_ns - 40 * MS, (1.0, 0.0, 0.0))
    assert localizer.state.state() == before and localizer.counters.corrected == 0


# ---- errors that last ------------------------------------------------------------------------


class Lasting:
    """Errors whose correlation falls as exp(-t/T): those of a map, met one after the other."""

    def __init__(self, lots: random.Random, stddev: float, seconds: float) -> None:
        self._lots, self._stddev, self._seconds = lots, stddev, seconds
        self._value = lots.gauss(0.0, stddev)

    def after(self, dt_s: float) -> float:
        kept = math.exp(-dt_s / self._seconds)
        self._value = kept * self._value + math.sqrt(1 - kept * kept) * self._lots.gauss(
            0.0, self._stddev)
        return self._value


def drive(seed: int, inflation: float, shift: float = 0.0, seconds: float = 60.0
          ) -> tuple[Localizer, list[float], list[float]]:
    """
    Drive with marks (white errors of 1 cm) and a SLAM (errors of 2 cm that last 2 s).

    :return: the localizer; errors squared over their covariance (NEES); errors in m.
    """
    lots = random.Random(seed)
    localizer, pose = located(), (0.0, 0.0, 0.0)
    slam = [Lasting(lots, each, 2.0) for each in (0.02, 0.02, 0.01)]
    nees, errors = [], []
    for index in range(round(seconds / 0.02)):
        pose = moved(pose, 0.008 + lots.gauss(0, 1e-3), 0.006 + lots.gauss(0, 1e-3))
        localizer.move(step(index))
        if index % 5 == 0:
            localizer.add_fix(PoseFix(localizer.stamp_ns, (
                pose[0] + lots.gauss(0, 0.01), pose[1] + lots.gauss(0, 0.01),
                pose[2] + lots.gauss(0, 0.02)), (1e-4, 0.0, 0.0, 1e-4, 0.0, 4e-4)))
        if index % 5 == 2:
            x, y, turn = (each.after(0.1) for each in slam)
            localizer.add_fix(PoseFix(localizer.stamp_ns, (
                pose[0] + x + shift, pose[1] + y, pose[2] + turn),
                (4e-4, 0.0, 0.0, 4e-4, 0.0, 1e-4), 1, inflation))
        if index % 25 == 24 and index > 250:
            xx, xy, xh, yy, yh, hh = localizer.state.covariance
            e = np.array([localizer.state.x - pose[0], localizer.state.y - pose[1],
                          math.remainder(localizer.state.heading - pose[2], math.tau)])
            nees.append(float(e @ np.linalg.solve(
                [[xx, xy, xh], [xy, yy, yh], [xh, yh, hh]], e)) / 3)
            errors.append(math.hypot(e[0], e[1]))
    return localizer, nees, errors


def test_errors_that_last_make_the_estimate_no_surer_than_it_is() -> None:
    """Ten poses a second whose errors last for 2 s are worth as much as one in 4 s."""
    as_independent, as_they_are = ([drive(seed, inflation) for seed in (1, 2)]
                                   for inflation in (1.0, 40.0))
    for localizer, _, _ in as_they_are:
        assert localizer.counters.rejected < 40 and localizer.counters.recovered == 0
    right, wrong = (float(np.mean([each for run in runs for each in run[1]]))
                    for runs in (as_they_are, as_independent))
    assert 0.6 < right < 1.5 < wrong
    right, wrong = (float(np.sqrt(np.mean(np.square([each for run in runs for each in run[2]]))))
                    for runs in (as_they_are, as_independent))
    assert right < wrong


# ---- sources that disagree -------------------------------------------------------------------


def test_sources_on_two_maps_do_not_fight_and_it_is_told_by_how_much() -> None:
    localizer, _, errors = drive(3, 40.0, shift=0.2, seconds=30.0)
    assert localizer.counters.recovered == 0 and max(errors) < 0.06
    apart_m, apart_rad = disagreement(localizer.records, localizer.stamp_ns)
    assert apart_m == pytest.approx(0.2, abs=0.04) and apart_rad < 0.03
    marks, slam = localizer.records[:2]
    assert marks.rejected < 0.05 * marks.accepted and slam.rejected > 10 * slam.accepted


def test_where_two_sources_contradict_from_the_start_the_first_one_says_where() -> None:
    localizer = Localizer()
    for index in range(100):
        localizer.move(step(index, speed=0.0, rate=0.0))
        if index % 5 == 0:
            localizer.add_fix(PoseFix(localizer.stamp_ns, (4.0, 0.0, 0.0), SURE, 1))
        if index % 5 == 2 and index > 2:
            localizer.add_fix(PoseFix(localizer.stamp_ns, (0.0, 0.0, 0.0), SURE, 0))
    assert localizer.located and abs(localizer.state.x) < 0.1


def test_a_source_that_is_silent_is_not_waited_for() -> None:
    localizer = Localizer()
    for index in range(200):
        localizer.move(step(index, speed=0.0, rate=0.0))
        if index == 3:
            localizer.add_fix(PoseFix(localizer.stamp_ns, (0.0, 0.0, 0.0), SURE, 0))
        if index % 5 == 0:
            localizer.add_fix(PoseFix(localizer.stamp_ns, (4.0, 0.0, 0.0), SURE, 1))
    assert localizer.located and localizer.state.x == pytest.approx(4.0, abs=0.1)
    assert NS_PER_S < localizer.stamp_ns
