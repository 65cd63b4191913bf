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

"""A mapper for hours: what it keeps and lets go, where it looks when lost, who it believes."""

from __future__ import annotations

import copy
from dataclasses import replace
import math
from typing import Any

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import numpy as np
import pytest

pytest.importorskip('scipy', reason='scipy is not installed')

from rt_robot_os.features.mapping.slam.graph import MapGraph  # noqa: E402
from rt_robot_os.features.mapping.slam.graph_arrays import arrays_of  # noqa: E402
from rt_robot_os.features.mapping.slam.graph_arrays import graph_of  # noqa: E402
from rt_robot_os.features.mapping.slam.keyframes import Keyframe  # noqa: E402
from rt_robot_os.features.mapping.slam.mapper import Mapper  # noqa: E402
from rt_robot_os.features.mapping.slam.marginalisation import chain  # noqa: E402
from rt_robot_os.features.mapping.slam.marginalisation import marginalise  # noqa: E402
from rt_robot_os.features.mapping.slam.marginalisation import reverse  # noqa: E402
from rt_robot_os.features.mapping.slam.pose_graph import AbsolutePose  # noqa: E402
from rt_robot_os.features.mapping.slam.pose_graph import optimise  # noqa: E402
from rt_robot_os.features.mapping.slam.pose_graph import PoseEdge  # noqa: E402
from rt_robot_os.features.mapping.slam.scan import Scan  # noqa: E402
from rt_robot_os.features.mapping.slam.scan import surface_of  # noqa: E402
from rt_robot_os.features.mapping.slam.trajectory import ScanTrajectory  # noqa: E402
from rt_robot_os.features.mapping.slam.transforms import between  # noqa: E402
from rt_robot_os.features.mapping.slam.transforms import composed  # noqa: E402
from rt_robot_os.features.mapping.slam.tuning import MapperTuning  # noqa: E402
from rt_robot_os.motion.grid_map import GridMap  # noqa: E402
from rt_robot_os.motion.walls import Walls  # noqa: E402

BEAMS = 180
STEP = math.tau / BEAMS
PERIOD_NS = 100_000_000


def building(cupboard: tuple[float, float] | None = (5.0, 4.2)) -> Walls:
    """Return two unlike rooms with a thin wall and a door between, and a cupboard or none."""
    cells = np.zeros((120, 200), np.int8)
    cells[:2], cells[-2:], cells[:, :2], cells[:, -2:] = 100, 100, 100, 100
    cells[:, 98:100] = 100
    cells[50:70, 98:100] = 0
    cells[2:20, 60:75] = 100
    cells[90:118, 2:16] = 100
    cells[20:34, 140:150] = 100
    if cupboard is not None:
        x, y = (round(each / 0.05) for each in cupboard)
        cells[y:y + 12, x - 24:x - 12] = 100
    return Walls.of(GridMap(cells, 0.05))


def seen(walls: Walls, pose: Any, stamp: int, odometry: Any, noise: Any) -> Scan:
    ranges = walls.cast(float(pose[0]), float(pose[1]),
                        pose[2] - math.pi + STEP * np.arange(BEAMS), 20.0)
    return Scan(stamp * PERIOD_NS, np.array(odometry), ranges + noise, -math.pi, STEP)


def round_trip(step_m: float = 0.14) -> Any:
    """Return a way through both rooms and back to where it began."""
    corners = ((1.5, 2.0), (3.8, 3.0), (6.4, 3.0), (7.6, 4.2), (6.2, 3.0), (3.8, 3.0), (1.9, 3.6),
               (1.5, 2.0))
    poses: list[tuple[float, float, float]] = []
    for a, b in zip(corners, corners[1:]):
        yaw = math.atan2(b[1] - a[1], b[0] - a[0])
        before = poses[-1][2] if poses else yaw
        turn = math.remainder(yaw - before, math.tau)
        turns = math.ceil(abs(turn) / 0.25)
        poses += [(*a, before + turn * i / turns) for i in range(1, turns)]
        count = math.ceil(math.dist(a, b) / step_m)
        poses += [(a[0] + (b[0] - a[0]) * i / count, a[1] + (b[1] - a[1]) * i / count, yaw)
                  for i in range(count)]
    return np.array(poses)


class Robot:
    """A robot whose wheels count 3 % too much."""

    def __init__(self, mapper: Mapper, walls: Walls) -> None:
        self.mapper, self.walls = mapper, walls
        self.rng = np.random.default_rng(5)
        self.wheels, self.stamp = np.zeros(3), 0
        self.at: Any = None

    def go(self, poses: Any, is_carried: bool = False) -> Any:
        """Go a way; return what the mapper says and how far that is off."""
        said, off = [], []
        for pose in poses:
            if self.at is not None and not is_carried:
                self.wheels = composed(self.wheels, between(self.at, pose) * (1.03, 1.0, 1.03))
            self.at, self.stamp, is_carried = pose, self.stamp + 1, False
            located = self.mapper.add(seen(self.walls, pose, self.stamp, self.wheels,
                                           self.rng.normal(0, 0.01, BEAMS)))
            while self.mapper.process_pending():
                pass
            said.append(located)
            off.append(float(np.hypot(*(located.pose[:2] - pose[:2]))))
        return said, np.array(off)


@pytest.fixture(scope='module')
def driven() -> tuple[Robot, Any, Any]:
    """Return a robot that went round once, what its mapper said and how far that was off."""
    way = round_trip()
    robot = Robot(Mapper(start=way[0]), building())
    said, off = robot.go(way)
    return robot, said, off


def test_rooms_on_both_sides_of_a_thin_wall_are_mapped_to_a_centimetre(driven: Any) -> None:
    robot, said, off = driven
    assert off.max() < 0.03 and not any(each.is_lost for each in said)
    way = round_trip()
    trajectory = robot.mapper.trajectory()
    assert np.hypot(*(trajectory - way)[:, :2].T).max() < 0.03
    errors = np.array([each.pose for each in said[1:]]) - way[1:]
    errors[:, 2] = (errors[:, 2] + math.pi) % math.tau - math.pi
    covariances = np.array([each.covariance for each in said[1:]])
    nees = np.einsum('ni,nij,nj->n', errors, np.linalg.inv(covariances), errors).mean()
    assert 0.03 < nees / 3 < 2.0  # neither far too sure nor far too modest


def test_what_is_known_is_not_kept_again(driven: Any) -> None:
    robot = copy.deepcopy(driven[0])
    kept, version = len(robot.mapper.keyframes), robot.mapper.version
    assert kept < 0.4 * robot.mapper.counts['scans']
    _, off = robot.go(round_trip()[:70])
    assert len(robot.mapper.keyframes) <= kept + 8 and off.max() < 0.03
    assert robot.mapper.version <= version + 12


def test_furniture_that_moved_is_taken_out_and_what_came_is_taken_in(driven: Any) -> None:
    robot = copy.deepcopy(driven[0])

    def points_at(low: Any, high: Any) -> int:
        count = 0
        for frame in robot.mapper.keyframes:
            there = frame.surface.points @ np.array((
                (math.cos(frame.pose[2]), math.sin(frame.pose[2])),
                (-math.sin(frame.pose[2]), math.cos(frame.pose[2])))) + frame.pose[:2]
            count += int(((there > low) & (there < high)).all(1).sum())
        return count
    before = points_at((3.7, 4.1), (4.5, 4.9))
    assert before > 30
    robot.walls = building((3.0, 4.9))
    way = round_trip()[:25]
    for _ in range(2):
        robot.go(way)
        robot.go(way[::-1])
    # What was seen from elsewhere stays until the robot looks from there.
    assert points_at((3.7, 4.1), (4.5, 4.9)) < 0.6 * before
    assert points_at((1.7, 4.8), (2.5, 5.6)) > 5
    assert robot.mapper.counts['points_gone'] > 0.4 * before


def test_a_robot_that_was_carried_away_says_so_keeps_nothing_and_finds_itself(
        driven: Any) -> None:
    robot = copy.deepcopy(driven[0])
    kept = len(robot.mapper.keyframes)
    there = np.repeat(np.array(((7.3, 3.6, 2.0),)), 25, axis=0)
    said, off = robot.go(there, is_carried=True)
    lost = [each.is_lost for each in said]
    assert all(lost[:10]) and not any(lost[20:]) and off[20:].max() < 0.05
    assert len(robot.mapper.keyframes) == kept and robot.mapper.counts['found'] == 1


def test_mapping_goes_on_from_a_saved_graph_where_the_robot_is_found(driven: Any) -> None:
    graph = copy.deepcopy(driven[0].mapper.graph)
    robot = Robot(Mapper.of_graph(graph), building())
    said, _ = robot.go(np.array(((2.0, 3.0, 0.4),)))
    assert said[0].is_lost and not said[0].is_kept
    robot.mapper.relocate(np.array((2.1, 2.9, 0.45)), robot.wheels)
    _, off = robot.go(round_trip()[:20])
    assert off.max() < 0.03
    with pytest.raises(ValueError, match='must be finite'):
        robot.mapper.relocate(np.array((math.nan, 0.0, 0.0)), robot.wheels)
    empty = Mapper.of_graph(MapGraph())
    assert not Robot(empty, building()).go(round_trip()[:2])[0][1].is_lost


def test_a_map_follows_absolute_poses_and_says_by_how_much_it_moved() -> None:
    way = round_trip()[:40]
    wrong = np.array((0.5, -0.3, 0.1))
    robot = Robot(Mapper(start=composed(way[0], wrong)), building())
    said, _ = robot.go(way[:12])
    for number in range(4, 11):
        true = composed(way[number], between(way[number], way[number + 1]) * 0.5)
        robot.mapper.add_absolute_pose((number + 1) * PERIOD_NS + PERIOD_NS // 2, true,
                                       np.diag((0.02 ** 2, 0.02 ** 2, 0.01 ** 2)))
    while robot.mapper.process_pending():
        pass
    robot.mapper.add_absolute_pose(11 * PERIOD_NS, way[10] + (4.0, 4.0, 1.0),
                                   np.diag((1e-4, 1e-4, 1e-4)))
    before = said[-1].pose
    said, off = robot.go(way[12:])
    assert off.max() < 0.05
    moved = [each.correction for each in said if each.correction is not None]
    assert moved and np.hypot(*(composed(moved[0], before) - way[11])[:2]) < 0.05
    assert robot.mapper.counts['fixes'] == 8
    with pytest.raises(ValueError, match='positive definite'):
        robot.mapper.add_absolute_pose(0, way[0], np.zeros((3, 3)))
    robot.mapper.add_absolute_pose(1, way[0], np.eye(3))
    assert robot.mapper.counts['fixes_left'] == 1  # older than all scans


def test_keyframes_are_bounded_in_a_place_and_in_all() -> None:
    way = round_trip(0.3)
    tuning = MapperTuning(keyframes_most=12, keep_share=1.1)
    robot = Robot(Mapper(tuning, start=way[0]), building())
    _, off = robot.go(way)
    mapper = robot.mapper
    assert len(mapper.keyframes) == 12 and mapper.counts['crowded'] > 5
    assert len(mapper.trajectory()) == len(way) and off.max() < 0.1
    assert np.hypot(*(mapper.trajectory() - way)[:, :2].T).max() < 0.1


def test_odometry_that_jumps_moves_nothing() -> None:
    way = round_trip()[:20]
    robot = Robot(Mapper(start=way[0]), building())
    robot.go(way[:10])
    robot.wheels = robot.wheels + (100.0, 0.0, 0.0)
    _, off = robot.go(way[10:])
    assert off.max() < 0.05 and robot.mapper.counts['jumps'] == 1


# ---- graphs ------------------------------------------------------------------------------------

NUMBER = st.floats(-5.0, 5.0)
POSE = st.tuples(NUMBER, NUMBER, st.floats(-3.1, 3.1)).map(np.array)


@settings(max_examples=25, deadline=None)
@given(POSE, POSE, st.floats(1.0, 1e4), st.floats(1.0, 1e4))
def test_edges_turn_round_and_chain(a: Any, b: Any, first: float, second: float) -> None:
    one = PoseEdge(0, 1, a, np.diag((first, second, first)))
    there = chain(one, PoseEdge(1, 2, b, np.diag((second, first, second))))
    assert there.relative == pytest.approx(composed(a, b), abs=1e-9)
    back = reverse(reverse(one))
    assert back.relative == pytest.approx(a, abs=1e-9)
    assert np.allclose(back.information, one.information, rtol=1e-4, atol=1e-3)
    assert np.linalg.eigvalsh(there.information).max() <= max(first, second) * 1.001


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 1 << 32), st.integers(4, 12), st.integers(1, 6))
def test_a_graph_that_forgets_stays_in_one_piece_and_where_it_was(
        seed: int, count: int, gone: int) -> None:
    rng = np.random.default_rng(seed)
    poses = rng.uniform(-5, 5, (count, 3)) * (1, 1, 0.5)
    graph = MapGraph([Keyframe(i, pose.copy(), pose, surface_of(
        Scan(i, pose, np.zeros(0), 0.0, 0.1), 20.0), float(i)) for i, pose in enumerate(poses)])
    pairs = [(int(rng.integers(0, i)), i) for i in range(1, count)]
    pairs += [(int(a), int(b)) for a, b in rng.integers(0, count, (count, 2)) if a != b]
    graph.edges = [PoseEdge(a, b, between(poses[a], poses[b]), np.diag(rng.uniform(10, 1e3, 3)),
                            bool(rng.integers(0, 2))) for a, b in pairs]
    graph.fixes = [AbsolutePose(int(rng.integers(0, count)), np.zeros(3), np.eye(3))]
    track, where = ScanTrajectory(1000), rng.integers(0, count, 30)
    for at in where.tolist():
        track.append(at, rng.uniform(-1, 1, 3))
    scans, edges = track.poses(list(poses)), len(graph.edges)
    for _ in range(min(gone, count - 1)):
        index = int(rng.integers(0, len(graph.keyframes)))
        seen_at = [each.pose for each in graph.keyframes]
        heir = marginalise(graph, index)
        track.remove_keyframe(index, heir, between(seen_at[heir], seen_at[index]))
        left = len(graph.keyframes)
        assert len(graph.edges) < edges or left == 1
        edges = len(graph.edges)
        known = {0}
        for _ in range(left):
            known |= {b for a, b in _both_ways(graph) if a in known}
        assert known == set(range(left))
        assert all(0 <= each.keyframe < left for each in graph.fixes)
        stands = np.array([each.pose for each in graph.keyframes])
        assert optimise(stands, graph.edges, 3).poses == pytest.approx(stands, abs=1e-6)
    assert np.allclose(track.poses([each.pose for each in graph.keyframes])[:, :2],
                       scans[:, :2], atol=1e-9)


def test_absolute_poses_are_saved_with_their_graph(driven: Any) -> None:
    graph = copy.deepcopy(driven[0].mapper.graph)
    graph.fixes = [AbsolutePose(1, np.array((1.0, 2.0, 0.5)), np.diag((4.0, 5.0, 6.0)))]
    arrays = arrays_of(graph)
    found = graph_of(arrays).fixes[0]
    assert found.keyframe == 1 and found.pose.tolist() == [1.0, 2.0, 0.5]
    assert found.information.tolist() == graph.fixes[0].information.tolist()
    assert graph_of({name: each for name, each in arrays.items()
                     if not name.startswith('fix_')}).fixes == []
    with pytest.raises(ValueError, match='an absolute pose refers to a missing keyframe'):
        graph_of({**arrays, 'fix_at': np.array((999,), np.int32)})


def _both_ways(graph: MapGraph) -> list[tuple[int, int]]:
    ends = [(each.first, each.second) for each in graph.edges]
    return ends + [(b, a) for a, b in ends]


def test_a_trajectory_remembers_the_last_poses_only() -> None:
    track = ScanTrajectory(3000)
    for number in range(4000):
        track.append(0, np.array((float(number), 0.0, 0.0)))
    assert track.forgotten + len(track) == 4000 and len(track) <= 3000
    assert track.poses([np.zeros(3)])[-1, 0] == 3999


def test_people_and_blindness_do_not_make_it_jump(driven: Any) -> None:
    robot = copy.deepcopy(driven[0])
    here = robot.at
    scan = seen(robot.walls, here, robot.stamp + 1, robot.wheels, 0.0)
    person = np.where(np.arange(BEAMS) % 60 < 25, 0.4, scan.ranges)
    located = robot.mapper.add(replace(scan, ranges=person))
    assert np.hypot(*(located.pose - here)[:2]) < 0.03
    for number in range(2, 14):
        blind = replace(scan, stamp_ns=scan.stamp_ns + number, ranges=np.full(BEAMS, np.inf))
        located = robot.mapper.add(blind)
        assert located.is_lost and np.hypot(*(located.pose - here)[:2]) < 0.03
    located = robot.mapper.add(replace(scan, stamp_ns=scan.stamp_ns + 20))
    assert not located.is_lost and np.hypot(*(located.pose - here)[:2]) < 0.03
