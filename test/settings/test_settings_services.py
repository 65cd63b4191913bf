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

"""Services of the node are checked with the rest of the settings."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('std_msgs.msg', reason='the ROS 2 messages are not installed')

from rt_robot_os.base.errors import ConfigError  # noqa: E402, I100
from rt_robot_os.settings import from_json  # noqa: E402
from rt_robot_os.settings import load  # noqa: E402
from rt_robot_os.settings import parameters  # noqa: E402
from rt_robot_os.settings import RobotSettings  # noqa: E402
from rt_robot_os.settings import to_json  # noqa: E402

TEXT = 'std_msgs/msg/String'
TOPICS = {'command': {'topic': 'alarms/command', 'message': TEXT, 'tail': 40},
          'answer': {'topic': 'alarms/answer', 'message': TEXT, 'tail': 40},
          'map': {'message': 'nav_msgs/msg/OccupancyGrid', 'fixed': {'header.frame_id': 'map'},
                  'tail': 100},
          'speed': {'message': 'std_msgs/msg/Float64'},
          'name': {'message': TEXT, 'fixed': {'data': 'anna'}}}
GOOD: dict[str, Any] = {'topic': 'alarms/command', 'text': 'acknowledge all by ROS'}

LOAD = {**GOOD, 'type': 'nav_msgs/srv/LoadMap', 'text': 'load {map_url}'}
GET = {'type': 'nav_msgs/srv/GetMap', 'topic': 'map'}


def robot(tmp_path: Path, **services: dict[str, Any]) -> RobotSettings:
    path = tmp_path / 'robot.yaml'
    path.write_text(json.dumps({'robot': {'ros__parameters': {
        'topics': list(TOPICS), 'services': list(services), **TOPICS, **services}}}))
    return load([path])


def test_a_service_is_named_after_its_section_unless_it_says_another(tmp_path: Path) -> None:
    found = robot(tmp_path, acknowledge=GOOD, test={**GOOD, 'service': '/alarms/test',
                                                    'answer_topic': 'alarms/answer'})
    assert [(each.name, each.service, each.answer_topic, each.timeout_s)
            for each in found.services] == [
        ('acknowledge', '~/acknowledge', '', 2.0), ('test', '/alarms/test', 'alarms/answer', 2.0)]
    assert from_json(to_json(found)).services == found.services
    named = {each.name: each.value for each in parameters(found)}
    assert named['services'] == ['acknowledge', 'test']
    assert named['test.text'] == 'acknowledge all by ROS'


def test_maps_are_loaded_by_a_text_and_given_from_a_topic(tmp_path: Path) -> None:
    found = robot(tmp_path, load=LOAD, get=GET)
    assert [(each.text, each.topic) for each in found.services] == [
        ('load {map_url}', 'alarms/command'), ('', 'map')]
    assert from_json(to_json(found)).services == found.services


@pytest.mark.parametrize(('service', 'problem'), [
    ({}, 'a.topic is missing'), ({'topic': 'alarms/command'}, 'a.text = .*must not be empty'),
    ({**GOOD, 'topic': 'alarms/comand'}, "a.topic = .*did you mean 'alarms/command'"),
    ({**GOOD, 'topic': 'speed'}, 'a.topic = .*is a std_msgs/msg/Float64: it must be a std_msgs'),
    ({**GOOD, 'topic': 'name'}, 'a.topic = .*fixed string'),
    ({**GOOD, 'answer_topic': 'speed'}, 'a.answer_topic = .*is a std_msgs/msg/Float64'),
    ({**GOOD, 'answer_topic': 'alarms/command'}, 'a.answer_topic = .*is the topic of the command'),
    ({**GOOD, 'text': ' '}, 'a.text = .*must not be empty'),
    ({**GOOD, 'text': 'x' * 41}, 'a.text = .*has 41 bytes: .*can hold 40'),
    ({**GOOD, 'text_false': 'no'}, 'a.text_false = .*is used with type: std_srvs/srv/SetBool'),
    ({**GOOD, 'type': 'std_srvs/srv/SetBool'}, 'a.text_false = .*needs a text for false'),
    ({**GOOD, 'type': 'std_srvs/srv/Empty'}, 'a.type = .*must be one of std_srvs/srv/Trigger, '),
    ({**LOAD, 'text': 'load'}, 'a.text = .*must contain {map_url}'),
    ({**GOOD, 'text': 'load {map_url}'}, 'a.text = .*only requests of type: nav_msgs/srv/LoadMap'),
    ({**GET, 'topic': 'speed'}, 'a.topic = .*it must be a nav_msgs/msg/OccupancyGrid'),
    ({**GET, 'text': 'give'}, 'a.text = .*not used with type: nav_msgs/srv/GetMap'),
    ({**GET, 'answer_topic': 'alarms/answer'}, 'a.answer_topic = .*is not used with type'),
    ({**GOOD, 'topic': 'map'}, 'a.topic = .*is a nav_msgs/msg/OccupancyGrid: it must be a std_'),
    ({**GOOD, 'service': '~/rearm'},
     'a.service = .*/robot/rearm is already a service of the node itself'),
    ({**GOOD, 'service': 'no way'}, 'a.service = .*must be names of letters'),
    ({**GOOD, 'timeout_s': 0}, 'a.timeout_s = 0'), ({**GOOD, 'timeout': 1}, 'a.timeout: unknown'),
])
def test_what_cannot_be_is_told(tmp_path: Path, service: dict[str, Any], problem: str) -> None:
    with pytest.raises(ConfigError, match=problem) as found:
        robot(tmp_path, a=service)
    assert len(found.value.problems) == 1 or not service


def test_two_services_have_two_names(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match='b.service = .*/robot/a is already a service of a'):
        robot(tmp_path, a=GOOD, b={**GOOD, 'service': '/robot/a'})
