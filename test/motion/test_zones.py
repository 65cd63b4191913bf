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

"""How far a robot can go: closed formulas against driving step by step, with random obstacles."""

from __future__ import annotations

import math

from hypothesis import example
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import numpy as np
import pytest

from rt_robot_os.motion.differential import moved
from rt_robot_os.motion.zones import braking_share
from rt_robot_os.motion.zones import Circle
from rt_robot_os.motion.zones import Footprint
from rt_robot_os.motion.zones import Rectangle

ROUND, BOX = Circle(0.2), Rectangle(0.35, 0.15, 0.2, 0.25)
CLEARANCE_M = 0.05
START = 0.0, 0.0, 0.0
SHAPES = st.sampled_from([ROUND, BOX])
SPEEDS = st.one_of(st.just(0.0), st.floats(0.05, 1.5), st.floats(-1.5, -0.05))
TURNS = st.one_of(st.just(0.0), st.floats(0.001, 3.0), st.floats(-3.0, -0.001))
POINTS = st.lists(st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0)), min_size=1, max_size=12)


def seen_from(poses: list[tuple[float, float, float]], x: np.ndarray, y: np.ndarray
              ) -> tuple[np.ndarray, np.ndarray]:
    """Return points of the start as a robot sees them from each of the poses, a row for each."""
    there_x, there_y, heading = np.array(poses).T[:, :, np.newaxis]
    dx, dy = x - there_x, y - there_y
    c, s = np.cos(heading), np.sin(heading)
    return c * dx + s * dy, c * dy - s * dx


def outside(shape: Footprint, points: list[tuple[float, float]]) -> tuple[np.ndarray, np.ndarray]:
    x, y = np.array(points).T
    keep = shape.room(x, y) > CLEARANCE_M + 1e-6
    return x[keep], y[keep]


@settings(max_examples=300, deadline=None)
@given(SHAPES, POINTS, SPEEDS, TURNS)
def test_the_time_until_it_touches_is_that_of_driving_step_by_step(
        shape: Footprint, points: list[tuple[float, float]], v: float, w: float) -> None:
    x, y = outside(shape, points)
    times = shape.times(x, y, v, w, CLEARANCE_M)
    assert not np.isnan(times).any()
    until = min(3.0, times.min(initial=math.inf))
    # Until then it touches nothing, ...
    px, py = seen_from([moved(START, v * t, w * t) for t in until * np.linspace(0.0, 0.999, 60)],
                       x, y)
    assert not within(shape, px, py, -1e-4).any()
    # ... and then it does.
    for i in np.flatnonzero(times < 30.0):
        px, py = seen_from([moved(START, v * times[i], w * times[i])], x[i], y[i])
        assert within(shape, px, py, 1e-4).all()


def within(shape: Footprint, x: np.ndarray, y: np.ndarray, margin_m: float) -> np.ndarray:
    """Return which points are in the zone, made larger by a margin."""
    return shape.room(x, y) < CLEARANCE_M + margin_m


# In a curve a corner is faster than `speed` says: no length of a step may be forgiven by it.
@example(BOX, [(0.875, 0.0)], 1.0, 1.0, 0.41015625, 1.0)
@settings(max_examples=200, deadline=None)
@given(SHAPES, POINTS, SPEEDS, TURNS, st.floats(0.0, 0.5), st.floats(0.1, 3.0))
def test_from_the_speed_that_is_allowed_it_stops_before_it_touches(
        shape: Footprint, points: list[tuple[float, float]], v: float, w: float,
        reaction_s: float, braking: float) -> None:
    x, y = outside(shape, points)
    stopping_s = shape.speed(v, w) / braking
    if not stopping_s:
        return
    share = braking_share(
        float(shape.times(x, y, v, w, CLEARANCE_M).min(initial=math.inf)), stopping_s, reaction_s)
    assert 0.0 <= share <= 1.0
    stops_s = reaction_s + share * stopping_s
    instants = [*np.linspace(0.0, reaction_s, 20), *np.linspace(reaction_s, stops_s, 60)]
    poses = [START]
    for before_s, now_s in zip(instants, instants[1:]):
        # The speed changes evenly between two instants, so that the way is exact.
        braked_s = (max(0.0, before_s - reaction_s) + max(0.0, now_s - reaction_s)) / 2
        whole_s = (now_s - before_s) * (share - braked_s / stopping_s)
        poses.append(moved(poses[-1], v * whole_s, w * whole_s))
    assert not within(shape, *seen_from(poses, x, y), -1e-4).any()


@pytest.mark.parametrize(('v', 'w', 'allowed'), [
    (0.3, 0.0, False), (-0.3, 0.0, True), (0.3, 0.3, False), (-0.3, 0.3, True)])
def test_away_from_what_it_touches_it_may_drive(v: float, w: float, allowed: bool) -> None:
    for shape, front_m in ((ROUND, 0.2), (BOX, 0.35), (BOX, 0.34)):
        x, y = np.array([front_m]), np.array([0.0])
        assert shape.room(x, y)[0] <= 0.0
        assert bool(shape.approached(x, y, *shape.normals(x, y), v, w).any()) is not allowed


def test_a_round_robot_turns_beside_a_wall_and_one_with_corners_does_not() -> None:
    x = np.linspace(-1.0, 1.0, 41)
    wall = np.full(41, 0.22)
    assert math.isinf(ROUND.times(x, wall, 0.0, 1.0, 0.019).min())
    for turn in (1.0, -1.0):
        assert BOX.times(x, wall, 0.0, turn, 0.019).min() < 0.1
    assert math.isinf(BOX.times(x, wall, 0.3, 0.0, 0.019).min())
    assert math.isinf(BOX.times(x, wall, -0.3, 0.0, 0.019).min())


def test_turning_in_place_the_side_meets_what_is_beside_it() -> None:
    x, y = np.array([0.0]), np.array([0.3])
    assert math.isinf(BOX.times(x, y, 0.3, 0.0, 0.05)[0])
    assert math.isinf(ROUND.times(x, y, 0.0, 1.0, 0.05)[0])
    # The circle of 0.3 m cuts the side, 0.25 m away, where its sine is 0.25 / 0.3.
    assert BOX.times(x, y, 0.0, 1.0, 0.05)[0] == pytest.approx(
        math.pi / 2 - math.asin(0.25 / 0.3))


@pytest.mark.parametrize(('time_s', 'share'), [
    (-1.0, 0.0), (0.0, 0.0), (math.inf, 1.0), (0.7, 1.0), (0.2 * 0.5 + 0.5 * 0.25, 0.5),
    (0.2 * 0.99 + 0.5 * 0.99 ** 2, 0.99)])
def test_the_share_that_stops_in_time(time_s: float, share: float) -> None:
    assert braking_share(time_s, 1.0, 0.2) == pytest.approx(share)
    assert braking_share(1e-9, 0.0, 0.0) == 1.0
