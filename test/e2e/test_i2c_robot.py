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

"""A robot with chips on I2C as its user starts it: emulated in another process, seen from ROS."""

from __future__ import annotations

from collections.abc import Callable
import math
import os
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402, I100
from geometry_msgs.msg import PoseWithCovarianceStamped  # noqa: E402
from rcl_interfaces.msg import Parameter  # noqa: E402
from rcl_interfaces.msg import ParameterType  # noqa: E402
from rcl_interfaces.msg import ParameterValue  # noqa: E402
from rcl_interfaces.srv import SetParameters  # noqa: E402
from sensor_msgs.msg import FluidPressure  # noqa: E402
from sensor_msgs.msg import Imu  # noqa: E402

pytestmark = pytest.mark.one_build

Until = Callable[..., Any]

ROBOT = """
robot:
  ros__parameters:
    core: {cpu: -2, scheduler_priority: 0}
    devices: [imu, baro]
    imu: {type: mpu6050, port: sim, output_rate_hz: 100.0, rate_hz: 200.0, axes: '-x -y z'}
    baro:
      type: bmp280
      port: sim
      rate_hz: 200.0
      timeout_s: 0.5
      retry_s: 0.1
      sim: {swing_m: 0.0, altitude_m: 100.0, faults: []}
    mirrors: [imu_out, pressure_out, altitude_out]
    imu_out: {topic: imu/data}
    pressure_out: {topic: baro/pressure}
    altitude_out: {topic: baro/altitude}
"""


def set_double(world: Any, name: str, value: float) -> Any:
    parameter = Parameter(name=name, value=ParameterValue(
        type=ParameterType.PARAMETER_DOUBLE, double_value=value))
    return world.call(SetParameters, '/robot/set_parameters',
                      SetParameters.Request(parameters=[parameter])).results[0]


def test_two_chips_on_one_bus_are_seen_from_ros(world: Any, until: Until) -> None:
    imu, pressure = world.listen(Imu, '/imu/data'), world.listen(FluidPressure, '/baro/pressure')
    robot = world.robot(ROBOT)
    until(lambda: len(imu) > 100 and len(pressure) > 25, 'samples of both chips')
    # Nobody but the core knows that both ports lead to one emulated bus.
    assert 'no device answers' not in robot.output
    sample = imu[-1]
    force = sample.linear_acceleration
    assert math.hypot(force.x, force.y, force.z) == pytest.approx(9.8, abs=0.3)
    assert sample.header.frame_id == 'imu_link' and sample.orientation_covariance[0] == -1
    assert pressure[-1].fluid_pressure == pytest.approx(100_129, abs=12)
    assert pressure[-1].variance == pytest.approx(1.69)
    stamps = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in list(imu)]
    assert all(a < b for a, b in zip(stamps, stamps[1:]))
    assert robot.end() == 0
    assert world.leftovers() == []


def test_the_pressure_at_sea_level_is_set_while_it_runs(world: Any, until: Until) -> None:
    altitude = world.listen(PoseWithCovarianceStamped, '/baro/altitude')
    world.robot(ROBOT)
    until(lambda: altitude and abs(altitude[-1].pose.pose.position.z - 100) < 2, '100 m')
    assert set_double(world, 'baro.sea_level_pa', 102_325.0).successful
    until(lambda: abs(altitude[-1].pose.pose.position.z - 183) < 2, '183 m')
    refused = set_double(world, 'baro.sea_level_pa', 5.0)
    assert not refused.successful and 'baro.sea_level_pa' in refused.reason


def test_a_chip_that_is_unplugged_is_told_and_comes_back(world: Any, until: Until) -> None:
    diagnostics = world.listen(DiagnosticArray, '/diagnostics')
    imu = world.listen(Imu, '/imu/data')
    # Again and again, for machines that have not started the robot by then.
    robot = world.robot(ROBOT.replace(
        'faults: []', "faults: ['unplug at 1 for 1', 'unplug at 8 for 1', 'unplug at 20 for 1']"))
    robot.wait_for_line('no device answers: check its power, SDA, SCL and pull-up resistors')
    seen = len(imu)
    until(lambda: len(imu) > seen + 50, 'the other chip on the same bus running on')
    robot.wait_for_line('active again after')
    until(lambda: any(s.name == 'robot: device baro' or 'baro' in s.name
                      for m in list(diagnostics) for s in m.status), 'diagnostics of it')


def test_a_port_that_does_not_exist_is_told_and_the_rest_runs(world: Any, until: Until) -> None:
    imu = world.listen(Imu, '/imu/data')
    robot = world.robot(ROBOT.replace('type: bmp280\n      port: sim',
                                      'type: bmp280\n      port: /dev/i2c-991'))
    robot.wait_for_line('I2C bus /dev/i2c-991 does not exist: ls /dev/i2c-')
    until(lambda: len(imu) > 20, 'the other chip')
    assert not os.path.exists('/dev/i2c-991')
