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

"""use_sim_time: the core's time is real, stamps follow /clock where there is one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from builtin_interfaces.msg import Time  # noqa: E402, I100
from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from rosgraph_msgs.msg import Clock  # noqa: E402
from sensor_msgs.msg import Imu  # noqa: E402

pytestmark = pytest.mark.one_build

Until = Callable[..., Any]


# What is not a setting: for how long the node waits for a first /clock before it warns.
PATIENT_FOR_HALF_A_SECOND = """
from rt_robot_os.ros import ros_time
ros_time._PATIENCE_S = 0.5
"""


def seconds(message: Any) -> float:
    return float(message.header.stamp.sec + message.header.stamp.nanosec / 1e9)


def test_stamps_follow_a_clock_and_without_one_the_robot_runs_on(
        world: Any, until: Until) -> None:
    imu = world.listen(Imu, '/imu/data')
    diagnostics = world.listen(DiagnosticArray, '/diagnostics')
    robot = world.robot(None, '-p', 'core.cpu:=-2', '-p', 'core.scheduler_priority:=0',
                        '-p', 'use_sim_time:=true', prelude=PATIENT_FOR_HALF_A_SECOND)
    robot.wait_for_line('/clock is not published')
    now = world.node.get_clock().now().nanoseconds / 1e9
    until(lambda: len(diagnostics) > 2 and imu, 'diagnostics and samples without a clock')
    assert abs(seconds(diagnostics[-1]) - now) < 120
    assert abs(seconds(imu[-1]) - now) < 120
    clock = world.node.create_publisher(Clock, '/clock', 10)

    def simulated(at: float) -> Callable[[], bool]:
        def look() -> bool:
            clock.publish(Clock(clock=Time(sec=int(at))))
            return (abs(seconds(imu[-1]) - at) < 5 and abs(seconds(diagnostics[-1]) - at) < 5)
        return look

    until(simulated(1000.0), 'stamps of simulated time')
    until(simulated(500.0), 'stamps of a simulation that began anew')
    assert sum('/clock is not published' in line for line in robot.lines) == 1
    assert robot.end() == 0
