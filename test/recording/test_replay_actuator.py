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


"""A robot that acts is replayed as it was: what devices read is part of the recording."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
from rt_robot_os.recording.reading import Recording
from rt_robot_os.topics import Layout
import wheels

SPEED = 'wheels/speed'
YAML = """
robot:
  ros__parameters:
    core: {record_bytes: true}
    devices: [base]
    modules: [drive]
    base: {type: wheels, port: sim, rate_hz: 50.0, read: interrupt, priority: 70}
    drive: {type: drive, rate_hz: 50.0, priority: 60}
"""


def test_a_robot_with_an_actuator_is_replayed_the_same(
        robot: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    wheels.install(robot.output)
    monkeypatch.setenv('PYTHONPATH', os.pathsep.join(
        [str(robot.output), str(Path(wheels.__file__).parents[1])]))
    (robot.output / 'robot.yaml').write_text(YAML)
    bag = robot.output / 'bag'
    recorder, log = robot.record('-o', str(bag))
    robot.until(lambda: b'waiting' in log.read_bytes(), 'a waiting recorder')
    robot.start('rt_robot_os.core.program', '--ros-args', *robot.ORDINARY, '--params-file',
                str(robot.output / 'robot.yaml'))
    robot.wait_for_messages(log, recorder, 200)
    assert robot.end(recorder) == 0, log.read_text()
    layout = Layout.compile('geometry_msgs/msg/Vector3Stamped', {'header.frame_id': 'base_link'})
    reports = [layout.view(bytearray(each.cdr)).vector for each in Recording(bag).samples()
               if each.topic == SPEED]
    assert any(report.z for report in reports) and not all(report.z for report in reports)
    code, text = robot.run('rt_robot_os.recording.replay_program', str(bag))
    assert code == 0, text
    assert 'no bytes of' not in text
