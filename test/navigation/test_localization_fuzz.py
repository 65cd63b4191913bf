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

"""Whatever comes in, what odometry and localisation publish are poses."""

from __future__ import annotations

import math
from typing import Any

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import numpy as np
import pytest

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.navigation.localization import Localization
from rt_robot_os.features.navigation.odometry import Odometry
from rt_robot_os.testing.module_bench import ModuleBench

pytest.importorskip('nav_msgs', reason='ROS 2 messages are not installed')

POSE = 'geometry_msgs/msg/PoseWithCovarianceStamped'
JOINTS = {'header.frame_id': 'base_link', 'name': ['left_wheel_joint', 'right_wheel_joint'],
          'position': 2, 'velocity': 2, 'effort': 0}
# Numbers that occur, and those that should not.
NUMBERS = st.one_of(st.floats(-3.0, 3.0), st.floats(), st.sampled_from(
    [0.0, -1.0, 1e-300, 1e300, -1e300, math.nan, math.inf, 1e9]))
# Seconds from now: in time, late, too late, from the future.
STAMPS = st.one_of(st.just(0.0), st.floats(-3.0, 0.0), st.floats(0.0, 10.0))
EVENTS = st.lists(st.tuples(
    st.sampled_from(['odom', 'odom', 'imu', 'fix', 'fix', 'told', 'drive', 'drive', 'wheels']),
    STAMPS, st.lists(NUMBERS, min_size=8, max_size=8)), min_size=1, max_size=20)


def finite(message: Any) -> bool:
    position, q = message.pose.pose.position, message.pose.pose.orientation
    covariance = message.pose.covariance.reshape(6, 6)
    return bool(all(map(math.isfinite, (position.x, position.y, q.z, q.w)))
                and math.hypot(q.z, q.w) == pytest.approx(1.0)
                and np.isfinite(covariance).all() and (covariance == covariance.T).all()
                and (np.diag(covariance) >= 0).all())


@given(EVENTS, st.booleans(), st.booleans())
@settings(max_examples=25, deadline=None)
def test_whatever_comes_in_what_goes_out_is_a_pose(
        events: list[tuple[str, float, list[float]]], gyro: bool, heading: bool) -> None:
    with ModuleBench() as bench:
        odom = bench.topic('odom', 'nav_msgs/msg/Odometry',
                           {'header.frame_id': 'odom', 'child_frame_id': 'base_link'})
        imu = bench.topic('imu/data', 'sensor_msgs/msg/Imu', {'header.frame_id': 'imu_link'})
        fix = bench.topic('stargazer/pose', POSE, {'header.frame_id': 'map'})
        told = bench.topic('initialpose', POSE, {'header.frame_id': 'map'})
        wheels = bench.topic('joint_states', 'sensor_msgs/msg/JointState', JOINTS)
        bench.add(Localization, use_gyro=gyro, use_imu_heading=heading,
                  initial_pose_topic='initialpose', initial_pose_known=True, rate_hz=50.0)
        bench.add(Odometry, 'wheels', use_gyro=gyro, wheel_radius_m=0.05, wheel_separation_m=0.3,
                  odom_topic='wheel_odom', odom_to_base_topic='wheel_transform')
        pose, wheel_odom = bench.watch('pose'), bench.watch('wheel_odom')

        def happen(kind: str, ahead_s: float, v: list[float]) -> None:
            stamp_ns = max(1, bench.kernel.now_ns() + round(ahead_s * NS_PER_S))
            if kind == 'drive':  # what usually comes
                v = [bench.kernel.now_ns() / NS_PER_S * 0.3, 0.0, 0.0, 1.0, 1e-4, 0.0, 0.0, 1e-4]
                stamp_ns = 0
            if kind in ('odom', 'drive'):
                message = odom.msg
                message.pose.pose.position = v[0], v[1], 0.0
                message.pose.pose.orientation = 0.0, 0.0, v[2], v[3]
                message.twist.covariance[[0, 5, 30, 35]] = v[4:8]
                odom.publish(stamp_ns)
            elif kind == 'imu':
                imu.msg.angular_velocity = v[0], v[1], v[2]
                imu.msg.orientation = v[3], v[4], v[5], v[6]
                imu.msg.orientation_covariance[[0, 8]] = v[6:8]
                imu.publish(stamp_ns)
            elif kind == 'wheels':
                wheels.msg.position[:] = v[:2]
                wheels.publish(stamp_ns)
            else:
                to = fix if kind == 'fix' else told
                to.msg.pose.pose.position = v[0], v[1], 0.0
                to.msg.pose.pose.orientation = 0.0, 0.0, v[2], v[3]
                to.msg.pose.covariance[[0, 1, 7, 11, 35]] = v[3:8]
                to.publish(stamp_ns)

        for index, event in enumerate(events):
            bench.at(0.1 * (index + 1), lambda event=event: happen(*event))
        for _ in range(len(events) // 10 + 1):
            bench.run(1.0)
            while pose.take():
                assert finite(pose.msg)
            while wheel_odom.take():
                assert finite(wheel_odom.msg)
