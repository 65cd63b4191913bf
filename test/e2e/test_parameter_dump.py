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

"""All parameters at once, as `ros2 param dump` asks for them, and a robot made from the dump."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from rcl_interfaces.msg import Parameter  # noqa: E402, I100
from rcl_interfaces.msg import ParameterType  # noqa: E402
from rcl_interfaces.msg import ParameterValue  # noqa: E402
from rcl_interfaces.srv import GetParameters  # noqa: E402
from rcl_interfaces.srv import ListParameters  # noqa: E402
from rcl_interfaces.srv import SetParameters  # noqa: E402
from rclpy.parameter import parameter_value_to_python  # noqa: E402
import yaml  # noqa: E402

pytestmark = pytest.mark.one_build

Until = Callable[..., Any]


def dump(world: Any) -> dict[str, Any]:
    listed = world.call(ListParameters, '/robot/list_parameters', ListParameters.Request())
    names = sorted(listed.result.names)
    values = world.call(
        GetParameters, '/robot/get_parameters', GetParameters.Request(names=names)).values
    assert len(values) == len(names)
    found = {name: parameter_value_to_python(value) for name, value in zip(names, values)}
    return {name: list(value) if hasattr(value, '__len__') and not isinstance(value, str)
            else value for name, value in found.items()}


def tree(values: dict[str, Any]) -> dict[str, Any]:
    root: dict[str, Any] = {}
    for name, value in values.items():
        *path, last = name.split('.')
        section = root
        for part in path:
            section = section.setdefault(part, {})
        section[last] = value
    return root


def test_a_dump_of_all_parameters_starts_the_same_robot(world: Any) -> None:
    robot = world.robot(None, '-p', 'core.cpu:=-2', '-p', 'core.scheduler_priority:=0')
    robot.wait_for_line('connected to the core')
    first = dump(world)
    assert first['imu.resources'] == [] and first['devices'] == ['imu', 'gps']
    assert robot.end() == 0
    text = yaml.dump({'/robot': {'ros__parameters': tree(first)}}, default_flow_style=False)
    robot = world.robot(text)
    robot.wait_for_line('connected to the core')
    assert dump(world) == first


LISTS = """
robot:
  ros__parameters:
    core: {cpu: -2, scheduler_priority: 0}
    modules: [guard]
    guard: {type: twist_guard, rate_hz: 50.0, priority: 40}
    topics: [cmd_vel]
    cmd_vel: {message: geometry_msgs/msg/Twist, depth: 8}
"""


def test_an_empty_list_is_taken_for_what_it_is_meant(world: Any) -> None:
    """Loaded from YAML, an empty list has the type that the loader gives it."""
    world.robot(LISTS).wait_for_line('connected to the core')
    for kind in (ParameterType.PARAMETER_BOOL_ARRAY, ParameterType.PARAMETER_BYTE_ARRAY):
        result = world.call(SetParameters, '/robot/set_parameters', SetParameters.Request(
            parameters=[Parameter(name='guard.resources', value=ParameterValue(type=kind))]))
        # It may not be changed while the robot runs, and that is all that is wrong with it.
        assert 'read-only' in result.results[0].reason
    assert dump(world)['guard.resources'] == []
