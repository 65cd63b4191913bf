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

"""Headings of an inertial sensor that do not fit: counted, reported, and believed in the end."""

from __future__ import annotations

import math
from typing import Any

from benchmarks.localization.plant import off
from benchmarks.localization.plant import Robot
from benchmarks.localization.plant import turned
from benchmarks.localization.recording import Line
from benchmarks.localization.replay import replay
from localization_bench import Bench
from localization_bench import far_robot
import pytest

from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.motion.quaternion import conjugate
from rt_robot_os.motion.quaternion import multiply
from rt_robot_os.motion.quaternion import rotate

pytest.importorskip('nav_msgs', reason='ROS 2 messages are not installed')


def outdoors(robot: Robot, **changes: Any) -> Bench:
    """Return a robot that has a gyroscope and a magnetometer, and no marks."""
    x, y, heading = robot.pose
    bench = Bench(robot, **{
        'use_gyro': True, 'use_imu_heading': True, 'imu_heading_stddev_rad': 0.05,
        'fix_topic': '', 'initial_pose_known': True, 'initial_x_m': x, 'initial_y_m': y,
        'initial_heading_rad': heading, 'initial_stddev_rad': 0.1, **changes})
    bench.attitude = 0.0, 0.0
    return bench


def test_a_wrong_heading_of_the_start_is_corrected_by_headings_that_agree() -> None:
    robot = far_robot()
    with outdoors(robot, initial_heading_rad=robot.pose[2] + 1.5) as bench:
        bench.drive(1.0, marks=False)
        found = bench.found
        assert found['headings_refused_in_row'] == found['headings_refused'] > 40
        assert turned(bench.newest(), robot.pose) > 1.0
        bench.drive(9.0, marks=False)
        found = bench.found
        assert found['headings_reopened'] == 1
        assert found['headings_refused_in_row'] == 0
        assert turned(bench.newest(), robot.pose) < math.radians(3.0)
        assert found['warning'] == ''


def test_what_was_driven_with_a_wrong_heading_is_doubted() -> None:
    robot = far_robot()
    with outdoors(robot, initial_heading_rad=robot.pose[2] + 1.5, kidnapped_s=5.0) as bench:
        bench.drive(12.0, marks=False)
        assert bench.found['headings_reopened'] == 1
        error_m = off(bench.newest(), robot.pose)
        assert 0.3 < error_m < 3 * bench.found['position_stddev_m']


def test_headings_that_are_refused_are_a_warning_with_the_angle() -> None:
    robot = far_robot()
    with outdoors(robot, kidnapped_s=0.0) as bench:
        bench.drive(3.0, marks=False)
        bench.attitude = 0.6, 0.0
        bench.drive(10.0, marks=False)
        found = bench.found
        assert found['headings_reopened'] == 0
        assert found['headings_refused_in_row'] > 400
        assert 'headings of imu/data have contradicted the estimate' in found['warning']
        assert 'by 34 degrees' in found['warning'] or 'by 35 degrees' in found['warning']
        assert turned(bench.newest(), robot.pose) < math.radians(5.0)


def test_a_magnetometer_that_stays_elsewhere_is_believed_without_marks() -> None:
    robot = far_robot()
    with outdoors(robot) as bench:
        bench.drive(5.0, marks=False)
        bench.attitude = 0.6, 0.0
        bench.drive(1.5, marks=False)
        assert bench.found['headings_reopened'] == 0
        bench.drive(4.0, marks=False)
        assert bench.found['headings_reopened'] == 1
        assert turned(bench.newest(), robot.pose) == pytest.approx(0.6, abs=0.05)


def test_marks_that_confirm_the_estimate_come_before_a_magnetometer() -> None:
    robot = far_robot()
    with outdoors(robot, fix_topic='stargazer/pose') as bench:
        bench.drive(5.0)
        bench.attitude = 0.6, 0.0
        bench.drive(10.0)
        found = bench.found
        assert (found['headings_reopened'], found['recovered']) == (0, 0)
        assert found['headings_refused_in_row'] > 400
        assert turned(bench.newest(), robot.pose) < math.radians(2.0)
        assert off(bench.newest(), robot.pose) < 0.05
        assert 'headings of imu/data have contradicted' in found['warning']


def test_iron_that_is_passed_changes_nothing() -> None:
    robot = far_robot()
    with outdoors(robot) as bench:
        for _ in range(3):
            bench.attitude = 0.0, 0.0
            bench.drive(3.0, marks=False)
            bench.attitude = 0.6, 0.0
            bench.drive(1.5, marks=False)
        found = bench.found
        assert found['headings_reopened'] == 0
        assert found['headings_refused'] > 150
        assert turned(bench.newest(), robot.pose) < math.radians(5.0)


def test_headings_that_do_not_agree_with_each_other_are_never_believed() -> None:
    robot = far_robot()
    with outdoors(robot) as bench:
        bench.drive(3.0, marks=False)
        for index in range(20):
            bench.attitude = 0.6 + 0.5 * (index % 4), 0.0
            bench.drive(0.5, marks=False)
        found = bench.found
        assert found['headings_reopened'] == 0
        assert found['headings_refused_in_row'] > 400
        assert turned(bench.newest(), robot.pose) < math.radians(10.0)


def test_a_bias_that_is_refused_at_rest_is_believed_in_the_end() -> None:
    robot = Robot(lambda time_s: (0.0, 0.0), gyro_bias=0.3)
    with Bench(robot, use_gyro=True, gyro_bias_stddev_rad_s=0.01, fix_topic='',
               initial_pose_known=True) as bench:
        bench.drive(1.5)
        assert bench.found['rests_refused'] > 10
        bench.drive(6.0)
        found = bench.found
        assert found['rests_reopened'] == 1
        assert found['drift'] == pytest.approx(0.3, abs=0.01)


def around_a_field(time_s: float) -> tuple[float, float]:
    """Drive 8 s straight on, then turn by a quarter in 2 s, again and again."""
    return 0.5, 0.0 if time_s % 10.0 < 8.0 else math.pi / 4


def drive_of(mounted: Mounting, seconds: float = 20.0) -> list[Line]:
    """Return what the sensors of a robot say on a drive, the inertial one mounted somehow."""
    robot = Robot(around_a_field, pose=(0.0, 0.0, 2.0), gyro_bias=0.02, gyro_stddev=0.005)
    sensor = mounted.quaternion()
    lines = []
    for step in range(round(seconds / 0.02)):
        robot.step()
        time_s = robot.time_s
        x, y, heading = robot.pose
        lines.append(Line(time_s, 'odom', (x, y, math.sin(heading / 2), math.cos(heading / 2),
                                           0.0, 0.0, 0.0, 1e-4, 1e-2)))
        attitude = Mounting(rotation_rad=(0.0, 0.0, heading)).quaternion()
        rate = rotate(conjugate(sensor), (0.0, 0.0, robot.gyro()))
        weight = rotate(conjugate(sensor), (0.0, 0.0, 9.81))
        lines.append(Line(time_s, 'imu', (*multiply(attitude, sensor), *rate, *weight)))
        if step % 50 == 0:
            lines.append(Line(time_s, 'truth', robot.pose))
    return lines


@pytest.mark.parametrize('rotation_rad', [(math.pi, 0.0, 0.0), (0.0, math.pi / 2, 0.0),
                                          (0.0, 0.5, 1.0)],
                         ids=['upside down', 'on end', 'tilted'])
def test_gravity_shows_that_the_mounting_is_another_one(
        rotation_rad: tuple[float, float, float]) -> None:
    mounted = Mounting(rotation_rad=rotation_rad)
    lines = drive_of(mounted)
    wrong, right = replay(lines), replay(lines, mounted)
    off_deg = math.degrees(math.hypot(*rotation_rad[:2]))
    assert wrong.statistics['gyro_gravity_off_deg'] == pytest.approx(off_deg, abs=1.0)
    assert f'gravity on imu/data is {off_deg:.0f} degrees from' in wrong.statistics['warning']
    assert right.statistics['gyro_gravity_off_deg'] == pytest.approx(0.0, abs=1.0)
    assert (right.statistics['warning'], right.statistics['headings_refused_in_row']) == ('', 0)
    assert max(right.errors()[0]) < 0.1


def test_a_sensor_that_is_mounted_turned_does_not_lock_the_heading_out() -> None:
    # The held-out drive: the wrong mounting turns the rate round, and headings stop fitting.
    lines = drive_of(Mounting(rotation_rad=(math.pi, 0.0, 0.0)), 60.0)
    drive = replay(lines)
    statistics = drive.statistics
    assert statistics['headings_refused'] > 500
    assert statistics['headings_reopened'] > 3
    assert 'gravity' in statistics['warning']
    # Round a square of 4 m: while the gate stays closed it goes up to 10.5 m off.
    assert max(drive.errors()[0]) < 6.0
