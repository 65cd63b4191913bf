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

"""The filter of the pose: its formulas against matrices, and what no measurement may do to it."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import numpy as np
import numpy.typing as npt
import pytest
from rt_robot_os.motion.differential import moved
from rt_robot_os.motion.ekf import Ekf
from rt_robot_os.motion.ekf import GATE_3
from rt_robot_os.motion.ekf import MOVE_SIGMAS
from rt_robot_os.motion.poses import arc_between
from rt_robot_os.motion.poses import composed
from rt_robot_os.motion.poses import transform

Matrix = npt.NDArray[np.float64]
PLACES = st.floats(-50.0, 50.0)
ANGLES = st.floats(-math.pi, math.pi)
POSES = st.tuples(PLACES, PLACES, ANGLES)
DEVIATIONS = st.floats(0.001, 3.0)
WAYS = st.floats(-0.5, 0.5)


def spread(a: float, b: float, c: float, mixed: float) -> Matrix:
    """Make a covariance with correlations."""
    root = np.array([[a, 0.0, 0.0], [mixed * b, b, 0.0], [-mixed * c, mixed * c, c]])
    return root @ root.T


def packed(matrix: Matrix) -> tuple[float, float, float, float, float, float]:
    return (float(matrix[0, 0]), float(matrix[0, 1]), float(matrix[0, 2]), float(matrix[1, 1]),
            float(matrix[1, 2]), float(matrix[2, 2]))


def matrix_of(state: Ekf) -> Matrix:
    return np.array([[state.p00, state.p01, state.p02, state.p03],
                     [state.p01, state.p11, state.p12, state.p13],
                     [state.p02, state.p12, state.p22, state.p23],
                     [state.p03, state.p13, state.p23, state.p33]])


def made(pose: tuple[float, float, float], covariance: Matrix, drift: float = 0.0,
         drift_variance: float = 0.0) -> Ekf:
    state = Ekf()
    state.begin(pose, packed(covariance))
    state.begin_drift(drift, drift_variance)
    return state


COVARIANCES = st.builds(spread, DEVIATIONS, DEVIATIONS, DEVIATIONS, st.floats(-0.9, 0.9))


@given(POSES, COVARIANCES, WAYS, WAYS, st.floats(0.0, 0.5), st.floats(-0.1, 0.1))
def test_a_prediction_is_that_of_the_matrices(
        pose: tuple[float, float, float], covariance: Matrix, way: float, turn: float,
        lever: float, drift: float) -> None:
    state = made(pose, covariance, drift, 0.01)
    before = matrix_of(state)
    state.predict(way, turn, lever, 0.002, 0.003, 0.001, 0.004)
    real = turn - drift * lever
    end = moved(pose, way, real)
    assert (state.x, state.y) == pytest.approx(end[:2])
    dx, dy = end[0] - pose[0], end[1] - pose[1]
    middle = pose[2] + real / 2
    f = np.array([[1, 0, -dy, lever * dy / 2], [0, 1, dx, -lever * dx / 2], [0, 0, 1, -lever],
                  [0, 0, 0, 1]])
    g = np.array([[math.cos(middle), -dy / 2], [math.sin(middle), dx / 2], [0, 1], [0, 0]])
    noise = np.array([[0.002, 0.001], [0.001, 0.003]])
    wanted = f @ before @ f.T + g @ noise @ g.T
    wanted[3, 3] += 0.004
    assert matrix_of(state) == pytest.approx(wanted, rel=1e-9, abs=1e-12)


@given(POSES, COVARIANCES, st.tuples(st.floats(-3, 3), st.floats(-3, 3), st.floats(-1, 1)),
       COVARIANCES)
def test_a_correction_is_that_of_the_matrices(
        pose: tuple[float, float, float], covariance: Matrix, off: tuple[float, float, float],
        measured: Matrix) -> None:
    state = made(pose, covariance, 0.02, 0.01)
    state.predict(0.3, 0.1, 0.5, 1e-4, 1e-4)  # the drift is correlated now
    before, at = matrix_of(state), np.array([*state.pose, state.drift])
    h = np.eye(3, 4)
    inverse = np.linalg.inv(h @ before @ h.T + measured)
    gain = before @ h.T @ inverse
    innovation = np.array(off)
    seen = (at[0] + off[0], at[1] + off[1], at[2] + off[2])
    used = state.update_pose(seen, packed(measured), math.inf)
    assert used
    assert state.nis == pytest.approx(float(innovation @ inverse @ innovation), rel=1e-6)
    wanted = at + gain @ innovation
    assert state.pose[:2] == pytest.approx(wanted[:2], rel=1e-6, abs=1e-9)
    assert math.remainder(state.heading - wanted[2], math.tau) == pytest.approx(0, abs=1e-8)
    assert state.drift == pytest.approx(wanted[3], rel=1e-6, abs=1e-9)
    assert matrix_of(state) == pytest.approx((np.eye(4) - gain @ h) @ before, rel=1e-5, abs=1e-9)


@pytest.mark.parametrize('which', [2, 3])
def test_a_heading_and_a_drift_correct_like_the_matrices(which: int) -> None:
    state = made((1.0, 2.0, 0.5), spread(0.3, 0.2, 0.1, 0.4), 0.02, 0.01)
    state.predict(0.5, 0.1, 0.5, 1e-3, 1e-3)
    before, at = matrix_of(state), np.array([*state.pose, state.drift])
    h = np.eye(4)[[which]]
    total = (h @ before @ h.T + 0.01).item()
    gain = (before @ h.T / total).ravel()
    update = state.update_heading if which == 2 else state.update_drift
    assert update(float(at[which]) + 0.05, 0.01)
    assert [*state.pose, state.drift] == pytest.approx(at + gain * 0.05)
    assert matrix_of(state) == pytest.approx(before - np.outer(gain, h @ before), abs=1e-12)
    assert state.nis == pytest.approx(0.05 ** 2 / total)


@given(POSES, COVARIANCES, POSES, COVARIANCES)
@settings(max_examples=300)
def test_no_measured_pose_moves_the_estimate_by_more_than_three_sigma(
        pose: tuple[float, float, float], covariance: Matrix, seen: tuple[float, float, float],
        measured: Matrix) -> None:
    state = made(pose, covariance)
    used = state.update_pose(seen, packed(measured))
    delta = np.array([state.x - pose[0], state.y - pose[1],
                      math.remainder(state.heading - pose[2], math.tau)])
    if not used:
        assert not delta.any() or abs(delta).max() < 1e-12
        return
    assert state.nis <= GATE_3
    sigmas = np.abs(delta) / np.sqrt(np.diag(covariance))
    assert (sigmas <= MOVE_SIGMAS + 1e-9).all()
    # In every direction of the plane, not along the axes only.
    position = delta[:2] @ np.linalg.inv(covariance[:2, :2]) @ delta[:2]
    assert position <= MOVE_SIGMAS ** 2 * (1 + 1e-6)


@given(ANGLES, st.floats(0.01, 2.0), ANGLES, st.floats(0.001, 2.0))
def test_no_measured_heading_moves_the_estimate_by_more_than_three_sigma(
        heading: float, deviation: float, seen: float, noise: float) -> None:
    state = made((0.0, 0.0, heading), spread(0.1, 0.1, deviation, 0.0))
    state.update_heading(seen, noise * noise)
    assert abs(math.remainder(state.heading - heading, math.tau)) <= 3 * deviation + 1e-9


@given(st.lists(st.tuples(WAYS, WAYS, st.booleans()), max_size=60))
@settings(max_examples=50)
def test_the_covariance_stays_one(steps: list[tuple[float, float, bool]]) -> None:
    state = made((0.0, 0.0, 0.0), spread(0.1, 0.1, 0.1, 0.0), 0.0, 0.01)
    for way, turn, seen in steps:
        state.predict(way, turn, 0.02, 1e-5, 1e-5, 0.0, 1e-8)
        if seen:
            state.update_pose(state.pose, (1e-6, 0.0, 0.0, 1e-6, 0.0, 1e-6))
            state.update_heading(state.heading, 1e-6)
    assert np.linalg.eigvalsh(matrix_of(state)).min() > -1e-12


def test_the_heading_is_corrected_the_short_way_round() -> None:
    state = made((0.0, 0.0, math.pi - 0.01), spread(0.1, 0.1, 0.1, 0.0))
    assert state.update_pose((0.0, 0.0, -math.pi + 0.01), packed(spread(0.1, 0.1, 0.1, 0.0)))
    assert abs(state.heading) == pytest.approx(math.pi, abs=1e-9)


@pytest.mark.parametrize('bad', [(0.0,) * 6, (math.nan,) * 6, (-1.0, 0, 0, -1.0, 0, -1.0)])
def test_a_covariance_that_is_none_changes_nothing(
        bad: tuple[float, float, float, float, float, float]) -> None:
    state = made((1.0, 2.0, 3.0), np.zeros((3, 3)))
    assert not state.update_pose((1.0, 2.0, 3.0), bad)
    assert state.pose == (1.0, 2.0, 3.0)


def test_a_filter_goes_back_to_where_it_was() -> None:
    state = made((1.0, 2.0, 0.3), spread(0.1, 0.1, 0.1, 0.2), 0.01, 0.01)
    kept = state.state()
    state.predict(1.0, 0.5, 0.1, 1e-3, 1e-3)
    assert state.state() != kept
    state.restore(kept)
    assert state.state() == kept


@given(POSES, st.floats(-2.0, 2.0), st.floats(-3.0, 3.0))
def test_the_arc_between_two_poses_leads_from_one_to_the_other(
        pose: tuple[float, float, float], way: float, turn: float) -> None:
    distance, angle = arc_between(pose, moved(pose, way, turn))
    assert distance == pytest.approx(way, abs=1e-6)
    assert angle == pytest.approx(turn, abs=1e-9)


@given(POSES, POSES)
def test_a_frame_that_is_found_puts_the_robot_where_it_is(
        pose: tuple[float, float, float], odometry: tuple[float, float, float]) -> None:
    again = composed(transform(pose, odometry), odometry)
    assert again[:2] == pytest.approx(pose[:2], abs=1e-9)
    assert math.remainder(again[2] - pose[2], math.tau) == pytest.approx(0.0, abs=1e-9)
