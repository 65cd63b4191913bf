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
import yaml

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
    ('cmd_vel_in', {'frame_id': 'x'}, 'cmd_vel_in.frame_id = .* with stamped: true, or as: '),
    ('cmd_vel_safe', {'stamped': True, 'frame_id': 'x' * 300}, 'at most 255 bytes')])
def test_what_cannot_be_is_told(name: str, values: dict[str, Any], problem: str) -> None:
    with pytest.raises(ConfigError, match=problem):
        mirror(name, **values)


# ---- other types in ROS ----------------------------------------------------------------------

WAYS = {'plan': {'message': 'std_msgs/msg/Float64MultiArray', 'tail': 300},
        'odom_to_base': {'message': 'geometry_msgs/msg/TransformStamped',
                         'fixed': {'header.frame_id': 'odom', 'child_frame_id': 'base_link'}},
        'map_to_odom': {'message': 'geometry_msgs/msg/TransformStamped',
                        'fixed': {'header.frame_id': 'map', 'child_frame_id': 'odom'}},
        'goal_pose': {'message': 'geometry_msgs/msg/PoseStamped',
                      'fixed': {'header.frame_id': 'map'}}}


def ways(folder: Path, **mirrors: Any) -> tuple[MirrorSettings, ...]:
    path = folder / 'robot.yaml'
    path.write_text(yaml.safe_dump({'robot': {'ros__parameters': {
        'topics': [*WAYS], 'mirrors': [*mirrors], **WAYS, **mirrors}}}))
    return load([path]).mirrors


def test_several_transforms_share_a_topic_of_ros(tmp_path: Path) -> None:
    found = ways(tmp_path, a={'topic': 'odom_to_base', 'as': 'tf2_msgs/msg/TFMessage'},
                 b={'topic': 'map_to_odom', 'as': 'tf2_msgs/msg/TFMessage'})
    assert [(m.ros_topic, m.reliability, m.depth) for m in found] == [('/tf', 'reliable', 100)] * 2


def test_a_goal_has_to_be_in_the_frame_of_the_topic(tmp_path: Path) -> None:
    found, = ways(tmp_path, a={'topic': 'goal_pose', 'direction': 'in'})
    assert found.core_frame_id == 'map'


@pytest.mark.parametrize(('mirror', 'problem'), [
    ({'topic': 'odom_to_base', 'as': 'tf2_msgs/msg/TFMessage', 'direction': 'in'},
     "a.as = .*'odom_to_base' is a geometry_msgs/msg/TransformStamped: what can be had in is "
     'std_msgs/msg/Float64MultiArray as nav_msgs/msg/Path$'),
    ({'topic': 'plan', 'as': 'tf2_msgs/msg/TFMessage'},
     'a.as = .*what can be had out is geometry_msgs/msg/TransformStamped as '
     'tf2_msgs/msg/TFMessage, std_msgs/msg/Float64MultiArray as nav_msgs/msg/Path'),
    ({'topic': 'plan', 'as': 'nav_msgs/msg/Path', 'stamped': True},
     "a.stamped = true: 'plan' is a std_msgs/msg/Float64MultiArray: only these can be had with"),
    ({'topic': 'plan', 'frame_id': 'map'}, 'a.frame_id = .*stamped: true, or as: nav_msgs'),
    ({'topic': 'plan', 'as': 'nav_msgs/msg/Path', 'frame_id': 'x' * 300}, 'at most 255 bytes')])
def test_what_cannot_be_converted_is_told(
        tmp_path: Path, mirror: dict[str, Any], problem: str) -> None:
    with pytest.raises(ConfigError, match=problem):
        ways(tmp_path, a=mirror)


def test_one_topic_of_ros_still_has_one_mirror_otherwise(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match='mirror a .* has /tf out already'):
        ways(tmp_path, a={'topic': 'odom_to_base', 'as': 'tf2_msgs/msg/TFMessage'},
             b={'topic': 'map_to_odom', 'ros_topic': '/tf'})


def test_commands_with_a_header_are_a_setting_away() -> None:
    assert mirror('cmd_vel_in', stamped=True).message == 'geometry_msgs/msg/Twist'
    assert mirror('cmd_vel_safe', stamped=True, frame_id='base_link').frame_id == 'base_link'
