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

"""Tracking laws: the vectors of Nav2, gains of held commands, and how well they track."""

from __future__ import annotations

import cmath
import json
import math
from pathlib import Path
from typing import Any

from driving import away_from
from driving import drive
from driving import eight
from driving import rms
from hypothesis import given
from hypothesis import strategies as st
import pytest

from rt_robot_os.motion.controllers import CONTROLLERS
from rt_robot_os.motion.controllers import make_controller
from rt_robot_os.motion.controllers.base import held
from rt_robot_os.motion.controllers.base import HeldGains
from rt_robot_os.motion.controllers.kanayama import Kanayama
from rt_robot_os.motion.controllers.kanayama import KanayamaGains
from rt_robot_os.motion.controllers.park_kuipers import curvature
from rt_robot_os.motion.controllers.park_kuipers import ParkKuipers
from rt_robot_os.motion.controllers.park_kuipers import ParkKuipersGains
from rt_robot_os.motion.controllers.park_kuipers import polar
from rt_robot_os.motion.controllers.regulated_pure_pursuit import carrot
from rt_robot_os.motion.controllers.regulated_pure_pursuit import curvature_to
from rt_robot_os.motion.controllers.regulated_pure_pursuit import for_curvature
from rt_robot_os.motion.controllers.regulated_pure_pursuit import on_circle
from rt_robot_os.motion.controllers.regulated_pure_pursuit import RegulatedPurePursuit
from rt_robot_os.motion.controllers.regulated_pure_pursuit import RegulatedPurePursuitGains
from rt_robot_os.motion.controllers.regulated_pure_pursuit import rotation
from rt_robot_os.motion.controllers.table import gain_fields
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.reference import PathReference
from rt_robot_os.motion.reference_path import straight
from rt_robot_os.motion.spline import legs
from rt_robot_os.motion.velocity_limits import VelocityLimits

LAWS = tuple(CONTROLLERS)


@pytest.fixture(name='vectors')
def _vectors(data_dir: Path) -> Any:
    return json.loads((data_dir / 'control' / 'nav2_vectors.json').read_text())


# ---- the vectors of Nav2 ---------------------------------------------------------------------


def test_segments_cut_circles_as_in_nav2(vectors: Any) -> None:
    for inside, outside, radius, found in vectors['circle_segment']:
        assert on_circle(inside, outside, radius) == pytest.approx(tuple(found))


def test_the_lookahead_is_that_of_nav2(vectors: Any) -> None:
    of = vectors['lookahead']['defaults']
    law = RegulatedPurePursuit(RegulatedPurePursuitGains(
        of['dist'], of['time'], of['min'], of['max']))
    for speed, distance in vectors['lookahead']['cases']:
        assert law.lookahead(speed) == pytest.approx(distance)
    assert RegulatedPurePursuit(RegulatedPurePursuitGains(
        of['dist'], 0.0)).lookahead(10.0) == of['dist']


def test_turns_to_a_heading_are_those_of_nav2(vectors: Any) -> None:
    of = vectors['rotate_to_heading']
    for case in of['cases']:
        assert rotation(case['angle'], case['current'], of['target'], of['max_accel'],
                        of['dt']) == pytest.approx(case['w'], abs=1e-3)


def test_polar_coordinates_are_those_of_nav2(vectors: Any) -> None:
    case, = vectors['egopolar']
    r, phi, delta = polar((*case['current'], -0.2), (*case['target'], 0.8))
    assert (r, phi, delta) == pytest.approx((case['r'], 0.8 - math.atan2(3, 2),
                                             -0.2 - math.atan2(3, 2)))


def test_the_graceful_law_gives_the_values_that_were_checked() -> None:
    law = ParkKuipers(ParkKuipersGains(1.0, 10.0, 0.2, 2.0, slowdown_m=0.1, speed_min_m_s=0.0))
    r, phi, delta = polar((0.0, 0.0, 0.0), (0.0, 5.0, 0.0))
    assert curvature(r, phi, delta, 1.0, 10.0) == pytest.approx(5.407042, abs=1e-6)
    assert law.to_pose((0.0, 0.0, 0.0), (0.0, 5.0, 0.0), 1.0, 1.0, 2.5) == pytest.approx(
        (0.1460446, 0.7896695), abs=1e-6)


@pytest.mark.parametrize(('bend', 'speed'), [
    (0.0, 0.5), (1.0, 0.5), (2.0, 0.2778), (-2.0, 0.2778)])
def test_tight_curves_are_driven_in_proportion_to_their_radius(bend: float, speed: float) -> None:
    assert for_curvature(0.5, bend, 0.9) == pytest.approx(speed, abs=1e-4)


def test_the_point_aimed_at_lies_on_the_circle_or_at_the_end() -> None:
    path = straight((0.0, 0.0), (2.0, 0.0))
    assert carrot(path, (0.5, 0.3, 0.0), 0.5, 0.5) == pytest.approx((0.4, -0.3))
    assert carrot(path, (1.9, 0.0, math.pi / 2), 1.9, 0.5) == pytest.approx((0.0, -0.1))
    assert carrot(path, (0.5, 0.9, 0.0), 0.5, 0.5) == pytest.approx((0.0, -0.9), abs=0.02)
    assert curvature_to(1.0, 1.0) == pytest.approx(1.0)
    assert curvature_to(0.01, 0.01) == 0.0


# ---- held commands ---------------------------------------------------------------------------


@given(st.floats(0.1, 8.0), st.floats(0.3, 2.0), st.floats(0.005, 3.0), st.floats(0.05, 2.0))
def test_a_held_command_has_the_poles_of_the_law_with_each_period(
        n: float, zeta: float, period: float, speed: float) -> None:
    square, damping = n * n, 2 * zeta * n
    f_y, f_theta = HeldGains().across(square, damping, period)
    k_y, k_theta = f_y * square / speed, f_theta * damping
    # The chain: heading += T u, distance += v T heading + v T^2 / 2 u; u = -k_y d - k_theta h.
    along = speed * period * period / 2
    trace = 2 - along * k_y - period * k_theta
    product = (1 - along * k_y) * (1 - period * k_theta) + period * k_y * (
        speed * period - along * k_theta)
    root = cmath.sqrt(damping * damping / 4 - square)
    wanted = [cmath.exp((-damping / 2 + sign * root) * period) for sign in (1, -1)]
    assert trace == pytest.approx(sum(wanted).real, abs=1e-6)
    assert product == pytest.approx((wanted[0] * wanted[1]).real, abs=1e-6)
    assert max(map(abs, wanted)) < 1.0


def test_short_periods_leave_the_gains_as_they_are() -> None:
    assert HeldGains().across(4.0, 3.2, 1e-6) == (1.0, 1.0)
    assert HeldGains().across(4.0, 3.2, 1e-3) == pytest.approx((1.0, 1.0), rel=5e-3)
    assert HeldGains().across(0.0, 0.0, 0.3) == (1.0, 1.0)
    assert held(2.0, 1e-6) == 2.0
    assert held(2.0, 0.3) * 0.3 == pytest.approx(1 - math.exp(-0.6))


@pytest.mark.parametrize('law', ['kanayama', 'samson'])
def test_a_period_of_a_second_is_stable_where_plain_gains_are_not(law: str) -> None:
    """The distance dies out; with the gains as they are the robot would weave for ever."""
    limits = VelocityLimits(speed_m_s=1.0, linear_max_m_s=1.2, acceleration_m_s2=5.0,
                            deceleration_m_s2=5.0, angular_acceleration_rad_s2=50.0,
                            angular_max_rad_s=6.0)
    controller = make_controller(law)
    reference = PathReference(straight((0.0, 0.0), (60.0, 0.0)), limits)
    pose: Pose = (0.0, 0.05, 0.0)
    for _ in range(12):
        v, w = controller.step(pose, reference, 1.0)
        x, y, yaw = pose
        pose = (x + v * math.cos(yaw + w / 2), y + v * math.sin(yaw + w / 2), yaw + w)
    assert abs(pose[1]) < 0.005


# ---- tracking --------------------------------------------------------------------------------


@pytest.mark.parametrize('law', LAWS)
def test_the_gains_of_each_law_are_settings_with_its_name(law: str) -> None:
    names = [field.name for field in gain_fields() if field.name.startswith(law)]
    assert names
    assert all(field.live and field.problem(field.default) is None for field in gain_fields())
    assert make_controller(law).NAME == law
    assert make_controller('kanayama', {'kanayama_k_y': 9.0}).gains == (  # type: ignore[attr-defined]  # noqa: E501
        KanayamaGains(k_y=9.0))


@pytest.mark.parametrize('law', LAWS)
@pytest.mark.parametrize('period', [0.02, 0.3])
def test_every_law_drives_the_eight(law: str, period: float) -> None:
    limits = VelocityLimits(angular_max_rad_s=2.0, lateral_max_m_s2=1.0)
    run = drive(law, (0.0, 0.0, math.pi / 4), period, limits)
    run.go(*eight())
    assert run.run() == 'done'
    path, = legs(eight(), 0.8)
    away = away_from(path, run.poses)
    timed = CONTROLLERS[law].TIMED
    assert max(away) < (0.005 if timed else 0.06)
    assert rms(away) < (0.003 if timed else 0.03)


@pytest.mark.parametrize('law', LAWS)
@pytest.mark.parametrize('left', [0.3, -0.3, 5.0])
def test_every_law_finds_back_to_its_path_without_circling(law: str, left: float) -> None:
    controller = make_controller(law)
    limits = VelocityLimits()
    path = straight((0.0, 0.0), (30.0, 0.0))
    reference = PathReference(path, limits)
    pose: Pose = (0.0, left, 0.0)
    for _ in range(4000):
        v, w = controller.step(pose, reference, 0.02)
        w = max(-1.0, min(1.0, w))
        x, y, yaw = pose
        pose = (x + 0.02 * v * math.cos(yaw), y + 0.02 * v * math.sin(yaw), yaw + 0.02 * w)
        assert abs(yaw) < 2.2
    assert abs(pose[1]) < 0.02


@given(st.tuples(*[st.floats(-1e6, 1e6)] * 3), st.sampled_from(LAWS),
       st.floats(0.001, 1.0))
def test_no_pose_makes_a_law_fail_or_say_what_is_no_number(pose: Pose, law: str, period: float
                                                           ) -> None:
    reference = PathReference(straight((0.0, 0.0), (3.0, 1.0)), VelocityLimits())
    controller = make_controller(law)
    for _ in range(3):
        assert all(map(math.isfinite, controller.step(pose, reference, period)))


@pytest.mark.parametrize('law', LAWS)
def test_a_pose_on_the_end_is_no_place_to_fail(law: str) -> None:
    reference = PathReference(straight((0.0, 0.0), (1.0, 0.0)), VelocityLimits())
    reference.advance(100.0)
    reference.nearest_m = 1.0
    v, w = make_controller(law).step((1.0, 0.0, 0.0), reference, 0.02)
    assert abs(v) < 0.06
    assert w == pytest.approx(0.0)


def test_a_slower_reference_is_not_overtaken() -> None:
    law = Kanayama()
    reference = PathReference(straight((0.0, 0.0), (3.0, 0.0)), VelocityLimits())
    for _ in range(100):
        reference.advance(0.02)
    ahead, _ = law.step((reference.along_m + 0.1, 0.0, 0.0), reference, 0.02)
    behind, _ = law.step((reference.along_m - 0.1, 0.0, 0.0), reference, 0.02)
    assert ahead < 0.3 < behind
