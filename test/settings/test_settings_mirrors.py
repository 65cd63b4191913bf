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

"""What may be said of a mirror besides its topic: headers, and how reliable it is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from rt_robot_os.errors import ConfigError
from rt_robot_os.settings import load
from rt_robot_os.settings import MirrorSettings

pytest.importorskip('geometry_msgs.msg', reason='the ROS 2 messages are not installed')

ROOT = Path(__file__).resolve().parents[2]


def mirror(name: str, **values: Any) -> MirrorSettings:
    robot = load([ROOT / 'config' / 'robot.yaml'],
                 {f'{name}.{key}': value for key, value in values.items()})
    return next(m for m in robot.mirrors if m.name == name)


@pytest.mark.parametrize(('name', 'values', 'expected'), [
    ('imu_data', {}, 'reliable'),
    ('imu_data', {'reliability': 'best_effort'}, 'best_effort'),
    ('cmd_vel_in', {}, 'best_effort'),
    ('cmd_vel_in', {'reliability': 'reliable'}, 'reliable'),
    ('cmd_vel_in', {'durability': 'transient_local'}, 'reliable')])
def test_inward_is_best_effort_unless_that_is_not_wanted(
        name: str, values: dict[str, Any], expected: str) -> None:
    assert mirror(name, **values).reliability == expected


@pytest.mark.parametrize(('name', 'values', 'problem'), [
    ('imu_data', {'stamped': True}, "stamped = true: 'imu/data' is a sensor_msgs/msg/Imu"),
    ('cmd_vel_in', {'frame_id': 'x'}, 'cmd_vel_in.frame_id = .* with stamped: true only'),
    ('cmd_vel_safe', {'stamped': True, 'frame_id': 'x' * 300}, 'at most 255 bytes')])
def test_what_cannot_be_is_told(name: str, values: dict[str, Any], problem: str) -> None:
    with pytest.raises(ConfigError, match=problem):
        mirror(name, **values)


def test_commands_with_a_header_are_a_setting_away() -> None:
    assert mirror('cmd_vel_in', stamped=True).message == 'geometry_msgs/msg/Twist'
    assert mirror('cmd_vel_safe', stamped=True, frame_id='base_link').frame_id == 'base_link'
