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

"""Ways over grids: cheapest ones, in small pieces, that never cross what is occupied."""

from __future__ import annotations

from collections.abc import Generator
from collections.abc import Iterator
import heapq
import math
from typing import Any
from typing import TypeVar

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import numpy as np
import pytest

from rt_robot_os.motion.distances import distances_within
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.grid_search import GridSearch
from rt_robot_os.motion.route import Route
from rt_robot_os.motion.route import RouteError
from rt_robot_os.motion.route import RoutePlanner
from rt_robot_os.motion.terrain import Terrain

RESOLUTION = 0.1
T = TypeVar('T')


def grid(*rows: str, origin: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> GridMap:
    """Make a map of a drawing: ``#`` occupied, ``?`` unknown; the first row is the highest."""
    values = {'#': 100, '?': -1, '.': 0}
    return GridMap(np.array([[values[c] for c in row] for row in reversed(rows)]), RESOLUTION,
                   origin)


def at_once(work: Iterator[Any]) -> Any:
    """Do all pieces; give the last."""
    last = None
    for last in work:
        pass
    return last


def planned(job: Generator[None, None, T]) -> tuple[T, int]:
    """Do all pieces; give the way, and how many pieces there were."""
    pieces = 0
    while True:
        try:
            next(job)
            pieces += 1
        except StopIteration as ended:
            return ended.value, pieces


def plan(chart: GridMap, start: tuple[float, float], goal: tuple[float, float],
         radius_m: float = 0.0, obstacles: tuple[tuple[float, float], ...] = (),
         **changes: Any) -> Route:
    terrain = Terrain(chart, radius_m, max(radius_m, changes.get('goal_room_m', 0.0) + RESOLUTION),
                      changes.pop('unknown', False))
    planner = RoutePlanner(terrain, **{'goal_tolerance_m': 0.5, 'start_tolerance_m': 0.5,
                                       'most': 500, **changes})
    cells = {terrain.cell(*place) for place in obstacles}
    return planned(planner.plan((*start, 0.0), (*goal, 1.0), cells))[0]


def reference_cost(terrain: Terrain, start: int, goal: int) -> float:
    """Find the cost of the cheapest way cell by cell, as textbooks do."""
    width, cost = terrain.width, terrain.cost
    steps = [(dy * width + dx, math.hypot(dx, dy)) for dy in (-1, 0, 1) for dx in (-1, 0, 1)
             if dx or dy]
    best, heap = {goal: 0.0}, [(0.0, goal)]
    while heap:
        spent, cell = heapq.heappop(heap)
        if cell == start:
            return spent
        if spent > best[cell]:
            continue
        for offset, length in steps:
            then = spent + length * 0.5 * float(cost[cell] + cost[cell + offset])
            if then < best.get(cell + offset, math.inf):
                best[cell + offset] = then
                heapq.heappush(heap, (then, cell + offset))
    return math.inf


def cost_of(terrain: Terrain, way: list[int]) -> float:
    total = 0.0
    for a, b in zip(way, way[1:]):
        length = 1.0 if abs(a - b) in (1, terrain.width) else math.sqrt(2.0)
        total += length * 0.5 * float(terrain.cost[a] + terrain.cost[b])
    return total


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.35), st.sampled_from([0.0, 0.15]))
def test_the_way_is_as_cheap_as_any(seed: int, share: float, radius_m: float) -> None:
    chance = np.random.default_rng(seed)
    cells = (chance.random((24, 31)) < share).astype(np.int8) * 100
    terrain = Terrain(GridMap(cells, RESOLUTION), radius_m, 0.4, False)
    free = np.flatnonzero(np.isfinite(terrain.cost))
    if free.size < 2:
        return
    start, goal = chance.choice(free, 2).tolist()
    search = GridSearch(terrain)
    for a, b in ((start, goal), (goal, start)):  # what the first search left does not matter
        way = at_once(search.way(a, b))
        expected = reference_cost(terrain, a, b)
        if math.isinf(expected):
            assert way == []
        else:
            assert (way[0], way[-1]) == (a, b)
            assert cost_of(terrain, way) == pytest.approx(expected, rel=1e-4)


@settings(max_examples=80, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.2), st.sampled_from([0.0, 0.12, 0.25]),
       st.booleans())
def test_no_way_comes_nearer_to_anything_than_the_robot_is_wide(
        seed: int, share: float, radius_m: float, turned: bool) -> None:
    chance = np.random.default_rng(seed)
    cells = (chance.random((30, 40)) < share).astype(np.int8) * 100
    cells[chance.random((30, 40)) < share / 3] = -1
    chart = GridMap(cells, RESOLUTION, (1.0, -2.0, 0.5 if turned else 0.0))
    start, goal = (chart.point(*(chance.random(2) * (4.0, 3.0))) for _ in range(2))
    try:
        route = plan(chart, start, goal, radius_m)
    except RouteError:
        return
    assert math.dist(route.poses[-1][:2], goal) <= 0.5 + 1e-9
    assert route.poses[0][:2] == pytest.approx(start)
    assert route.poses[-1][2] == 1.0
    points = np.array([pose[:2] for pose in route.poses])
    along = np.linspace(0.0, 1.0, 20)[:, None]
    dense = np.concatenate([a + along * (b - a) for a, b in zip(points, points[1:])] or [points])
    if chart.value(*start) != 0:
        dense = dense[20:]  # it is thought to be within something, and drives out of it
    assert not np.any(chart.values(*dense.T) == 100)
    xs, ys = chart.centres()
    walls = np.stack((xs[cells == 100], ys[cells == 100]), axis=1)
    if len(walls):
        gaps = np.array([np.hypot(*(walls - place).T).min() for place in dense])
        if len(gaps) and gaps[:20].min() > radius_m + 1.5 * RESOLUTION:
            assert gaps.min() > radius_m


def test_it_goes_round_a_wall_and_keeps_away_from_it_where_there_is_room() -> None:
    chart = grid(*['.' * 60] * 20, *['.' * 28 + '##' + '.' * 30] * 20)
    terrain = Terrain(chart, 0.2, 0.8, False)
    route = planned(RoutePlanner(terrain, 0.5, 0.5, 500).plan(
        (1.0, 1.0, 0.0), (5.0, 1.0, 0.0), ()))[0]
    over = [y for x, y, _ in route.poses if 2.7 < x < 3.1]
    assert min(over) > 2.4
    assert 5.0 < route.length_m < 6.5
    # Smooth: no corner of more than some degrees, far less than that of cells.
    yaws = [yaw for _, _, yaw in route.poses[:-1]]
    assert max(abs(b - a) for a, b in zip(yaws, yaws[1:])) < 0.35


def test_open_ground_is_crossed_straight() -> None:
    route = plan(grid(*['.' * 50] * 50), (0.5, 0.5), (4.5, 3.0))
    assert route.length_m == pytest.approx(math.dist((0.5, 0.5), (4.5, 3.0)), rel=1e-3)
    assert route.moved_m == 0.0


def test_obstacles_that_are_not_on_the_map_are_gone_round_and_forgotten() -> None:
    terrain = Terrain(grid(*['.' * 60] * 30), 0.2, 0.2, False)
    planner = RoutePlanner(terrain, 0.5, 0.5, 500)
    there = {terrain.cell(3.0, y) for y in (1.2, 1.3, 1.4, 1.5, 1.6)}
    round_it = planned(planner.plan((1.0, 1.4, 0.0), (5.0, 1.4, 0.0), there))[0]
    straight = planned(planner.plan((1.0, 1.4, 0.0), (5.0, 1.4, 0.0), ()))[0]
    assert round_it.length_m > 4.1
    assert straight.length_m == pytest.approx(4.0)
    wall = {terrain.cell(3.0, 0.05 + n / 10) for n in range(30)}
    with pytest.raises(RouteError, match='beside what stands there now'):
        planned(planner.plan((1.0, 1.4, 0.0), (5.0, 1.4, 0.0), wall))


@pytest.mark.parametrize(('goal', 'moved'), [
    ((2.5, 0.55), 0.0), ((2.5, 2.02), 0.4), ((5.2, 1.0), 0.3), ((2.5, 1.75), 0.11)])
def test_a_goal_where_the_robot_cannot_stand_is_moved_a_little(
        goal: tuple[float, float], moved: float) -> None:
    chart = grid(*['#' * 50] * 2, *['.' * 50] * 18)
    route = plan(chart, (0.5, 0.5), goal, 0.1)
    assert route.moved_m == pytest.approx(moved, abs=0.09)
    assert math.dist(route.poses[-1][:2], goal) == pytest.approx(route.moved_m)


@pytest.mark.parametrize(('goal', 'moved'), [
    ((2.5, 1.55), 0.2), ((2.5, 1.0), 0.0), ((0.25, 1.0), 0.0)], ids=['wall', 'free', 'niche'])
def test_at_a_goal_there_is_more_room_where_the_map_has_it(
        goal: tuple[float, float], moved: float) -> None:
    # A niche at the left, in which there is no more room anywhere near.
    chart = grid(*['#' * 50] * 2, *['.' * 50] * 5, '#' * 10 + '.' * 40, *['.' * 50] * 4,
                 '#' * 10 + '.' * 40, *['.' * 50] * 7)
    route = plan(chart, (2.5, 0.5), goal, 0.1, goal_room_m=0.4, goal_tolerance_m=0.3)
    assert route.moved_m == pytest.approx(moved, abs=0.05)
    if not moved:
        assert route.poses[-1][:2] == goal


@pytest.mark.parametrize(('goal', 'text'), [
    ((2.5, 2.9), 'the goal 2.50, 2.90 is in something, .* within 0.5 m'),
    ((9.0, 1.0), 'the goal 9.00, 1.00 is off the map, which goes from 0, 0 to 5, 3'),
    ((math.nan, 1.0), 'off the map'), ((1e300, 1.0), 'off the map'),
    ((4.9, 0.5), 'no way to the goal is wide enough')])
def test_a_goal_that_cannot_be_reached_is_refused_with_the_reason(
        goal: tuple[float, float], text: str) -> None:
    chart = grid(*['#' * 50] * 12, *['.' * 40 + '#' + '.' * 9] * 18)
    with pytest.raises(RouteError, match=text):
        plan(chart, (0.5, 0.5), goal, 0.1)


def test_a_goal_near_a_wall_is_not_moved_to_its_other_side() -> None:
    chart = grid(*['.' * 50] * 10, *['#' * 50], *['.' * 50] * 3, *['#' * 50], *['.' * 50] * 9)
    with pytest.raises(RouteError, match='too near to something'):
        plan(chart, (0.5, 0.2), (2.5, 1.15), 0.2)


def test_unknown_ground_is_forbidden_unless_it_is_allowed() -> None:
    chart = grid(*['.' * 10 + '?' * 5 + '.' * 10] * 10)
    with pytest.raises(RouteError, match='no way'):
        plan(chart, (0.5, 0.5), (2.0, 0.5))
    assert plan(chart, (0.5, 0.5), (2.0, 0.5), unknown=True).length_m == pytest.approx(1.5)


def test_what_the_robot_stands_on_is_free_though_nobody_has_seen_it() -> None:
    chart = grid('#########', '#.......#', '#.??....#', '#.??....#', '#.......#', '#########')
    start, goal = (0.35, 0.35), (0.65, 0.15)
    with pytest.raises(RouteError, match='no free ground within 0.05 m'):
        plan(chart, start, goal, start_tolerance_m=0.05)
    route = plan(chart, start, goal, start_tolerance_m=0.05, own_m=0.15)
    assert route.poses[0][:2] == start
    with pytest.raises(RouteError, match='too near to something'):  # what is known stays
        plan(chart, start, goal, 0.25, start_tolerance_m=0.05, own_m=0.15)


def test_a_goal_in_unknown_ground_is_moved_to_known_ground_but_not_through_a_wall() -> None:
    chart = grid('#########', '#...#???#', '#...#?..#', '#...#?..#', '#...#...#', '#########')
    assert plan(chart, (0.75, 0.15), (0.55, 0.45), goal_tolerance_m=0.3).moved_m > 0.1
    chart = grid('##########', *['#....#???#'] * 4, '##########')
    with pytest.raises(RouteError, match='in ground that nobody has seen yet, and the robot can'):
        plan(chart, (0.25, 0.25), (0.65, 0.25), goal_tolerance_m=0.35)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(-30, 30), st.integers(-30, 30),
       st.integers(60, 180), st.integers(60, 180), st.booleans())
def test_a_terrain_made_of_the_one_before_is_as_one_made_anew(
        seed: int, row: int, column: int, rows: int, columns: int, unknown: bool) -> None:
    chance = np.random.default_rng(seed)
    world = (chance.random((300, 300)) < 0.004).astype(np.int8) * 100
    world[chance.random((300, 300)) < 0.01] = -1
    world[100:130, 60:220] = -1
    before = GridMap(world[60:210, 60:230], RESOLUTION, (1.0, -2.0, 0.3))
    for _ in range(int(chance.integers(0, 4))):
        y, x = chance.integers(50, 250, 2)
        world[y:y + 5, x:x + 5] = chance.choice((-1, 0, 100))
    x, y = before.point(column * RESOLUTION, row * RESOLUTION)
    after = GridMap(world[60 + row:60 + row + rows, 60 + column:60 + column + columns],
                    RESOLUTION, (x, y, 0.3))
    first = Terrain(before, 0.22, 0.5, unknown)
    made, pieces = planned(Terrain.in_pieces(after, 0.22, 0.5, unknown, first))
    anew = Terrain(after, 0.22, 0.5, unknown)
    assert pieces > 3
    assert made.width == anew.width
    for name in ('static', 'cost', 'solid', '_wall_m'):
        assert np.array_equal(getattr(made, name), getattr(anew, name)), name
    again, _ = planned(Terrain.in_pieces(GridMap(after.cells, RESOLUTION, after.origin), 0.22, 0.5,
                                         unknown, made))
    assert again is made


def test_a_robot_too_near_to_a_wall_leaves_it_and_one_that_is_stuck_says_so() -> None:
    chart = grid(*['.' * 40] * 20, *['#' * 40])
    route = plan(chart, (1.0, 0.15), (3.0, 1.5), 0.3)
    assert route.poses[0][:2] == (1.0, 0.15)
    with pytest.raises(RouteError, match='no free ground within 0.2 m'):
        plan(chart, (1.0, 0.15), (3.0, 1.5), 0.5, start_tolerance_m=0.2)
    with pytest.raises(RouteError, match='the robot is off the map'):
        plan(chart, (-1.0, 0.15), (3.0, 1.5))


def test_where_it_is_already_the_way_is_short() -> None:
    route = plan(grid(*['.' * 20] * 20), (1.0, 1.0), (1.0, 1.0))
    assert route.length_m < 0.01
    assert route.poses[-1] == (1.0, 1.0, 1.0)


def test_work_is_done_in_pieces_and_a_way_has_no_more_poses_than_asked_for() -> None:
    chance = np.random.default_rng(5)
    cells = (chance.random((200, 200)) < 0.01).astype(np.int8) * 100
    cells[5:15, 5:15] = cells[-15:-5, -15:-5] = 0
    terrain = Terrain(GridMap(cells, 0.05), 0.1, 0.3, False)
    route, pieces = planned(RoutePlanner(terrain, 0.5, 0.5, 60).plan(
        (0.5, 0.5, 0.0), (9.5, 9.5, 0.0), ()))
    assert pieces > 100
    assert len(route.poses) <= 60


@pytest.mark.parametrize(('shape', 'most'), [((30, 40), 6.0), ((300, 40), 190.0)])
def test_distances_are_those_between_the_middles_of_cells(
        shape: tuple[int, int], most: float) -> None:
    chance = np.random.default_rng(2)
    occupied = chance.random(shape) < 0.6 / shape[0]
    occupied[200:, :] = False
    there = np.argwhere(occupied)
    every = np.argwhere(np.ones_like(occupied))
    expected = np.hypot(*(every[:, None] - there).transpose(2, 0, 1)).min(axis=1)
    found, _ = planned(distances_within(np.pad(occupied, int(most)), most))
    found = found.ravel()
    assert found == pytest.approx(np.minimum(expected, most), abs=2e-5)
