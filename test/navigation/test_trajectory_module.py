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

"""The module trajectory on the virtual clock: where it brings the robot, and why it stops."""

from __future__ import annotations

import math
from typing import Any

import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.devices.motor_faults import MotorFault
from rt_robot_os.features.navigation.trajectory import Trajectory
from rt_robot_os.motion.angles import wrapped
from rt_robot_os.motion.controllers import CONTROLLERS
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.spline import legs
from rt_robot_os.testing.fakes import settings_of
from steered import Bench

pytest.importorskip('nav_msgs', reason='ROS 2 messages are not installed')

UP = math.pi / 2
LAWS = tuple(CONTROLLERS)


@pytest.fixture(name='bench')
def _bench() -> Any:
    with Bench() as bench:
        yield bench


def eight(radius_m: float = 1.5, count: int = 200) -> list[Pose]:
    angles = [math.tau * i / count for i in range(count + 1)]
    return [(radius_m * math.sin(a), radius_m * math.sin(a) * math.cos(a),
             math.atan2(math.cos(2 * a), math.cos(a))) for a in angles]


# ---- arriving --------------------------------------------------------------------------------


@pytest.mark.parametrize('law', LAWS)
def test_a_goal_is_reached_then_others_may_steer(law: str) -> None:
    with Bench(law=law) as bench:
        bench.at(0.5, lambda: bench.drive_to(1.5, 1.0, -UP))
        bench.run(20.0)
        assert bench.state == 'done'
        assert bench.robot[:2] == pytest.approx((1.5, 1.0), abs=0.03)
        assert wrapped(bench.robot[2]) == pytest.approx(-UP, abs=0.03)
        assert bench.changes == ['idle', 'turning', 'driving', 'turning', 'done']
        assert bench.all_commands[-1] == (0.0, 0.0)
        count = len(bench.all_commands)
        bench.run(2.0)
        assert len(bench.all_commands) == count
        assert bench.module.statistics()['warning'] == ''


def test_no_goal_no_command(bench: Bench) -> None:
    bench.run(3.0)
    assert bench.all_commands == []
    assert bench.changes == ['idle']
    assert len(bench.told) >= 3  # who comes late hears it too


def test_a_plan_is_followed(bench: Bench) -> None:
    bench.at(0.5, lambda: bench.follow(*eight()))
    bench.run(45.0)
    assert bench.state == 'done'
    leg, = legs(eight(), 0.8)
    assert bench.distance_m == pytest.approx(leg.length_m, abs=0.05)


def test_the_error_tells_how_far_the_reference_is(bench: Bench) -> None:
    bench.at(0.5, lambda: bench.drive_to(2.0, 0.0, 0.0))
    bench.run(3.0)
    assert bench.errors.latest()
    x, y, z = bench.errors.msg.vector
    assert abs(x) < 0.05 and abs(y) < 0.01 and abs(z) < 0.01
    assert 0.1 < bench.module.statistics()['progress'] < 0.9


# ---- stops that say why ----------------------------------------------------------------------


def stops(bench: Bench, what: Any, why: str, after_s: float = 4.0) -> None:
    """Drive to a goal, let something happen, and see that the robot stops and stays."""
    bench.at(0.5, lambda: bench.drive_to(5.0, 0.0, 0.0))
    bench.at(after_s, what)
    bench.run(after_s - 0.1)
    assert bench.velocity[0] > 0.25
    bench.run(18.0)
    assert bench.state.startswith('stopped: ')
    assert why in bench.state
    assert bench.all_commands[-1] == (0.0, 0.0)
    assert bench.velocity[0] == pytest.approx(0.0, abs=0.01)
    assert why in str(bench.module.statistics()['warning']) or why == 'cancelled'


def test_a_localiser_that_falls_silent_stops_the_robot_for_good(bench: Bench) -> None:
    def silence() -> None:
        bench.map_silent = True

    stops(bench, silence, 'pose is 0.5 s old, at most 0.5')
    count = len(bench.all_commands)
    bench.map_silent = False
    bench.run(2.0)
    assert len(bench.all_commands) == count
    bench.at(0.1, lambda: bench.drive_to(5.0, 0.0, 0.0))
    bench.run(20.0)
    assert bench.state == 'done'


def test_odometry_that_falls_silent_stops_the_robot(bench: Bench) -> None:
    stops(bench, lambda: setattr(bench, 'odom_silent', True), 'odometry is 0.5 s old')


def test_a_clock_that_stands_still_is_an_old_pose(bench: Bench) -> None:
    stops(bench, lambda: setattr(bench, 'frozen', True), 'pose is ')


def test_an_uncertain_pose_stops_the_robot(bench: Bench) -> None:
    stops(bench, lambda: setattr(bench, 'variance', 0.2), 'position is known to 0.63 m only')


@pytest.mark.parametrize('variance', [math.nan, -1.0])
def test_poses_without_covariance_are_refused_and_counted(bench: Bench, variance: float) -> None:
    stops(bench, lambda: setattr(bench, 'variance', variance), 'pose is 0.5 s old')
    assert bench.module.statistics()['poses_refused'] > 100


def test_a_blocked_robot_gives_up(bench: Bench) -> None:
    stops(bench, lambda: setattr(bench, 'held', True), 'blocked: no progress for 10 s')


def test_a_cancellation_stops_the_robot(bench: Bench) -> None:
    stops(bench, bench.stop, 'cancelled')
    assert bench.module.statistics()['cancelled'] == 1


def test_an_emergency_stop_ends_what_is_driven(bench: Bench) -> None:
    stops(bench, bench.emergency, 'e-stop')


def test_a_robot_that_is_carried_away_stops(bench: Bench) -> None:
    def carry() -> None:
        bench.shift = (0.0, 0.8, 0.0)

    stops(bench, carry, 'off the path by 0.8')
    assert bench.module.statistics()['pose_jumps'] == 1


@pytest.mark.parametrize(('goal', 'why'), [
    ((math.nan, 0.0, 0.0), 'goal is no pose: position nan'),
    ((1e300, 0.0, 0.0), 'goal is no pose'),
    ((math.inf, 0.0, 0.0), 'goal is no pose'), ((0.0, 120.0, 0.0), 'm away, at most 100'),
    ((1.0, 0.0, math.nan), 'goal is no pose')])
def test_a_goal_that_nobody_can_mean_stops_the_robot(bench: Bench, goal: Pose, why: str) -> None:
    stops(bench, lambda: bench.drive_to(*goal), why)
    assert bench.module.statistics()['goals_refused'] == 1


def test_an_orientation_that_was_never_filled_in_is_refused(bench: Bench) -> None:
    def bare() -> None:
        bench.goal.msg.pose.position = 1.0, 0.0, 0.0
        bench.goal.msg.pose.orientation = 0.0, 0.0, 0.0, 0.0
        bench.goal.publish()

    stops(bench, bare, 'orientation 0, 0, 0, 0')


@pytest.mark.parametrize(('numbers', 'why'), [
    ([], 'took the plan back'), ([0.0, 1.0], 'path has 2 numbers'),
    ([0.0, 0.0, 0.0, math.nan, 0.0, 0.0], 'pose 1 of 2 is no place'),
    ([1e300] * 6, 'pose 0 of 2 is no place'),
    ([1e7] * 6, 'goal is 1.41421e+07 m away'),
    ([0.0, 0.0, 0.0, 1e5, 0.0, 0.0], '100000 m away'),
    ([50.0, 50.0, 0.0, 51.0, 50.0, 0.0], 'off the path: it begins')])
def test_a_path_that_cannot_be_driven_stops_the_robot(bench: Bench, numbers: list[float],
                                                      why: str) -> None:
    def publish() -> None:
        bench.plan.msg.data = numbers
        bench.plan.publish()

    stops(bench, publish, why)


def test_a_path_of_the_same_pose_again_and_again_is_a_goal(bench: Bench) -> None:
    bench.at(0.5, lambda: bench.follow(*[(1.0, 0.0, 0.0)] * 50))
    bench.run(12.0)
    assert bench.state == 'done'
    assert bench.robot[:2] == pytest.approx((1.0, 0.0), abs=0.03)


def test_a_goal_before_the_first_pose_is_refused() -> None:
    with Bench() as bench:
        bench.map_silent = True
        bench.at(0.5, lambda: bench.drive_to(1.0, 0.0, 0.0))
        bench.run(2.0)
        assert bench.state == 'stopped: no pose yet'
        assert bench.all_commands == []
        assert bench.module.statistics()['goals_refused'] == 1


# ---- smoothly --------------------------------------------------------------------------------


def test_a_new_goal_while_driving_is_taken_without_a_stop(bench: Bench) -> None:
    bench.at(0.5, lambda: bench.drive_to(3.0, 0.0, 0.0))
    bench.at(5.0, lambda: bench.drive_to(4.0, 0.5, 0.0))
    bench.run(5.0)
    before = len(bench.all_commands)
    bench.run(3.0)
    assert min(v for v, _ in bench.all_commands[before:]) > 0.2
    bench.run(15.0)
    assert bench.state == 'done'
    assert bench.robot[:2] == pytest.approx((4.0, 0.5), abs=0.03)


def test_a_correction_of_the_localiser_does_not_kick_the_robot(bench: Bench) -> None:
    def correct() -> None:
        bench.shift = (0.15, 0.1, 0.1)

    bench.at(0.5, lambda: bench.drive_to(5.0, 0.0, 0.0))
    bench.at(6.0, correct)
    bench.run(5.9)
    before = len(bench.all_commands)
    bench.run(3.0)
    after = bench.all_commands[before:]
    for (v0, w0), (v1, w1) in zip(after, after[1:]):
        assert abs(v1 - v0) <= 0.3 * 0.02 + 1e-9
        assert abs(w1 - w0) <= 0.6 * 0.02
    assert min(v for v, _ in after) > 0.15
    assert max(abs(w) for _, w in after) < 0.4


def test_a_cancellation_later_than_a_goal_counts() -> None:
    with Bench(rate_hz=1 / 0.3) as bench:
        bench.at(0.65, lambda: bench.drive_to(3.0, 0.0, 0.0))
        bench.at(0.7, bench.stop)
        bench.run(4.0)
        assert bench.all_commands == []
        bench.at(0.05, bench.stop)
        bench.at(0.1, lambda: bench.drive_to(1.0, 0.0, 0.0))
        bench.run(15.0)
        assert bench.state == 'done'


# ---- life ------------------------------------------------------------------------------------


def test_a_safe_state_is_a_standstill_and_nothing_goes_on_after_it(bench: Bench) -> None:
    bench.at(0.5, lambda: bench.drive_to(5.0, 0.0, 0.0))
    bench.at(4.0, bench.module.safe_state)
    bench.run(8.0)
    assert bench.all_commands[-1] == (0.0, 0.0)
    assert bench.state == 'stopped: safe state'
    assert bench.robot[0] < 1.3


def test_a_law_and_its_gains_change_while_driving(bench: Bench) -> None:
    bench.at(0.5, lambda: bench.drive_to(3.0, 0.0, 0.0))
    bench.at(4.0, lambda: bench.module.change('law', 'samson'))
    bench.at(5.0, lambda: bench.module.change('samson_b', 9.0))
    bench.at(6.0, lambda: bench.module.change('law', 'regulated_pure_pursuit'))
    bench.run(20.0)
    assert bench.module.statistics()['law'] == 'regulated_pure_pursuit'
    assert bench.state == 'done'


def test_a_module_without_anything_to_follow_is_refused() -> None:
    with pytest.raises(ConfigError, match='nothing to follow'):
        Trajectory('steer', settings_of(Trajectory, goal_topic=''))


def test_a_module_without_rate_is_refused() -> None:
    bench = Bench()
    made = Trajectory('slow', settings_of(Trajectory, command_topic='a', state_topic='b',
                                          progress_topic='c', error_topic='d'))
    made.declare(bench.bus, 0.0)
    made.bind(bench.bus, bench.kernel.add_task('slow', made.job, priority=3))
    with pytest.raises(ConfigError, match='slow.rate_hz is missing'):
        made.configure()


def test_goals_in_another_frame_than_the_pose_are_refused() -> None:
    bench = Bench()
    bench.topic('elsewhere', 'geometry_msgs/msg/PoseStamped', {'header.frame_id': 'odom'})
    with pytest.raises(ConfigError, match="'odom', pose in 'map'"):
        other = bench.add(Trajectory, 'other', rate_hz=10.0, goal_topic='elsewhere',
                          command_topic='a', state_topic='b', progress_topic='c',
                          error_topic='d')
        other.configure()


# ---- the motor board -------------------------------------------------------------------------


def test_a_wheel_that_its_board_holds_ends_the_drive_and_a_new_goal_begins_another(
        bench: Bench) -> None:
    bench.at(0.5, lambda: bench.drive_to(2.0, 0.0, 0.0))
    bench.at(2.0, lambda: bench.tell_faults(MotorFault.LEFT_STANDSTILL))
    bench.run(4.0)
    assert bench.state == 'stopped: motor board: the left wheel stands still'
    assert bench.all_commands[-1] == (0.0, 0.0)
    bench.drive_to(2.0, 0.0, 0.0)
    bench.run(0.5)
    assert bench.state == 'stopped: motor board: the left wheel stands still'
    bench.tell_faults(0)
    bench.run(0.5)
    assert bench.state.startswith('stopped')  # nothing moves by itself
    bench.drive_to(2.0, 0.0, 0.0)
    bench.run(15.0)
    assert bench.state == 'done'


def test_a_fault_that_came_and_went_between_two_steps_stops_the_robot(bench: Bench) -> None:
    def reset() -> None:
        bench.tell_faults(MotorFault.COUNTS_NEW)
        bench.tell_faults(0)

    bench.at(0.5, lambda: bench.drive_to(2.0, 0.0, 0.0))
    bench.at(2.0, reset)
    bench.run(4.0)
    assert bench.state == 'stopped: motor board: its counters restarted'


def test_lost_bytes_and_a_low_battery_do_not_end_a_drive(bench: Bench) -> None:
    bench.at(0.5, lambda: bench.drive_to(2.0, 0.0, 0.0))
    bench.at(2.0, lambda: bench.tell_faults(MotorFault.LINE | MotorFault.BATTERY_LOW | 1 << 16))
    bench.run(15.0)
    assert bench.state == 'done'


# ---- e-stop and planner ----------------------------------------------------------------------


def test_a_goal_that_came_before_the_release_of_the_e_stop_is_not_driven_after_it() -> None:
    with Bench(estop_release_topic='release') as bench:
        bench.at(0.5, bench.emergency)
        bench.at(1.0, bench.let_go)  # the button is still in: that releases nothing
        bench.at(1.5, lambda: bench.drive_to(1.0, 0.0, 0.0))
        bench.at(2.0, lambda: bench.emergency(False))
        bench.at(2.5, bench.let_go)
        bench.run(5.0)
        assert bench.state == 'stopped: e-stop, not released yet'
        assert bench.all_commands == []
        bench.drive_to(1.0, 0.0, 0.0)
        bench.run(10.0)
        assert bench.state == 'done'


def test_a_plan_that_is_taken_back_says_so(bench: Bench) -> None:
    bench.at(0.5, lambda: bench.follow((0.0, 0.0, 0.0), (2.0, 0.0, 0.0)))
    bench.at(2.0, bench.follow)
    bench.run(4.0)
    assert bench.state == 'stopped: the planner took the plan back'
