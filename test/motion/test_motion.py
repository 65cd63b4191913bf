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

"""Angles, arcs, wheels and mountings."""

from __future__ import annotations

import json
import math
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st
import pytest

from rt_robot_os.motion.angles import roll_pitch_yaw_of
from rt_robot_os.motion.angles import wrapped
from rt_robot_os.motion.angles import yaw_of
from rt_robot_os.motion.differential import body_velocity
from rt_robot_os.motion.differential import moved
from rt_robot_os.motion.differential import tick_difference
from rt_robot_os.motion.differential import wheel_speeds
from rt_robot_os.motion.mounting import in_base
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.motion.quaternion import from_up
from rt_robot_os.motion.quaternion import rotate

ANGLES = st.floats(-1.5, 1.5)
SPEEDS = st.floats(-3.0, 3.0)


@given(st.floats(-1e6, 1e6))
def test_a_wrapped_angle_points_the_same_way(angle: float) -> None:
    found = wrapped(angle)
    assert -math.pi <= found <= math.pi
    assert math.cos(found - angle) == pytest.approx(1.0, abs=1e-9)


@given(ANGLES, ANGLES, st.floats(-3.1, 3.1))
def test_the_quaternion_of_a_mounting_has_its_angles(roll: float, pitch: float, yaw: float
                                                     ) -> None:
    q = Mounting(rotation_rad=(roll, pitch, yaw)).quaternion()
    assert roll_pitch_yaw_of(*q) == pytest.approx((roll, pitch, yaw), abs=1e-6)
    assert yaw_of(*(2.0 * each for each in q)) == pytest.approx(yaw, abs=1e-6)


def test_a_point_before_a_sensor_that_looks_left_lies_left_of_the_robot() -> None:
    sensor = Mounting((0.1, 0.0, 0.2), (0.0, 0.0, math.pi / 2))
    assert sensor.in_parent((1.0, 0.0, 0.0)) == pytest.approx((0.1, 1.0, 0.2))


@given(st.lists(st.tuples(ANGLES, ANGLES, st.floats(-3.1, 3.1), SPEEDS, SPEEDS), min_size=1,
                max_size=4))
def test_a_chain_of_frames_puts_a_point_where_its_links_do(
        links: list[tuple[float, float, float, float, float]]) -> None:
    mountings = {}
    point = expected = (0.3, -0.2, 0.1)
    for index, (roll, pitch, yaw, x, y) in enumerate(links):
        parent = f'{index + 1}' if index + 1 < len(links) else 'base_link'
        mountings[str(index)] = Mounting((x, y, 0.5), (roll, pitch, yaw), parent)
        expected = mountings[str(index)].in_parent(expected)
    found = in_base(mountings, '0')
    assert found.parent == 'base_link'
    assert found.in_parent(point) == pytest.approx(expected, abs=1e-6)


def test_a_frame_that_nobody_mounted_is_at_its_own_origin() -> None:
    assert in_base({}, 'base_link') == Mounting(parent='base_link')


@given(SPEEDS, SPEEDS, st.floats(0.05, 2.0))
def test_wheels_and_body_are_each_others_inverse(linear: float, angular: float, separation: float
                                                 ) -> None:
    wheels = wheel_speeds(linear, angular, separation)
    assert body_velocity(*wheels, separation) == pytest.approx((linear, angular), abs=1e-9)


def test_arcs_are_those_of_ros2_control(data_dir: Path) -> None:
    odometry = json.loads((data_dir / 'control' / 'nav2_vectors.json').read_text())['odometry']
    for case in odometry['cases']:
        left, right = (case[w] * odometry['radius'] * case['dt'] for w in ('wl', 'wr'))
        distance, turn = body_velocity(left, right, odometry['separation'])
        assert moved((0.0, 0.0, 0.0), distance, turn) == pytest.approx(
            (case['x'], case['y'], case['th']), abs=1e-12)


@given(SPEEDS, st.floats(-3.0, 3.0), st.integers(2, 50))
def test_an_arc_in_pieces_ends_where_it_ends_at_once(distance: float, turn: float, parts: int
                                                     ) -> None:
    pose = whole = (1.0, -2.0, 0.5)
    for _ in range(parts):
        pose = moved(pose, distance / parts, turn / parts)
    assert pose == pytest.approx(moved(whole, distance, turn), abs=1e-6)


@given(st.integers(0, 65535), st.integers(-32768, 32767))
def test_a_counter_that_wraps_loses_no_tick(old: int, step: int) -> None:
    assert tick_difference((old + step) & 0xFFFF, old, 16) == step


@given(st.floats(0.0, math.pi), ANGLES)
def test_the_shortest_turn_upright_is_exact_also_for_what_is_nearly_upside_down(
        tilt: float, direction: float) -> None:
    for angle in (tilt, math.pi - tilt * 1e-9):
        up = (math.sin(angle) * math.cos(direction), math.sin(angle) * math.sin(direction),
              math.cos(angle))
        q = from_up(up)
        assert q is not None
        assert rotate(q, up) == pytest.approx((0.0, 0.0, 1.0), abs=1e-12)
