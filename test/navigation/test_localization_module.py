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

"""The module localization on the virtual clock: what it publishes, and where it finds itself."""

from __future__ import annotations

import math

from benchmarks.localization.plant import DT_S
from benchmarks.localization.plant import eight
from benchmarks.localization.plant import off
from benchmarks.localization.plant import RADIUS_M
from benchmarks.localization.plant import Robot
from benchmarks.localization.plant import SEPARATION_M
from benchmarks.localization.plant import turned
from localization_bench import Bench
from localization_bench import far_robot
from localization_bench import pose_of
import pytest

from rt_robot_os.base.reports import formatted
from rt_robot_os.base.reports import Reports
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.motion.angles import yaw_of
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.differential import wheel_speeds
from rt_robot_os.motion.poses import composed
from rt_robot_os.sim.world.drive_base import DriveBase
from rt_robot_os.sim.world.drive_base import STEP_NS
from rt_robot_os.sim.world_settings import WorldSettings

pytest.importorskip('nav_msgs', reason='ROS 2 messages are not installed')


@pytest.mark.parametrize('use_gyro', [False, True])
def test_the_robot_is_found_and_followed(use_gyro: bool) -> None:
    robot = far_robot()
    with Bench(robot, use_gyro=use_gyro) as bench:
        bench.drive(20.0)
        assert off(bench.newest(), robot.pose) < 0.03
        assert turned(bench.newest(), robot.pose) < math.radians(2.0)
        found = bench.found
        assert found['located'] and found['warning'] == ''
        assert found['accepted'] > 190
        assert 0.8 < found['nis'] < 1.25
        if use_gyro:
            assert found['drift'] == pytest.approx(0.02, abs=0.005)


def test_poses_have_the_stamps_of_odometry_and_map_to_odom_leads_to_them() -> None:
    robot = far_robot()
    with Bench(robot) as bench:
        for _ in range(20):
            bench.drive(0.2)
            odometry: dict[int, Pose] = {}
            while bench.odom.take():
                odometry[bench.odom.stamp_ns] = pose_of(bench.odom.msg)
            while bench.pose.take():
                assert bench.transform.take()
                stamp_ns = bench.pose.stamp_ns
                assert bench.transform.stamp_ns == stamp_ns
                transform = bench.transform.msg
                assert (transform.header.frame_id, transform.child_frame_id) == ('map', 'odom')
                assert bench.pose.msg.header.frame_id == 'map'
                t, q = transform.transform.translation, transform.transform.rotation
                again = composed((t.x, t.y, yaw_of(q.x, q.y, q.z, q.w)), odometry[stamp_ns])
                assert off(again, pose_of(bench.pose.msg)) < 1e-9
                assert turned(again, pose_of(bench.pose.msg)) < 1e-9
                covariance = bench.pose.msg.pose.covariance.reshape(6, 6)
                assert (covariance == covariance.T).all()
                assert (covariance.diagonal() > 0).all()
        assert bench.pose.seq > 150


def test_nothing_is_published_before_the_pose_is_known() -> None:
    with Bench(far_robot()) as bench:
        bench.drive(3.0, marks=False)
        assert not bench.pose.take() and not bench.transform.take()
        assert 'the pose is not known yet' in bench.warning
        assert 'stargazer/pose' in bench.warning


def test_a_pose_from_the_settings_is_where_it_begins() -> None:
    robot = far_robot()
    with Bench(robot, fix_topic='', initial_pose_known=True, initial_x_m=3.44, initial_y_m=1.0,
               initial_heading_rad=2.0, initial_stddev_m=0.05) as bench:
        bench.drive(8.0, marks=False)
        assert off(bench.newest(), robot.pose) < 0.05


def test_a_pose_that_a_person_gives_is_taken_over() -> None:
    robot = far_robot()
    with Bench(robot, fix_topic='') as bench:
        bench.drive(4.0, marks=False)
        assert not bench.pose.take()
        bench.mark(robot.pose, to=bench.told, stddev_m=0.5)  # as RViz sends it
        bench.drive(4.0, marks=False)
        assert off(bench.newest(), robot.pose) < 0.1
        # The clock of the machine with RViz is another one; it does not matter.
        bench.mark((-7.0, 2.0, 0.0), bench.kernel.now_ns() + 9 * NS_PER_S, to=bench.told,
                   stddev_m=0.5)
        bench.drive(0.1, marks=False)
        assert off(bench.newest(), (-7.0, 2.0, 0.0)) < 0.1
        reports = Reports()
        bench.module.log.connect(reports, bench.kernel.now_ns)
        bench.mark((math.nan, 2.0, 0.0), to=bench.told)
        bench.drive(0.1, marks=False)
        assert off(bench.newest(), (-7.0, 2.0, 0.0)) < 0.1
        bench.drive(3.0, marks=False)
        texts = [str(formatted(line)) for line, _ in reports.lines]
        assert ['initialpose was refused' in text for text in texts] == [True]


class Simulated(Robot):
    """The base of the simulated world, with motors that lag and wheels that slip."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.base = DriveBase(
            WorldSettings(start=self.pose, seed=self.seed, slip=0.02, slip_noise=0.05,
                          wheel_radius_error=(0.0, 0.01)),
            wheel_radius_m=RADIUS_M, wheel_separation_m=SEPARATION_M)

    def step(self, dt_s: float = DT_S) -> None:
        speed, rate = self.drive(self.time_s)
        self.time_s += dt_s
        left, right = wheel_speeds(speed, rate, SEPARATION_M)
        self.base.set_wheel_speeds(left / RADIUS_M, right / RADIUS_M)
        for _ in range(round(dt_s * NS_PER_S) // STEP_NS):
            self.base.step()
        self.left_rad, self.right_rad = self.base.wheel_angles
        self.pose = self.base.pose
        self.rate_rad_s = self.base.velocity[1]


@pytest.mark.parametrize('seed', [1, 2, 3])
def test_a_base_with_dynamics_and_slip_is_followed(seed: int) -> None:
    robot = Simulated(eight, pose=(3.44, 1.0, 2.0), gyro_bias=0.02, gyro_stddev=0.005, seed=seed)
    with Bench(robot, use_gyro=True) as bench:
        bench.drive(10.0)
        for _ in range(5):
            bench.drive(1.0)
            assert off(bench.newest(), robot.pose) < 0.05
            assert turned(bench.newest(), robot.pose) < math.radians(2.0)
        bench.drive(10.0, marks=False)
        assert off(bench.newest(), robot.pose) < 0.15
        bench.drive(2.0)
        assert off(bench.newest(), robot.pose) < 0.05
        assert bench.found['recovered'] == 0


def test_a_robot_that_is_carried_away_is_found_and_the_jump_is_told() -> None:
    robot, reports = far_robot(), Reports()
    with Bench(robot, use_gyro=True) as bench:
        bench.module.log.connect(reports, bench.kernel.now_ns)
        bench.drive(5.0)
        x, y, heading = robot.pose
        robot.pose = x + 2.0, y, heading + 1.0
        bench.drive(1.5)
        assert 'have contradicted the estimate' in bench.warning
        bench.drive(3.5)
        assert off(bench.newest(), robot.pose) < 0.05
        assert bench.found['recovered'] == 1
        assert bench.found['jump_m'] > 1.5
        assert bench.warning == ''
        texts = [str(formatted(line)) for line, _ in reports.lines]
        assert sum('the pose jumps by 2.' in text for text in texts) == 1
        assert sum('found at (3.4' in text for text in texts) == 1


def test_false_marks_do_not_move_the_pose() -> None:
    robot = far_robot()
    with Bench(robot, use_gyro=True) as bench:
        bench.drive(5.0)
        for _ in range(5):
            before = bench.newest()
            bench.mark(robot.misled())
            bench.drive(DT_S * 2, marks=False)
            deviation = bench.found['position_stddev_m']
            assert off(bench.newest(), before) < 0.02 + 3 * deviation
        assert bench.found['recovered'] == 0


def test_a_dead_zone_is_no_error_but_its_time_and_doubt_are_told() -> None:
    robot = far_robot()
    with Bench(robot, use_gyro=True, stddev_warn_m=0.02) as bench:
        bench.drive(5.0)
        sure = bench.found['position_stddev_m']
        bench.drive(10.0, marks=False)
        assert off(bench.newest(), robot.pose) < 0.15
        found = bench.found
        assert found['dead_time_s'] == pytest.approx(9.0, abs=0.2)
        assert found['position_stddev_m'] > 1.5 * sure
        assert 'no measured poses are used' in found['warning']
        bench.drive(2.0)
        assert bench.found['dead_time_s'] == pytest.approx(9.0, abs=0.2)
        assert bench.warning == ''


def test_marks_that_are_late_are_put_in_their_place() -> None:
    robot = far_robot()
    with Bench(robot, use_gyro=True) as bench:
        bench.delay_s = 0.5
        bench.drive(15.0)
        assert off(bench.newest(), robot.pose) < 0.03
        found = bench.found
        assert found['late'] > 100
        assert found['latest_ms'] == pytest.approx(500.0, abs=30.0)
        assert 0.8 < found['nis'] < 1.25


def test_a_second_source_counts_as_well() -> None:
    robot = far_robot()
    with Bench(robot, use_gyro=True, second_fix_topic='slam/pose') as bench:
        bench.drive(4.0)
        accepted = bench.found['accepted']
        for _ in range(5):
            bench.mark(robot.pose, to=bench.slam)
            bench.drive(0.1, marks=False)
        assert bench.found['accepted'] == accepted + 5


def test_the_heading_of_a_magnetometer_and_the_slope_are_used() -> None:
    robot = far_robot()
    with Bench(robot, use_gyro=True, use_imu_heading=True, imu_heading_offset_rad=-0.7,
               imu_heading_stddev_rad=0.05, fix_topic='', initial_pose_known=True,
               initial_x_m=3.44, initial_y_m=1.0, initial_heading_rad=2.3,
               initial_stddev_rad=0.5) as bench:
        bench.attitude = 0.7, 0.0
        bench.drive(10.0, marks=False)
        assert turned(bench.newest(), robot.pose) < math.radians(1.0)
        before, start = bench.newest(), robot.pose
        bench.attitude = 0.7, 0.5  # uphill or downhill: the map is seen from above
        bench.drive(2.0, marks=False)
        moved_m, rolled_m = off(bench.newest(), before), off(robot.pose, start)
        assert moved_m == pytest.approx(rolled_m * math.cos(0.5), rel=0.03)
        bench.attitude = None  # a sensor that says it has none
        bench.drive(1.0, marks=False)
        assert bench.warning == ''
