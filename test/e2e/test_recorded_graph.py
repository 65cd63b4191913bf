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

"""A recording shows the graph as ROS sees it: names, types and service quality."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')
pytest.importorskip('mcap', reason='recordings need mcap')

from mcap.reader import make_reader  # noqa: E402, I100
from rosbags.highlevel import AnyReader  # noqa: E402
from rosbags.interfaces import QosDurability  # noqa: E402
from rosbags.interfaces import QosReliability  # noqa: E402
import yaml  # noqa: E402

pytestmark = pytest.mark.one_build

RECORD = 'rt_robot_os.recording.record_program'
REPLAY = 'rt_robot_os.recording.replay_program'
Until = Callable[..., Any]
YAML = """
/**/robot:
  ros__parameters:
    core: {cpu: -2, scheduler_priority: 0}
    devices: [imu]
    imu: {type: witmotion, port: sim, topic: imu/data, mag_topic: imu/mag, rate_hz: 200.0,
          priority: 80}
    topics: [command]
    command: {message: geometry_msgs/msg/Twist}
    mirrors: [data, again, mag, command_in]
    data: {topic: imu/data, depth: 7, reliability: best_effort}
    again: {topic: imu/data, ros_topic: /diagnosis/imu, depth: 3}
    mag: {topic: imu/mag, ros_topic: '~/magnetometer', durability: transient_local, depth: 4}
    command_in: {topic: command, ros_topic: cmd_vel, direction: in}
"""
NAMES = {'/arm/inertial', '/diagnosis/imu', '/arm/robot/magnetometer'}


def test_topics_have_names_types_and_quality_of_their_mirrors(world: Any, until: Until) -> None:
    robot = world.robot(YAML, '-r', '__ns:=/arm', '-r', 'imu/data:=inertial')
    robot.wait_for_line('connected to the core')
    until(lambda: all(world.node.get_publishers_info_by_topic(name) for name in NAMES),
          'the publishers of the mirrors')
    bag = world.folder / 'bag'
    recorder = world.start(RECORD, '--robot', 'arm.robot', '--duration', '1',
                           '-o', str(bag))
    assert recorder.process.wait(60) == 0, recorder.output
    with AnyReader([bag]) as reader:
        found = {each.topic: each for each in reader.connections}
    assert set(found) == {*NAMES, '/arm/cmd_vel', '/rosout'}
    for name in NAMES:
        live, = world.node.get_publishers_info_by_topic(name)
        offered, = found[name].ext.offered_qos_profiles
        assert found[name].msgtype == live.topic_type
        assert offered.reliability == QosReliability[live.qos_profile.reliability.name]
        assert offered.durability == QosDurability[live.qos_profile.durability.name]
        assert found[name].msgcount > 20
    assert {name: found[name].ext.offered_qos_profiles[0].depth for name in NAMES} == {
        '/arm/inertial': 7, '/diagnosis/imu': 3, '/arm/robot/magnetometer': 4}
    # A file by itself, without metadata.yaml, tells the same.
    with next(bag.glob('*.mcap')).open('rb') as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    for channel in summary.channels.values():
        profile, = yaml.safe_load(channel.metadata['offered_qos_profiles'])
        assert profile['history'] == 'keep_last'
        assert profile['depth'] == found[channel.topic].ext.offered_qos_profiles[0].depth


def test_a_topic_is_found_by_either_name_and_replayed(world: Any, until: Until) -> None:
    robot = world.robot(YAML.replace('core: {', 'core: {record_bytes: true, '), '-r', '__ns:=/arm',
                        '-r', 'imu/data:=inertial')
    robot.wait_for_line('connected to the core')
    for asked, options, named in (
            ('/arm/inertial', (), {'/arm/inertial', '/diagnosis/imu'}),
            ('imu/data', ('--core-names',), {'/imu/data'}),
            ('/arm/imu/data', (), None)):
        bag = world.folder / asked.replace('/', '_')
        recorder = world.start(RECORD, '--robot', 'arm.robot', '--duration', '1',
                               '-o', str(bag), asked, *options)
        code = recorder.process.wait(60)
        recorder.join()
        if named is None:
            assert code == 2
            assert f'no topic {asked} in the core; known are' in recorder.output
            assert '/arm/inertial' in recorder.output
            assert not bag.exists()
            continue
        assert code == 0, recorder.output
        with AnyReader([bag]) as reader:
            assert {each.topic for each in reader.connections} == named
        replay = world.start(REPLAY, str(bag))
        assert replay.process.wait(60) == 0, replay.output
        replay.join()
        row, = [line.split() for line in replay.lines if line.startswith('imu/data ')]
        assert int(row[1]) > 50
