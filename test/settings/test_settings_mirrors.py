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

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.settings import from_json
from rt_robot_os.settings import load
from rt_robot_os.settings import MirrorSettings
from rt_robot_os.settings import RobotParameters
from rt_robot_os.settings import RobotSettings
from rt_robot_os.settings import to_json
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
        'list': {'message': 'std_msgs/msg/String', 'tail': 300},
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
     "a.as = .*'odom_to_base' is a geometry_msgs/msg/TransformStamped: the conversions for "
     'direction: in are std_msgs/msg/Float64MultiArray as nav_msgs/msg/Path$'),
    ({'topic': 'plan', 'as': 'tf2_msgs/msg/TFMessage'},
     'a.as = .*the conversions for direction: out are geometry_msgs/msg/TransformStamped as '
     'tf2_msgs/msg/TFMessage, std_msgs/msg/Float64MultiArray as nav_msgs/msg/Path'),
    ({'topic': 'plan', 'as': 'nav_msgs/msg/Path', 'stamped': True},
     "a.stamped = true: 'plan' is a std_msgs/msg/Float64MultiArray: only these types can get"),
    ({'topic': 'plan', 'frame_id': 'map'}, 'a.frame_id = .*stamped: true, or as: nav_msgs'),
    ({'topic': 'plan', 'as': 'nav_msgs/msg/Path', 'frame_id': 'x' * 300}, 'at most 255 bytes')])
def test_what_cannot_be_converted_is_told(
        tmp_path: Path, mirror: dict[str, Any], problem: str) -> None:
    with pytest.raises(ConfigError, match=problem):
        ways(tmp_path, a=mirror)


@pytest.mark.parametrize(('topic', 'as_'), [
    ('plan', 'nav_msgs/msg/Path'), ('plan', 'visualization_msgs/msg/MarkerArray'),
    ('list', 'diagnostic_msgs/msg/DiagnosticArray')])
def test_what_has_one_header_can_be_given_its_frame(tmp_path: Path, topic: str, as_: str) -> None:
    [found] = ways(tmp_path, a={'topic': topic, 'as': as_, 'frame_id': 'flat'})
    assert (found.as_, found.frame_id) == (as_, 'flat')


def test_one_topic_of_ros_still_has_one_mirror_otherwise(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match='mirror a .* already has /tf out'):
        ways(tmp_path, a={'topic': 'odom_to_base', 'as': 'tf2_msgs/msg/TFMessage'},
             b={'topic': 'map_to_odom', 'ros_topic': '/tf'})


# ---- many topics at once ---------------------------------------------------------------------

HOUSE = {name: {'topic': topic, 'message': message} for name, topic, message in (
    ('warmth', 'wsn/kitchen/temperature', 'std_msgs/msg/Float64'),
    ('more', 'wsn/hall/temperature', 'std_msgs/msg/Float64'),
    ('damp', 'wsn/hall/humidity', 'std_msgs/msg/Float64'),
    ('order', 'wsn/command', 'geometry_msgs/msg/Twist'),
    ('other', 'speed', 'geometry_msgs/msg/Twist'))}


def house(folder: Path, **mirrors: Any) -> RobotSettings:
    path = folder / 'robot.yaml'
    path.write_text(yaml.safe_dump({'robot': {'ros__parameters': {
        'topics': [*HOUSE], 'mirrors': [*mirrors], **HOUSE, **mirrors}}}, sort_keys=False))
    return load([path])


def pairs(robot: RobotSettings) -> list[tuple[str, str, str]]:
    return [(m.name, m.topic, m.ros_topic) for m in robot.mirrors]


def test_a_star_stands_for_all_topics_that_match(tmp_path: Path) -> None:
    found = house(tmp_path, all={'topic': 'wsn/*', 'depth': 3})
    assert pairs(found) == [('all', each['topic'], each['topic']) for each in HOUSE.values()
                            if each['topic'].startswith('wsn/')]
    assert {mirror.depth for mirror in found.mirrors} == {3}


def test_a_topic_goes_to_the_mirror_that_names_it_then_to_the_first_pattern(tmp_path: Path
                                                                            ) -> None:
    found = house(tmp_path, hall={'topic': 'wsn/hall/*', 'ros_topic': 'entrance/*'},
                  all={'topic': '*'}, orders={'topic': 'wsn/command', 'direction': 'in'})
    assert pairs(found) == [
        ('hall', 'wsn/hall/temperature', 'entrance/temperature'),
        ('hall', 'wsn/hall/humidity', 'entrance/humidity'),
        ('all', 'wsn/kitchen/temperature', 'wsn/kitchen/temperature'),
        ('all', 'speed', 'speed'), ('orders', 'wsn/command', 'wsn/command')]


def test_two_stars_keep_their_order(tmp_path: Path) -> None:
    found = house(tmp_path, a={'topic': 'wsn/*/t*', 'ros_topic': '/house/*/x*'})
    assert [each.ros_topic for each in found.mirrors] == [
        '/house/kitchen/xemperature', '/house/hall/xemperature']


@pytest.mark.parametrize(('values', 'problem'), [
    ({'topic': 'wsn/hal/*'}, r"a.topic = 'wsn/hal/\*': no topic matches, did you mean 'wsn/hall"),
    ({'topic': 'wsn//*'}, r"a.topic = 'wsn//\*': must be names of"),
    ({'topic': 'wsn/*', 'direction': 'in'}, r'a.topic = .*\* is only for direction: out'),
    ({'topic': 'wsn/*', 'ros_topic': 'house'}, r'a.ros_topic = .*as many \* as topic'),
    ({'topic': 'wsn/*', 'ros_topic': 'house *'}, r'a.ros_topic = .*must be names of'),
    ({'topic': 'speed', 'ros_topic': 'x/*'}, r"a.ros_topic = 'x/\*': must be names of"),
    ({'topic': 'spee*', 'as': 'nav_msgs/msg/Path'}, "a.as = .*'speed' is a geometry_msgs"),
    ({'topic': 'wsn/*', 'stamped': True}, "a.stamped = .*'wsn/kitchen/temperature' is a")])
def test_a_pattern_that_cannot_be_is_told_once(
        tmp_path: Path, values: dict[str, Any], problem: str) -> None:
    with pytest.raises(ConfigError, match=problem) as found:
        house(tmp_path, a=values)
    assert len(found.value.problems) == 1


def test_a_pattern_without_anything_left_is_told(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match='each matching topic already has a mirror'):
        house(tmp_path, a={'topic': 'wsn/*'}, b={'topic': 'wsn/h*'})


def test_a_pattern_is_one_parameter_and_a_change_is_for_all(tmp_path: Path) -> None:
    found = RobotParameters(house(tmp_path, a={'topic': 'wsn/*', 'ros_topic': 'x/*'}))
    assert found.known['mirrors'].value == ['a']
    assert (found.known['a.topic'].value, found.known['a.ros_topic'].value) == ('wsn/*', 'x/*')
    assert found.refusal('a.max_rate_hz', 2.0) is None
    found.set('a.max_rate_hz', 2.0)
    assert {each.max_rate_hz for each in found.settings.mirrors} == {2.0}
    assert from_json(to_json(found.settings)).mirrors == found.settings.mirrors


def test_commands_with_a_header_are_a_setting_away() -> None:
    assert mirror('cmd_vel_in', stamped=True).message == 'geometry_msgs/msg/Twist'
    assert mirror('cmd_vel_safe', stamped=True, frame_id='base_link').frame_id == 'base_link'
