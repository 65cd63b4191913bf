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

"""The guard against collisions: how near it lets a robot come, what stops it, what it says."""

from __future__ import annotations

import math
from typing import Any

from guarded_robot import Guarded
from guarded_robot import MS
from guarded_robot import RAYS
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import numpy as np
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.navigation.collision_guard import CollisionGuard
from rt_robot_os.motion.differential import moved
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.motion.run_on import RunOn
from rt_robot_os.motion.zones import Circle
from rt_robot_os.motion.zones import Rectangle
from rt_robot_os.testing.fakes import settings_of

pytest.importorskip('sensor_msgs', reason='ROS 2 messages are not installed')

WALL = np.stack((np.full(401, 2.0), np.linspace(-2.0, 2.0, 401)), axis=1)


@pytest.mark.parametrize('shape', [
    {}, {'footprint_m': [0.3, 0.2, 0.2, 0.2]}], ids=['round', 'corners'])
@pytest.mark.parametrize(('v', 'w'), [(1.0, 0.0), (0.2, 0.0), (0.8, 0.15), (0.6, -0.2)])
def test_it_comes_to_a_stand_before_a_wall_however_fast_it_came(
        shape: dict[str, Any], v: float, w: float) -> None:
    robot = Guarded(WALL, **shape)
    robot.steer(v, w)
    robot.bench.run(15.0)
    outline = Rectangle(0.3, 0.2, 0.2, 0.2) if shape else Circle(0.2)
    free_m = float(outline.room(*robot.seen().T).min())
    assert robot.velocity == (0.0, 0.0)
    # Clearance and stop zone; on an arc the wall is a little nearer than along the way.
    assert 0.11 < free_m < 0.24
    speeds = [speed for _, speed, _ in robot.out]
    assert max(speeds) == pytest.approx(v)
    assert [text.partition(' 0.')[0] for text in robot.told()] == ['scan: obstacle']
    assert robot.guard.statistics()['state'] == 'stop'
    assert 'scan: obstacle' in robot.guard.statistics()['warning']
    # It braked no harder than it said it can, but for what one scan shows at once.
    for (t0, a, _), (t1, b, _) in zip(robot.out, robot.out[1:]):
        assert a - b < 0.5 * max(t1 - t0, 0.05) + 0.16


@pytest.mark.parametrize('run_on', [RunOn(2.0, 0.5), RunOn(0.6, 0.2), RunOn(10.0, 0.0)], ids=str)
@pytest.mark.parametrize(('v', 'w'), [(1.0, 0.0), (0.4, 0.0), (0.8, 0.15), (0.6, -0.2)])
def test_whenever_its_computer_falls_silent_it_touches_no_wall(
        v: float, w: float, run_on: RunOn) -> None:
    robot = Guarded(WALL, run_on=run_on)
    left: list[float] = []

    def look() -> None:
        robot.go_on()
        for step in range(1, 21):
            pose = moved(robot.pose, *(speed * run_on.total_s * step / 20
                                       for speed in robot.velocity))
            left.append(float(np.hypot(*(WALL - pose[:2]).T).min()) - 0.2)

    robot.bench.kernel.add_task('look', look, priority=80, rate_hz=50.0)
    robot.steer(v, w)
    robot.bench.run(30.0)
    assert min(left) > 0.0
    # It is no reason to stay away: in the end it stands where it would have stood anyway.
    assert robot.pose[0] > 1.4
    free_m_s = run_on.speed_m_s(1.8)
    assert max(speed for _, speed, _ in robot.out) >= min(v, 0.8 * free_m_s)


def test_what_goes_on_in_silence_is_said() -> None:
    robot = Guarded(WALL, run_on=RunOn(2.0, 0.5))
    robot.steer(0.8)
    robot.bench.run(0.5)
    assert 'without this computer the motors go on for 2.5 s' in str(
        robot.guard.statistics()['limited_by'])


def test_where_nothing_looks_it_goes_on_by_no_more_than_the_stop_zone() -> None:
    robot = Guarded(run_on=RunOn(2.0, 0.8), silent='slow')
    robot.steer(0.5)
    robot.bench.at(1.0, lambda: robot.scan_task.set_rate_hz(0.01))
    robot.bench.run(2.0)
    assert robot.velocity[0] == pytest.approx(0.15 / 3.0)


def test_away_from_the_wall_and_turning_beside_it_is_free() -> None:
    robot = Guarded(np.stack((np.full(401, 0.27), np.linspace(-2.0, 2.0, 401)), axis=1))
    robot.steer(0.3, 0.0, until_s=1.0)
    robot.steer(0.0, 0.5, from_s=1.0, until_s=2.0)
    robot.steer(-0.3, 0.0, from_s=2.0)
    robot.bench.run(3.0)
    assert all(out[1:] == (0.0, 0.0) for out in robot.out if out[0] < 1.0)
    assert all(out[1:] == (0.0, 0.5) for out in robot.out if 1.02 < out[0] < 2.0)
    assert robot.pose[0] < -0.1
    assert [text.partition(' 0.')[0] for text in robot.told()] == ['scan: obstacle', '']


def test_who_steps_in_the_way_stops_it_at_once_and_going_away_lets_it_go_on() -> None:
    robot = Guarded()
    robot.steer(0.5)
    robot.bench.run(1.0)
    assert robot.velocity == (0.5, 0.0)
    ahead_m = robot.pose[0] + 0.32
    robot.points = np.array([[ahead_m, 0.0]])
    robot.out.clear()
    robot.bench.run(0.5)
    stops = [t for t, v, _ in robot.out if v == 0.0]
    assert stops[0] == 1.0  # the scan that shows it, not the next command
    assert robot.told() == ['scan: obstacle 0.10 m before the robot, at 0 degrees']
    # A little further away is not enough to go on, and then it is.
    robot.points = np.array([[robot.pose[0] + 0.2 + 0.19, 0.0]])
    robot.bench.run(0.5)
    assert robot.velocity == (0.0, 0.0)
    robot.points = np.empty((0, 2))
    robot.bench.run(0.2)
    assert robot.velocity == (0.5, 0.0)
    assert robot.told()[-1] == ''


@pytest.mark.parametrize(('silent', 'speed'), [('stop', 0.0), ('slow', 0.15)])
def test_a_scanner_that_falls_silent_stops_or_slows_it_when_its_time_is_out(
        silent: str, speed: float) -> None:
    robot = Guarded(silent=silent)
    robot.steer(0.5)
    robot.bench.at(1.0, lambda: robot.scan_task.set_rate_hz(0.01))
    robot.bench.run(2.0)
    changed = [t for t, v, _ in robot.out if v == pytest.approx(speed, abs=1e-6)]
    last_scan_s = 1.0
    assert changed[0] == pytest.approx(last_scan_s + 0.5, abs=0.06)
    assert robot.velocity[0] == pytest.approx(speed)
    assert robot.told() == (['scan: nothing is heard'] if silent == 'stop' else [])


def test_nothing_moves_before_the_scanner_is_heard() -> None:
    robot = Guarded()
    robot.bench.at(0.0, lambda: robot.scan_task.set_rate_hz(0.01))
    robot.steer(0.5, from_s=0.8)
    robot.bench.run(1.0)
    assert {v for _, v, _ in robot.out} == {0.0}


@pytest.mark.parametrize('ranges', [math.nan, 0.0, 99.0], ids=['NaN', 'too near', 'no clock'])
def test_a_scan_that_shows_nothing_is_silence(ranges: float) -> None:
    robot = Guarded(scan_hz=0.01)

    def show() -> None:
        robot.show(np.full(RAYS, math.inf if ranges == 99.0 else ranges))

    def stuck() -> None:
        robot.scan.publish(500 * MS)

    robot.bench.kernel.add_task('bad', stuck if ranges == 99.0 else show, priority=50,
                                rate_hz=20.0, phase_ns=MS)
    robot.steer(0.5)
    robot.bench.run(2.0)
    assert robot.velocity == (0.0, 0.0)
    assert robot.guard.statistics()['scan_unusable'] > 10


@pytest.mark.parametrize(('distance', 'v', 'moves'), [
    (math.inf, 0.2, True), (2.0, 0.2, True), (0.3, 0.2, True), (0.12, 0.2, False),
    (-math.inf, 0.2, False), (0.05, 0.2, False), (-math.inf, -0.2, True), (0.12, -0.2, True),
    (5.0, 0.2, True), (math.nan, 0.2, False)])
def test_ranges_mean_what_rep_117_says(distance: float, v: float, moves: bool) -> None:
    robot = Guarded(scan_topics=[], range_topics=['sonar'])
    robot.bench.kernel.add_task('sonar', lambda: robot.ping(distance), priority=50, rate_hz=20.0)
    robot.steer(v)
    robot.bench.run(0.3)
    assert (robot.velocity[0] != 0.0) is moves


def test_an_obstacle_at_the_edge_of_the_beam_counts() -> None:
    robot = Guarded(scan_topics=[], range_topics=['sonar'])
    robot.bench.mountings['sonar'] = Mounting((0.2, 0.21, 0.1), (0.0, 0.0, 0.3))
    robot.bench.kernel.add_task('sonar', lambda: robot.ping(0.15), priority=50, rate_hz=20.0)
    robot.steer(0.2)
    robot.bench.run(1.5)
    assert 0.0 < robot.pose[0]
    assert robot.guard.statistics()['state'] != 'free'


def test_a_bumper_blocks_the_way_ahead_also_a_while_after_it_and_no_other() -> None:
    robot = Guarded(bumper_topic='bumper', bumper_hold_s=0.5, bumper_timeout_s=0.0)
    robot.steer(0.3, until_s=1.0)
    robot.bench.at(0.5, lambda: robot.bump(2))
    robot.steer(-0.2, from_s=1.0, until_s=2.0)
    robot.bench.at(1.1, lambda: robot.bump(0))
    robot.steer(0.3, from_s=1.3)
    robot.bench.run(1.9)
    assert (0.5, 0.0, 0.0) in robot.out
    ahead = [t for t, v, _ in robot.out if v > 0.0]
    assert [t for t in ahead if 0.5 <= t < 1.6] == []
    assert max(ahead) > 1.6
    assert min(v for _, v, _ in robot.out) < 0.0
    assert 'bumper: something touches the robot' in robot.told()


@pytest.mark.parametrize(('bits', 'v', 'w', 'moves'), [
    (8, 0.2, 0.0, False), (8, -0.2, 0.0, True), (8, 0.0, 0.5, True), (16, -0.2, 0.0, False),
    (16, 0.0, 0.5, False), (1, 0.2, 0.3, False), (4, -0.2, 0.3, True)])
def test_edges_and_wheels_in_the_air(bits: int, v: float, w: float, moves: bool) -> None:
    robot = Guarded(bumper_topic='bumper')
    robot.bench.at(0.02, lambda: robot.bump(bits))
    robot.steer(v, w)
    robot.bench.run(0.3)
    assert (robot.velocity != (0.0, 0.0)) is moves


def test_without_commands_one_standstill_and_then_silence_whatever_is_seen() -> None:
    robot = Guarded()
    robot.steer(0.5, until_s=0.5)
    robot.bench.run(3.0)
    late = [out for out in robot.out if out[0] > 0.5]
    assert late == [(0.963, 0.0, 0.0)]
    assert robot.guard.statistics()['command_timeouts'] == 1


def test_scans_do_not_make_a_command_younger() -> None:
    robot = Guarded(WALL)
    robot.steer(0.5, until_s=0.1)
    stamps: list[int] = []
    read = robot.bench.bus.subscribe('cmd_vel_safe', 'test')
    robot.bench.run(0.5)
    while read.take():
        if read.msg.linear.x:
            stamps.append(read.stamp_ns)
    assert set(stamps) == {63 * MS}


@pytest.mark.parametrize('value', [math.nan, math.inf, 1e300])
def test_what_is_no_command_is_a_standstill_and_counted(value: float) -> None:
    robot = Guarded()
    robot.steer(0.5, until_s=0.5)
    robot.steer(0.5, value, from_s=0.5, until_s=0.55)
    robot.bench.run(0.54)
    assert robot.velocity == (0.0, 0.0)
    assert robot.guard.statistics()['refused'] == 1


@pytest.mark.parametrize(('yaw', 'backwards'), [(0.0, -0.1), (math.pi, -0.5)])
def test_limits_keep_the_arc_and_backwards_it_is_slow_unless_a_sensor_looks_there(
        yaw: float, backwards: float) -> None:
    robot = Guarded(scan_topics=[], range_topics=['sonar'], linear_max_m_s=0.5)
    robot.bench.mountings['sonar'] = Mounting((0.0, 0.0, 0.1), (0.0, 0.0, yaw))
    robot.bench.kernel.add_task('sonar', lambda: robot.ping(math.inf), priority=50, rate_hz=20.0)
    robot.steer(2.0, 1.0, until_s=0.5)
    robot.steer(-0.6, 0.12, from_s=0.5)
    robot.bench.run(1.0)
    assert (0.063, 0.5, 0.25) in robot.out
    assert robot.out[-1][1:] == pytest.approx((backwards, -backwards / 5))


def test_somebody_may_ask_for_a_lower_speed_and_takes_it_back() -> None:
    robot = Guarded(scan_topics=[], range_topics=['sonar'], linear_max_m_s=0.5, topics=[
        'speed_limit'], speed_limit_topic='speed_limit')
    robot.bench.kernel.add_task('sonar', lambda: robot.ping(math.inf), priority=50, rate_hz=20.0)
    asked = robot.bench.bus.publisher('speed_limit')

    def ask(speed_m_s: float) -> None:
        asked.msg.data = speed_m_s
        asked.publish()

    ask(0.3)  # before it begins
    for at_s, speed_m_s in ((2.0, 0.1), (3.0, math.nan), (4.0, 0.0), (5.0, 9.0)):
        robot.bench.at(at_s, lambda speed_m_s=speed_m_s: ask(speed_m_s))
    robot.steer(1.0, 0.5)
    robot.bench.run(6.0)
    speeds = {int(at_s): v for at_s, v, w in robot.out if v and w == pytest.approx(v / 2)}
    assert [speeds[second] for second in range(6)] == pytest.approx(
        [0.3, 0.3, 0.1, 0.1, 0.5, 0.5])


def test_the_guard_runs_within_the_publication_while_something_computes() -> None:
    robot = Guarded(scan_hz=0.01)
    kernel, done = robot.bench.kernel, []

    def compute() -> None:
        kernel.clock.spend(20 * MS)
        done.append(kernel.now_ns())

    kernel.add_task('planner', compute, priority=10, rate_hz=10.0)
    robot.steer(0.5)
    robot.bench.at(0.01, lambda: robot.show(np.full(RAYS, math.inf)))
    robot.bench.at(0.307, lambda: robot.show(np.full(RAYS, 0.15)))
    robot.bench.run(0.35)
    assert [t for t, v, _ in robot.out if v == 0.0][0] == 0.307
    # It had begun at 0.3 s, and the steering at 0.313 s was for nothing.
    assert [t for t in done if t > 300 * MS] == [320 * MS]


@pytest.mark.parametrize(('changes', 'text'), [
    ({'scan_topics': []}, 'it has no sensor'),
    ({'range_topics': ['scan']}, "'scan' is listed twice"),
    ({'safe_topic': 'cmd_vel_mux'}, 'it would receive its own output'),
    ({'footprint_m': [0.2, 0.2]}, 'must be four distances')])
def test_settings_that_guard_nothing_are_told(changes: dict[str, Any], text: str) -> None:
    with pytest.raises(ConfigError, match=text):
        CollisionGuard('guard', settings_of(CollisionGuard, **changes))


def test_a_sensor_of_which_nobody_says_where_it_is_is_refused() -> None:
    robot = Guarded()
    del robot.bench.mountings['laser']
    with pytest.raises(ConfigError, match="no transform for frame 'laser'"):
        robot.bench.run(0.1)


_POINTS = st.lists(st.tuples(st.floats(0.3, 2.5), st.floats(-math.pi, math.pi)), max_size=8)


@settings(max_examples=25, deadline=None)
@given(_POINTS, st.floats(-0.3, 1.0), st.floats(-1.5, 1.5),
       st.sampled_from([[], [0.25, 0.15, 0.15, 0.15]]))
def test_among_random_obstacles_it_never_drives_into_one(
        polar: list[tuple[float, float]], v: float, w: float, corners: list[float]) -> None:
    outline = Rectangle(*corners) if corners else Circle(0.2)
    robot = Guarded([(r * math.cos(a), r * math.sin(a)) for r, a in polar], footprint_m=corners)
    robot.steer(v, w)
    nearest = [math.inf]

    def look() -> None:
        robot.go_on()
        if len(robot.points):
            nearest[0] = min(nearest[0], float(outline.room(*robot.seen().T).min()))

    if polar:
        x, y = robot.points.T
        start_m = float(outline.room(x, y).min())
    else:
        start_m = math.inf
    robot.bench.kernel.add_task('look', look, priority=30, rate_hz=100.0)
    robot.bench.run(4.0)
    # Half a ray of the scan is 5 mm at 2.5 m.
    assert nearest[0] > min(start_m, 0.025) - 0.02
