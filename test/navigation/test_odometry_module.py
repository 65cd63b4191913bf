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

"""The module odometry on the virtual clock: what it publishes, and what it says of bad input."""

from __future__ import annotations

import math
from typing import Any

from benchmarks.localization.plant import DT_S
from benchmarks.localization.plant import eight
from benchmarks.localization.plant import off
from benchmarks.localization.plant import RADIUS_M
from benchmarks.localization.plant import Robot
from benchmarks.localization.plant import SEPARATION_M
from benchmarks.localization.plant import turned
import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.navigation.odometry import Odometry
from rt_robot_os.motion.angles import yaw_of
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.testing.module_bench import ModuleBench

pytest.importorskip('nav_msgs', reason='ROS 2 messages are not installed')

JOINTS = {'header.frame_id': 'base_link', 'name': ['left_wheel_joint', 'right_wheel_joint'],
          'position': 2, 'velocity': 2, 'effort': 0}
BASE = {'wheel_radius_m': RADIUS_M, 'wheel_separation_m': SEPARATION_M}


class Bench(ModuleBench):
    """Odometry with wheels, and perhaps a gyroscope, that the test makes."""

    def __init__(self, use_gyro: bool = False, joints: dict[str, Any] | None = None,
                 mountings: dict[str, Mounting] | None = None, **settings: Any) -> None:
        super().__init__()
        self.joints = self.topic('joint_states', 'sensor_msgs/msg/JointState',
                                 joints or JOINTS, rate_hz=50.0)
        self.imu = self.topic('imu/data', 'sensor_msgs/msg/Imu',
                              {'header.frame_id': 'imu_link'}, rate_hz=100.0)
        self.module = self.add(Odometry, use_gyro=use_gyro, **{**BASE, **settings})
        self.module.mountings = mountings or {}
        self.odom = self.watch('odom')
        self.transform = self.watch('odom_to_base')

    def wheels(self, left_rad: float, right_rad: float, stamp_ns: int = 0) -> None:
        self.joints.msg.position[:] = left_rad, right_rad
        self.joints.publish(stamp_ns)

    def turning(self, rate_rad_s: float, stamp_ns: int = 0) -> None:
        self.imu.msg.angular_velocity = 0.0, 0.0, rate_rad_s
        self.imu.publish(stamp_ns)

    @property
    def warning(self) -> str:
        return str(self.module.statistics()['warning'])


def drive(bench: Bench, robot: Robot, seconds: float, imu: bool = True) -> None:
    """Let a robot drive, the gyroscope at twice the rate of the encoders."""
    for index in range(round(seconds / DT_S)):
        def go(index: int = index) -> None:
            for _ in range(2):
                robot.step(DT_S / 2)
            bench.wheels(*robot.angles)

        if imu:
            bench.at(index * DT_S + 0.007, lambda: bench.turning(robot.gyro()))
            bench.at(index * DT_S + 0.017, lambda: bench.turning(robot.gyro()))
        bench.at(index * DT_S + 0.02, go)
    bench.run(seconds + 0.03)


def last(bench: Bench) -> Any:
    while bench.odom.take():
        pass
    return bench.odom.msg


def pose_of(message: Any) -> tuple[float, float, float]:
    position, q = message.pose.pose.position, message.pose.pose.orientation
    return position.x, position.y, yaw_of(q.x, q.y, q.z, q.w)


def test_odometry_has_pose_velocity_frames_and_the_stamp_of_the_wheels() -> None:
    with Bench() as bench:
        bench.at(0.10, lambda: bench.wheels(1.0, 1.0, 90_000_000))
        bench.at(0.12, lambda: bench.wheels(1.2, 1.4, 110_000_000))
        bench.run(0.2)
        assert bench.odom.take()
        assert pose_of(bench.odom.msg) == (0.0, 0.0, 0.0)
        assert bench.odom.take()
        message = bench.odom.msg
        assert bench.odom.stamp_ns == 110_000_000
        assert (message.header.frame_id, message.child_frame_id) == ('odom', 'base_link')
        assert message.twist.twist.linear.x == pytest.approx(0.3 * RADIUS_M / DT_S)
        assert message.twist.twist.angular.z == pytest.approx(0.2 * RADIUS_M / 0.3 / DT_S)
        x, y, heading = pose_of(message)
        assert x == pytest.approx(0.015, abs=1e-5)
        assert heading == pytest.approx(0.2 * RADIUS_M / 0.3)
        covariance = message.pose.covariance.reshape(6, 6)
        assert (covariance == covariance.T).all()
        assert (covariance.diagonal() > 0).all()
        assert (message.twist.covariance.reshape(6, 6).diagonal() > 0).all()
        assert bench.transform.take() and bench.transform.take()
        transform = bench.transform.msg
        assert bench.transform.stamp_ns == 110_000_000
        assert (transform.header.frame_id, transform.child_frame_id) == ('odom', 'base_link')
        assert transform.transform.translation.x == x
        q = transform.transform.rotation
        assert yaw_of(q.x, q.y, q.z, q.w) == pytest.approx(heading)


def test_an_eight_ends_where_the_wheels_say() -> None:
    robot = Robot(eight)
    with Bench() as bench:
        drive(bench, robot, 20.0)
        assert off(pose_of(last(bench)), robot.pose) < 0.01


def test_a_gyroscope_with_a_bias_keeps_the_heading_of_a_robot_with_unequal_wheels() -> None:
    robot = Robot(eight, left_error=0.02, gyro_bias=0.03, gyro_stddev=0.003)
    with Bench(use_gyro=True) as bench:
        drive(bench, robot, 20.0)
        assert turned(pose_of(last(bench)), robot.pose) < math.radians(1.0)
        assert bench.module.statistics()['gyro_bias_rad_s'] == pytest.approx(0.03, abs=0.002)
        assert bench.module.statistics()['turn_from'] == 'gyro'
    robot = Robot(eight, left_error=0.02)
    with Bench() as bench:
        drive(bench, robot, 20.0)
        assert turned(pose_of(last(bench)), robot.pose) > math.radians(5.0)


def test_a_gyroscope_mounted_upside_down_turns_the_same_way() -> None:
    robot = Robot(eight)
    with Bench(use_gyro=True, mountings={
            'imu_link': Mounting(rotation_rad=(math.pi, 0.0, 0.4))}) as bench:
        upright = robot.gyro
        robot.gyro = lambda: -upright()  # type: ignore[method-assign]
        drive(bench, robot, 12.0)
        assert bench.module.statistics()['slips'] == 0
        assert turned(pose_of(last(bench)), robot.pose) < math.radians(1.0)


def test_the_pose_is_continuous_and_the_heading_of_many_turns_is_right() -> None:
    robot = Robot(lambda _: (0.0, 2.0))
    with Bench() as bench:
        before, stamp_ns, count = (0.0, 0.0, 0.0), 0, 0
        for _ in range(50):
            drive(bench, robot, 10 * DT_S, imu=False)
            while bench.odom.take():
                pose = pose_of(bench.odom.msg)
                assert turned(pose, before) < 0.05
                assert bench.odom.stamp_ns > stamp_ns
                before, stamp_ns = pose, bench.odom.stamp_ns
                count += 1
        assert count == 500
        # The first sample is the origin: a step less than the robot has made.
        assert turned(before, robot.pose) < 2.0 * DT_S + 0.005


# ---- bad input -------------------------------------------------------------------------------


def test_wheels_of_another_name_are_refused_with_those_that_are_there() -> None:
    with Bench(joints={**JOINTS, 'name': ['a', 'b']}) as bench:
        with pytest.raises(ConfigError, match="dut.left_joint = 'left_wheel_joint'.*has a, b|"
                                              'it has a, b'):
            bench.run(0.1)


def test_silence_is_followed_by_silence_and_told() -> None:
    with Bench() as bench:
        bench.run(0.1)
        assert 'no samples yet on joint_states' in bench.warning
        bench.at(0.0, lambda: bench.wheels(0.0, 0.0))
        bench.run(0.5)
        assert bench.warning == ''
        bench.run(3.0)
        assert 'joint_states has been silent for 3.5 s' in bench.warning
        assert bench.odom.take() and not bench.odom.take()


def test_a_clock_that_stands_still_is_told_and_moves_nothing() -> None:
    with Bench() as bench:
        for index in range(20):
            bench.at(0.1 + index * DT_S,
                     lambda index=index: bench.wheels(index * 0.1, index * 0.1, NS_PER_S // 10))
        bench.run(0.6)
        assert bench.module.statistics()['stopped'] == 19
        assert 'the clock of the source stands still' in bench.warning
        assert bench.odom.take() and not bench.odom.take()


def test_positions_that_are_no_numbers_are_told_and_never_published() -> None:
    with Bench() as bench:
        bench.at(0.1, lambda: bench.wheels(0.0, 0.0))
        for index in range(5):
            bench.at(0.12 + index * DT_S, lambda: bench.wheels(math.nan, 1e300))
        bench.run(0.25)
        assert bench.module.statistics()['not_finite'] == 5
        assert 'not finite' in bench.warning
        bench.at(0.0, lambda: bench.wheels(0.1, 0.1))
        bench.run(0.1)
        assert bench.warning == ''
        assert all(map(math.isfinite, pose_of(last(bench))))


def test_wheels_that_are_always_too_fast_are_told() -> None:
    with Bench(wheel_speed_max_m_s=0.05) as bench:
        for index in range(10):
            bench.at(index * DT_S + DT_S,
                     lambda index=index: bench.wheels(index * 1.0, index * 1.0))
        bench.run(0.3)
        assert 'wheel_speed_max_m_s 0.05' in bench.warning
        assert bench.module.statistics()['implausible'] == 9


def test_a_gyroscope_that_is_silent_is_told_and_the_wheels_go_on() -> None:
    robot = Robot(eight)
    with Bench(use_gyro=True) as bench:
        drive(bench, robot, 6.0, imu=False)
        assert 'no samples of imu/data' in bench.warning
        assert off(pose_of(last(bench)), robot.pose) < 0.01


def test_a_gyroscope_of_another_clock_is_told_and_the_wheels_go_on() -> None:
    robot = Robot(eight)
    with Bench(use_gyro=True) as bench:
        late = bench.turning
        bench.turning = lambda rate: late(  # type: ignore[method-assign]
            rate, bench.kernel.now_ns() + 5 * NS_PER_S)
        drive(bench, robot, 6.0)
        assert 'no samples of imu/data' in bench.warning
        assert off(pose_of(last(bench)), robot.pose) < 0.01


def test_a_gyroscope_that_says_nonsense_is_left_out() -> None:
    robot = Robot(eight)
    with Bench(use_gyro=True) as bench:
        robot.gyro = lambda: math.nan  # type: ignore[method-assign]
        drive(bench, robot, 6.0)
        assert bench.module.statistics()['gyro_not_finite'] > 100
        assert off(pose_of(last(bench)), robot.pose) < 0.01


def test_a_wheel_whose_encoder_is_broken_is_named() -> None:
    robot = Robot(lambda time_s: (0.3 if time_s > 1.5 else 0.0, 0.0))
    with Bench(use_gyro=True) as bench:
        real = bench.wheels
        bench.wheels = lambda left, right: real(0.0, right)  # type: ignore[method-assign]
        drive(bench, robot, 2.5)
        assert 'the left wheel reports no motion' in bench.warning
        assert turned(pose_of(last(bench)), robot.pose) < math.radians(2.0)
