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

"""Paths by their length, and the speeds at which they are driven."""

from __future__ import annotations

import math
import random

from driving import eight
from hypothesis import assume
from hypothesis import example
from hypothesis import given
from hypothesis import strategies as st
import pytest

from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.reference import PathReference
from rt_robot_os.motion.reference import TimeLaw
from rt_robot_os.motion.reference_path import checked
from rt_robot_os.motion.reference_path import PathError
from rt_robot_os.motion.reference_path import straight
from rt_robot_os.motion.spline import legs
from rt_robot_os.motion.spline import spline
from rt_robot_os.motion.velocity_limits import VelocityLimits

LIMITS = VelocityLimits(speed_m_s=0.5, linear_max_m_s=0.6, angular_max_rad_s=1.0,
                        acceleration_m_s2=0.4, deceleration_m_s2=0.5, lateral_max_m_s2=0.2)
POINTS = st.lists(st.tuples(st.floats(-20, 20), st.floats(-20, 20)), min_size=2, max_size=12)


def circle(radius_m: float, parts: int = 40) -> list[Pose]:
    angles = [math.tau * 0.75 * i / parts for i in range(parts + 1)]
    return [(radius_m * math.sin(a), radius_m * (1 - math.cos(a)), 0.0) for a in angles]


def test_a_spline_through_a_circle_has_its_curvature_and_length() -> None:
    leg, = legs(circle(2.0), 0.8)
    assert leg.length_m == pytest.approx(math.tau * 0.75 * 2.0, rel=1e-4)
    assert all(each == pytest.approx(0.5, rel=0.03) for each in leg.curvature)
    x, y, heading, _ = leg.at(leg.length_m / 3)
    assert (x, y, heading) == pytest.approx((2.0, 2.0, math.pi / 2), abs=2e-3)


def test_two_poses_make_the_cubic_between_them() -> None:
    path = spline([(3.44, 1.0), (3.44, 2.3)], math.radians(120), math.radians(90))
    assert path.at(0.0)[2] == pytest.approx(math.radians(120), abs=1e-6)
    assert path.at(9.0)[:3] == pytest.approx((3.44, 2.3, math.radians(90)), abs=1e-6)
    assert 1.3 < path.length_m < 1.35


@example([(0.25, 0.0), (0.28125, 0.0), (0.25, 0.0)], 'spline')
@given(POINTS, st.sampled_from(['spline', 'line']))
def test_legs_join_and_pass_the_first_and_the_last_point(points: list[tuple[float, float]],
                                                         shape: str) -> None:
    poses = checked([(x, y, 0.0) for x, y in points])
    if len(poses) < 2:
        return
    found = legs(poses, 0.8, shape)
    if not found:
        # Closer together than knots, and back where it began.
        assert all(math.dist(pose[:2], poses[-1][:2]) < 0.25 for pose in poses)
        assert poses[0][:2] == pytest.approx(poses[-1][:2], abs=1e-3)
        return
    ends = [(leg.at(0.0)[:2], leg.at(leg.length_m)[:2]) for leg in found]
    assert ends[0][0] == pytest.approx(poses[0][:2], abs=1e-6)
    assert ends[-1][1] == pytest.approx(poses[-1][:2], abs=1e-6)
    for (_, end), (begin, _) in zip(ends, ends[1:]):
        assert end == pytest.approx(begin, abs=1e-6)
    for leg in found:
        assert all(map(math.isfinite, (*leg.x, *leg.y, *leg.heading, *leg.curvature)))


def test_repeated_poses_are_left_out_and_the_last_heading_stays() -> None:
    poses = [(0.0, 0.0, 0.1), (0.0, 0.0, 0.2), (1.0, 0.0, 0.3), (1.0, 0.0, 0.4), (1.0, 0.0, 0.5)]
    assert checked(poses) == [(0.0, 0.0, 0.1), (1.0, 0.0, 0.5)]
    assert checked([(1.0, 2.0, 0.5)] * 9) == [(1.0, 2.0, 0.5)]


@pytest.mark.parametrize('pose', [
    (math.nan, 0.0, 0.0), (0.0, math.inf, 0.0), (0.0, 0.0, math.nan), (1e300, 1e300, 0.0)])
def test_numbers_that_are_none_or_too_large_are_refused_by_name(pose: Pose) -> None:
    with pytest.raises(PathError, match='pose 1 of 2'):
        checked([(0.0, 0.0, 0.0), pose])


def test_an_empty_path_is_refused() -> None:
    with pytest.raises(PathError, match='empty'):
        checked([])


def test_the_noise_of_a_dense_path_is_no_corner() -> None:
    noise = random.Random(1)
    poses = [(0.01 * i, noise.gauss(0.0, 0.003), 0.0) for i in range(300)]
    leg, = legs(poses, 0.8)
    assert leg.length_m == pytest.approx(2.99, abs=0.05)
    assert max(map(abs, leg.curvature)) < 2.5


def test_a_way_there_and_back_has_a_corner_at_its_turn() -> None:
    there = [(0.05 * i, 0.0, 0.0) for i in range(21)]
    out, back = legs([*there, *there[::-1]][:-1], 0.8)
    assert out.length_m == pytest.approx(1.0, abs=0.1)
    assert back.heading[0] == pytest.approx(math.pi, abs=1e-6)


def test_a_loop_smaller_than_knots_is_no_way() -> None:
    assert legs([(0.0, 0.0, 0.0), (0.03, 0.0, 0.0), (0.0, 0.0, 0.0)], 0.8) == []


def test_a_corner_ends_a_leg() -> None:
    square: list[Pose] = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0)]
    assert [leg.length_m for leg in legs(square, 0.8)] == pytest.approx([1.0, 1.0, 1.0])
    assert len(legs(square, 2.0)) == 1


@given(st.floats(0.05, 3.0), st.floats(0.1, 4.0), st.floats(0.1, 2.0), st.floats(0.1, 2.0),
       st.floats(0.0, 0.6))
@example(1.0, 1.0, 0.4, 0.5, 0.0)
@example(2.0, 1.0, 0.4, 0.5, 0.6)
def test_no_jerk_is_larger_than_its_limit_also_where_braking_follows_at_once(
        length_m: float, jerk: float, up: float, down: float, speed: float) -> None:
    # Where the way is too short to stop at all no limit can be kept.
    assume(speed ** 2 / (1.6 * down) + speed * (up + down) / jerk < length_m)
    limits = VelocityLimits(speed_m_s=0.6, linear_max_m_s=0.6, acceleration_m_s2=up,
                            deceleration_m_s2=down, jerk_max_m_s3=jerk)
    law = TimeLaw(straight((0.0, 0.0), (length_m, 0.0)), limits, 0.0, speed)
    period = 0.01
    along = [law.at(i * period) for i in range(-200, math.ceil(law.duration_s / period) + 3)]
    for _ in range(3):
        along = [(b - a) / period for a, b in zip(along, along[1:])]
    assert max(map(abs, along)) <= jerk * 1.01 + 1e-3


@pytest.mark.parametrize('jerk', [0.0, 0.8])
@pytest.mark.parametrize('speed', [0.0, 0.3])
def test_the_time_law_keeps_every_limit(jerk: float, speed: float) -> None:
    limits = VelocityLimits(speed_m_s=0.5, linear_max_m_s=0.6, angular_max_rad_s=0.6,
                            acceleration_m_s2=0.4, deceleration_m_s2=0.5, lateral_max_m_s2=0.2,
                            jerk_max_m_s3=jerk)
    path, = legs(eight(), 0.8)
    law, period = TimeLaw(path, limits, 0.0, speed), 0.01
    along = [law.at(i * period) for i in range(math.ceil(law.duration_s / period) + 2)]
    speeds = [(b - a) / period for a, b in zip(along, along[1:])]
    slack = 1.02 if jerk == 0.0 else 1.25
    assert along[0] == pytest.approx(0.0, abs=1e-9)
    assert along[-1] == pytest.approx(path.length_m, abs=1e-6)
    assert min(speeds) >= -1e-9
    assert max(speeds) <= 0.5 + 1e-6
    for at, now in zip(along, speeds):
        bend = abs(path.at(at)[3])
        assert now * bend <= 0.6 * slack
        assert now * now * bend <= 0.2 * slack
    changes = [(b - a) / period for a, b in zip(speeds, speeds[1:])]
    assert max(changes) <= 0.4 * slack
    assert min(changes) >= -0.5 * slack
    if jerk:
        jerks = [abs(b - a) / period for a, b in zip(changes, changes[1:])]
        assert max(jerks) <= jerk * 1.1


def test_a_straight_line_takes_the_time_of_its_trapezoid() -> None:
    law = TimeLaw(straight((0.0, 0.0), (2.0, 0.0)), LIMITS)
    # Four fifths of the accelerations are for the reference, the rest for the law.
    assert law.duration_s == pytest.approx(2.0 / 0.5 + 0.5 / 0.32 / 2 + 0.5 / 0.4 / 2, rel=1e-3)


@given(st.floats(0.002, 30.0), st.floats(0.0, 2.0), st.floats(0.0, 1.0), st.sampled_from([0, 1]))
def test_a_time_law_ends_at_the_end_however_fast_it_begins(length: float, speed: float,
                                                           part: float, jerk: float) -> None:
    path = straight((0.0, 0.0), (length, 0.0))
    law = TimeLaw(path, VelocityLimits(jerk_max_m_s3=jerk), part * length, speed)
    times = [law.duration_s * i / 50 for i in range(51)]
    along = [law.at(t) for t in times]
    assert along[-1] == pytest.approx(length, abs=1e-6)
    assert all(b >= a - 1e-9 for a, b in zip(along, along[1:]))


def test_a_target_holds_what_the_reference_does_in_the_whole_period() -> None:
    path, = legs(circle(1.0), 0.8)
    reference = PathReference(path, LIMITS)
    x = y = heading = 0.0
    while not reference.finished:
        target = reference.target(0.3)
        assert math.hypot(target.x_m - x, target.y_m - y) < 2e-3
        turn = target.angular_rad_s * 0.3
        chord = target.linear_m_s * 0.3 * (math.sin(turn / 2) / (turn / 2) if turn else 1.0)
        x = target.x_m + chord * math.cos(target.heading_rad + turn / 2)
        y = target.y_m + chord * math.sin(target.heading_rad + turn / 2)
        heading = target.heading_rad + turn
        reference.advance(0.3)
    assert heading == pytest.approx(path.heading[-1], abs=1e-3)


def test_a_reference_waits_for_a_robot_that_is_held() -> None:
    reference = PathReference(straight((0.0, 0.0), (5.0, 0.0)), LIMITS)
    for _ in range(2000):
        reference.advance(0.02, reference.along_m)
    assert reference.along_m < 0.31


def test_the_nearest_point_stays_on_its_branch_of_a_crossing() -> None:
    path, = legs(eight(), 0.8)
    assert path.nearest(0.0, 0.0, 0.1) == pytest.approx(0.0, abs=0.02)
    assert path.nearest(0.0, 0.0, path.length_m / 2 + 0.2) == pytest.approx(
        path.length_m / 2, abs=0.02)
