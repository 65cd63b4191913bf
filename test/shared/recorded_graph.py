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

"""Compare a bag with the live graph that was recorded, and play it as `ros2 bag play` does."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import fields
from importlib.util import find_spec
from pathlib import Path
import signal
from typing import Any

import numpy as np
from rclpy.node import NodeNameNonExistentError
from rclpy.qos import QoSDurabilityPolicy
from rclpy.qos import QoSProfile
from rclpy.qos import QoSReliabilityPolicy
from rosbags.highlevel import AnyReader
from rt_robot_os.settings import load
from rt_robot_os.topics.resolve import message_class

Until = Callable[..., Any]
RECORD = 'rt_robot_os.recording.record_program'
# What the node alone publishes, and no bag of ours has.
OF_THE_NODE = {'/parameter_events', '/robot/transition_event'}
# Of a type that ROS may lack here; then the live graph has no such topics, and a bag has.
TRANSFORMS = '/tf', '/tf_static'
LACKING = () if find_spec('tf2_msgs') else TRANSFORMS
# As RViz and tf2_ros ask for them; who comes late gets the latched ones.
RELIABLE, LATCHED = QoSReliabilityPolicy.RELIABLE, QoSDurabilityPolicy.TRANSIENT_LOCAL
RVIZ = {'/tf': QoSProfile(depth=100, reliability=RELIABLE),
        '/scan': QoSProfile(depth=5, reliability=RELIABLE),
        '/plan': QoSProfile(depth=5, reliability=RELIABLE)}
RVIZ_LATE = {'/tf_static': QoSProfile(depth=100, reliability=RELIABLE, durability=LATCHED),
             '/map': QoSProfile(depth=5, reliability=RELIABLE, durability=LATCHED)}


def plain(value: Any) -> Any:
    """Give a message without the times in it: node and recorder map clocks for themselves."""
    kind = getattr(value, '__msgtype__', '')
    if kind == 'builtin_interfaces/msg/Time':
        return None
    if kind:
        return tuple(plain(getattr(value, each.name)) for each in fields(value))
    if isinstance(value, np.ndarray):
        return value.tobytes()
    if isinstance(value, list):
        return tuple(map(plain, value))
    return repr(value)  # a number that is none equals itself


class Recorded:
    """
    A recording of a robot that runs, and what is published meanwhile.

    :param config: of the robot: its topics are waited for.
    :param compared: topics whose messages are compared; all of them if none.
    :ivar bag: its folder.
    :ivar live: the messages that came on the live graph, as CDR.
    """

    def __init__(self, world: Any, until: Until, config: Path, *compared: str) -> None:
        self.bag = world.folder / 'bag.yaml'  # whatever its name, the leftovers do not count it
        self._node = world.node
        self._until = until
        mirrored = {f"/{each.ros_topic.lstrip('/')}" for each in load([config]).mirrors}
        until(lambda: mirrored <= self.types().keys(), 'the topics of the robot')
        self.live: dict[str, list[bytes]] = {}
        for name, qos in self._offered().items():
            if name in compared or not compared:
                self.live[name] = []
                world.node.create_subscription(
                    message_class(self.types()[name]), name, self.live[name].append, QoSProfile(
                        depth=5000, reliability=qos.reliability, durability=qos.durability),
                    raw=True)
        self._program = world.start(RECORD, '-o', str(self.bag))
        self._program.wait_for_line(' messages ')  # by then all topics were asked for
        self._before = {name: len(messages) for name, messages in self.live.items()}

    def types(self) -> dict[str, str]:
        """Give the types of the topics of the live graph."""
        try:
            rows = [*self._node.get_subscriber_names_and_types_by_node('robot', '/'),
                    *self._node.get_publisher_names_and_types_by_node('robot', '/')]
        except NodeNameNonExistentError:
            return {}
        return {name: kinds[0] for name, kinds in rows if name not in OF_THE_NODE} | {
            name: 'tf2_msgs/msg/TFMessage' for name in LACKING}

    def _offered(self) -> dict[str, QoSProfile]:
        """Give the quality of what the robot publishes."""
        rows = self._node.get_publisher_names_and_types_by_node('robot', '/')
        return {name: next(each.qos_profile
                           for each in self._node.get_publishers_info_by_topic(name)
                           if each.node_name == 'robot')
                for name, _ in rows if name not in OF_THE_NODE}

    def wait_for(self, name: str) -> None:
        """Wait until a compared topic has had messages since the recording began."""
        # The first of two may have been on its way when it began.
        self._until(lambda: len(self.live[name]) >= self._before[name] + 2, f'messages on {name}')

    def end(self) -> None:
        """End the recording."""
        assert self._program.end(signal.SIGINT) == 0, self._program.output

    def check(self, *with_messages: str) -> None:
        """
        Compare names, types, quality and messages with the live graph.

        :param with_messages: topics on which something must have come.
        """
        with AnyReader([self.bag]) as reader:
            found = {each.topic: each for each in reader.connections}
            types = {name: each.msgtype for name, each in found.items()}
            assert types == self.types(), set(types.items()) ^ set(self.types().items())
            for name, live in self._offered().items():
                offered, = found[name].ext.offered_qos_profiles
                assert (offered.reliability.name, offered.durability.name) == (
                    live.reliability.name, live.durability.name), name
            silent = [name for name in with_messages if not found[name].msgcount]
            assert not silent, f'nothing was recorded on {silent}'
            messages: dict[str, Counter[Any]] = {name: Counter() for name in self.live}
            for connection, _, raw in reader.messages(
                    [each for each in reader.connections if each.topic in messages]):
                messages[connection.topic][plain(
                    reader.deserialize(raw, connection.msgtype))] += 1
            for name, recorded in messages.items():
                self._until(lambda name=name, recorded=recorded: recorded <= Counter(
                    plain(reader.deserialize(raw, types[name])) for raw in list(self.live[name])),
                    f'{name} on the live graph as it was recorded')

    def messages(self, *topics: str) -> list[tuple[str, bytes, str, QoSProfile]]:
        """Read messages in their order, with the type and the quality that the bag offers."""
        with AnyReader([self.bag]) as reader:
            wanted = [each for each in reader.connections if each.topic in topics]
            return [(connection.topic, bytes(raw), connection.msgtype, qos_of(connection))
                    for connection, _, raw in reader.messages(wanted)]


def qos_of(connection: Any) -> QoSProfile:
    """Give the quality with which `ros2 bag play` offers a topic."""
    offered, = connection.ext.offered_qos_profiles
    return QoSProfile(depth=offered.depth,
                      reliability=QoSReliabilityPolicy[offered.reliability.name],
                      durability=QoSDurabilityPolicy[offered.durability.name])


def play_to_rviz(world: Any, until: Until, recorded: Recorded) -> dict[str, list[bytes]]:
    """
    Play a bag to subscriptions with RViz's quality of service.

    :return: what they got, by topic.
    """
    got: dict[str, list[bytes]] = {
        name: [] for name in (*RVIZ, *RVIZ_LATE) if name not in LACKING}
    messages = recorded.messages(*got)
    classes = {name: message_class(type_name) for name, _, type_name, _ in messages}
    publishers = {name: world.node.create_publisher(classes[name], name, qos)
                  for name, _, _, qos in messages}

    def listen(name: str, qos: QoSProfile) -> None:
        world.node.create_subscription(classes[name], name, got[name].append, qos, raw=True)

    for name in got.keys() & RVIZ.keys():
        listen(name, RVIZ[name])
        until(publishers[name].get_subscription_count, f'a subscription of {name}')
    sent: Counter[str] = Counter()
    for name, raw, _, _ in messages:
        publishers[name].publish(raw)
        sent[name] += 1
        if name in RVIZ and not sent[name] % RVIZ[name].depth:
            until(lambda: len(got[name]) == sent[name], f'{sent[name]} messages on {name}')
    for name in got.keys() & RVIZ_LATE.keys():
        listen(name, RVIZ_LATE[name])
    for name in got:
        wanted = sent[name] if name in RVIZ else 1
        until(lambda: len(got[name]) >= wanted, f'{wanted} messages on {name}')
    return got
