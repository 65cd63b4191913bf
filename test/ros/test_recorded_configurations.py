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

"""A recording of each shipped configuration has the topics that its node has in ROS."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')
pytest.importorskip('mcap', reason='recordings need mcap')
pytest.importorskip('tf2_msgs', reason='the type of /tf is not installed')

import rclpy  # noqa: E402, I100
from rclpy.node import Node  # noqa: E402
from rt_robot_os.link import TopicInfo  # noqa: E402
from rt_robot_os.link.stamp_mapper import StampMapper  # noqa: E402
from rt_robot_os.recording.graph import LOG  # noqa: E402
from rt_robot_os.recording.graph import TopicGraph  # noqa: E402
from rt_robot_os.recording.selection import Selection  # noqa: E402
from rt_robot_os.recording.selection import Wanted  # noqa: E402
from rt_robot_os.ros.mirrors import Mirrors  # noqa: E402
from rt_robot_os.ros.static_transforms import StaticTransforms  # noqa: E402
from rt_robot_os.settings import load  # noqa: E402
from rt_robot_os.settings import RobotSettings  # noqa: E402
from rt_robot_os.settings.static_frames import published_frames  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
# The configurations of robots, and one that is laid over another.
OVER = {'config/mapping.yaml': 'config/service_robot.yaml'}
OF_OTHERS = {'config/nav2.yaml', 'config/diagnostics_aggregator.yaml'}
SHIPPED = sorted({path.relative_to(ROOT).as_posix()
                  for path in ROOT.glob('config/*.yaml')} - OF_OTHERS)
RICHEST = 'config/service_robot.yaml', 'config/assisted_living.yaml'
# A topic with its type, and of a publisher its quality.
Topics = dict[str, tuple[str, ...]]


def load_shipped(path: str) -> RobotSettings:
    return load([ROOT / each for each in (OVER.get(path), path) if each])


@pytest.fixture(scope='module')
def node() -> Iterator[Node]:
    """Give a node without an executor: it only lists its own entities."""
    context = rclpy.Context()
    rclpy.init(context=context)
    made = Node('robot', context=context, use_global_arguments=False, enable_rosout=False,
                start_parameter_services=False)
    yield made
    made.destroy_node()
    rclpy.shutdown(context=context)


def live(node: Node, settings: RobotSettings) -> Topics:
    """Make what the robot's node makes of these settings, and ask ROS what it is."""
    mirrors = Mirrors(node, settings.mirrors, StampMapper())
    static = StaticTransforms(node, published_frames(settings))
    try:
        found: Topics = {}
        publishers = [(each.publisher, each.publisher.qos_profile) for each in mirrors.outward]
        if static._publisher is not None:
            publishers.append((static._publisher, static._publisher.qos_profile))
        for publisher, qos in publishers:
            found[publisher.topic_name] = (
                type_of(publisher.msg_type), qos.reliability.name.lower(),
                qos.durability.name.lower(), str(qos.depth))
        # What is subscribed only has the quality that its subscriptions accept.
        outward = {mirror.settings.topic for mirror in mirrors.outward}
        for inward in mirrors.inward:
            if inward.settings.topic not in outward:
                found[inward.subscription.topic_name] = (
                    type_of(inward.subscription.msg_type), 'reliable',
                    inward.settings.durability, str(inward.settings.depth))
        return found
    finally:
        mirrors.destroy()
        static.destroy()


def type_of(cls: type) -> str:
    package, kind, _ = cls.__module__.split('.', 2)
    return f'{package}/{kind}/{cls.__name__}'


def recorded(settings: RobotSettings) -> tuple[Topics, Selection]:
    """Give what `record` writes of a robot with these settings when nothing is named."""
    core = {mirror.topic: mirror.message for mirror in settings.mirrors}
    core |= {'a/topic/of/the/core/alone': 'std_msgs/msg/String'} if core else {}
    infos = {name: TopicInfo(name, number, message, 100, 100, None, 8, 0.0)
             for number, (name, message) in enumerate(core.items())}
    chosen = Selection(infos, (), Wanted(), TopicGraph(settings, 'robot'))
    facts = [each.facts for shown in chosen.shown.values() for each in shown]
    return {each.name: (each.type_name, each.reliability, each.durability, str(each.depth))
            for each in facts}, chosen


@pytest.mark.parametrize('path', SHIPPED)
def test_it_has_the_names_types_and_quality_of_the_live_graph(node: Node, path: str) -> None:
    settings = load_shipped(path)
    found, chosen = recorded(settings)
    there = live(node, settings)
    static = there.pop('/tf_static', None)
    assert found == there
    assert chosen.names == {*there, LOG.name, *(('/tf_static',) if static else ())}
    assert bool(chosen.frames) == bool(static)
    assert not chosen.missing and not chosen.unknown_types
    if path in RICHEST:
        assert there['/plan'][0] == there['/path'][0] == 'nav_msgs/msg/Path'
        assert there['/tf'][0] == 'tf2_msgs/msg/TFMessage'
        assert static == ('tf2_msgs/msg/TFMessage', 'reliable', 'transient_local', '1')


@pytest.mark.parametrize('path', SHIPPED)
def test_nothing_of_the_core_is_lost_to_a_replay(path: str) -> None:
    settings = load_shipped(path)
    _, chosen = recorded(settings)
    raw = {info.name for info, shown in chosen.shown.items()
           if any(each.facts.core_topic == info.name and each.convert is None for each in shown)}
    kept = {info.name for info in chosen.kept}
    assert {mirror.topic for mirror in settings.mirrors} <= raw | kept
    assert not settings.mirrors or 'a/topic/of/the/core/alone' in kept - raw
