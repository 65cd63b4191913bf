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

"""Samples that may wait on their way to ROS: all come, in order, and the setting can change."""

from __future__ import annotations

from collections.abc import Callable
import struct
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402, I100
from geometry_msgs.msg import Vector3  # noqa: E402
from rcl_interfaces.msg import Parameter  # noqa: E402
from rcl_interfaces.msg import ParameterType  # noqa: E402
from rcl_interfaces.msg import ParameterValue  # noqa: E402
from rcl_interfaces.srv import SetParameters  # noqa: E402
from rt_robot_os.link import LinkClient  # noqa: E402
from rt_robot_os.link.client import LinkSilent  # noqa: E402

pytestmark = pytest.mark.one_build

Until = Callable[..., Any]

ROBOT = """
robot:
  ros__parameters:
    core: {cpu: -2, scheduler_priority: 0}
    topics: [numbers]
    numbers: {message: geometry_msgs/msg/Vector3, depth: 512}
    mirrors: [out]
    out: {topic: numbers, depth: 2000, delay_ms: 40.0}
"""


def set_delay(world: Any, delay_ms: float) -> Any:
    request = SetParameters.Request(parameters=[Parameter(
        name='out.delay_ms', value=ParameterValue(
            type=ParameterType.PARAMETER_DOUBLE, double_value=delay_ms))])
    return world.call(SetParameters, '/robot/set_parameters', request).results[0]


def mirror_of(watch: LinkClient) -> dict[str, Any]:
    """Give what the core says of the node's mirror."""
    for client in watch.statistics().clients:
        if client['name'] == 'robot' and client['mirrors']:
            mirror: dict[str, Any] = client['mirrors'][0]
            return mirror
    return {}


def shown(diagnostics: list[Any]) -> dict[str, str]:
    """Give the last row of the mirror in /diagnostics."""
    for message in reversed(list(diagnostics)):
        for status in message.status:
            if status.name == 'robot: mirror numbers -> numbers':
                return {v.key: v.value for v in status.values}
    return {}


def test_what_may_wait_comes_complete_and_in_order_while_the_delay_changes(
        world: Any, until: Until) -> None:
    came = world.listen(Vector3, '/numbers')
    diagnostics = world.listen(DiagnosticArray, '/diagnostics')
    robot = world.robot(ROBOT)
    robot.wait_for_line('connected to the core')
    with LinkClient(world.folder / 'robot.sock', 'test') as client:
        channel = client.advertise('numbers')

        def publish(number: int) -> None:
            try:
                client.publish(channel, b'\0\1\0\0' + struct.pack('<3d', number, 0, 0))
            except LinkSilent:  # the core lets those wait who send much
                until(lambda: not client.pump(0.01), 'room')
                publish(number)

        def heard() -> bool:
            publish(0)
            return bool(came)

        until(heard, 'a first sample')
        until(lambda: mirror_of(client)['delay_ms'] == 20.0 and shown(diagnostics).get(
            'delay_ms') == '40', 'the delay, one half of it in the core')
        last = 0
        for delay_ms in (100.0, 0.0, 10.0):
            assert set_delay(world, delay_ms).successful
            assert mirror_of(client)['delay_ms'] == delay_ms / 2
            for number in range(last + 1, last + 301):
                publish(number)
            last += 300
        until(lambda: came[-1].x == last, 'the last sample')
        numbers = [m.x for m in came if m.x]
        assert numbers == list(range(1, last + 1))
        counted = mirror_of(client)
        assert counted['sent'] == counted['published']
        refused = set_delay(world, 100.1)
        assert not refused.successful and 'out.delay_ms' in refused.reason
    assert robot.end() == 0
