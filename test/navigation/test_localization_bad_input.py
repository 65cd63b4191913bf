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

"""The module localization and what is wrong, late, silent or no number."""

from __future__ import annotations

import math
from typing import Any

from benchmarks.localization.plant import DT_S
from benchmarks.localization.plant import off
from localization_bench import Bench
from localization_bench import far_robot
from localization_bench import POSE
import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.navigation.localization import Localization
from rt_robot_os.motion.differential import Pose
from rt_robot_os.testing.module_bench import ModuleBench
from rt_robot_os.topics import Publisher

pytest.importorskip('nav_msgs', reason='ROS 2 messages are not installed')


def test_measured_poses_in_another_frame_are_refused() -> None:
    with Bench(far_robot(), frame='odom') as bench:
        with pytest.raises(ConfigError, match="stargazer/pose is in the frame 'odom'"):
            bench.run(0.1)


def test_odometry_of_other_frames_is_refused() -> None:
    with Bench(far_robot(), odom_frame_id='wheel_odom') as bench:
        with pytest.raises(ConfigError, match="odom is of the frames 'odom' -> 'base_link'"):
            bench.run(0.1)


@pytest.mark.parametrize('bad', [(math.nan, 1.0, 0.0), (1e300, 0.0, 0.0), (0.0, math.inf, 0.0),
                                 (0.0, 0.0, math.nan)])
def test_measured_poses_that_are_no_numbers_are_left_out_and_told(bad: Pose) -> None:
    robot = far_robot()
    with Bench(robot) as bench:
        bench.drive(3.0)
        for _ in range(4):
            bench.mark(bad)
            bench.drive(DT_S, marks=False)
        assert bench.found['not_finite'] == 4
        assert 'they are not finite, or have no direction' in bench.warning
        assert off(bench.newest(), robot.pose) < 0.03


def test_a_covariance_that_is_none_is_told() -> None:
    robot = far_robot()
    with Bench(robot) as bench:
        bench.drive(3.0)
        for _ in range(4):
            bench.mark(robot.pose, stddev_m=math.nan)
            bench.drive(DT_S, marks=False)
        assert bench.found['bad_covariance'] == 4
        assert 'covariance' in bench.warning


def test_stamps_from_the_future_are_told() -> None:
    robot = far_robot()
    with Bench(robot) as bench:
        bench.drive(3.0)
        for _ in range(4):
            bench.mark((9.0, 9.0, 0.0), bench.kernel.now_ns() + 5 * NS_PER_S)
            bench.drive(DT_S, marks=False)
        assert bench.found['future'] == 4
        assert 'ahead of now: are the clocks synchronised?' in bench.warning
        assert off(bench.newest(), robot.pose) < 0.03


def test_the_clock_of_the_landmarks_stands_still() -> None:
    robot = far_robot()
    with Bench(robot) as bench:
        bench.drive(3.0)
        stamp_ns = bench.kernel.now_ns()
        for _ in range(6):
            bench.mark(robot.pose, stamp_ns)
            bench.drive(0.1, marks=False)
        assert bench.found['stopped'] == 5
        assert 'the clock of the source stands still' in bench.warning
        assert off(bench.newest(), robot.pose) < 0.03
        bench.drive(1.0)
        assert bench.warning == ''


def test_odometry_that_is_silent_is_told_and_nothing_old_is_published() -> None:
    robot = far_robot()
    with Bench(robot) as bench:
        bench.run(0.2)
        assert 'no samples yet on odom' in bench.warning
        bench.drive(3.0)
        count = bench.pose.topic.head
        bench.run(2.5)
        assert 'odom has been silent' in bench.warning
        assert bench.pose.topic.head == count
        bench.drive(1.0)
        assert bench.warning == ''
        assert off(bench.newest(), robot.pose) < 0.03


@pytest.mark.parametrize('use_gyro', [False, True])
def test_without_odometry_the_measured_poses_go_on(use_gyro: bool) -> None:
    robot = far_robot()
    with Bench(robot, use_gyro=use_gyro) as bench:
        bench.drive(6.0)
        bench.with_wheels = False  # the motor board is unplugged, the robot is pushed on
        for _ in range(4):
            bench.drive(1.0)
            assert off(bench.newest(), robot.pose) < 0.08
            assert bench.kernel.now_ns() - bench.pose.stamp_ns < NS_PER_S // 5
        assert 'that of measured poses alone' in bench.warning
        assert bench.found['recovered'] == 0
        before = bench.newest()
        bench.with_wheels = True  # what the wheels turned meanwhile is not counted twice
        bench.drive(0.3, marks=False)
        assert off(bench.newest(), before) < 0.2
        bench.drive(2.0)
        assert off(bench.newest(), robot.pose) < 0.03
        assert bench.warning == ''


def test_measured_poses_alone_are_enough() -> None:
    robot = far_robot()
    with Bench(robot) as bench:
        bench.with_wheels = False
        bench.drive(5.0)
        assert off(bench.newest(), robot.pose) < 0.08
        assert 'no samples yet on odom' in bench.warning


def publish_odometry(odom: Publisher, x: float, stamp_ns: int = 0) -> None:
    odom.msg.pose.pose.position.x = x
    odom.msg.pose.pose.orientation.w = 1.0
    odom.publish(stamp_ns)


def only_localization(**settings: Any) -> tuple[ModuleBench, Localization, Publisher]:
    """Give localisation on odometry that the test makes, of no covariance."""
    bench = ModuleBench()
    odom = bench.topic('odom', 'nav_msgs/msg/Odometry',
                       {'header.frame_id': 'odom', 'child_frame_id': 'base_link'})
    module = bench.add(Localization, fix_topic='', initial_pose_known=True, **settings)
    return bench, module, odom


def test_odometry_that_jumps_is_not_followed_but_makes_the_pose_unsure() -> None:
    bench, module, odom = only_localization()
    with bench:
        for index in range(50):
            bench.at((index + 1) * DT_S, lambda index=index: publish_odometry(
                odom, 0.005 * index + (100.0 if index >= 25 else 0.0)))
        pose, transform = bench.watch('pose'), bench.watch('map_to_odom')
        before = module
        bench.run(1.1)
        assert before.statistics()['odom_jumps'] == 1
        while pose.take():
            transform.take()
        assert pose.msg.pose.pose.position.x == pytest.approx(0.005 * 48, abs=1e-6)
        assert transform.msg.transform.translation.x == pytest.approx(-100.005, abs=1e-6)


@pytest.mark.parametrize('variance', [0.0, -1.0, 1e300, math.nan])
def test_odometry_that_says_nothing_of_its_covariance_gets_one(variance: float) -> None:
    bench, module, odom = only_localization()
    odom.msg.twist.covariance[[0, 35]] = variance
    with bench:
        for index in range(101):
            bench.at((index + 1) * DT_S, lambda index=index: publish_odometry(odom, 0.01 * index))
        pose = bench.watch('pose')
        bench.run(2.1)
        while pose.take():
            pass
        covariance = pose.msg.pose.covariance
        # The settings' 0.1 m and 0.1 rad, what unequal wheels may do on this metre, some noise.
        assert math.sqrt(covariance[35]) == pytest.approx(math.hypot(0.1, 0.05), abs=0.005)
        assert math.sqrt(covariance[0]) == pytest.approx(0.1, abs=0.01)
        assert module.statistics()['warning'] == ''


def test_odometry_that_is_no_number_or_whose_clock_stands_still_is_left_out() -> None:
    bench, module, odom = only_localization()
    with bench:
        pose = bench.watch('pose')
        bench.at(0.1, lambda: publish_odometry(odom, 0.0))
        for index in range(5):
            bench.at(0.2 + index * DT_S, lambda: publish_odometry(odom, math.nan))
            bench.at(0.4 + index * DT_S, lambda: publish_odometry(odom, 0.1, NS_PER_S // 10))
        bench.run(2.0)
        found = module.statistics()
        assert (found['odom_not_finite'], found['odom_backwards']) == (5, 5)
        assert 'its clock has stood still' in found['warning']
        assert pose.take() and not pose.take()
        bench.at(0.1, lambda: publish_odometry(odom, 0.02))
        bench.run(0.2)
        assert pose.take()
        assert pose.msg.pose.pose.position.x == pytest.approx(0.02, abs=1e-6)


def test_odometry_that_begins_anew_leaves_the_robot_where_it_is() -> None:
    bench, module, odom = only_localization()
    with bench:
        pose = bench.watch('pose')
        bench.at(3.0, lambda: publish_odometry(odom, 0.0))
        bench.at(3.1, lambda: publish_odometry(odom, 0.1))
        bench.at(3.2, lambda: publish_odometry(odom, 0.0, NS_PER_S))
        bench.at(3.3, lambda: publish_odometry(odom, 0.1, NS_PER_S + NS_PER_S // 10))
        bench.run(3.5)
        assert module.statistics()['odom_restarts'] == 1
        while pose.take():
            pass
        assert pose.msg.pose.pose.position.x == pytest.approx(0.2, abs=1e-6)


def test_a_gyroscope_that_is_silent_is_told_and_odometry_turns_instead() -> None:
    robot = far_robot()
    with Bench(robot, use_gyro=True) as bench:
        bench.drive(5.0)
        bench.with_imu = False
        bench.drive(5.0)
        assert 'no samples of imu/data' in bench.warning
        assert off(bench.newest(), robot.pose) < 0.03


def test_odometry_that_is_slow_is_not_taken_for_silent() -> None:
    bench = ModuleBench()
    odom = bench.topic('odom', 'nav_msgs/msg/Odometry',
                       {'header.frame_id': 'odom', 'child_frame_id': 'base_link'})
    marks = bench.topic('stargazer/pose', POSE, {'header.frame_id': 'map'})
    marks.msg.pose.pose.orientation.w = 1.0
    marks.msg.pose.covariance[[0, 7, 35]] = 1e-4, 1e-4, 3e-4
    with bench:
        module = bench.add(Localization, initial_pose_known=True)
        pose = bench.watch('pose')
        for index in range(8):
            bench.at(0.1 + index, lambda index=index: publish_odometry(odom, 0.1 * index))
            bench.at(0.6 + index, marks.publish)
        bench.run(8.5)
        stamps = []
        while pose.take():
            stamps.append(round(pose.stamp_ns / NS_PER_S, 1))
        # Of the first two there is no telling what the period is.
        assert [stamp for stamp in stamps if stamp > 2] == [2.1, 3.1, 4.1, 5.1, 6.1, 7.1]
        assert module.statistics()['accepted'] + module.statistics()['rejected'] == 7
