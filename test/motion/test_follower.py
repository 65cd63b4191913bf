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

"""A follower: goals and paths to their ends, and why not."""

from __future__ import annotations

import math

from driving import away_from
from driving import drive
from driving import eight
from driving import resting
from driving import rms
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest

from rt_robot_os.motion.angles import wrapped
from rt_robot_os.motion.controllers import CONTROLLERS
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.follower import Phase
from rt_robot_os.motion.follower_tuning import FollowerTuning
from rt_robot_os.motion.reference_path import PathError
from rt_robot_os.motion.spline import legs
from rt_robot_os.motion.velocity_limits import VelocityLimits

LAWS = tuple(CONTROLLERS)
UP = math.pi / 2


@pytest.mark.parametrize('law', LAWS)
@pytest.mark.parametrize('period', [0.02, 0.3])
def test_a_goal_is_reached_with_its_heading(law: str, period: float) -> None:
    run = drive(law, period_s=period)
    run.go((2.0, 1.0, -UP))
    assert run.run() == 'done'
    assert run.states == ['turning', 'driving', 'turning', 'done']
    assert run.pose[:2] == pytest.approx((2.0, 1.0), abs=0.03)
    assert wrapped(run.pose[2]) == pytest.approx(-UP, abs=0.03)
    assert run.follower.progress == 1.0
    assert run.commands[-1] == (0.0, 0.0)
    assert resting(run)


def test_a_rest_gives_no_command_so_that_others_may_steer() -> None:
    run = drive()
    assert run.follower.step((0.0, 0.0, 0.0), 0.02) is None
    run.go((0.5, 0.0, 0.0))
    run.run()
    assert run.follower.step((0.5, 0.0, 0.0), 0.02) is None


def test_a_goal_at_the_place_of_the_robot_is_a_turn() -> None:
    run = drive()
    run.go((0.01, 0.0, 3.0))
    assert run.run() == 'done'
    assert run.states == ['turning', 'done']
    assert run.distance_m < 0.01


def test_any_heading_will_do_with_a_large_tolerance() -> None:
    run = drive(tuning=FollowerTuning(goal_tolerance_rad=7.0))
    run.go((1.0, 0.0, 3.0))
    assert run.run() == 'done'
    assert abs(run.pose[2]) < 0.1


def test_a_square_is_driven_with_turns_at_its_corners() -> None:
    square = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 0.0)]
    run = drive()
    run.go(*square)
    assert run.run() == 'done'
    assert run.states.count('turning') == 4
    assert run.distance_m == pytest.approx(4.0, abs=0.1)


def test_repeated_poses_change_nothing() -> None:
    path: list[Pose] = [(0.0, 0.0, 0.0), (1.0, 0.2, 0.0), (2.0, 0.0, 0.0)]
    once, often = drive(), drive()
    once.go(*path)
    often.go(*[pose for pose in path for _ in range(5)])
    assert once.run() == often.run() == 'done'
    assert once.pose == pytest.approx(often.pose)


@pytest.mark.parametrize(('poses', 'why'), [
    ([], 'empty'), ([(math.nan, 0.0, 0.0)], 'no place'),
    ([(1.0, 0.0, 0.0), (1e300, 0.0, 0.0)], 'no place'),
    ([(1e7, 0.0, 0.0)], 'm away'), ([(8.0, 8.0, 0.0), (9.0, 9.0, 0.0)], 'off the path')])
def test_a_path_that_cannot_be_driven_stops_the_robot_and_says_why(poses: list[Pose], why: str
                                                                   ) -> None:
    run = drive()
    run.go((5.0, 0.0, 0.0))
    run.run(4.0)
    assert run.velocity[0] > 0.25
    with pytest.raises(PathError, match=why):
        run.go(*poses)
    assert why in run.run()
    assert run.follower.state.startswith('stopped: ')
    assert run.velocity[0] < 0.05
    run.go((3.0, 0.0, 0.0))
    assert run.run() == 'done'


def test_a_new_goal_ahead_is_taken_without_a_stop() -> None:
    run = drive()
    run.go((3.0, 0.0, 0.0))
    run.run(5.0)
    before = len(run.commands)
    run.go((4.0, 0.6, 0.3))
    run.run(3.0)
    assert min(v for v, _ in run.commands[before:]) > 0.2
    assert run.run() == 'done'
    assert run.pose[:2] == pytest.approx((4.0, 0.6), abs=0.03)


def test_a_drive_that_begins_in_a_turn_does_not_go_backwards() -> None:
    """The turning rate of before points the other way than the curve."""
    run = drive(period_s=0.1)
    run.go((-1.0, -0.0, 0.0))
    run.run(2.1)
    assert run.commands[-1][1] < -0.9
    run.go((-0.625, -1.25, 0.0))
    assert run.run() == 'done'
    assert min(v for v, _ in run.commands) > -0.02


def test_a_robot_that_somebody_else_drives_is_taken_over_without_a_jerk() -> None:
    run = drive()
    run.velocity = (0.3, 0.0)
    run.go((3.0, 0.0, 0.0))
    run.run(2.0)
    assert min(v for v, _ in run.commands) > 0.25
    turning = drive()
    turning.velocity = (0.3, 0.0)
    turning.go((-3.0, 0.0, 0.0))
    assert turning.run() == 'done'
    assert turning.commands[0][0] == pytest.approx(0.3 - 0.3 * 0.02)


def test_a_new_goal_behind_brakes_before_it_turns() -> None:
    run = drive()
    run.go((3.0, 0.0, 0.0))
    run.run(5.0)
    before = len(run.commands)
    run.go((0.0, 0.0, 0.0))
    assert run.run() == 'done'
    speeds = [v for v, _ in run.commands[before - 1:]]
    assert all(a - b <= 0.3 * 0.02 + 1e-9 for a, b in zip(speeds, speeds[1:]))
    assert run.pose[:2] == pytest.approx((0.0, 0.0), abs=0.03)


def test_plans_that_come_every_second_do_not_hold_the_robot_up() -> None:
    """The way is planned from where the robot was half a second ago."""
    run = drive()
    behind = run.pose
    run.go(*[(0.1 * i, 0.0, 0.0) for i in range(41)])
    run.run(2.0)
    for _ in range(40):
        behind = run.pose
        run.run(0.5)
        if resting(run):
            break
        x, y, _ = behind
        run.go(*[(x + (4.0 - x) * i / 20, y * (1 - i / 20), 0.0) for i in range(21)])
        run.run(0.5)
        assert run.velocity[0] > 0.25 or run.pose[0] > 3.3
    assert run.follower.state == 'done'
    assert run.time_s < 18.0


def test_plans_that_come_all_the_time_do_not_hold_a_turn_up() -> None:
    once, often = drive(), drive()
    way = [(0.0, 0.1 * i, 0.0) for i in range(31)]
    once.go(*way)
    once.run(3.0)
    for _ in range(15):
        often.go(*way)
        often.run(0.2)
    assert often.pose[1] > once.pose[1] - 0.02  # it may begin to drive a little earlier
    assert often.states == once.states == ['turning', 'driving']


def test_a_held_robot_is_blocked_also_when_plans_go_on_coming() -> None:
    run = drive()
    run.held = True
    for _ in range(11):
        run.go(*[(0.1 * i, 0.0, 0.0) for i in range(31)])
        run.run(1.0)
    assert 'stopped: blocked: no progress for 10 s' in run.states


def test_progress_never_falls_while_plans_to_the_same_goal_come() -> None:
    run = drive()
    seen = [0.0]
    while not seen[1:] or not resting(run):
        x = run.pose[0]
        run.go(*[(x + (3.0 - x) * i / 20, 0.0, 0.0) for i in range(21)])
        run.run(1.0)
        seen.append(run.follower.progress)
    assert seen == sorted(seen)
    assert seen[5] == pytest.approx(run.poses[250][0] / 3.0, abs=0.05)
    run.go((0.0, 0.0, 0.0))
    assert run.follower.progress == 0.0


def test_a_tiny_loop_is_a_turn() -> None:
    run = drive()
    run.go((0.0, 0.0, 0.0), (0.03, 0.0, 0.0), (0.0, 0.0, 1.0))
    assert run.run() == 'done'
    assert run.pose == pytest.approx((0.0, 0.0, 1.0), abs=0.03)


def test_every_change_of_speed_is_within_the_limits() -> None:
    limits = VelocityLimits(acceleration_m_s2=0.4, deceleration_m_s2=0.6,
                            angular_acceleration_rad_s2=1.0)
    run = drive(limits=limits, noise=(0.01, 0.02))
    run.go(*eight())
    run.run()
    for (v0, w0), (v1, w1) in zip(run.commands, run.commands[1:]):
        assert -0.6 * 0.02 - 1e-9 <= v1 - v0 <= 0.4 * 0.02 + 1e-9 or v0 * v1 < 0
        assert abs(w1 - w0) <= 1.0 * 0.02 + 1e-9


def test_a_robot_that_is_held_is_blocked() -> None:
    run = drive()
    run.go((3.0, 0.0, 0.0))
    run.run(3.0)
    run.held = True
    assert run.run() == 'stopped: blocked: no progress for 10 s'
    assert run.commands[-1] == (0.0, 0.0)
    turning = drive()
    turning.held = True
    turning.go((0.0, 3.0, 0.0))
    assert turning.run() == 'stopped: blocked: no progress for 10 s of turning'


def test_a_robot_that_is_let_go_does_not_leap() -> None:
    run = drive()
    run.go((3.0, 0.0, 0.0))
    run.run(4.0)
    run.held = True
    run.run(4.0)
    before, run.held = len(run.commands), False
    assert max(v for v, _ in run.commands[before - 20:]) < 0.2
    assert run.run() == 'done'
    assert run.pose[:2] == pytest.approx((3.0, 0.0), abs=0.03)


def test_a_robot_that_is_carried_away_stops() -> None:
    run = drive()
    run.go((3.0, 0.0, 0.0))
    run.run(4.0)
    run.jump = (0.0, 0.8, 0.0)
    assert run.run().startswith('stopped: off the path by 0.8')


def test_a_robot_that_is_turned_round_stops_turns_and_goes_on() -> None:
    run = drive()
    run.go((3.0, 0.0, 0.0))
    run.run(4.0)
    x, y, yaw = run.pose
    run.pose = (x, y, yaw + 2.0)
    assert run.run() == 'done'
    assert run.states == ['driving', 'turning', 'driving', 'turning', 'done'] or (
        'turning' in run.states[1:-2])
    assert run.pose[:2] == pytest.approx((3.0, 0.0), abs=0.03)


def test_a_goal_that_was_missed_is_tried_again_then_said() -> None:
    """The localiser corrects itself by 6 cm when the robot arrives."""
    run = drive()
    run.go((1.0, 0.0, 0.0))
    run.run(4.2)
    run.jump = (0.0, 0.06, 0.0)
    assert run.run() == 'done'
    assert run.pose[:2] == pytest.approx((1.0, -0.06), abs=0.03)
    stubborn = drive(tuning=FollowerTuning(attempts=0))
    stubborn.go((1.0, 0.0, 0.0))
    while stubborn.follower.progress < 0.99:
        stubborn.run(0.02)
    stubborn.jump = (0.0, 0.06, 0.0)
    assert stubborn.run().startswith('stopped: missed the goal by 0.06')


def test_a_goal_that_is_far_away_all_at_once_is_not_tried_again() -> None:
    run = drive()
    run.go((1.0, 0.0, 0.0))
    while run.follower.phase is not Phase.SETTLE:
        run.run(0.02)
    run.jump = (500.0, 0.0, 0.0)
    assert run.run().startswith('stopped: goal is 5')


def test_a_stop_brakes_on_the_curve_then_rests() -> None:
    run = drive(start=(0.0, 0.0, math.pi / 4))
    run.go(*eight())
    run.run(6.0)
    before = len(run.commands)
    bend = run.commands[-1][1] / run.commands[-1][0]
    run.follower.stop('cancelled')
    assert run.run() == 'stopped: cancelled'
    braking = run.commands[before:]
    assert 10 < len(braking) < 80
    assert all(w == pytest.approx(v * bend, abs=1e-6) for v, w in braking)
    assert braking[-1] == (0.0, 0.0)


@settings(max_examples=25, deadline=None)
@given(st.tuples(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3.1, 3.1)),
       st.tuples(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3.1, 3.1)),
       st.floats(0.5, 20.0), st.sampled_from(LAWS))
def test_goals_one_after_the_other_end_at_the_last_one(first: Pose, second: Pose, after: float,
                                                       law: str) -> None:
    run = drive(law, period_s=0.1)
    run.go(first)
    run.run(after)
    run.go(second)
    assert run.run() == 'done'
    assert run.pose[:2] == pytest.approx(second[:2], abs=0.05)
    assert abs(wrapped(run.pose[2] - second[2])) < 0.05


@pytest.mark.parametrize('seed', range(5))
def test_the_papers_run_with_a_noisy_pose_at_300_ms(seed: int) -> None:
    run = drive(start=(3.44, 1.0, math.radians(120)), period_s=0.3, noise=(0.004, 0.006),
                seed=seed, tuning=FollowerTuning(goal_tolerance_rad=0.01))
    run.go((3.44, 2.3, UP))
    assert run.run() == 'done'
    assert run.distance_m == pytest.approx(1.30, abs=0.02)
    assert run.pose[:2] == pytest.approx((3.44, 2.3), abs=0.02)
    assert rms([x - 3.44 for x, y, _ in run.poses if y > 1.3]) < 0.015


def test_the_law_beats_regulated_pure_pursuit_in_the_same_world() -> None:
    path, = legs(eight(), 0.8)
    limits = VelocityLimits(angular_max_rad_s=2.0, lateral_max_m_s2=1.0)
    away = {}
    for law in LAWS:
        run = drive(law, (0.0, 0.0, math.pi / 4), 0.02, limits, (0.005, 0.005))
        run.go(*eight())
        assert run.run() == 'done'
        away[law] = rms(away_from(path, run.poses))
    assert away['kanayama'] < 0.02
    assert away['kanayama'] < away['regulated_pure_pursuit']
    assert away['samson'] < away['regulated_pure_pursuit']


ANY = st.floats(allow_nan=True, allow_infinity=True)
NEAR = st.floats(-3.0, 3.0)
ANYWHERE = st.one_of(st.tuples(ANY, ANY, ANY), st.tuples(NEAR, NEAR, NEAR))


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.lists(ANYWHERE, max_size=6), ANYWHERE, st.integers(1, 8)),
                min_size=1, max_size=6),
       st.sampled_from(LAWS), st.sampled_from([0.02, 0.3]), st.sampled_from(['spline', 'line']))
def test_whatever_comes_commands_are_numbers_within_limits(
        wishes: list[tuple[list[Pose], Pose, int]], law: str, period: float, shape: str) -> None:
    limits = VelocityLimits(wheel_max_m_s=0.35)
    run = drive(law, period_s=period, limits=limits, tuning=FollowerTuning(path_shape=shape))
    before = (0.0, 0.0)
    for poses, seen, steps in wishes:
        try:
            run.follower.go(poses, run.pose)
        except PathError:
            assert run.follower.state.startswith('stopped: ')
        for step in range(steps):
            command = run.follower.step(seen if step == 0 else run.pose, period, run.velocity)
            if command is None:
                break
            v, w = command
            assert abs(v) + abs(w) * 0.15 <= 0.35 + 1e-9
            assert abs(v - before[0]) <= 0.3 * period + 1e-9
            assert abs(w - before[1]) <= 1.5 * period + 1e-9
            before = command
            run.velocity = command
        assert all(map(math.isfinite, run.follower.error))
        assert 0.0 <= run.follower.progress <= 1.0
