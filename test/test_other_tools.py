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

"""What comes for other tools fits the default robot: launch file, aggregator, Foxglove layout."""

from __future__ import annotations

from collections.abc import Iterator
import json
from pathlib import Path
import re
from typing import Any
from xml.etree import ElementTree

import pytest

from rt_robot_os.features.mapping.process.outputs import TOPICS
from rt_robot_os.features.mapping.settings import load as mapping_settings
from rt_robot_os.settings import load
import yaml

pytest.importorskip('geometry_msgs.msg', reason='the ROS 2 messages are not installed')

ROOT = Path(__file__).resolve().parents[1]
CONFIG = ROOT / 'config'
ROS_TOPICS = {'/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray',
              '/rosout': 'rcl_interfaces/msg/Log'}


def panels(layout: Any) -> Iterator[str]:
    """Give the panels of a layout, which is a tree of splits."""
    if isinstance(layout, str):
        yield layout
        return
    assert layout['direction'] in ('row', 'column') and 0 < layout['splitPercentage'] < 100
    yield from panels(layout['first'])
    yield from panels(layout['second'])


def field_of(message: str, path: str) -> Any:
    """Follow a path of fields through a ROS message."""
    from rt_robot_os.topics.resolve import message_class
    found: Any = message_class(message)()
    for name in path.split('.'):
        found = getattr(found, name)
    return found


def test_the_foxglove_layout_shows_what_the_default_robot_publishes() -> None:
    saved = json.loads((CONFIG / 'foxglove_layout.json').read_text())
    shown = list(panels(saved['layout']))
    assert sorted(shown) == sorted(saved['configById'])
    assert {name.partition('!')[0] for name in shown} == {
        'Plot', 'map', 'DiagnosticSummary', 'DiagnosticStatusPanel', 'RosOut'}
    robot = load([CONFIG / 'robot.yaml'])
    topics = {f'/{mirror.ros_topic}': mirror.message for mirror in robot.mirrors} | ROS_TOPICS
    for name, panel in saved['configById'].items():
        for key in ('topicToRender', 'followTopic'):
            assert panel.get(key, '/rosout') in topics, name
        for path in panel.get('paths', ()):
            topic, _, field = path['value'].partition('.')
            assert isinstance(field_of(topics[topic], field), float), path


def test_the_foxglove_layout_of_the_service_robot_shows_and_commands_what_there_is() -> None:
    saved = json.loads((CONFIG / 'foxglove_service_robot.json').read_text())
    panel = saved['configById']
    assert sorted(panels(saved['layout'])) == sorted(panel)
    mirrors = load([CONFIG / 'service_robot.yaml']).mirrors
    out = {f'/{m.ros_topic}': m.message for m in mirrors if m.direction == 'out'}
    into = {f'/{m.ros_topic}': m.message for m in mirrors if m.direction == 'in'}
    scene = panel['3D!scene']
    assert set(scene['topics']) | {panel['Image!camera']['imageMode']['imageTopic']} <= set(out)
    assert into[scene['publish']['poseTopic']] == 'geometry_msgs/msg/PoseStamped'
    assert into[scene['publish']['poseEstimateTopic']].endswith('PoseWithCovarianceStamped')
    assert into[panel['Teleop!hand']['topic']] == 'geometry_msgs/msg/Twist'
    for name, each in panel.items():
        assert each.get('topicToRender', '/rosout') in ROS_TOPICS, name
        for path in each.get('paths', ()):
            topic, _, field = path['value'].partition('.')
            assert field_of(out[topic], field.partition('[')[0]) is not None, path


def test_the_foxglove_layout_of_the_sensor_network_shows_what_there_is() -> None:
    saved = json.loads((CONFIG / 'foxglove_sensor_network.json').read_text())
    panel = saved['configById']
    assert sorted(panels(saved['layout'])) == sorted(panel)
    out = {f'/{m.ros_topic}': m.as_ or m.message
           for m in load([CONFIG / 'sensor_network.yaml']).mirrors if m.direction == 'out'}
    assert set(panel['3D!scene']['topics']) <= set(out)
    assert out['/wsn/nodes'] == 'visualization_msgs/msg/MarkerArray'
    for name, each in panel.items():
        assert each.get('topicToRender', '/rosout') in ROS_TOPICS, name
        for path in each.get('paths', ()):
            topic, _, field = path['value'].partition('.')
            assert isinstance(field_of(out[topic], field), float), path


def test_the_foxglove_layout_of_the_assisted_flat_shows_what_there_is() -> None:
    saved = json.loads((CONFIG / 'foxglove_assisted_living.json').read_text())
    panel = saved['configById']
    assert sorted(panels(saved['layout'])) == sorted(panel)
    out = {f'/{m.ros_topic.lstrip("/")}': m.as_ or m.message
           for m in load([CONFIG / 'assisted_living.yaml']).mirrors if m.direction == 'out'}
    assert set(panel['3D!scene']['topics']) <= set(out)
    assert out['/alarms'] == 'diagnostic_msgs/msg/DiagnosticArray'
    for name, each in panel.items():
        assert each.get('topicToRender', '/rosout') in {*ROS_TOPICS, *out}, name
        paths = [path['value'] for path in each.get('paths', ())] + [
            each[key] for key in ('topicPath',) if key in each]
        for path in paths:
            topic, _, field = path.partition('.')
            assert field_of(out[topic], field.partition('[')[0]) is not None, path


def test_every_status_of_the_robot_is_in_one_group_of_the_aggregator() -> None:
    groups = yaml.safe_load((CONFIG / 'diagnostics_aggregator.yaml').read_text())[
        '/**']['ros__parameters']
    assert groups.pop('path') and groups.pop('pub_rate')
    prefixes = [prefix for group in groups.values() for key, values in group.items()
                if key in ('startswith', 'find_and_remove_prefix') for prefix in values]
    source = (ROOT / 'rt_robot_os' / 'ros' / 'diagnostics.py').read_text()
    names = re.findall(r"f'\{self\._name\}: (\w+)", source)
    assert {'core', 'device', 'task', 'topic', 'client', 'clock'} <= set(names)
    for name in names:
        matching = [prefix for prefix in prefixes if f'robot: {name} x'.startswith(prefix)
                    or f'robot: {name}' == prefix]
        assert len(matching) == 1, (name, matching)


def test_the_launch_file_passes_on_what_it_takes() -> None:
    text = (ROOT / 'launch' / 'robot.launch.xml').read_text()
    launch = ElementTree.fromstring(text)
    taken = [each.get('name') for each in launch.iter('arg')]
    assert taken == ['params_file', 'name', 'namespace', 'log_level', 'respawn']
    assert set(re.findall(r'\$\(var (\w+)\)', text)) == set(taken)
    node, = launch.iter('node')
    assert node.get('name') == '$(var name)' and node.get('respawn') == '$(var respawn)'
    assert all(each.get('description') for each in launch.iter('arg'))
    # The XML parser of Jazzy's launch compares it with a number before it looks up variables.
    assert float(node.get('respawn_delay', '')) > 0


@pytest.mark.parametrize('name', ['service_robot', 'sensor_network', 'assisted_living'])
def test_the_launch_file_of_a_whole_robot_takes_the_same(name: str) -> None:
    text = (ROOT / 'launch' / f'{name}.launch.xml').read_text()
    launch = ElementTree.fromstring(text)
    ours = ElementTree.parse(ROOT / 'launch' / 'robot.launch.xml').getroot()
    taken = [each.get('name') for each in ours.findall('arg')]
    more = {'assisted_living': {'mapping', 'monitor'}, 'service_robot': {'mapping'}}.get(
        name, set())
    given = [str(each.get('name')) for each in launch.findall('arg')]
    assert [each for each in given if each not in more] == taken
    assert set(given) == set(taken) | more
    include, = launch.iter('include')
    assert {each.get('name'): each.get('value') for each in include.findall('arg')} == {
        each: f'$(var {each})' for each in taken}
    assert launch.findall('arg')[0].get('default', '').endswith(f'/config/{name}.yaml')


def test_the_robot_that_maps_is_the_service_robot_with_another_file_over_it() -> None:
    launch = ElementTree.parse(ROOT / 'launch' / 'mapping.launch.xml').getroot()
    files = {each.get('name'): each.get('default', '') for each in launch.findall('arg')}
    paths = [CONFIG / files[name].rpartition('/')[2]
             for name in ('params_file', 'mapping_params_file')]
    assert all(files.get(name) for name in ('name', 'log_level'))
    robot, mapping = launch.iter('node')
    both = '--params-file $(var params_file) --params-file $(var mapping_params_file)'
    assert both in robot.get('args', '') and both in mapping.get('args', '')
    settings = load(paths)
    modules = {each.name: each.settings for each in settings.modules}
    where = modules['localization']
    assert where['fix_topic'] == 'slam/pose' and where['correction_topic'] == 'slam/correction'
    assert not where['second_fix_topic'] and modules['planner']['map_topic'] == 'map'
    assert 'stargazer' not in [each.name for each in settings.devices]
    # What mapping reads and publishes is there, with and without.
    beside = mapping_settings(paths, {})
    assert beside.fix_topic == '' and beside.start == 'origin'
    # service_robot.launch.xml mapping:=true gives it the one file.
    with_marks = mapping_settings(paths[:1], {})
    assert with_marks.fix_topic == 'stargazer/pose' and with_marks.start == 'pose'
    alone = load([CONFIG / 'service_robot.yaml'])
    for found in settings, alone:
        declared = {each.topic for each in found.topics}
        assert set(TOPICS) <= declared and {'mapping/command', 'initialpose'} <= declared


def test_the_robot_of_assisted_living_works_on_the_map_that_is_made() -> None:
    path = CONFIG / 'assisted_living.yaml'
    settings = load([path])
    modules = {each.name: each.settings for each in settings.modules}
    for name in 'planner', 'agent':
        # The file is for where nobody has been yet.
        assert modules[name]['map_topic'] == 'map' and modules[name]['map']
    for name in 'anna_seen', 'bob_seen':
        # Whoever lies there would be on the other one, and so be nobody.
        assert not modules[name]['map_topic'] and modules[name]['map']
    assert modules['localization']['second_fix_topic'] == 'slam/pose'
    assert set(TOPICS) <= {each.topic for each in settings.topics}
    # Marks keep the map in its place, and with it all that the robot knows of it.
    assert mapping_settings([path], {}).fix_topic == 'stargazer/pose'
    beside, like = (
        {each.name: each for each in load([CONFIG / name]).services if 'mapping/' in each.service}
        for name in ('assisted_living.yaml', 'service_robot.yaml'))
    assert beside == like and like


def test_the_monitor_beside_a_robot_takes_the_file_of_the_robot(
        monkeypatch: pytest.MonkeyPatch) -> None:
    launch = ElementTree.parse(ROOT / 'launch' / 'assisted_living.launch.xml').getroot()
    node, = (each for each in launch.iter('node') if each.get('exec') == 'monitor')
    path = str(CONFIG / 'assisted_living.yaml')
    given = node.get('args', '').replace('$(var namespace)/$(var name)', '/robot').replace(
        '$(var params_file)', path)
    assert path in given
    server = pytest.importorskip('rt_robot_os.monitor.server', reason='no libraries of monitor')
    from rt_robot_os.monitor.command import run
    served: list[Any] = []
    monkeypatch.setattr(server, 'serve', lambda *each: served.append(each))
    assert run(given.split()) == 0
    (settings, beside), = served
    assert settings.host == '127.0.0.1' and beside.node == '/robot'
    # By itself it says that the file has nothing for it.
    assert run(['--ros-args', '--params-file', path]) == 2


def test_a_map_that_came_before_a_viewer_is_there_for_it() -> None:
    mirrors = {each.ros_topic: each for each in load([CONFIG / 'service_robot.yaml']).mirrors}
    kept = mirrors['map']
    # As map_server and slam_toolbox publish it.
    assert (kept.reliability, kept.durability, kept.depth) == ('reliable', 'transient_local', 1)
    assert kept.message == 'nav_msgs/msg/OccupancyGrid'
    layout = json.loads((CONFIG / 'foxglove_service_robot.json').read_text())
    shown = layout['configById']['3D!scene']['topics']
    assert {'/map', '/slam/path', '/slam/graph'} <= set(shown) and set(
        name.lstrip('/') for name in shown) <= set(mirrors)


@pytest.mark.parametrize('name', sorted(path.name for path in CONFIG.glob('*.yaml')))
def test_ros_reads_each_parameter_file(name: str) -> None:
    # The parser of rcl takes less than others do, as of what stands in braces.
    context = pytest.importorskip('rclpy.context').Context()
    context.init(['--ros-args', '--params-file', str(CONFIG / name)])
    context.try_shutdown()


def test_each_server_of_nav2_has_its_parameters_and_is_managed() -> None:
    launch = ElementTree.parse(ROOT / 'launch' / 'service_robot_nav2.launch.xml').getroot()
    names = [node.get('name', '') for node in launch.iter('node')]
    assert names[0] == 'robot'
    nav2 = yaml.safe_load((CONFIG / 'nav2.yaml').read_text())
    configured = {name for name in names if name in nav2}
    assert configured == set(names) - {'robot', 'map_server'}
    assert set(nav2) - configured == {'local_costmap', 'global_costmap'}
    managed = nav2['lifecycle_manager_navigation']['ros__parameters']['node_names']
    assert managed == [name for name in names[1:] if not name.startswith('lifecycle')]


def test_nav2_finds_the_topics_and_frames_of_the_service_robot() -> None:
    launch = (ROOT / 'launch' / 'service_robot_nav2.launch.xml').read_text()
    modules = re.findall(r'-p modules:=\[([\w,]+)\]', launch)[0].split(',')
    robot = load([CONFIG / 'service_robot.yaml'], {'modules': modules})
    assert [module.name for module in robot.modules] == modules
    out = {'/' + m.ros_topic.lstrip('/'): m for m in robot.mirrors if m.direction == 'out'}
    nav2 = (CONFIG / 'nav2.yaml').read_text()
    topics = set(re.findall(r'topic: (/\w+)', nav2))
    assert topics == {'/odom', '/scan'} and topics <= set(out)
    frames = set(re.findall(r'(?:frame|base_frame): (\w+)', nav2))
    assert frames == {'map', 'odom', 'base_link'}
    steered = [m for m in robot.mirrors if m.direction == 'in' and m.ros_topic == 'cmd_vel']
    assert steered and steered[0].message == 'geometry_msgs/msg/Twist'
    scan = next(device for device in robot.devices if device.type == 'hokuyo')
    assert robot.mountings[scan.settings['frame_id']].parent == 'base_link'
    transforms = {m.topic for m in robot.mirrors if m.as_ == 'tf2_msgs/msg/TFMessage'}
    assert transforms == {'odom_to_base', 'map_to_odom'}


@pytest.mark.parametrize('name', ['robot', 'rover'])
def test_the_default_configuration_is_for_a_node_of_any_name(name: str) -> None:
    assert [device.name for device in load([CONFIG / 'robot.yaml'], node=name).devices] == [
        'imu', 'gps']
