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

"""The module localization on the virtual clock: what it publishes, and what bad input does."""

from __future__ import annotations

import math
from typing import Any

import pytest

from rt_robot_os.errors import ConfigError
from rt_robot_os.modules.localization import Localization
from rt_robot_os.modules.odometry import Odometry
from rt_robot_os.motion.angles import yaw_of
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.differential import wheel_speeds
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.motion.poses import composed
from rt_robot_os.reports import formatted
from rt_robot_os.reports import Reports
from rt_robot_os.sim.world.drive_base import DriveBase
from rt_robot_os.sim.world.drive_base import STEP_NS
from rt_robot_os.sim.world_settings import WorldSettings
from rt_robot_os.testing.module_bench import ModuleBench
from rt_robot_os.tools.bench.localization.plant import DT_S
from rt_robot_os.tools.bench.localization.plant import eight
from rt_robot_os.tools.bench.localization.plant import off
from rt_robot_os.tools.bench.localization.plant import RADIUS_M
from rt_robot_os.tools.bench.localization.plant import Robot
from rt_robot_os.tools.bench.localization.plant import SEPARATION_M
from rt_robot_os.tools.bench.localization.plant import turned
from rt_robot_os.topics import Publisher
from rt_robot_os.units import NS_PER_S

pytest.importorskip('nav_msgs', reason='ROS 2 messages are not installed')

POSE = 'geometry_msgs/msg/PoseWithCovarianceStamped'
JOINTS = {'header.frame_id': 'base_link', 'name': ['left_wheel_joint', 'right_wheel_joint'],
          'position': 2, 'velocity': 2, 'effort': 0}
STDDEV_M, STDDEV_RAD = 0.01, math.radians(1.0)


class Bench(ModuleBench):
    """A robot that drives, with odometry and localisation on it."""

    def __init__(self, robot: Robot, frame: str = 'map', **settings: Any) -> None:
        super().__init__()
        self.robot = robot
        self.joints = self.topic('joint_states', 'sensor_msgs/msg/JointState', JOINTS)
        self.imu = self.topic('imu/data', 'sensor_msgs/msg/Imu', {'header.frame_id': 'imu_link'})
        self.marks = self.topic('stargazer/pose', POSE, {'header.frame_id': frame})
        self.told = self.topic('initialpose', POSE, {'header.frame_id': 'map'})
        self.slam = self.topic('slam/pose', POSE, {'header.frame_id': 'map'})
        self.loops = self.topic('slam/correction', POSE, {'header.frame_id': 'map'})
        self.add(Odometry, 'odometry', wheel_radius_m=RADIUS_M, wheel_separation_m=SEPARATION_M)
        self.module = self.add(Localization, initial_pose_topic='initialpose', **settings)
        self.pose = self.watch('pose')
        self.transform = self.watch('map_to_odom')
        self.odom = self.watch('odom')
        self.mark_every = 5
        self.with_imu = self.with_wheels = True
        self.attitude: tuple[float, float] | None = None
        self.delay_s = 0.0
        self.time_s = 0.0
        # Who says where the robot is, and how its map lies on the true one.
        self.source = self.marks
        self.map_at: Pose = (0.0, 0.0, 0.0)
        # How the map of a SLAM beside the marks lies on the true one.
        self.slam_at: Pose | None = None

    def mark(self, pose: Pose, stamp_ns: int = 0, to: Publisher | None = None,
             stddev_m: float = STDDEV_M) -> None:
        to = to or self.source
        to.msg.pose.pose.position = pose[0], pose[1], 0.0
        to.msg.pose.pose.orientation = 0.0, 0.0, math.sin(pose[2] / 2), math.cos(pose[2] / 2)
        to.msg.pose.covariance[[0, 7, 35]] = stddev_m ** 2, stddev_m ** 2, STDDEV_RAD ** 2
        to.publish(stamp_ns)

    def drive(self, seconds: float, marks: bool = True) -> None:
        """Go on driving, and look at landmarks."""
        steps = round(seconds / DT_S)
        for index in range(steps):
            def go(index: int = index) -> None:
                self.robot.step()
                if self.with_wheels:
                    self.joints.msg.position[:] = self.robot.angles
                    self.joints.publish()
                if self.with_imu:
                    self.inertial()
                if marks and index % self.mark_every == 0:
                    seen, stamp_ns = self.robot.seen(STDDEV_M, STDDEV_RAD), self.kernel.now_ns()
                    self.later.append((index + round(self.delay_s / DT_S),
                                       composed(self.map_at, seen), stamp_ns))
                if self.slam_at is not None and index % self.mark_every == 3:
                    self.mark(composed(self.slam_at, self.robot.pose), to=self.slam)
                while self.later and self.later[0][0] <= index:
                    self.mark(*self.later.pop(0)[1:])

            self.at((index + 1) * DT_S, go)
        self.later: list[tuple[int, Pose, int]] = []
        self.run(seconds + DT_S / 2)

    def inertial(self) -> None:
        """Publish what the inertial sensor says; with an orientation when there is one."""
        message = self.imu.msg
        message.angular_velocity = 0.0, 0.0, self.robot.gyro()
        message.orientation_covariance[0] = -1.0
        if self.attitude is not None:
            offset, pitch = self.attitude
            message.orientation = Mounting(
                rotation_rad=(0.0, pitch, self.robot.pose[2] + offset)).quaternion()
            message.orientation_covariance[0] = 1e-4
        self.imu.publish()

    def newest(self) -> Pose:
        while self.pose.take():
            pass
        assert self.pose.seq >= 0
        return pose_of(self.pose.msg)

    @property
    def found(self) -> dict[str, Any]:
        return dict(self.module.statistics())

    @property
    def warning(self) -> str:
        return str(self.found['warning'])


def pose_of(message: Any) -> Pose:
    position, q = message.pose.pose.position, message.pose.pose.orientation
    return position.x, position.y, yaw_of(q.x, q.y, q.z, q.w)


def far_robot(**changes: Any) -> Robot:
    return Robot(eight, pose=(3.44, 1.0, 2.0), right_error=0.01, gyro_bias=0.02,
                 gyro_stddev=0.005, **changes)


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


# ---- bad input -------------------------------------------------------------------------------


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
