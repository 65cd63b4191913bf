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

"""Loops: how far the robot may be wrong, what has to be said twice, a turn that nobody counted."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

pytest.importorskip('scipy', reason='scipy is not installed')

from rt_robot_os.features.mapping.slam import loop_closing  # noqa: E402
from rt_robot_os.features.mapping.slam.graph import MapGraph  # noqa: E402
from rt_robot_os.features.mapping.slam.keyframes import Keyframe  # noqa: E402
from rt_robot_os.features.mapping.slam.local_map_query import LocalMapQuery  # noqa: E402
from rt_robot_os.features.mapping.slam.loop_closing import LoopClosing  # noqa: E402
from rt_robot_os.features.mapping.slam.loops import LoopCandidate  # noqa: E402
from rt_robot_os.features.mapping.slam.loops import LoopVerdict  # noqa: E402
from rt_robot_os.features.mapping.slam.mapper import Mapper  # noqa: E402
from rt_robot_os.features.mapping.slam.pose_graph import PoseEdge  # noqa: E402
from rt_robot_os.features.mapping.slam.scan import Scan  # noqa: E402
from rt_robot_os.features.mapping.slam.scan import surface_of  # noqa: E402
from rt_robot_os.features.mapping.slam.transforms import between  # noqa: E402
from rt_robot_os.features.mapping.slam.transforms import composed  # noqa: E402
from rt_robot_os.features.mapping.slam.tuning import MapperTuning  # noqa: E402
from rt_robot_os.motion.grid_map import GridMap  # noqa: E402
from rt_robot_os.motion.walls import Walls  # noqa: E402

NOTHING = surface_of(Scan(0, np.zeros(3), np.full(9, np.inf), 0.0, 0.1), 10.0)


def along(count: int, turn_sigma: float = 0.02) -> MapGraph:
    """Return keyframes a metre apart along a straight way, joined to the next."""
    frames = [Keyframe(index, np.array((float(index), 0.0, 0.0)), np.zeros(3), NOTHING,
                       float(index)) for index in range(count)]
    information = np.diag((0.02 ** -2, 0.02 ** -2, turn_sigma ** -2))
    return MapGraph(frames, [PoseEdge(index, index + 1, np.array((1.0, 0.0, 0.0)), information)
                             for index in range(count - 1)])


def verdict(keyframes: Any, place: LoopCandidate, there: Any, places: int = 3) -> LoopVerdict:
    """Return that a keyframe is somewhere else, if as many places say the same."""
    edge = PoseEdge(place.nearest, place.keyframe, between(keyframes[place.nearest].pose, there),
                    np.eye(3) * 100.0, True)
    return LoopVerdict(place.keyframe, place.nearest, 0.9, 0.9, 0.9, '', edge, places)


def test_a_heading_that_was_wrong_far_away_makes_a_place_doubtful_by_the_way_from_there() -> None:
    ways, turns = LocalMapQuery(along(61)).spread(60)
    # Of 60 headings, each 0.02 rad: at arms of 1 to 60 m, and none below 5 m.
    expected = math.sqrt(sum((0.02 * max(arm, 5)) ** 2 for arm in range(1, 61)))
    assert ways[0] == pytest.approx(expected, rel=0.05)
    assert turns[0] == pytest.approx(0.02 * math.sqrt(60), rel=0.01)
    assert ways[59] < 0.15


@pytest.mark.parametrize(('second', 'closed'), [
    ((3.1, 0.0, 0.0), 3),  # by the same way
    ((-3.0, 0.0, 0.0), 0),  # another room that looks alike
    (None, 0)])
def test_a_loop_that_moves_the_robot_far_is_closed_when_three_places_say_the_same(
        monkeypatch: pytest.MonkeyPatch, second: Any, closed: int) -> None:
    graph, counts = along(40), dict.fromkeys(('loops', 'refused', 'near_misses', 'skipped'), 0)
    doing = LoopClosing(graph, MapperTuning(), counts)

    def found(keyframes: Any, place: LoopCandidate, tuning: MapperTuning) -> Any:
        yield
        off = (3.0, 0.0, 0.0) if place.keyframe < 39 else second
        if off is None:
            return None
        there = keyframes[place.keyframe].pose + off
        return verdict(keyframes, place, there)

    monkeypatch.setattr(loop_closing, 'verified', found)
    for keyframe in (37, 38, 38, 39):
        assert not counts['loops']
        doing.add_candidate(LoopCandidate(keyframe, 0, (0,), 3.0, 0.1))
        while doing.is_busy:
            doing.process_pending()
    closed += bool(closed)  # of one place there are two
    assert counts['loops'] == closed == sum(each.is_loop for each in graph.edges)
    # What nothing else confirms is not lost in silence.
    waiting = 4 - closed - (second is None)
    assert counts['near_misses'] == waiting
    assert not waiting or 'no other keyframe' in doing.near_misses[-1].reason


def test_a_doubted_loop_follows_keyframes_that_are_taken_out(
        monkeypatch: pytest.MonkeyPatch) -> None:
    graph, counts = along(40), dict.fromkeys(('loops', 'refused', 'near_misses', 'skipped'), 0)
    doing = LoopClosing(graph, MapperTuning(), counts)

    def found(keyframes: Any, place: LoopCandidate, tuning: MapperTuning) -> Any:
        yield
        there = keyframes[place.keyframe].pose + (3.0, 0.0, 0.0)
        return verdict(keyframes, place, there)

    monkeypatch.setattr(loop_closing, 'verified', found)
    for keyframe in (37, 38):
        doing.add_candidate(LoopCandidate(keyframe, 2, (2,), 3.0, 0.1))
        doing.process_pending(whole=True)
    doing.add_candidate(LoopCandidate(39, 2, (2,), 3.0, 0.1))
    doing.process_pending()  # the first piece of it; then a keyframe goes
    del graph.keyframes[0]
    graph.edges = [PoseEdge(each.first - 1, each.second - 1, each.relative, each.information)
                   for each in graph.edges[1:]]
    doing.remove_keyframe(0)
    assert doing.is_busy
    doing.process_pending(whole=True)
    assert [(each.first, each.second) for each in graph.edges if each.is_loop] == [
        (1, 38), (1, 36), (1, 37)]


def test_a_turn_that_the_wheels_did_not_count_is_found() -> None:
    cells = np.zeros((120, 160), np.int8)
    cells[:2], cells[-2:], cells[:, :2], cells[:, -2:] = 100, 100, 100, 100
    cells[20:40, 30:60] = cells[80:100, 100:110] = cells[60:64, 2:50] = 100
    walls, rng = Walls.of(GridMap(cells, 0.05)), np.random.default_rng(3)
    beams, step = 181, math.pi / 180
    poses = [(4.0 + 0.3 * index, 2.6, 0.4 * index) for index in range(10)]
    yaw = 3.6 - 1.4  # 5.4 m to the wall
    poses += [(6.7 + way * math.cos(yaw), 2.6 + way * math.sin(yaw), yaw)
              for way in (0.0, 0.5, 1.0, 1.5)]
    mapper, wheels, off = Mapper(start=np.array(poses[0])), np.zeros(3), []
    for number, pose in enumerate(np.array(poses)):
        if number and number != 10:  # the wheels turn 1.4 rad, and nobody counts
            wheels = composed(wheels, between(np.array(poses[number - 1]), pose))
        ranges = walls.cast(pose[0], pose[1], pose[2] - math.pi / 2 + step * np.arange(beams),
                            20.0)
        off.append(between(pose, mapper.add(Scan(
            number, wheels, ranges + rng.normal(0, 0.01, beams), -math.pi / 2, step)).pose))
    assert abs(off[9][2]) < 0.02 and np.hypot(*off[9][:2]) < 0.05
    assert abs(off[-1][2]) < 0.02 and np.hypot(*off[-1][:2]) < 0.1
    # The scan after the turn saw nothing that was known; those behind it say where it was.
    assert abs(off[10][2]) > 1.0 and mapper.counts['lost'] == 1
    mapper.optimise_all()
    late = between(np.array(poses[10]), mapper.trajectory()[10])
    assert abs(late[2]) < 0.02 and np.hypot(*late[:2]) < 0.05
    assert mapper.counts['lost'] == 0
