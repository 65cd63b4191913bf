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

"""Exploring: the map gets closed, what cannot be reached is left, it always ends and says why."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from dataclasses import field
import itertools
import math
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('scipy', reason='scipy is not installed')

from rt_robot_os.features.mapping.slam.exploration import CLOSED  # noqa: E402
from rt_robot_os.features.mapping.slam.exploration import ExplorationSettings  # noqa: E402
from rt_robot_os.features.mapping.slam.exploration import Explorer  # noqa: E402
from rt_robot_os.features.mapping.slam.frontiers import frontiers_of  # noqa: E402
from rt_robot_os.features.mapping.slam.growing_grid import GrowingGrid  # noqa: E402
from rt_robot_os.features.mapping.slam.keyframes import Keyframe  # noqa: E402
from rt_robot_os.features.mapping.slam.scan import Scan  # noqa: E402
from rt_robot_os.features.mapping.slam.scan import surface_of  # noqa: E402
from rt_robot_os.features.mapping.slam.tour import first_of_tour  # noqa: E402
from rt_robot_os.motion.grid_map import GridMap  # noqa: E402
from rt_robot_os.motion.grid_search import GridSearch  # noqa: E402
from rt_robot_os.motion.terrain import Terrain  # noqa: E402
from rt_robot_os.motion.walls import Walls  # noqa: E402

MAPS = Path(__file__).resolve().parents[3] / 'config' / 'maps'
BROAD = pytest.mark.skipif(not os.environ.get('RT_ROBOT_OS_BROAD'),
                           reason='long: set RT_ROBOT_OS_BROAD')
STEP_NS = 500_000_000
RADIUS_M = 0.35
ANGLES = -math.pi + np.arange(360) * math.tau / 360


@dataclass
class Robot:
    """A robot with a perfect planner and perfect wheels in a place that it does not know."""

    true: GridMap
    pose: Any
    settings: ExplorationSettings = ExplorationSettings()
    refuses: Callable[[Any], bool] = lambda goal: False
    now_ns: int = 0
    driven_m: float = 0.0
    state: str = ''
    goals: list[Any] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.pose = np.array(self.pose, float)
        self.walls = Walls.of(self.true)
        self.explorer = Explorer(self.settings)
        self.keyframes: list[Keyframe] = []
        self.growing = GrowingGrid(0.05)
        self.way: list[tuple[float, float]] = []
        self._see()

    def run(self, most_s: float = 2000.0) -> str:
        """Explore to the end; return what is said of it."""
        while not self.explorer.is_done:
            assert self.now_ns < most_s * 1e9, f'never ends: {self.explorer.state}'
            goal = self.explorer.step(self.now_ns, self.growing.grid(), self.pose, self.state)
            if goal is not None:
                self.goals.append(goal)
                self._plan(goal)
            self._drive(0.15)
            self.now_ns += STEP_NS
        return self.explorer.state

    def known(self) -> float:
        """Return how much of the free ground is on the map."""
        return float((self.growing.grid().values(*self.true.centres())[self.true.cells == 0]
                      == 0).mean())

    def _see(self) -> None:
        x, y, yaw = self.pose
        scan = Scan(self.now_ns, self.pose, self.walls.cast(x, y, yaw + ANGLES, 20.0), ANGLES[0],
                    ANGLES[1] - ANGLES[0])
        self.keyframes.append(Keyframe(self.now_ns, self.pose.copy(), self.pose,
                                       surface_of(scan, 20.0), 0.0))
        while not self.growing.update(self.keyframes):
            pass

    def _plan(self, goal: Any) -> None:
        terrain = Terrain(self.growing.grid(), RADIUS_M, 0.0, False)
        ends = [terrain.cell(*self.pose[:2]), terrain.cell(*goal[:2])]
        for number, cell in enumerate(ends):
            near = terrain.around(cell, 0.5)
            ends[number] = int(near[np.isfinite(terrain.cost[near])][0])
        *_, cells = GridSearch(terrain).way(*ends)
        self.way = [terrain.place(each) for each in cells]
        self.goal = goal
        self.state = f'planned: {len(cells)} cells'
        if self.refuses(goal) or not cells:
            self.way, self.state = [], f'refused: {goal[0]:.2f}, {goal[1]:.2f} is no place'

    def _drive(self, left_m: float) -> None:
        while self.way and left_m > 0.0:
            step = np.array(self.way[0]) - self.pose[:2]
            length = float(np.hypot(*step))
            part = 1.0 if length <= left_m else left_m / length
            self.pose[:2] += part * step
            self.driven_m += part * length
            left_m -= length
            if part == 1.0:
                del self.way[0]
                if not self.way:
                    self.state, self.pose[2] = 'done', self.goal[2]
                    self._see()
        if np.hypot(*(self.pose - self.keyframes[-1].pose)[:2]) > 0.3:
            self._see()


def rooms(*gaps: float, width: int = 60) -> GridMap:
    """Return rooms of 3 m by 3 m in a row, between each two a door so wide, in m."""
    cells = np.zeros((64, 4 + (width + 2) * (len(gaps) + 1)), np.int8)
    cells[:2], cells[-2:], cells[:, :2], cells[:, -2:] = 100, 100, 100, 100
    for number, gap in enumerate(gaps, 1):
        column = number * (width + 2)
        cells[:, column:column + 2] = 100
        half = round(gap / 0.05 / 2)
        cells[32 - half:32 + half, column:column + 2] = 0
    return GridMap(cells, 0.05)


def test_a_flat_is_explored_until_its_map_is_closed_and_the_robot_is_back() -> None:
    robot = Robot(GridMap.load(MAPS / 'flat.yaml'), (3.44, 1.0, 2.1))
    assert robot.run() == CLOSED
    assert robot.known() > 0.93  # the rest is behind what is too narrow
    assert robot.driven_m < 50.0
    assert np.hypot(*(robot.pose - (3.44, 1.0, 2.1))[:2]) < 0.3


@BROAD
def test_a_house_of_ten_rooms_is_explored() -> None:
    robot = Robot(GridMap.load(MAPS / 'house.yaml'), (2.5, 3.8, 0.0))
    assert robot.run() == CLOSED
    assert robot.known() > 0.95 and robot.driven_m < 180.0


@pytest.mark.parametrize('gap_m', [0.0, 0.1, 0.5])
def test_what_is_behind_a_shut_or_narrow_door_is_left(gap_m: float) -> None:
    robot = Robot(rooms(1.0, gap_m), (1.5, 1.0, 0.0))
    assert robot.run(300.0) == CLOSED
    wall_m = 2 * 62 * 0.05
    assert all(goal[0] < wall_m for goal in robot.goals)
    assert robot.growing.grid().value(4.5, 2.8) == 0  # but the room before it is known
    assert (robot.growing.grid().value(wall_m + 1.0, 1.6) == 0) == (gap_m > 0.0)


def test_a_refused_place_is_left_and_tried_once_more_at_the_end() -> None:
    robot = Robot(rooms(1.0, 1.0), (4.6, 1.0, 0.0), refuses=lambda goal: bool(goal[0] > 6.0))
    said = robot.run(300.0)
    assert said.startswith(f'{CLOSED}; given up: ') and 'is no place' in said
    refused = [tuple(goal) for goal in robot.goals if goal[0] > 6.0]
    # Each was given again, as the planner may have had an older map; all once, then all again.
    assert refused and refused[::2] == refused[1::2]
    assert refused == refused[:len(refused) // 2] * 2
    assert robot.known() > 0.6  # the rooms before it


def test_a_planner_that_had_an_older_map_gets_the_goal_again() -> None:
    explorer = Explorer()
    said = {0: '', 1: 'refused: it is unknown there', 5: 'planned: 1.00 m'}
    answers: Callable[[float], str] = (
        lambda now_s: said[max(at for at in said if at <= now_s)])
    goals = step_through(explorer, half_known(), answers, 20.0)
    assert [round(now_s) for now_s, _ in goals] == [0, 4]
    assert explorer.state.startswith('exploring: to ')


def step_through(explorer: Explorer, grid: GridMap, states: Callable[[float], str],
                 most_s: float) -> list[tuple[float, Any]]:
    """Let a robot stand where it is; return the goals with the seconds at which they came."""
    found = []
    for tick in range(round(most_s * 2)):
        goal = explorer.step(tick * STEP_NS, grid, (1.0, 1.5, 0.0), states(tick / 2))
        if goal is not None:
            found.append((tick / 2, goal))
    return found


def half_known() -> GridMap:
    """Return a room whose far half nobody has seen."""
    cells = np.array(rooms().cells)
    cells[:, 40:] = -1
    return GridMap(cells, 0.05)


def test_nobody_answers_the_goal_is_given_again_and_then_it_ends() -> None:
    explorer = Explorer(ExplorationSettings(patience_s=20.0))
    goals = step_through(explorer, half_known(), lambda now_s: '', 100.0)
    assert explorer.is_done and len(goals) >= 2
    assert goals[0][1].tolist() == goals[1][1].tolist()
    assert CLOSED in explorer.state or explorer.state.startswith('stopped: none of')
    assert 'the planner says: nothing' in explorer.state


def test_what_was_said_of_the_goal_before_is_not_taken_for_this_one() -> None:
    for before in ('refused: 9.00, 1.00 is in a wall', 'stopped: cancelled', 'done'):
        explorer = Explorer()
        answers: Callable[[float], str] = (
            lambda now_s: before if now_s < 3.0 else 'planned: 1.00 m')
        goals = step_through(explorer, half_known(), answers, 7.0)
        assert len(goals) == 1
        assert explorer.state.startswith('exploring: to ')


@pytest.mark.parametrize('said, ends', [
    ('stopped: a motor fault', 'stopped: a motor fault'),
    ('stopped: cancelled', 'stopped: cancelled'),
])
def test_a_robot_that_was_stopped_is_not_sent_on(said: str, ends: str) -> None:
    explorer = Explorer()
    step_through(explorer, half_known(), lambda now_s: 'planned' if now_s < 2.0 else said, 5.0)
    assert explorer.is_done and explorer.state == ends


def test_a_planner_that_is_done_elsewhere_ends_it() -> None:
    explorer = Explorer(ExplorationSettings(radius_m=0.2))
    cells = np.array(rooms(1.0).cells)
    cells[:, 100:] = -1
    step_through(explorer, GridMap(cells, 0.05), lambda now_s: 'done', 200.0)
    assert explorer.is_done and 'm before it' in explorer.state


def test_the_goal_stays_while_another_place_is_as_near() -> None:
    corridor = np.full((24, 400), -1, np.int8)
    corridor[:2], corridor[-2:], corridor[2:-2, 100:300] = 100, 100, 0
    explorer, x, goals = Explorer(), 10.0, []
    for tick in range(30):
        goal = explorer.step(tick * STEP_NS, GridMap(corridor, 0.05), (x, 0.6, 0.0), 'planned')
        if goal is not None:
            goals.append(goal)
        x += math.copysign(0.15, goals[0][0] - 10.0)
        end = round(x / 0.05) + (100 if goals[0][0] > 10.0 else -100)
        corridor[2:-2, min(end, 200):max(end, 200)] = 0  # it sees as it drives
    assert len({goal[0] > 10.0 for goal in goals}) == 1


def test_a_robot_where_it_cannot_get_out_says_so() -> None:
    cells = np.array(rooms(0.3).cells)
    cells[:, 100:] = -1
    grid, explorer = GridMap(cells, 0.05), Explorer()
    explorer.step(0, grid, (4.0, 1.5, 0.0), '')  # it began in the other room
    step_through(explorer, grid, lambda now_s: 'done', 20.0)
    assert explorer.is_done and explorer.state.startswith('stopped: no way out at 1.00, 1.50')


@pytest.mark.parametrize('pose', [(30.0, 1.0, 0.0), (1.0, 0.02, 0.0), (-5.0, -5.0, 0.0)])
def test_a_robot_that_is_nowhere_on_the_map_is_told_and_given_up(
        pose: tuple[float, float, float]) -> None:
    explorer = Explorer()
    solid = GridMap(np.where(np.arange(64)[:, None] < 30, 100, rooms().cells), 0.05)
    for now_s in range(60):
        assert explorer.step(now_s * 1_000_000_000, solid, pose, '') is None
    assert explorer.is_done and 'has no free ground round it' in explorer.state
    assert Explorer().step(0, solid, (math.nan, 0.0, 0.0), '') is None


def test_frontiers_are_at_the_edge_of_what_is_known_with_room_for_the_robot() -> None:
    found = frontiers_of(half_known(), (1.0, 1.5), RADIUS_M, 0.4)
    assert [round(each.x, 1) for each in found.frontiers] == [2.0]
    frontier = found.frontiers[0]
    assert frontier.size_m == pytest.approx(3.0, abs=0.1)
    assert 0.25 < frontier.x - frontier.stand[0] < 0.7  # it sees what is there from before
    assert frontier.way_m == pytest.approx(0.6, abs=0.3)
    assert not frontiers_of(rooms(), (1.0, 1.5), RADIUS_M, 0.4).frontiers


def test_places_are_taken_in_the_order_of_the_shortest_way_home() -> None:
    # On a line: here is 0, home is 9; what is behind comes first though it is further.
    places = np.array([-2.0, 1.0, 3.0, 8.0])
    between = np.abs(places[:, None] - places)
    assert first_of_tour(np.abs(places), between, np.abs(9.0 - places)) == 0
    assert first_of_tour(np.abs(places), between, np.abs(-9.0 - places)) == 1
    rng = np.random.default_rng(2)
    points = rng.uniform(0.0, 10.0, (5, 2))
    apart = np.hypot(*(points[:, None] - points).transpose(2, 0, 1))
    ways = np.hypot(*points.T)
    best = min(itertools.permutations(range(5)), key=lambda order: ways[order[0]] + sum(
        apart[a, b] for a, b in zip(order, order[1:])))
    assert first_of_tour(ways, apart, np.zeros(5)) == best[0]


def test_a_map_that_lies_turned_has_its_frontiers_where_they_are() -> None:
    straight = half_known()
    turned = GridMap(straight.cells, straight.resolution_m, (5.0, -2.0, 0.7))
    there = frontiers_of(straight, (1.0, 1.5), RADIUS_M, 0.4).frontiers
    found = frontiers_of(turned, turned.point(1.0, 1.5), RADIUS_M, 0.4).frontiers
    assert len(found) == len(there) == 1
    assert (found[0].x, found[0].y) == pytest.approx(turned.point(there[0].x, there[0].y))
    assert found[0].stand == pytest.approx(turned.point(*there[0].stand), abs=0.06)
    assert found[0].way_m == pytest.approx(there[0].way_m, abs=0.2)


def test_where_home_was_just_left_is_not_taken_for_a_way_out() -> None:
    cells = np.array(half_known().cells)
    cells[18:20, 2:22] = cells[44:46, 2:22] = cells[18:46, 22:24] = 100  # a nook of 1 m
    explorer = Explorer()
    explorer.step(0, GridMap(cells, 0.05), (1.3, 1.6, 0.0), '')  # it began before it
    for now_s in range(1, 12):
        explorer.step(now_s * 1_000_000_000, GridMap(cells, 0.05), (0.6, 1.6, 0.0), 'done')
    assert explorer.state.startswith('stopped: no way out at 0.60, 1.60')
