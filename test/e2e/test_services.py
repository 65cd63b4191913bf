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

"""A robot with services: a text goes into the core and its answer comes back, and diagnoses."""

from __future__ import annotations

from collections.abc import Callable
import json
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')
pytest.importorskip('diagnostic_msgs', reason='ROS 2 messages are not installed')

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402, I100
from std_msgs.msg import String  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

Until = Callable[..., Any]

# What a module would do, the test does over ROS: it hears the commands and answers them.
YAML = """
/**:
  ros__parameters:
    core: {cpu: -2, scheduler_priority: 0, lock_memory: false}
    topics: [command, answer, open]
    command: {topic: alarms/command, message: std_msgs/msg/String, tail: 200}
    answer: {topic: alarms/answer, message: std_msgs/msg/String, tail: 300}
    open: {topic: alarms/list, message: std_msgs/msg/String, tail: 1000}
    mirrors: [commands, answers, list_in, list_out]
    commands: {topic: alarms/command}
    answers: {topic: alarms/answer, direction: in, reliability: reliable}
    list_in: {topic: alarms/list, ros_topic: list_in, direction: in, reliability: reliable}
    list_out: {topic: alarms/list, ros_topic: /alarms, as: diagnostic_msgs/msg/DiagnosticArray,
               durability: transient_local}
    services: [acknowledge, unheard]
    acknowledge: {service: ~/alarms/acknowledge, topic: alarms/command,
                  text: acknowledge all by ROS, answer_topic: alarms/answer, timeout_s: 30.0}
    unheard: {topic: alarms/command, text: unheard, answer_topic: alarms/answer, timeout_s: 0.1}
"""


def test_alarms_are_shown_and_acknowledged_over_ros(world: Any, until: Until) -> None:
    commands = world.listen(String, '/alarms/command')
    shown = world.listen(DiagnosticArray, '/alarms')
    status = world.listen(DiagnosticArray, '/diagnostics')
    answers = world.node.create_publisher(String, '/alarms/answer', 10)
    lists = world.node.create_publisher(String, '/list_in', 10)
    robot = world.robot(YAML)
    until(lambda: answers.get_subscription_count() and lists.get_subscription_count(), 'mirrors')
    client = world.node.create_client(Trigger, '/robot/alarms/acknowledge')
    until(client.service_is_ready, 'the service')
    asked = client.call_async(Trigger.Request())
    until(lambda: commands, 'the command')
    assert commands[0].data == 'acknowledge all by ROS'
    refused = world.call(Trigger, '/robot/unheard', Trigger.Request())
    assert not refused.success and 'it is not known whether it was done' in refused.message
    assert not asked.done()
    answers.publish(String(data=json.dumps(
        {'command': 'acknowledge all by ROS', 'ok': True, 'text': 'acknowledged 7'})))
    until(asked.done, 'the answer')
    assert (asked.result().success, asked.result().message) == (True, 'acknowledged 7')

    lists.publish(String(data='nonsense'))
    lists.publish(String(data=json.dumps({'status': [
        {'level': 2, 'name': 'alarm 7', 'hardware_id': 'anna', 'values': {'state': 'raised'}}]})))
    until(lambda: shown, 'the list of alarms')
    [alarm] = shown[0].status
    assert (alarm.level, alarm.hardware_id, alarm.values[0].value) == (b'\2', 'anna', 'raised')
    assert shown[0].header.stamp.sec > 1_000_000_000

    def values(name: str) -> dict[str, str]:
        found = [s for array in status[-1:] for s in array.status if s.name == name]
        return {each.key: each.value for s in found for each in s.values}

    until(lambda: values('robot: mirror alarms/list -> /alarms').get('refused') == '1', 'refusal')
    until(lambda: values('robot: service /robot/unheard').get('unanswered') == '1', 'counters')
    assert values('robot: service /robot/alarms/acknowledge')['done'] == '1'
    assert robot.end() == 0
