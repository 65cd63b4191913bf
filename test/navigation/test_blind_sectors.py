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

"""What a scanner cannot see is not free: how a guard drives among blind sectors."""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import Any

from guarded_robot import ANGLES
from guarded_robot import Guarded
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import numpy as np
import pytest
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.motion.zones import Circle

pytest.importorskip('sensor_msgs', reason='ROS 2 messages are not installed')

# What drivers publish where a scanner has no valid reading.
NOTHING = {'NaN': math.nan, 'zero': 0.0, 'below range_min': 0.01, 'negative': -1.0}


def wall(x_m: float) -> np.ndarray:
    return np.stack((np.full(401, x_m), np.linspace(-2.0, 2.0, 401)), axis=1)


def sector(share: float, value: float = math.nan, middle_rad: float = 0.0
           ) -> Callable[[np.ndarray], None]:
    """Blind a share of all rays, those next to a direction."""
    off = np.abs(np.remainder(ANGLES - middle_rad + math.pi, 2 * math.pi) - math.pi)

    def spoil(ranges: np.ndarray) -> None:
        ranges[off <= share * math.pi] = value
    return spoil


def scattered(share: float, value: float = math.nan) -> Callable[[np.ndarray], None]:
    """Blind other rays with each scan."""
    random = np.random.default_rng(7)

    def spoil(ranges: np.ndarray) -> None:
        ranges[random.random(ranges.size) < share] = value
    return spoil


def free_m(robot: Guarded, radius_m: float = 0.2) -> float:
    return float(Circle(radius_m).room(*robot.seen().T).min())


@pytest.mark.parametrize(('value', 'how'), [
    *((value, sector) for value in NOTHING.values()), (math.nan, scattered), (0.0, scattered)])
@pytest.mark.parametrize('share', [0.5, 0.7, 0.85, 0.95, 1.0])
def test_it_does_not_drive_into_a_wall_that_the_scanner_cannot_see(
        share: float, value: float, how: Callable[..., Any]) -> None:
    robot = Guarded(wall(0.65))
    robot.spoil = how(share, value)
    robot.steer(0.8)
    robot.bench.run(3.0)
    assert free_m(robot) > 0.1
    assert robot.velocity == (0.0, 0.0)
    assert robot.told()[0].startswith('scan: ')


@pytest.mark.parametrize('share', [0.1, 0.5, 0.8])
@pytest.mark.parametrize('free', [0.45, 0.8, 1.5])
def test_a_scanner_that_goes_blind_on_the_way_stops_it_before_the_wall(
        free: float, share: float) -> None:
    robot = Guarded(wall(0.2 + free + 1.2))

    def spoil(ranges: np.ndarray) -> None:
        if robot.pose[0] > 1.2:
            sector(share)(ranges)

    robot.spoil = spoil
    robot.steer(0.8)
    robot.bench.run(5.0)
    assert robot.pose[0] > 1.2
    assert free_m(robot) > 0.1
    assert robot.velocity == (0.0, 0.0)


def test_what_it_cannot_see_is_said_with_the_angles() -> None:
    robot = Guarded()
    robot.spoil = sector(1 / 3)
    robot.steer(0.5)
    robot.bench.run(0.5)
    [text] = robot.told()
    before, low, _, high, after = text.rsplit(' ', 4)
    assert (before, after) == ('scan: no valid readings from', 'degrees')
    assert (float(low), float(high)) == pytest.approx((-60, 60), abs=2.5)
    statistics = robot.guard.statistics()
    assert statistics['warning'] == f'stopped: {text}'
    assert statistics['scan_blind_deg'] == pytest.approx(120, abs=1)


def test_the_angles_are_those_of_the_sector_that_is_in_the_way() -> None:
    robot = Guarded()

    def spoil(ranges: np.ndarray) -> None:
        sector(1 / 9)(ranges)
        sector(1 / 9, middle_rad=2.0)(ranges)

    robot.spoil = spoil
    robot.steer(0.5)
    robot.bench.run(0.5)
    _, low, _, high, _ = robot.told()[0].rsplit(' ', 4)
    assert (float(low), float(high)) == pytest.approx((-20, 20), abs=2.5)


@pytest.mark.parametrize('value', [math.inf, 11.0])
def test_an_open_hall_is_free_and_so_is_one_with_single_lost_rays(value: float) -> None:
    robot = Guarded()

    def spoil(ranges: np.ndarray) -> None:
        ranges[:] = value
        ranges[::40] = math.nan
        ranges[1::40] = math.nan

    robot.spoil = spoil
    robot.steer(1.0)
    robot.bench.run(2.0)
    assert {v for _, v, _ in robot.out} == {1.0}
    assert robot.guard.statistics()['state'] == 'free'


def test_a_sector_that_is_lost_for_one_scan_does_not_slow_it() -> None:
    robot = Guarded(wall(6.0))
    count = 0

    def spoil(ranges: np.ndarray) -> None:
        nonlocal count
        count += 1
        if count % 4 == 0:
            sector(0.4)(ranges)

    robot.spoil = spoil
    robot.steer(0.6)
    robot.bench.run(3.0)
    assert {v for _, v, _ in robot.out} == {0.6}


def test_the_longer_it_cannot_see_the_slower_it_drives_and_then_it_stands() -> None:
    robot = Guarded()
    robot.spoil = lambda ranges: sector(0.4)(ranges) if robot.pose[0] > 1.0 else None
    robot.steer(0.8)
    robot.bench.run(4.0)
    speeds = [v for _, v, _ in robot.out]
    assert speeds[0] == 0.8
    assert all(b < a + 0.01 for a, b in zip(speeds, speeds[1:]))
    assert len({round(v, 2) for v in speeds}) > 5
    assert speeds[-1] == 0.0
    assert 'scan: no valid readings' in robot.guard.statistics()['warning']


def test_what_it_saw_is_remembered_where_it_was_also_when_it_turns() -> None:
    # It has seen the wall ahead, turns by a quarter, and the way there is lost from then on.
    robot = Guarded(wall(0.7))
    robot.spoil = lambda ranges: (sector(0.3, middle_rad=-math.pi / 2)(ranges)
                                  if robot.pose[2] > 1.0 else None)
    robot.steer(0.0, 1.5, until_s=1.1)
    robot.steer(0.5, -1.5, from_s=1.1)
    robot.bench.run(6.0)
    assert free_m(robot) > 0.05


def test_it_can_turn_away_from_what_it_cannot_see_and_drive_on() -> None:
    robot = Guarded()
    robot.spoil = lambda ranges: sector(0.15)(ranges) if abs(robot.pose[2]) < 0.5 else None
    robot.steer(0.5, until_s=1.0)
    robot.steer(0.0, 1.0, from_s=1.0, until_s=2.0)
    robot.steer(0.5, from_s=2.0)
    robot.bench.run(3.0)
    assert {v for t, v, _ in robot.out if t < 1.0} == {0.0}
    assert {w for t, _, w in robot.out if 1.1 < t < 2.0} == {1.0}
    assert max(v for t, v, _ in robot.out if t > 2.0) == pytest.approx(0.5)


@pytest.mark.parametrize(('share', 'speed'), [(0.0, -0.6), (0.3, -0.1)])
def test_backwards_into_a_blind_sector_it_drives_as_where_no_sensor_looks(
        share: float, speed: float) -> None:
    robot = Guarded()
    robot.spoil = sector(share, middle_rad=math.pi) if share else robot.spoil
    robot.steer(-0.6)
    robot.bench.run(1.0)
    assert robot.velocity[0] == pytest.approx(speed)


@pytest.mark.parametrize(('share', 'turning'), [(0.0, 1.0), (0.2, 0.1 / math.hypot(0.4, 0.2))])
def test_corners_turn_slowly_into_a_blind_sector(share: float, turning: float) -> None:
    robot = Guarded(footprint_m=[0.4, 0.2, 0.2, 0.2])
    robot.spoil = sector(share, middle_rad=math.pi / 2) if share else robot.spoil
    robot.steer(0.0, 1.0)
    robot.bench.run(0.5)
    assert robot.velocity[1] == pytest.approx(turning)


@pytest.mark.parametrize(('shape', 'turning'), [
    ({'footprint_m': [0.4, 0.2, 0.2, 0.2]}, 0.15 / math.hypot(0.4, 0.2)), ({}, 1.0)],
    ids=['corners', 'round'])
def test_corners_turn_slowly_where_no_sensor_looks(shape: dict[str, Any], turning: float) -> None:
    robot = Guarded(scan_topics=[], range_topics=['sonar'], **shape)
    robot.bench.kernel.add_task('sonar', lambda: robot.ping(math.inf), priority=50, rate_hz=20.0)
    robot.steer(0.0, 1.0, until_s=0.5)
    robot.steer(0.5, 0.2, from_s=0.5)
    robot.bench.run(1.0)
    assert [w for t, _, w in robot.out if 0.1 < t < 0.2] == pytest.approx([turning] * 2)
    assert robot.velocity == (0.5, 0.2)


def test_an_arc_into_a_blind_sector_is_limited_and_one_away_from_it_is_not() -> None:
    speeds = []
    for turning in (0.5, -0.5):
        robot = Guarded()
        robot.spoil = sector(0.1, middle_rad=math.radians(80))
        robot.steer(0.5, turning)
        robot.bench.run(0.5)
        speeds.append(robot.out[0][1])
    assert speeds[0] < 0.3
    assert speeds[1] == 0.5


def test_slow_is_what_the_settings_may_ask_for() -> None:
    robot = Guarded(unseen='slow')
    robot.spoil = sector(0.5)
    robot.steer(0.8)
    robot.bench.run(1.0)
    assert robot.velocity[0] == pytest.approx(0.15)
    assert robot.guard.statistics()['warning'].startswith('slowed: scan: no valid readings')


@pytest.mark.parametrize('mounting', [
    Mounting((0.1, 0.0, 0.2), (math.pi, 0.0, 0.0)), Mounting((0.1, 0.0, 0.2), (0.0, 0.0, 2.0))],
    ids=['upside down', 'turned'])
def test_the_mounting_of_the_scanner_counts(mounting: Mounting) -> None:
    # The rays of the scanner that look to the left of the robot are blind, a little ahead.
    robot = Guarded(mounted=mounting)
    left = math.radians(80)
    blind = -left if mounting.rotation_rad[0] else left - 2.0
    robot.spoil = sector(0.1, middle_rad=blind)
    robot.steer(0.5, 0.5, until_s=0.5)
    robot.steer(0.5, -0.5, from_s=0.5)
    robot.bench.run(1.0)
    assert max(v for t, v, _ in robot.out if t < 0.5) < 0.3
    assert max(v for t, v, _ in robot.out if t > 0.5) == pytest.approx(0.5)


@settings(deadline=None, max_examples=12)
@given(st.floats(0.35, 2.0), st.floats(-0.8, 0.8), st.floats(0.1, 1.0),
       st.floats(-math.pi, math.pi), st.sampled_from([*NOTHING.values()]), st.floats(0.0, 1.0),
       st.booleans())
def test_whatever_is_lost_nothing_ahead_is_touched(
        x_m: float, w: float, share: float, middle_rad: float, value: float, from_s: float,
        is_scattered: bool) -> None:
    robot = Guarded(wall(x_m))
    lose = scattered(share, value) if is_scattered else sector(share, value, middle_rad)
    robot.spoil = lambda ranges: (
        lose(ranges) if robot.bench.kernel.now_ns() >= from_s * 1e9 else None)
    robot.steer(0.8, w)
    nearest_m = math.inf
    for _ in range(30):
        robot.bench.run(0.1)
        nearest_m = min(nearest_m, free_m(robot))
    assert nearest_m > 0.0


@pytest.mark.parametrize(('low', 'high'), [
    (0.02, math.nan), (0.02, 0.0), (math.nan, 10.0), (-1.0, 10.0), (10.0, 10.0)])
def test_a_scan_whose_limits_are_not_valid_shows_nothing(low: float, high: float) -> None:
    robot = Guarded(wall(0.65))
    robot.limits = low, high
    robot.steer(0.5)
    robot.bench.run(1.0)
    assert {v for _, v, _ in robot.out} == {0.0}
    assert robot.guard.statistics()['scan_unusable'] > 10


@pytest.mark.parametrize(('low', 'high'), [
    (0.1, math.nan), (0.1, 0.0), (math.nan, 3.0), (-0.1, 3.0), (0.0, 0.0)])
def test_a_range_whose_limits_are_not_valid_shows_nothing(low: float, high: float) -> None:
    robot = Guarded(scan_topics=[], range_topics=['sonar'])
    robot.bench.kernel.add_task('sonar', lambda: robot.ping(0.3, low, high), priority=50,
                                rate_hz=20.0)
    robot.steer(0.2)
    robot.bench.run(0.5)
    assert {v for _, v, _ in robot.out} == {0.0}


def test_a_sensor_of_one_fixed_distance_is_a_reading() -> None:
    robot = Guarded(scan_topics=[], range_topics=['sonar'])
    robot.bench.kernel.add_task('sonar', lambda: robot.ping(math.inf, 0.5, 0.5), priority=50,
                                rate_hz=20.0)
    robot.steer(0.2)
    robot.bench.run(0.5)
    assert robot.velocity[0] == 0.2


@pytest.mark.parametrize('value', [0.0, -1.0])
def test_a_range_below_the_shortest_distance_is_not_free(value: float) -> None:
    robot = Guarded(scan_topics=[], range_topics=['sonar'])
    robot.bench.kernel.add_task('sonar', lambda: robot.ping(value), priority=50, rate_hz=20.0)
    robot.steer(0.2)
    robot.bench.run(0.5)
    assert {v for _, v, _ in robot.out} == {0.0}


@pytest.mark.parametrize('silent', ['stop', 'slow'])
def test_a_bumper_that_has_to_be_heard_and_is_not_stops_it(silent: str) -> None:
    robot = Guarded(bumper_topic='bumper', bumper_timeout_s=0.2, silent=silent)
    task = robot.bench.kernel.add_task('bumper', lambda: robot.bump(0), priority=50, rate_hz=20.0)
    robot.bench.at(1.0, lambda: task.set_rate_hz(0.01))
    robot.steer(0.5)
    robot.bench.run(2.0)
    assert {v for t, v, _ in robot.out if t < 1.1} == {0.5}
    assert robot.velocity[0] == pytest.approx(0.0 if silent == 'stop' else 0.15)
    assert robot.told() == (['bumper: nothing is heard'] if silent == 'stop' else [])


def test_a_bumper_that_was_never_heard_stops_it() -> None:
    robot = Guarded(bumper_topic='bumper', bumper_timeout_s=0.2)
    robot.steer(0.5)
    robot.bench.run(1.0)
    assert {v for _, v, _ in robot.out} == {0.0}


def test_the_outline_is_that_of_the_robot_and_not_a_place_that_has_to_be_seen() -> None:
    # A scanner behind the front of a long robot: what it cannot see there is the robot itself.
    robot = Guarded(footprint_m=[0.5, 0.2, 0.2, 0.2])
    robot.spoil = scattered(0.3)
    robot.steer(0.3)
    robot.bench.run(1.0)
    assert robot.velocity[0] == pytest.approx(0.3)
