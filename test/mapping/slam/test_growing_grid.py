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

"""The grid of a map that grows and moves: always whole, the same as drawn at once, bounded."""

from __future__ import annotations

from dataclasses import replace
import math
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('scipy', reason='scipy is not installed')

from rt_robot_os.features.mapping.slam.growing_grid import GrowingGrid  # noqa: E402
from rt_robot_os.features.mapping.slam.keyframes import Keyframe  # noqa: E402
from rt_robot_os.features.mapping.slam.occupancy import grid_of  # noqa: E402
from rt_robot_os.features.mapping.slam.scan import Scan  # noqa: E402
from rt_robot_os.features.mapping.slam.scan import Surface  # noqa: E402
from rt_robot_os.features.mapping.slam.scan import surface_of  # noqa: E402
from rt_robot_os.motion.grid_map import FREE  # noqa: E402
from rt_robot_os.motion.grid_map import GridMap  # noqa: E402
from rt_robot_os.motion.grid_map import OCCUPIED  # noqa: E402
from rt_robot_os.motion.grid_map import UNKNOWN  # noqa: E402
from rt_robot_os.motion.walls import disc_distances  # noqa: E402
from rt_robot_os.motion.walls import Walls  # noqa: E402

ROOT = Path(__file__).resolve().parents[3]
FLAT = GridMap.load(ROOT / 'config' / 'maps' / 'flat.yaml')
WALLS = Walls.of(FLAT)
BEAMS = 180
ANGLES = -math.pi + np.arange(BEAMS) * math.tau / BEAMS
TWO = float(ANGLES[150])


def keyframe(x: float, y: float, yaw: float = 0.0, ranges: object = None) -> Keyframe:
    """Return what a laser sees in the flat, or what it is told to see."""
    pose = np.array((x, y, yaw))
    seen = WALLS.cast(x, y, yaw + ANGLES, 20.0) if ranges is None else np.asarray(ranges, float)
    scan = Scan(0, pose, seen, ANGLES[0], ANGLES[1] - ANGLES[0])
    return Keyframe(0, pose, pose, surface_of(scan, 20.0), 0.0)


def drawn(growing: GrowingGrid, keyframes: list[Keyframe]) -> GridMap:
    while not growing.update(keyframes):
        pass
    return growing.grid()


def same(one: GridMap, other: GridMap) -> bool:
    return one.origin == other.origin and np.array_equal(one.cells, other.cells)


def test_what_was_added_moved_and_removed_leaves_the_map_that_is_drawn_at_once() -> None:
    rng = np.random.default_rng(3)
    keyframes = [keyframe(*place, yaw) for place, yaw in zip(
        ((3.44, 1.0), (3.3, 3.0), (2.45, 3.9), (5.0, 3.6), (6.5, 3.4), (7.5, 3.2)), range(6))]
    growing = GrowingGrid(0.05)
    for _ in range(4):
        for each in keyframes:
            each.pose = each.pose + rng.normal(0.0, (1.0, 1.0, 0.3))
        drawn(growing, keyframes)
        del keyframes[int(rng.integers(len(keyframes)))]
    assert same(drawn(growing, keyframes), grid_of(keyframes))
    assert growing.counts['keyframes'] == 2
    assert growing.counts['drawn'] - growing.counts['taken_away'] == 2


def test_readers_see_the_last_whole_map_while_all_is_redrawn_in_pieces() -> None:
    keyframes = [keyframe(3.44 - 0.05 * number, 1.0 + 0.2 * number) for number in range(10)]
    growing = GrowingGrid(0.05)
    assert growing.version == 0 and growing.grid().cells.tolist() == [[UNKNOWN]]
    before = drawn(growing, keyframes)
    version = growing.version
    for each in keyframes:
        each.pose = each.pose + (0.3, 0.2, 0.05)
    calls = 1
    while not growing.update(keyframes, most=50_000):
        calls += 1
        assert growing.grid() is before and growing.version == version
        # The graph goes on moving: readers still get a whole map in the end.
        keyframes[calls % 10].pose = keyframes[calls % 10].pose + (0.0, 0.0, 0.0)
    assert calls > 5 and growing.version > version
    assert same(growing.grid(), grid_of(keyframes))


def test_pieces_of_work_are_bounded_and_a_redraw_of_a_thousand_is_over_some_time() -> None:
    surface = keyframe(3.44, 1.0).surface
    keyframes = [Keyframe(0, np.array((0.01 * number, 0.0, 0.0)), np.zeros(3),
                          surface_copy(surface), 0.0) for number in range(100)]
    growing = GrowingGrid(0.05)
    drawn(growing, keyframes)
    for each in keyframes:
        each.pose = each.pose + (1.0, 0.0, 0.1)
    calls, most = 1, 0
    before = growing.counts['drawn']
    while not growing.update(keyframes):
        calls += 1
        most = max(most, growing.counts['drawn'] - before)
        before = growing.counts['drawn']
    assert 4 < calls < 40 and most < 25  # 100 in all, each some 0.4 ms


def surface_copy(surface: Surface) -> Surface:
    """Return another of the same: keyframes are told apart by their surfaces."""
    return replace(surface)


def test_a_small_movement_draws_nothing_anew_and_small_ones_add_up() -> None:
    keyframes = [keyframe(3.44, 1.0)]
    growing = GrowingGrid(0.05)
    drawn(growing, keyframes)
    for number in range(1, 5):
        keyframes[0].pose = keyframes[0].pose + (0.008, 0.0, 0.0)
        assert growing.update(keyframes)
        assert growing.counts['drawn'] == (1 if number < 4 else 2)


def test_what_is_drawn_grows_to_all_sides_with_its_edges_in_large_steps() -> None:
    one = [keyframe(3.44, 1.0)]
    growing = GrowingGrid(0.05)
    for x, y in ((0.0, 0.0), (-50.0, 0.0), (0.0, 40.0), (30.0, -30.0)):
        one.append(Keyframe(0, np.array((x, y, 0.0)), np.zeros(3), surface_copy(one[0].surface),
                            0.0))
        grid = drawn(growing, one)
        assert grid.value(x + 0.5, y) == FREE
        assert grid.rows % 20 == grid.columns % 20 == 0
    assert grid.size_m[0] > 80.0 and growing.counts['tiles'] < 40
    assert same(grid, grid_of(one))
    assert drawn(growing, one[:1]).size_m[0] < 15.0
    assert growing.counts['tiles'] < 6


def test_a_map_that_is_too_large_gets_larger_cells_and_smaller_ones_again() -> None:
    keyframes = [keyframe(3.44, 1.0), keyframe(3.3, 3.0)]
    growing = GrowingGrid(0.05, cells_most=150_000)
    assert drawn(growing, keyframes).resolution_m == 0.05
    keyframes[1].pose = keyframes[1].pose + (15.0, 12.0, 0.0)  # lost
    before = growing.grid()
    assert not growing.update(keyframes, most=1)
    assert growing.grid() is before
    large = drawn(growing, keyframes)
    assert large.resolution_m == growing.cell_m == 0.1
    assert large.cells.size <= 150_000 and growing.counts['resized'] == 1
    keyframes[1].pose = keyframes[1].pose - (15.0, 12.0, 0.0)  # found
    assert drawn(growing, keyframes).resolution_m == 0.05
    assert same(growing.grid(), grid_of(keyframes))


@pytest.mark.parametrize('pose', [(math.nan, 0.0, 0.0), (0.0, math.inf, 0.0), (1e9, 0.0, 0.0)])
def test_a_keyframe_without_a_place_is_left_out_and_counted(
        pose: tuple[float, float, float]) -> None:
    keyframes = [keyframe(3.44, 1.0), keyframe(3.3, 3.0)]
    growing = GrowingGrid(0.05)
    drawn(growing, keyframes)
    keyframes[1].pose = np.array(pose)
    drawn(growing, keyframes)
    assert growing.counts['refused'] == 1
    drawn(growing, [])
    assert (growing.grid().cells == UNKNOWN).all() and growing.counts['footprint_bytes'] == 0


@pytest.mark.parametrize('wrong', [{'cell_m': 0.0}, {'cell_m': math.nan}, {'cells_most': 0},
                                   {'reach_m': 0.01}, {'echoless_m': -1.0}])
def test_lengths_that_make_no_map_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match='cells of'):
        GrowingGrid(**wrong)  # type: ignore[arg-type]


def test_beams_without_an_echo_clear_a_little_and_never_what_others_see() -> None:
    nothing = np.full(BEAMS, math.inf)
    growing = GrowingGrid(0.05, echoless_m=3.0)
    once = drawn(growing, [keyframe(0.0, 0.0, 0.0, nothing)])
    assert (once.cells == UNKNOWN).all()  # one may be glass
    wall = np.where(np.abs(ANGLES) < 0.5, 2.0, math.nan)
    keyframes = [keyframe(0.0, 0.0, 0.0, wall),
                 *(keyframe(0.0, 0.0, 0.01, nothing) for _ in range(9))]
    grid = drawn(growing, keyframes)
    assert grid.value(2.0, 0.0) == OCCUPIED and grid.value(2.5, 0.02) == FREE
    x, y = math.cos(TWO + 0.01), math.sin(TWO + 0.01)  # a beam goes there
    assert grid.value(2.5 * x, 2.5 * y) == FREE and grid.value(3.2 * x, 3.2 * y) == UNKNOWN
    never = drawn(GrowingGrid(0.05, echoless_m=0.0), keyframes)
    assert never.value(2.5 * x, 2.5 * y) == UNKNOWN
    # What failed, or was too near, says nothing.
    failed = [keyframe(0.0, 0.0, 0.0, np.full(BEAMS, bad)) for bad in (math.nan, -math.inf, 0.0)]
    assert (drawn(GrowingGrid(0.05), failed * 3).cells == UNKNOWN).all()


def test_glass_that_is_seen_from_ahead_stays_though_more_look_through_it() -> None:
    glass_m, behind_m = 2.02, 4.0
    keyframes = []
    for y in np.arange(-3.0, 3.0, 0.3):
        wall = behind_m / np.cos(ANGLES)
        pane = glass_m / np.cos(ANGLES)
        ranges = np.where(np.abs(ANGLES) < 0.35, pane, wall)
        keyframes.append(keyframe(0.0, float(y), 0.0,
                                  np.where(np.abs(ANGLES) < 1.2, ranges, math.nan)))
    grid = grid_of(keyframes)
    rows = np.arange(-1.5, 1.5, 0.05)
    assert (grid.values(np.full(rows.shape, 2.02), rows) == OCCUPIED).mean() > 0.95
    assert (grid.values(np.full(rows.shape, 1.5), rows) == FREE).all()


def agreement(grid: GridMap) -> tuple[float, float]:
    """Return which share of what is called occupied and free is so within 10 cm."""
    x, y = grid.centres()
    found = []
    for value, true in ((OCCUPIED, FLAT.occupied_mask()), (FREE, ~FLAT.occupied_mask())):
        row, column, inside = FLAT.indices(x[grid.cells == value], y[grid.cells == value])
        near = np.any([true[np.clip(row + up, 0, FLAT.rows - 1),
                            np.clip(column + across, 0, FLAT.columns - 1)]
                       for up in (-2, -1, 0, 1, 2) for across in (-2, -1, 0, 1, 2)], axis=0)
        found.append(float((near & inside).mean()))
    return found[0], found[1]


def test_the_flat_is_drawn_as_it_is_and_who_walks_through_is_not() -> None:
    rng = np.random.default_rng(5)
    keyframes = []
    for number in range(120):
        x, y = WAY[number % len(WAY)]
        yaw = float(rng.uniform(-3.0, 3.0))
        pose = np.array((x, y, yaw)) + rng.normal(0.0, (0.02, 0.02, 0.005))
        person = (np.array(WAY[number // 3 % len(WAY)]) + rng.normal(0.0, 0.3, 2)) - (x, y)
        ranges = WALLS.cast(x, y, yaw + ANGLES, 20.0) + rng.normal(0.0, 0.02, BEAMS)
        if math.hypot(*person) > 0.5:
            ranges = np.minimum(ranges, disc_distances(*person, yaw + ANGLES, 0.15))
        seen = keyframe(x, y, yaw, ranges)
        seen.pose = pose
        keyframes.append(seen)
    grid = grid_of(keyframes)
    occupied, free = agreement(grid)
    assert occupied > 0.97 and free > 0.97
    x, y = FLAT.centres()
    middle = (FLAT.cells == 0) & ~grown(FLAT.occupied_mask())
    seen_there = grid.values(x[middle], y[middle])
    assert (seen_there == OCCUPIED).sum() == 0
    assert (seen_there == FREE).mean() > 0.85


#: Places in all rooms of the flat.
WAY = ((3.44, 1.0), (3.3, 3.0), (2.45, 3.9), (2.45, 5.2), (3.3, 5.8), (5.2, 5.65), (6.4, 5.8),
       (7.85, 4.3), (8.3, 3.7), (8.9, 1.6), (6.6, 1.4), (5.2, 3.7))


def grown(mask: np.ndarray) -> np.ndarray:
    """Return what is within 15 cm of something."""
    wide = mask.copy()
    for _ in range(3):
        wide[1:] |= wide[:-1].copy()
        wide[:-1] |= wide[1:].copy()
        wide[:, 1:] |= wide[:, :-1].copy()
        wide[:, :-1] |= wide[:, 1:].copy()
    return wide


def test_a_map_is_read_back_by_map_server_and_planner_as_it_is(tmp_path: Path) -> None:
    grid = drawn(GrowingGrid(0.05), [keyframe(3.44, 1.0), keyframe(3.3, 3.0)])
    grid.save(tmp_path / 'made.yaml')
    back = GridMap.load(tmp_path / 'made.yaml')
    assert np.array_equal(back.cells, grid.cells)
    assert back.origin == grid.origin and back.resolution_m == grid.resolution_m
    picture = (tmp_path / 'made.pgm').read_bytes()
    assert picture.startswith(b'P5') and set(picture[-grid.cells.size:]) == {0, 205, 254}
    text = (tmp_path / 'made.yaml').read_text()
    for line in ("image: 'made.pgm'", 'mode: trinary', 'negate: 0', 'occupied_thresh: 0.65',
                 'free_thresh: 0.196'):  # not 0.25: then 205 would be read as free
        assert line in text.splitlines()
