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

"""The one world of the simulated devices: body, walls, people, what happens, chance."""

from __future__ import annotations

from dataclasses import replace
import math
from pathlib import Path

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import numpy as np
import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.motion.walls import Walls
from rt_robot_os.sim.world import DriveBase
from rt_robot_os.sim.world import World
from rt_robot_os.sim.world_settings import WorldSettings

OPEN = WorldSettings(map='open')
BUSY = replace(OPEN, slip_noise=0.05, seed=7, people=('anna 0.8 1 1 4 1 4 3',),
               events=('kidnap 1 1 0.5 at 2', 'person anna 2 2 at 1 for 0.5',
                       'slip 0.3 at 1.5 for 1'))


def rooms(folder: Path) -> WorldSettings:
    """Write a room of 4 x 3 m with walls of 0.1 m and a box in it; its corner is at -1, -1."""
    cells = np.zeros((60, 80), dtype=np.int8)
    cells[:2] = cells[-2:] = 100
    cells[:, :2] = cells[:, -2:] = 100
    cells[20:30, 60:70] = 100
    GridMap(cells, 0.05, (-1.0, -1.0, 0.0)).save(folder / 'room.yaml')
    return WorldSettings(map=str(folder / 'room.yaml'))


def drive(world: World, seconds: float, left: float = 6.0, right: float = 6.0) -> World:
    world.advance(round(world.time_s * NS_PER_S))
    world.base.set_wheel_speeds(left, right)
    world.advance(round((world.time_s + seconds) * NS_PER_S))
    return world


# ---- the body -----------------------------------------------------------------------------------

def test_the_wheels_follow_their_motors_with_a_lag_and_the_robot_its_wheels() -> None:
    world = drive(World(OPEN), 0.06)
    assert world.base.wheel_speeds[0] == pytest.approx(6.0 * (1 - math.exp(-0.8)), rel=0.4)
    assert 0.5 < world.base.wheel_speeds[0] < 3.9
    drive(world, 4.94)
    x, y, yaw = world.base.pose
    assert world.base.wheel_speeds == (6.0, 6.0)
    assert world.base.velocity == pytest.approx((0.3, 0.0))
    assert x == pytest.approx(0.05 * world.base.wheel_angles[0])
    assert x == pytest.approx(1.5, abs=0.05) and (y, yaw) == (0.0, 0.0)


def test_wheels_gain_no_speed_faster_than_they_can() -> None:
    world = drive(World(replace(OPEN, motor_lag_s=0.001, motor_acceleration_rad_s2=10.0)), 0.5)
    assert world.base.wheel_speeds[0] == pytest.approx(5.0, abs=0.05)
    assert world.base.acceleration[0] == pytest.approx(0.5, abs=0.05)


def test_one_wheel_drives_a_circle() -> None:
    base = drive(World(OPEN), 3.0, 0.0, 6.0).base
    turned = 0.05 * base.wheel_angles[1] / base.wheel_separation_m
    assert base.pose[2] == pytest.approx(math.remainder(turned, math.tau))
    assert math.hypot(base.pose[0], base.pose[1] - 0.15) == pytest.approx(0.15)
    assert base.acceleration[1] == pytest.approx(0.15 * 1.0, rel=0.02)  # v times w


def test_a_robot_without_voltage_runs_down_and_stands() -> None:
    world = drive(World(OPEN), 1.0)
    world.base.coast()
    drive_until = world.base.pose[0]
    world.advance(2 * NS_PER_S)
    assert 0.0 < world.base.velocity[0] < 0.05
    world.advance(9 * NS_PER_S)
    assert world.base.velocity == (0.0, 0.0) and world.base.wheel_speeds == (0.0, 0.0)
    assert world.base.pose[0] == pytest.approx(drive_until + 0.3 * 0.4, abs=0.02)


def test_a_duty_is_a_share_of_the_full_speed() -> None:
    world = World(replace(OPEN, motor_speed_rad_s=10.0))
    world.advance(0)
    world.base.set_duty(0.5, -3.0)
    world.advance(NS_PER_S)
    assert world.base.wheel_speeds == pytest.approx((5.0, -10.0), abs=1e-3)


@pytest.mark.parametrize('told', [math.nan, math.inf, -math.inf, 1e300])
def test_no_command_breaks_the_motors(told: float) -> None:
    world = drive(World(OPEN), 0.5, told, told)
    assert all(abs(speed) <= 20.0 for speed in world.base.wheel_speeds)
    assert all(map(math.isfinite, world.base.pose))


def test_larger_wheels_and_slip_show_in_the_way_and_not_in_the_angles() -> None:
    true = drive(World(OPEN), 2.0).base
    larger = drive(World(replace(OPEN, wheel_radius_error=(0.02, 0.02))), 2.0).base
    slipping = drive(World(replace(OPEN, slip=0.05)), 2.0).base
    assert larger.wheel_angles == slipping.wheel_angles == true.wheel_angles
    assert larger.pose[0] == pytest.approx(1.02 * true.pose[0])
    assert slipping.pose[0] == pytest.approx(0.95 * true.pose[0])


def test_a_base_of_its_own_goes_like_that_of_a_world() -> None:
    alone = DriveBase(wheel_radius_m=0.05, wheel_separation_m=0.3)
    alone.advance(500)
    alone.set_wheel_speeds(6.0, 5.0)
    alone.advance(500 + NS_PER_S)
    assert alone.pose == drive(World(OPEN), 1.0, 6.0, 5.0).base.pose


# ---- walls --------------------------------------------------------------------------------------

def test_a_wall_stops_the_robot_while_its_wheels_go_on(tmp_path: Path) -> None:
    world = drive(World(replace(rooms(tmp_path), start=(0.0, 1.0, 0.0))), 20.0)
    x, y, _ = world.base.pose
    assert x == pytest.approx(2.9 - 0.18, abs=1e-3) and y == 1.0
    assert world.base.wheel_angles[0] * 0.05 > 5.0
    assert world.base.velocity[0] == pytest.approx(0.0, abs=1e-9)
    assert world.base.contact_rad == pytest.approx(0.0, abs=1e-3)
    assert world.base.contacts == 1 and world.base.impact_m_s == pytest.approx(0.3, abs=1e-3)
    world.base.coast()
    world.advance(round((world.time_s + 9.0) * NS_PER_S))
    assert world.base.contact_rad is None
    assert world.base.touched(0.001) == pytest.approx([0.0], abs=1e-3)  # it stands against it
    drive(world, 2.0, -6.0, -6.0)
    assert world.base.pose[0] < 2.4 and world.base.touched(0.001) == []
    assert world.base.contacts == 1
    assert drive(world, 9.0, 3.0, 3.0).base.contacts == 2
    assert world.base.impact_m_s == pytest.approx(0.3, abs=1e-3), 'the largest one'


def test_along_a_wall_it_slides_into_the_corner(tmp_path: Path) -> None:
    base = drive(World(replace(rooms(tmp_path), start=(1.0, 1.0, 0.6))), 30.0).base
    assert base.pose[:2] == pytest.approx((2.9 - 0.18, 1.9 - 0.18), abs=2e-3)


@settings(deadline=None, max_examples=20)
@given(st.lists(st.tuples(st.floats(-20, 20), st.floats(-20, 20)), min_size=1, max_size=12))
def test_however_it_drives_it_is_never_in_a_wall(
        tmp_path_factory: pytest.TempPathFactory, speeds: list[tuple[float, float]]) -> None:
    world = World(rooms(tmp_path_factory.mktemp('room')))
    for left, right in speeds:
        drive(world, 0.7, left, right)
        x, y, _ = world.base.pose
        nearest = world.cast(x, y, np.linspace(-math.pi, math.pi, 180)).min()
        assert nearest > 0.18 - 1e-3


def test_people_stop_it_too_and_it_goes_on_when_they_do() -> None:
    world = drive(World(replace(OPEN, people=('anna 0.0 1.0 0.0',))), 10.0)
    assert world.base.pose[0] == pytest.approx(1.0 - 0.22 - 0.18, abs=1e-3)
    world.inject(['person', 'anna', '5.0', '5.0'])
    assert drive(world, 5.0).base.pose[0] > 1.5


# ---- rays ---------------------------------------------------------------------------------------

def test_the_scan_of_a_straight_wall_is_straight(tmp_path: Path) -> None:
    world = World(rooms(tmp_path))
    angles = np.linspace(0.0, math.tau, 720, endpoint=False)
    ranges = world.cast(0.0, 0.5, angles, 5.6)
    x, y = ranges * np.cos(angles), 0.5 + ranges * np.sin(angles)
    on_a_wall = np.minimum.reduce([abs(x - 2.9), abs(x + 0.9), abs(y - 1.9), abs(y + 0.9),
                                   abs(x - 2.0), abs(y - 0.5)])
    assert on_a_wall.max() < 1e-9
    assert world.cast(0.0, 0.5, np.array([0.0]), 1.0).tolist() == [math.inf]
    assert world.cast(-0.95, 0.5, np.array([0.0])).tolist() == [0.0]


def test_rays_may_come_in_any_order(tmp_path: Path) -> None:
    world = World(rooms(tmp_path))
    angles = np.random.default_rng(1).uniform(-9.0, 9.0, 100)
    alone = [float(world.cast(0.3, 0.1, np.array([angle]))[0]) for angle in angles]
    assert world.cast(0.3, 0.1, angles) == pytest.approx(alone)


@pytest.mark.parametrize('degrees', [0, 7, 10, 20, 30, 45, 60, 77, 88])
def test_a_slanted_wall_is_straight_although_cells_make_stairs(degrees: int) -> None:
    slant = math.radians(degrees)
    row, column = np.mgrid[0:200, 0:200] + 0.5
    behind = (row - 100) * math.cos(slant) - (column - 100) * math.sin(slant) > 20
    walls = Walls.of(GridMap((behind * 100).astype(np.int8), 0.05))
    off = np.linspace(-0.9, 0.9, 200)
    distance = walls.cast(5.0, 5.0, off + slant + math.pi / 2, 20.0) * np.cos(off)
    assert distance.max() - distance.min() < 0.03
    assert distance.std() < 0.008
    assert distance.mean() == pytest.approx(1.0, abs=0.03)


def test_a_person_is_seen_as_a_disc_below_their_height() -> None:
    world = World(replace(OPEN, people=('anna 0.0 2.0 0.0',)))
    angles = np.radians([-10.0, 0.0, 3.0, 10.0, 180.0])
    seen = world.cast(0.0, 0.0, angles, 5.0)
    assert seen[1] == pytest.approx(1.78) and 1.78 < seen[2] < 2.0
    assert np.isinf(seen[[0, 3, 4]]).all()
    assert np.isinf(world.cast(0.0, 0.0, angles, 5.0, height_m=2.0)).all()


def test_a_sensor_looks_from_where_it_is_mounted() -> None:
    world = World(replace(OPEN, start=(1.0, 2.0, math.pi / 2)))
    mounting = Mounting((0.2, 0.1, 0.3), (0.0, 0.0, -math.pi / 2))
    assert world.pose_of(mounting) == pytest.approx((0.9, 2.2, 0.0))


# ---- time and chance ----------------------------------------------------------------------------

def busy(times_ms: list[int]) -> tuple[object, ...]:
    """Look at a busy world at some times; tell where everything is after three seconds."""
    world = World(BUSY)
    world.advance(123)
    world.base.set_wheel_speeds(5.0, 6.0)
    for time_ms in times_ms:
        world.advance(123 + time_ms * NS_PER_MS)
    world.advance(123 + 3000 * NS_PER_MS)
    return world.base.pose, world.base.wheel_angles, world.people[0].x, world.people[0].y


@settings(deadline=None, max_examples=10)
@given(st.lists(st.integers(-5, 3000), max_size=20))
def test_what_happens_does_not_depend_on_who_looks_when(times_ms: list[int]) -> None:
    assert busy(times_ms) == busy([])


def test_another_seed_is_another_chance() -> None:
    one, other = (drive(World(replace(BUSY, seed=seed)), 1.0).base.pose for seed in (1, 2))
    assert one != other


# ---- what happens -------------------------------------------------------------------------------

def test_the_robot_is_kidnapped_and_its_wheels_notice_nothing() -> None:
    world = drive(World(OPEN), 1.0)
    before = world.base.wheel_angles
    world.inject(['kidnap', '3.0', '-2.0', '1.5'])
    assert world.base.pose == (3.0, -2.0, 1.5) and world.base.wheel_angles == before


def test_people_walk_their_way_and_stand_where_they_are_told() -> None:
    world = World(replace(OPEN, start=(9.0, 9.0, 0.0), people=('anna 1.0 0 0 2 0 2 1',),
                          events=('person anna 1 5 at 4 for 2',)))
    anna, = world.people
    places = []
    for second in range(8):
        world.advance(second * NS_PER_S)
        places.append((round(anna.x, 1), round(anna.y, 1)))
    assert places[:4] == [(0, 0), (1, 0), (2, 0), (2, 1)]
    assert places[5] == (1, 5)
    assert places[7] != (1, 5)


def test_people_wait_for_the_robot_in_their_way() -> None:
    world = World(replace(OPEN, start=(1.0, 0.0, 0.0), people=('anna 1.0 0 0 2 0',)))
    world.advance(0)
    world.advance(3 * NS_PER_S // 2)
    assert world.people[0].x == pytest.approx(1.0 - 0.5, abs=0.03)
    world.inject('kidnap 0 5 0'.split())
    world.advance(5 * NS_PER_S // 2)
    assert world.people[0].x > 1.4


def test_people_who_waited_for_the_robot_for_long_turn_round() -> None:
    world = World(replace(OPEN, start=(1.0, 0.0, 0.0), people=('anna 1.0 0 0 2 0 2 3 0 3',)))
    world.advance(0)
    world.advance(3 * NS_PER_S // 2)
    assert world.people[0].x == pytest.approx(1.0 - 0.5, abs=0.03)
    world.advance(7 * NS_PER_S // 2)
    assert (world.people[0].x, world.people[0].y) == pytest.approx((0.0, 1.0), abs=0.05)
    world.advance(15 * NS_PER_S // 2)
    assert (world.people[0].x, world.people[0].y) == pytest.approx((2.0, 3.0), abs=0.05)
    world.advance(19 * NS_PER_S // 2)
    assert world.people[0].y < 1.1, 'she comes from the other side'


def test_slip_comes_and_goes() -> None:
    world = World(replace(OPEN, slip=0.1, events=('slip 0.5 at 1 for 1',)))
    found = []
    for second in (0.5, 1.5, 2.5):
        world.advance(0)
        world.advance(round(second * NS_PER_S))
        found.append(world.base.slip)
    assert found == [0.1, 0.5, 0.1]


def test_light_and_warmth_have_their_places() -> None:
    world = World(replace(OPEN, lights=('0 0 400',), light_lux=100.0, temperature_c=20.0,
                          heat=('1 0 5 0.5',)))
    assert world.light_lux(0.0, 0.0) == pytest.approx(500.0)
    assert 100.0 < world.light_lux(3.0, 0.0) < 200.0
    assert world.temperature_c(1.0, 0.0) == pytest.approx(25.0)
    assert world.temperature_c(9.0, 0.0) == pytest.approx(20.0)
    world.inject(['lamp', '0'])
    assert world.light_lux(0.0, 0.0) == pytest.approx(100.0)


@pytest.mark.parametrize('line, text', [
    ('', "'' is not a known event: write kidnap X Y YAW; person NAME X Y [SECONDS]"),
    ('kidnap 1 2', 'must be one of'), ('kidnap 1 2 nan', "'nan' is not a valid number"),
    ('person bob 1 2', 'no such person; there are anna'), ('person anna', 'must be one of'),
    ('slip 7', 'a share of 7'), ('walk anna 1', 'must be one of'), ('dance', "'dance'")])
def test_what_cannot_happen_is_refused(line: str, text: str) -> None:
    with pytest.raises(ConfigError, match='world') as caught:
        World(BUSY).inject(line.split())
    assert text in str(caught.value)


def test_a_robot_cannot_begin_in_a_wall(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match='world.start: the map has an obstacle'):
        World(replace(rooms(tmp_path), start=(-0.95, 0.0, 0.0)))


@pytest.mark.parametrize('away', [3.0, -3.0])
def test_from_a_person_who_steps_into_it_the_robot_may_go_away(away: float) -> None:
    world = World(replace(OPEN, people=('anna 0.0 5.0 5.0',)))
    world.inject(['person', 'anna', str(0.05 * away), '0.0'])
    assert abs(drive(world, 2.0, away, away).base.pose[0]) < 0.01
    assert abs(drive(world, 2.0, -away, -away).base.pose[0]) > 0.2


def test_it_is_not_put_into_a_wall(tmp_path: Path) -> None:
    settings = rooms(tmp_path)
    with pytest.raises(ConfigError, match='world: kidnap: the map has an obstacle at 2'):
        World(settings).inject('kidnap 2.2 0.2 0'.split())
    with pytest.raises(ConfigError, match='world.events: kidnap: the map has'):
        World(replace(settings, events=('kidnap 2.2 0.2 0 at 3',)))


def test_after_a_long_halt_it_goes_on_at_the_present_time() -> None:
    alone, world = DriveBase(), World(OPEN)
    for each in (alone, world):
        each.advance(0)
        each.advance(3600 * NS_PER_S)
    world.base.set_wheel_speeds(5.0, 5.0)
    alone.set_wheel_speeds(5.0, 5.0)
    for each in (alone, world):
        each.advance(3601 * NS_PER_S)
    assert world.base.pose[0] == alone.pose[0] == pytest.approx(0.25, abs=0.03)


def test_every_problem_of_a_world_is_told_at_once() -> None:
    with pytest.raises(ConfigError) as caught:
        World(WorldSettings(
            map='open', start=(1.0,), people=('anna 1 2', 'bob 1 2 3', 'bob 1 2 3'),
            landmarks=('1.5 0 0 0', '7 0 0'), nodes=('hall 1 2 x',), heat=('0 0 1 0',),
            events=('kidnap 1 2 3', 'kidnap 1 2 3 at 4 for 5', 'person anna 1 2 at -1')))
    problems = caught.value.problems
    assert len(problems) == 10
    assert "world.people: 'anna 1 2': must be a name, a speed in m/s and x y" in problems[0]
    assert 'world.people: bob is listed twice' in problems
    assert 'world.start: must be 3 numbers' in problems
