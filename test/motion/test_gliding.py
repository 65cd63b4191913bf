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

"""A robot that touches something: in which directions it may go on."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rt_robot_os.motion.zones import Circle
from rt_robot_os.motion.zones import Footprint
from rt_robot_os.motion.zones import Rectangle

ROUND, BOX = Circle(0.2), Rectangle(0.35, 0.15, 0.2, 0.25)
#: The most that it may come nearer to what it touches, in degrees off the direction along it.
GLANCING_DEG = math.degrees(math.asin(0.02))


def pushes(shape: Footprint, x: float, y: float, v: float, w: float = 0.0) -> bool:
    """Return whether a velocity would push a point that the footprint touches."""
    xs, ys = np.array([x]), np.array([y])
    assert abs(shape.room(xs, ys)[0]) < 1e-9
    return bool(shape.approached(xs, ys, *shape.normals(xs, ys), v, w).any())


@pytest.mark.parametrize('side', [1.0, -1.0])
@pytest.mark.parametrize('v', [0.05, 1.5, -0.05, -1.5])
@pytest.mark.parametrize(('towards_deg', 'pushed'), [
    (-10.0, False), (0.0, False), (GLANCING_DEG - 0.05, False), (GLANCING_DEG + 0.05, True),
    (5.0, True), (90.0, True)])
def test_it_glides_along_a_wall_and_is_not_driven_into_one_of_some_degrees(
        towards_deg: float, pushed: bool, v: float, side: float) -> None:
    towards = math.radians(towards_deg)
    x, y = math.copysign(1.0, v) * math.sin(towards), side * math.cos(towards)
    assert pushes(ROUND, 0.2 * x, 0.2 * y, v) is pushed


def test_along_its_straight_sides_it_drives_and_backs_beside_a_wall() -> None:
    for y in (0.2, -0.25):
        for x in (-0.1, 0.0, 0.3):
            assert not pushes(BOX, x, y, 0.5) and not pushes(BOX, x, y, -0.5)


@pytest.mark.parametrize(('x', 'w', 'pushed'), [
    (0.3, 0.5, True), (0.3, -0.5, False), (-0.1, 0.5, False), (-0.1, -0.5, True),
    (0.02, 0.5, True), (0.02, 5.0, True), (0.005, 0.5, False), (0.005, 5.0, False)])
def test_turning_in_place_a_side_pushes_what_is_before_or_behind_its_middle(
        x: float, w: float, pushed: bool) -> None:
    assert pushes(BOX, x, 0.2, 0.0, w) is pushed
    assert pushes(BOX, x, -0.25, 0.0, -w) is pushed


def test_a_round_robot_turns_in_place_whatever_it_touches() -> None:
    for angle in np.linspace(-math.pi, math.pi, 25):
        for w in (2.0, -2.0):
            assert not pushes(ROUND, 0.2 * math.cos(angle), 0.2 * math.sin(angle), 0.0, w)


def test_a_curve_away_from_a_wall_is_free_and_one_into_it_is_not() -> None:
    # The point at the front left corner comes nearer as fast as the corner turns into it.
    assert not pushes(BOX, 0.35 - 1e-6, 0.2, 0.5, -0.5)
    assert pushes(BOX, 0.35 - 1e-6, 0.2, 0.5, 0.5)


def test_what_stands_still_pushes_nothing() -> None:
    assert not pushes(ROUND, 0.2, 0.0, 0.0) and not pushes(BOX, 0.35, 0.0, 0.0)
