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

"""A core that is killed with `kill -9` and started anew goes on with its alarms."""

from __future__ import annotations

from collections.abc import Iterator
import json
from typing import Any

from alarms_core import Core
from processes import GUARD_YAML
from processes import in_a_folder
from processes import wait_until
import pytest

YAML = f"""{GUARD_YAML.replace('modules: [guard]', 'modules: [guard, alarms]')}\
    alarms: {{type: alarms, rate_hz: 10.0, priority: 41, delivery_timeout_s: 60.0,
             critical_steps: ['operator 3600']}}
    devices: [journal]
    journal: {{type: journal, port: JOURNAL, rate_hz: 20.0, priority: 25, retry_s: 0.1}}
    topics: [cmd_vel, heartbeat, cause, command, report]
    cmd_vel: {{message: geometry_msgs/msg/Twist}}
    heartbeat: {{topic: notifier/heartbeat, message: std_msgs/msg/String, tail: 500}}
    cause: {{topic: alarms/causes, message: std_msgs/msg/String, depth: 64, tail: 3000}}
    command: {{topic: alarms/command, message: std_msgs/msg/String, depth: 64, tail: 500}}
    report: {{topic: alarms/report, message: std_msgs/msg/String, depth: 64, tail: 500}}
"""
HELP = {'kind': 'help', 'subject': 'anna', 'level': 'critical', 'text': 'the button was pressed'}


class Robot:
    """A core with alarms and a journal, and a client that hears what it tells."""

    def __init__(self, core: Core) -> None:
        self.core = core
        self.publish, self.kill = core.publish, core.kill
        (core.folder / 'robot.yaml').write_text(
            YAML.replace('JOURNAL', str(core.folder / 'kept')))

    def begin(self) -> None:
        self.core.heard.clear()
        self.core.start('alarms/events', 'alarms/notify', 'alarms/list', 'alarms/stored',
                        'alarms/answer')

    def said(self, topic: str) -> list[dict[str, Any]]:
        return [json.loads(text) for text in self.core.heard.get(topic, [])]

    def wait_for(self, topic: str, **values: Any) -> dict[str, Any]:
        return dict(wait_until(lambda: next(
            (each for each in self.said(topic) if values.items() <= each.items()), None),
            f'{values} on {topic}'))


@pytest.fixture
def robot() -> Iterator[Robot]:
    with in_a_folder(Core) as core:
        yield Robot(core)


def test_an_alarm_outlives_kills_and_is_told_under_the_same_key(robot: Robot) -> None:
    robot.begin()
    robot.publish('alarms/causes', HELP)
    first = robot.wait_for('alarms/notify', channel='operator', subject='anna')
    robot.kill()  # nobody has reported of it

    robot.begin()
    robot.wait_for('alarms/notify', key=first['key'], alarm=first['alarm'])
    event = robot.wait_for('alarms/events', restored=True)
    assert (event['event'], event['subject'], event['kinds']) == ('raised', 'anna', ['help'])
    robot.publish('alarms/report', {'key': first['key'], 'channel': 'operator', 'ok': True,
                                    'text': 'shown'})
    robot.publish('alarms/command', 'acknowledge anna by mary')
    assert robot.wait_for('alarms/answer', alarm=first['alarm'])['ok'] is True
    acknowledged = robot.wait_for('alarms/events', event='acknowledged')
    wait_until(lambda: any(each.get('stored', 0) >= 4 for each in robot.said('alarms/stored')),
               'the acknowledgement on the disk')
    robot.kill()

    robot.begin()
    event = robot.wait_for('alarms/events', restored=True)
    assert (event['event'], event['by']) == ('acknowledged', 'mary')
    assert event['seq'] > acknowledged['seq']
    robot.publish('alarms/command', f'resolve {first["alarm"]} by mary she is fine')
    robot.wait_for('alarms/events', event='resolved', by='mary')
    assert robot.said('alarms/notify') == []
