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

"""A robot finds itself in a saved map or says that it cannot, and follows itself in one."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

pytest.importorskip('scipy', reason='scipy is not installed')

from benchmarks.slam.drives import flat_drive  # noqa: E402, I100
from benchmarks.slam.drives import FLAT_WAY  # noqa: E402
from benchmarks.slam.drives import shipped_map  # noqa: E402
from benchmarks.slam.restart_trials import Conditions  # noqa: E402
from benchmarks.slam.restart_trials import restart_trials  # noqa: E402
from rt_robot_os.base.errors import ConfigError  # noqa: E402
from rt_robot_os.features.mapping.slam import place_search  # noqa: E402
from rt_robot_os.features.mapping.slam.global_localization import FoundPose  # noqa: E402
from rt_robot_os.features.mapping.slam.global_localization import GlobalLocalizer  # noqa: E402
from rt_robot_os.features.mapping.slam.known_map import KnownMap  # noqa: E402
from rt_robot_os.features.mapping.slam.map_localizer import MapLocalizer  # noqa: E402
from rt_robot_os.features.mapping.slam.scan import Scan  # noqa: E402
from rt_robot_os.features.mapping.slam.transforms import between  # noqa: E402
from rt_robot_os.features.mapping.slam.transforms import composed  # noqa: E402
from rt_robot_os.features.mapping.slam.transforms import Floats  # noqa: E402
from rt_robot_os.motion.grid_map import GridMap  # noqa: E402
from rt_robot_os.motion.walls import Walls  # noqa: E402

SECOND_NS = 1_000_000_000


@pytest.fixture(scope='module')
def flat() -> GridMap:
    return shipped_map('flat')


def seen(walls: Walls, pose: Floats, number: int, odometry: Floats | None = None,
         seed: int = 1) -> Scan:
    """Return a scan of 180 beams all round, ten a second."""
    angles = -math.pi + np.arange(180) * math.tau / 180
    ranges = walls.cast(pose[0], pose[1], pose[2] + angles, 12.0)
    noise = np.random.default_rng(seed + number).normal(0.0, 0.01, 180)
    return Scan(number * SECOND_NS // 10, pose if odometry is None else odometry, ranges + noise,
                -math.pi, math.tau / 180)


def search(finder: GlobalLocalizer, walls: Walls, pose: Floats, scans: int = 8
           ) -> FoundPose | None:
    """Show a robot that stands what it sees."""
    for number in range(scans):
        found = finder.add_scan(seen(walls, pose, number))
        while found is None and finder.process_pending():
            pass
        if found is not None:
            return found
    return None


def off(found: Floats, true: Floats) -> tuple[float, float]:
    error = between(true, found)
    return float(np.hypot(error[0], error[1])), math.degrees(abs(float(error[2])))


@pytest.mark.parametrize('conditions', [
    Conditions(beams=180), Conditions(fov_rad=math.radians(240.0), turn_rad_s=0.3)])
def test_a_robot_finds_itself_among_people_at_random_places(
        flat: GridMap, conditions: Conditions) -> None:
    trials = restart_trials(5, 3, flat, conditions=conditions)
    assert (trials.right, trials.wrong) == (5, 0), trials.misses


def two_rooms(unlike: bool = False) -> GridMap:
    """Return two rooms that look the same, a door between; a pillar in one makes them unlike."""
    cells = np.zeros((60, 122), np.int8)
    cells[:1], cells[-1:], cells[:, :1], cells[:, -1:] = 100, 100, 100, 100
    cells[:, 60:62] = 100
    for left in (0, 61):
        cells[10:25, left + 1:left + 9] = 100
        cells[45:59, left + 25:left + 40] = 100
    cells[25:43, 60:62] = 0
    if unlike:
        cells[8:16, 34:44] = 100
    return GridMap(cells, 0.05)


def test_rooms_that_look_alike_get_no_answer_until_the_robot_has_seen_more() -> None:
    grid = two_rooms()
    walls, finder = Walls.of(grid), GlobalLocalizer(grid)
    start = np.array((1.2, 0.7, 0.3))  # the door is out of sight, or looks the same
    shut = grid.cells.copy()
    shut[25:43, 60:62] = 100
    assert search(GlobalLocalizer(GridMap(shut, 0.05)), Walls.of(GridMap(shut, 0.05)), start,
                  30) is None
    assert search(GlobalLocalizer(two_rooms(True)), Walls.of(two_rooms(True)), start) is not None
    found = None
    for number in range(60):  # to the middle of the room, and through the door
        pose = start + np.array((0.04, 0.02 if number < 50 else 0.0, 0.0)) * number
        found = finder.add_scan(seen(walls, pose, number, pose))
        while found is None and finder.process_pending():
            pass
        if found is not None:
            break
    assert found is not None and off(found.pose, pose)[0] < 0.2


def test_two_places_are_said_to_be_two() -> None:
    cells = two_rooms().cells.copy()
    cells[25:43, 60:62] = 100
    grid = GridMap(cells, 0.05)
    finder = GlobalLocalizer(grid)
    assert search(finder, Walls.of(grid), np.array((1.2, 0.7, 0.3)), 10) is None
    assert finder.state == 'ambiguous between 2 places: move the robot'
    finder.restart()
    assert finder.state == 'searching: waiting for a scan'


def test_a_robot_outside_of_the_map_is_not_found(flat: GridMap) -> None:
    finder = GlobalLocalizer(flat)
    other = two_rooms()
    assert search(finder, Walls.of(other), np.array((1.5, 1.5, 0.0)), 12) is None
    blind = Scan(9 * SECOND_NS, np.zeros(3), np.full(180, np.inf), -3.0, 0.03)
    assert finder.add_scan(blind) is None and 'only 0 beams see something' in finder.state


@pytest.mark.parametrize('cell_m, origin', [
    (0.01, (0.0, 0.0, 0.0)), (0.05, (3.0, -20.0, 2.1)), (0.2, (-1.0, 2.0, -1.0))])
def test_maps_of_other_resolutions_and_origins_do(cell_m: float, origin: Any) -> None:
    rooms = two_rooms(True).cells
    many = round(0.05 / cell_m) or 1  # cells of 20 cm: rooms four times as large
    grid = GridMap(np.kron(rooms, np.ones((many, many), np.int8)), cell_m, origin)
    walls = Walls.of(grid)
    scale = grid.resolution_m * grid.columns / 6.1
    inside = np.array((1.2 * scale, 0.9 * scale, 0.3))
    pose = composed(np.array(origin), inside)
    found = search(GlobalLocalizer(grid), walls, pose)
    assert found is not None
    assert off(found.pose, pose)[0] < max(0.1, cell_m) and off(found.pose, pose)[1] < 3.0


def test_one_that_stands_is_found_where_a_few_beams_tell_two_rooms_apart() -> None:
    house = shipped_map('house')
    walls, finder = Walls.of(house), GlobalLocalizer(house)
    # The bath and the workshop are of the same shape; one is 10 cm wider than the other.
    for place in ((16.32, 10.08, -1.68), (17.48, 10.68, 0.86), (15.92, 10.68, 1.08)):
        pose = np.array(place)
        finder.restart()
        found = search(finder, walls, pose)
        assert found is not None, finder.state
        assert off(found.pose, pose)[0] < 0.1 and off(found.pose, pose)[1] < 2.0


def test_a_search_of_too_many_places_keeps_the_best(
        flat: GridMap, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(place_search, '_SQUARES_MOST', 500)
    monkeypatch.setattr(place_search, '_LEAVES_MOST', 300)
    pose = np.array((3.44, 1.0, 2.0))
    found = search(GlobalLocalizer(flat), Walls.of(flat), pose)
    assert found is not None and off(found.pose, pose)[0] < 0.1


def test_who_is_followed_on_a_large_map_measures_only_what_is_near(flat: GridMap) -> None:
    cells = np.full((3000, 3000), -1, np.int8)
    cells[:flat.rows, :flat.columns] = flat.cells
    cells[2000:2000 + flat.rows, 2000:2000 + flat.columns] = flat.cells
    large = GridMap(cells, flat.resolution_m, flat.origin)
    known, pose = KnownMap(large), np.array((3.44, 1.0, 2.0))
    follower = MapLocalizer(large, None, pose, known=known)
    assert off(follower.add(seen(Walls.of(flat), pose, 0)).pose, pose)[0] < 0.1
    assert (known.distances[:flat.rows, :flat.columns] < 255).any()
    assert (known.distances[2000:, 2000:] == 255).all()


def test_a_map_in_which_nobody_can_be_says_so() -> None:
    with pytest.raises(ConfigError, match='nothing in it is free'):
        GlobalLocalizer(GridMap(np.full((9, 9), 100, np.int8), 0.05))
    with pytest.raises(ConfigError, match='nothing in it is occupied'):
        MapLocalizer(GridMap(np.zeros((9, 9), np.int8), 0.05), None, np.zeros(3))


# ---- following ---------------------------------------------------------------------------------

def test_a_robot_is_followed_through_a_flat_with_people_and_knows_how_well() -> None:
    drive = flat_drive(3, FLAT_WAY[:12], walkers=2, beams=120, scan_hz=2.0)
    follower = MapLocalizer(drive.grid, None, drive.truth[0])
    located = [follower.add(scan) for scan in drive.scans]
    errors = between(drive.truth, np.array([each.pose for each in located]))
    assert np.hypot(errors[:, 0], errors[:, 1]).max() < 0.1
    assert math.degrees(np.abs(errors[:, 2]).max()) < 2.5
    assert not follower.lost
    on_map = np.array([each.pose for each in located]) - drive.truth
    on_map[:, 2] = errors[:, 2]
    square = [error @ np.linalg.solve(each.covariance, error)
              for error, each in zip(on_map, located)]
    assert np.mean(np.array(square) < 7.81) > 0.93  # chi-square of three, 95 %


def test_a_robot_that_stands_for_an_hour_does_not_turn(flat: GridMap) -> None:
    walls, pose = Walls.of(flat), np.array((3.44, 1.0, 2.0))
    follower = MapLocalizer(flat, None, pose)
    errors = []
    for number in range(120):  # one scan in half a minute; the gyroscope drifts by 36 degrees
        drift = np.array((0.0, 0.0, math.radians(0.3) * number))
        scan = seen(walls, pose, number * 300, drift)
        errors.append(off(follower.add(scan).pose, pose))
    far, turned = np.array(errors).T
    assert far.max() < 0.05 and turned.max() < 1.5
    # The end is as good as the beginning.
    assert np.mean(turned[-30:]) < np.mean(turned[:30]) + 0.2


def test_a_robot_that_is_carried_away_notices_and_a_crowd_does_not_confuse_it(
        flat: GridMap) -> None:
    walls, pose = Walls.of(flat), np.array((3.44, 1.0, 2.0))
    follower = MapLocalizer(flat, None, pose)
    for number in range(5):
        follower.add(seen(walls, pose, number))
    for number in range(5, 105, 5):  # ten seconds among people who leave nothing in sight
        scan = seen(walls, pose, number, pose)
        near = np.minimum(scan.ranges, 0.5)
        located = follower.add(Scan(scan.stamp_ns, pose, near, scan.angle_min,
                                    scan.angle_increment))
        assert located.is_lost and not follower.lost
    assert not follower.add(seen(walls, pose, 105)).is_lost
    other = np.array((7.5, 6.0, -1.0))
    for number in range(106, 140):
        located = follower.add(seen(walls, other, number, pose))
    assert located.is_lost and 'beams go through walls of the map' in follower.lost
    assert follower.counts['lost'] == 1
    follower.relocate(other)
    assert not follower.add(seen(walls, other, 140, pose)).is_lost and not follower.lost


def test_odometry_that_is_set_anew_does_not_move_the_robot(flat: GridMap) -> None:
    walls, pose = Walls.of(flat), np.array((3.44, 1.0, 2.0))
    follower = MapLocalizer(flat, None, pose)
    follower.add(seen(walls, pose, 0, np.array((50.0, -3.0, 1.0))))
    located = follower.add(seen(walls, pose, 1, np.zeros(3)))
    assert off(located.pose, pose)[0] < 0.1 and follower.counts['jumps'] == 1
    with pytest.raises(ValueError, match='odometry says'):
        follower.add(seen(walls, pose, 2, np.array((np.nan, 0.0, 0.0))))
