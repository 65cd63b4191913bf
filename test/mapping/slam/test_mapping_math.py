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

"""Matching, graph and relations: what is put in askew comes out straight."""

from __future__ import annotations

import math
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

pytest.importorskip('scipy', reason='scipy is not installed')

from rt_robot_os.features.mapping.slam.alignment import SurfaceLines  # noqa: E402
from rt_robot_os.features.mapping.slam.correlation import best_fit  # noqa: E402
from rt_robot_os.features.mapping.slam.correlation import SearchWindow  # noqa: E402
from rt_robot_os.features.mapping.slam.likelihood import LikelihoodField  # noqa: E402
from rt_robot_os.features.mapping.slam.pose_graph import AbsolutePose  # noqa: E402
from rt_robot_os.features.mapping.slam.pose_graph import optimise  # noqa: E402
from rt_robot_os.features.mapping.slam.pose_graph import PoseEdge  # noqa: E402
from rt_robot_os.features.mapping.slam.scan import Scan  # noqa: E402
from rt_robot_os.features.mapping.slam.scan import surface_of  # noqa: E402
from rt_robot_os.features.mapping.slam.transforms import between  # noqa: E402
from rt_robot_os.features.mapping.slam.transforms import composed  # noqa: E402
from rt_robot_os.features.mapping.slam.transforms import placed  # noqa: E402

NUMBER = st.floats(-20.0, 20.0)
POSE = st.tuples(NUMBER, NUMBER, st.floats(-math.pi, math.pi - 1e-9)).map(np.array)


def room(pose: Any, width: float = 6.0, depth: float = 4.0, beams: int = 360) -> Scan:
    """Return what a laser sees in a room with a corner cut off."""
    angles = pose[2] - math.pi + np.arange(beams) * 2 * math.pi / beams
    dx, dy = np.cos(angles), np.sin(angles)
    with np.errstate(divide='ignore'):
        x = np.where(dx > 0, (width - pose[0]) / dx, -pose[0] / dx)
        y = np.where(dy > 0, (depth - pose[1]) / dy, -pose[1] / dy)
        cut = (width + depth - 2.0 - pose[0] - pose[1]) / (dx + dy)
    ranges = np.minimum(np.abs(x), np.abs(y))
    ranges = np.where((cut > 0) & (cut < ranges), cut, ranges)
    return Scan(0, pose, ranges, -math.pi, 2 * math.pi / beams)


@given(POSE, POSE)
def test_between_is_what_composed_undoes(first: Any, second: Any) -> None:
    assert composed(first, between(first, second)) == pytest.approx(second, abs=1e-9)


@given(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4), st.floats(-0.3, 0.3))
def test_a_scan_is_found_in_a_window_and_aligned_to_the_millimetre(
        x: float, y: float, yaw: float) -> None:
    there = surface_of(room(np.array((2.0, 1.5, 0.0))), 20.0)
    here = surface_of(room(np.array((2.0 + x, 1.5 + y, yaw))), 20.0)
    pose, score = best_fit(LikelihoodField(there.points), here.points,
                           SearchWindow(np.zeros(3), 0.6, 0.5))
    assert score > 0.8
    aligned = SurfaceLines(there.points[there.lined], there.normals[there.lined]).align(
        here.points, pose)
    assert aligned.share > 0.9
    assert aligned.pose == pytest.approx((x, y, yaw), abs=0.01)


def test_the_best_of_a_window_is_the_best_of_every_place_of_it() -> None:
    rng = np.random.default_rng(1)
    points, others = rng.uniform(-2, 2, (60, 2)), rng.uniform(-2, 2, (40, 2))
    field = LikelihoodField(points)
    window = SearchWindow(np.zeros(3), 0.4, 0.1, 0.2, 0.1)
    pose, score = best_fit(field, others, window)
    everywhere = []
    for turn in np.arange(-11, 12) * window.step_rad:
        cells = field.cells_of(placed(np.array((0.0, 0.0, turn)), others))
        for up in range(-8, 12):
            for across in range(-8, 12):
                x, y = cells[:, 0] + across, cells[:, 1] + up
                # The hills themselves: of each point the highest counts.
                off = (np.stack((x, y), -1)[:, None] - field.cells_of(points)) ** 2
                near = np.where((np.abs(off) <= 25).all(-1), off.sum(-1), np.inf).min(1)
                value = np.exp(-near * field.cell_m ** 2 / (2 * 0.07 ** 2))
                far = (across ** 2 + up ** 2) * field.cell_m ** 2 / 0.04
                everywhere.append(value.mean() - 0.01 * (far + (turn / 0.1) ** 2))
    assert score == pytest.approx(max(everywhere), abs=2e-3)  # hills have 546 steps
    assert math.hypot(pose[0], pose[1]) < 0.9


def test_a_loop_takes_back_what_the_way_has_summed_up_and_a_wrong_one_counts_little() -> None:
    true = np.array([(math.cos(a) * 5, math.sin(a) * 5, a + math.pi / 2)
                     for a in np.linspace(0, 2 * math.pi, 41)])
    true = composed(np.broadcast_to(between(true[0], np.zeros(3)), true.shape), true)
    drift = np.array((0.02, 0.01, 0.01))
    steps = between(true[:-1], true[1:]) + drift
    poses = [true[0]]
    for step in steps:
        poses.append(composed(poses[-1], step))
    weak, strong = np.diag((400.0, 400.0, 1e3)), np.diag((1e4, 1e4, 1e4))
    edges = [PoseEdge(i, i + 1, step, weak) for i, step in enumerate(steps)]
    edges += [PoseEdge(i, 40 - i, between(true[i], true[40 - i]), strong, True) for i in range(5)]
    before = np.hypot(*(np.array(poses) - true)[-1, :2])
    wrong = PoseEdge(10, 30, np.array((0.0, 0.0, 0.0)), strong, True)
    found = optimise(np.array(poses), [*edges, wrong], 30)
    after = np.hypot(*(found.poses - true)[-1, :2])
    assert before > 1.0 and after < 0.1
    assert found.weights[-1] < 0.01 and found.weights[:-1].min() > 0.9


@pytest.mark.parametrize('wrong', [0, 1, 2])
def test_absolute_poses_move_a_whole_map_to_where_they_say_and_a_wrong_one_does_not(
        wrong: int) -> None:
    true = np.array([(3.0 + 0.5 * i, 2.0, 0.1) for i in range(20)])
    steps = between(true[:-1], true[1:])
    edges = [PoseEdge(i, i + 1, step, np.diag((1e4, 1e4, 1e4))) for i, step in enumerate(steps)]
    drawn = composed(np.broadcast_to(np.array((-3.0, 1.0, 0.7)), true.shape), true)
    known = np.diag((400.0, 400.0, 400.0))
    fixes = [AbsolutePose(i, true[i], known) for i in range(0, 20, 4)]
    fixes += [AbsolutePose(i + 1, true[i + 1] + (8.0, 3.0, 0.5), known) for i in range(wrong)]
    found = optimise(drawn, edges, 20, fixes)
    assert found.poses == pytest.approx(true, abs=0.01)
    assert found.fix_weights[:5].min() > 0.9
    assert not wrong or found.fix_weights[5:].max() < 0.01


@pytest.mark.parametrize('ranges', [[], [math.nan] * 9, [math.inf] * 9, [0.0] * 9, [-1.0] * 9,
                                    [1e9] * 9, [2.0]])
def test_a_scan_without_a_surface_is_empty_or_alone(ranges: list[float]) -> None:
    surface = surface_of(Scan(0, np.zeros(3), np.array(ranges), 0.0, 0.1), 20.0)
    assert len(surface) == ranges.count(2.0)
    assert not surface.lined.any()
