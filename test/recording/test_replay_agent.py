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

"""An emergency that was recorded is replayed: the agent does the same at the same times."""

from __future__ import annotations

from pathlib import Path
import re
from typing import Any

import pytest
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import Level
from rt_robot_os.recording.reading import Recording
from rt_robot_os.topics import Layout

pytest.importorskip('geometry_msgs', reason='ROS 2 messages are not installed')

YAML = """
robot:
  ros__parameters:
    core: {record_bytes: true}
    devices: []
    modules: [alarms, agent]
    alarms: {type: alarms, rate_hz: 10.0, priority: 41, stored_topic: '', confirm_s: 60.0}
    agent:
      {type: agent, priority: 40, nodes: [wrist 3.0 4.0 1.0], confirm_s: 1.0, places: 1,
       answer_s: 0.5, retries: 0, give_up_s: 0.3, battery_topic: '', answer_topic: '',
       observed_topic: ''}
    topics: [reports, command, pose, planner_state, steering, estop]
    reports: {topic: alarms/report, message: std_msgs/msg/String, tail: 100}
    command: {topic: agent/command, message: std_msgs/msg/String, tail: 100}
    pose:
      {message: geometry_msgs/msg/PoseWithCovarianceStamped, fixed: {header.frame_id: map}}
    planner_state: {topic: planner/state, message: std_msgs/msg/String, tail: 200}
    steering: {message: std_msgs/msg/String, tail: 200}
    estop: {message: std_msgs/msg/Bool}
"""
TEXT = Layout.compile('std_msgs/msg/String', {}, tail=3000)
POSE = Layout.compile('geometry_msgs/msg/PoseWithCovarianceStamped', {'header.frame_id': 'map'})


def transitions(bag: Path) -> list[str]:
    layout = Layout.compile('std_msgs/msg/String', {}, tail=4000)
    return [str(layout.to_dict(each.cdr)['data']) for each in Recording(bag).samples()
            if each.topic == 'agent/transitions']


def test_an_emergency_is_replayed_with_the_same_transitions_at_the_same_times(
        robot: Any) -> None:
    (robot.output / 'robot.yaml').write_text(YAML)
    bag = robot.output / 'bag'
    recorder, log = robot.record('-o', str(bag))
    robot.until(lambda: b'waiting' in log.read_bytes(), 'a waiting recorder')
    core, said = robot.start('rt_robot_os.core.program', '--ros-args', *robot.ORDINARY,
                             '--params-file', str(robot.output / 'robot.yaml'))
    with robot.connect() as client:
        pose = client.advertise('pose')

        def is_recorded() -> bool:
            client.publish(pose, POSE.from_dict({'pose': {'pose': {'orientation': {'w': 1.0}}}}))
            client.pump(0.05)
            return re.search(r'[1-9]\d* messages', log.read_text()) is not None

        robot.until(is_recorded, 'a recorder that has something')
        fall = Cause('fall', 'anna', Level.CRITICAL, True, 'fell', 'test', 'wrist').to_json()
        client.publish(client.advertise('alarms/causes'), TEXT.from_dict({'data': fall}))

        def is_home() -> bool:
            client.beat()
            client.pump(0.05)
            return 'return to idle' in said.read_text() or core.poll() is not None

        robot.until(is_home, 'an agent that has come home')
    assert core.poll() is None, said.read_text()
    robot.wait_for_messages(log, recorder, 20)
    assert robot.end(recorder) == 0, log.read_text()
    robot.end(core)
    real = transitions(bag)
    assert [text.split('"to":"')[1].split('"')[0] for text in real] == [
        'confirm', 'approach', 'give_up', 'return', 'idle'], said.read_text()
    code, text = robot.run('rt_robot_os.recording.replay_program', str(bag))
    assert code == 0, text
    assert 'runs at its own instants' not in text
    (line,) = [line for line in text.splitlines() if line.startswith('agent/transitions ')]
    assert line.split()[1:] == ['5', '0', '0', '0', '0', '0']
