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

"""Outlines of maps and rays among walls, against slow ways to the same."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import numpy as np
import pytest

from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.outline import outline
from rt_robot_os.motion.walls import disc_distances
from rt_robot_os.motion.walls import nearest_point
from rt_robot_os.motion.walls import Walls

# No map is finer. Within the last digits of a float one is on either side of a wall.
COORDINATES = st.floats(-5.0, 5.0).map(lambda value: round(value, 4))
SEGMENTS = st.lists(st.tuples(COORDINATES, COORDINATES, COORDINATES, COORDINATES).filter(
    lambda s: math.hypot(s[2] - s[0], s[3] - s[1]) > 0.1), max_size=12)


def slow_cast(segments: list[tuple[float, ...]], x: float, y: float, angle: float) -> float:
    """Meet one ray with each segment that is seen from its left."""
    nearest = math.inf
    dx, dy = math.cos(angle), math.sin(angle)
    for ax, ay, bx, by in segments:
        ex, ey = bx - ax, by - ay
        across = dx * ey - dy * ex
        if across <= 0.0:
            continue
        distance = ((ax - x) * ey - (ay - y) * ex) / across
        along = ((ax - x) * dy - (ay - y) * dx) / across
        if distance > 0.0 and 0.0 <= along <= 1.0:
            nearest = min(nearest, distance)
    return nearest


@settings(deadline=None)
@given(SEGMENTS, COORDINATES, COORDINATES, st.lists(st.floats(-10.0, 10.0), min_size=1,
                                                    max_size=40), st.booleans())
def test_rays_meet_what_each_alone_would_meet(
        segments: list[tuple[float, ...]], x: float, y: float, angles: list[float],
        ordered: bool) -> None:
    angles = sorted(angles) if ordered else angles
    found = Walls(np.array(segments, dtype=float).reshape(-1, 4)).cast(x, y, np.array(angles))
    for angle, distance in zip(angles, found):
        expected = slow_cast(segments, x, y, angle)
        # A ray along the end of a segment may count as on it or not.
        near = [slow_cast(segments, x, y, angle + off) for off in (-1e-6, 0.0, 1e-6)]
        if all(each == pytest.approx(expected, rel=1e-3) for each in near):
            assert distance == pytest.approx(expected, rel=1e-6)


def test_of_many_walls_only_those_in_reach_are_looked_at_and_none_is_missed() -> None:
    chance = np.random.default_rng(3)
    starts = chance.uniform(-50.0, 50.0, (3000, 2))
    segments = np.hstack([starts, starts + chance.uniform(-1.0, 1.0, (3000, 2))])
    walls = Walls(segments)
    angles = np.linspace(-3.0, 3.0, 60)
    for x, y in chance.uniform(-50.0, 50.0, (20, 2)):
        everything = walls.cast(x, y, angles)
        some = walls.cast(x, y, angles, 6.0)
        assert some == pytest.approx(np.where(everything > 6.0, math.inf, everything))


@settings(deadline=None, max_examples=50)
@given(st.lists(st.tuples(st.integers(0, 14), st.integers(0, 14)), min_size=1, max_size=80),
       st.floats(-3.0, 3.0))
def test_the_outline_of_boxes_is_theirs_to_the_last_digit(
        corners: list[tuple[int, int]], yaw: float) -> None:
    """Boxes of 4 x 4 cells have no stairs: rays meet the very edges of their cells."""
    cells = np.zeros((72, 72), dtype=np.int8)
    for row, column in corners:
        cells[4 * row + 4:4 * row + 8, 4 * column + 4:4 * column + 8] = 100
    grid = GridMap(cells, 0.1, (1.0, -2.0, yaw))
    walls = Walls.of(grid)
    x, y = grid.centre(1, 1)
    for angle in np.linspace(0.01, 6.0, 25):
        distance = float(walls.cast(x, y, np.array([angle]))[0])
        along = np.arange(0.0, 12.0, 0.004)
        hits = grid.values(x + along * np.cos(angle), y + along * np.sin(angle)) >= 50
        if not hits.any():
            assert distance > 11.9 or distance == math.inf or (
                grid.value(x + (distance + 1e-6) * np.cos(angle),
                           y + (distance + 1e-6) * np.sin(angle)) >= 50)
        else:
            assert distance == pytest.approx(along[hits.argmax()], abs=0.0041) or (
                distance < along[hits.argmax()]
                and grid.occupied(x + (distance + 1e-6) * np.cos(angle),
                                  y + (distance + 1e-6) * np.sin(angle)))


@settings(deadline=None, max_examples=50)
@given(st.lists(st.sampled_from([(0, 1), (1, 0), (0, -1), (-1, 0)]), max_size=60),
       st.floats(0.0, 6.0))
def test_no_ray_leaves_a_closed_room(steps: list[tuple[int, int]], turn: float) -> None:
    cells = np.full((130, 130), 100, dtype=np.int8)
    row = column = 65
    middles = [(row, column)]
    for step in steps:
        row, column = row + step[0], column + step[1]
        middles.append((row, column))
    for row, column in middles:
        cells[row - 1:row + 2, column - 1:column + 2] = 0
    grid = GridMap(cells, 0.05)
    walls = Walls.of(grid)
    angles = np.linspace(0.0, math.tau, 60) + turn
    for row, column in middles[::7]:
        ranges = walls.cast(*grid.centre(row, column), angles)
        assert np.isfinite(ranges).all() and ranges.max() < 4.0


def test_one_jog_of_a_wall_stays_a_jog_and_a_small_post_keeps_its_place() -> None:
    cells = np.zeros((40, 80), dtype=np.int8)
    cells[30:, :] = 100
    cells[29, 40:] = 100      # thicker by one cell
    cells[10, 10] = 100       # the leg of a table
    segments = outline(GridMap(cells, 0.05))
    lower = segments[np.isclose(segments[:, 1], segments[:, 3]) & (segments[:, 1] > 1.0)]
    assert {round(float(y), 3) for y in lower[:, 1]} == {1.5, 1.45, 2.0}
    ranges = Walls(segments).cast(0.525, 0.0, np.array([math.pi / 2]))
    assert ranges[0] == pytest.approx(0.5)


def test_segments_near_a_point_are_found() -> None:
    walls = Walls(np.array([[0.0, 0.0, 1.0, 0.0], [5.0, 5.0, 6.0, 5.0]]))
    assert walls.near(0.5, 0.3, 0.2) == ((0.0, 0.0, 1.0, 0.0),)
    assert walls.near(3.0, 3.0, 0.2) == ()
    assert nearest_point((0.0, 0.0, 1.0, 0.0), 0.4, 2.0) == (0.4, 0.0)
    assert nearest_point((0.0, 0.0, 1.0, 0.0), -3.0, 2.0) == (0.0, 0.0)


def test_from_within_a_disc_it_is_met_at_once() -> None:
    assert disc_distances(0.1, 0.0, np.array([0.0, 3.0]), 0.2).tolist() == [0.0, 0.0]
    assert disc_distances(1.0, 0.0, np.array([0.0, 3.0]), 0.2).tolist() == [0.8, math.inf]
