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

"""Compare a bag with the live graph that it was recorded of, and play it as `ros2 bag play` does."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
import signal
from typing import Any

import numpy as np
from rclpy.qos import QoSDurabilityPolicy
from rclpy.qos import QoSProfile
from rclpy.qos import QoSReliabilityPolicy
from rosbags.highlevel import AnyReader
from rt_robot_os.topics.resolve import message_class

Until = Callable[..., Any]
RECORD = 'rt_robot_os.clients.recording.record_program'
# What the node alone publishes, and no bag of ours has.
OF_THE_NODE = {'/parameter_events', '/robot/transition_event'}
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
    A recording of a robot that runs, and all that is published meanwhile.

    :ivar bag: its folder.
    :ivar types: of the topics of the live graph.
    """

    def __init__(self, world: Any, until: Until) -> None:
        self.bag = world.folder / 'bag.yaml'  # whatever its name, the leftovers do not count it
        self._node = world.node
        self._until = until
        until(lambda: world.node.get_publishers_info_by_topic('/rosout'), 'the robot in the graph')
        published = dict(world.node.get_publisher_names_and_types_by_node('robot', '/'))
        subscribed = dict(world.node.get_subscriber_names_and_types_by_node('robot', '/'))
        self.types = {name: kinds[0] for name, kinds in (subscribed | published).items()
                      if name not in OF_THE_NODE}
        self._offered = {name: self._quality(name) for name in published if name in self.types}
        self._live: dict[str, list[bytes]] = {name: [] for name in self._offered}
        for name, (reliability, durability) in self._offered.items():
            world.node.create_subscription(
                message_class(self.types[name]), name, self._live[name].append,
                QoSProfile(depth=5000, reliability=reliability, durability=durability), raw=True)
        self._program = world.start(RECORD, '-o', str(self.bag))
        self._program.wait_for_line('connected to the core')

    def _quality(self, name: str) -> Any:
        return next((each.qos_profile.reliability, each.qos_profile.durability)
                    for each in self._node.get_publishers_info_by_topic(name)
                    if each.node_name == 'robot')

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
            assert types == self.types, set(types.items()) ^ set(self.types.items())
            for name, (reliability, durability) in self._offered.items():
                offered, = found[name].ext.offered_qos_profiles
                assert (offered.reliability.name, offered.durability.name) == (
                    reliability.name, durability.name), name
            messages: dict[str, Counter[Any]] = {name: Counter() for name in found}
            for connection, _, raw in reader.messages():
                messages[connection.topic][plain(
                    reader.deserialize(raw, connection.msgtype))] += 1
            silent = [name for name in with_messages if not messages[name]]
            assert not silent, f'nothing was recorded on {silent}'
            for name in self._offered:
                def more(name: str = name) -> Any:
                    live = Counter(plain(reader.deserialize(raw, self.types[name]))
                                   for raw in list(self._live[name]))
                    return messages[name] <= live
                self._until(more, f'{name} as it was recorded, on the live graph')

    def messages(self, *topics: str) -> list[tuple[str, bytes, QoSProfile]]:
        """Read messages in their order, with the quality that the bag offers."""
        with AnyReader([self.bag]) as reader:
            wanted = [each for each in reader.connections if each.topic in topics]
            return [(connection.topic, bytes(raw), qos_of(connection))
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
    got: dict[str, list[bytes]] = {name: [] for name in (*RVIZ, *RVIZ_LATE)}

    def listen(name: str, qos: QoSProfile) -> None:
        world.node.create_subscription(
            message_class(recorded.types[name]), name, got[name].append, qos, raw=True)

    messages = recorded.messages(*got)
    publishers = {name: world.node.create_publisher(
        message_class(recorded.types[name]), name, qos) for name, _, qos in messages}
    for name, qos in RVIZ.items():
        listen(name, qos)
        until(publishers[name].get_subscription_count, f'a subscription of {name}')
    sent: Counter[str] = Counter()
    for name, raw, _ in messages:
        publishers[name].publish(raw)
        sent[name] += 1
        if name in RVIZ and not sent[name] % RVIZ[name].depth:
            until(lambda: len(got[name]) == sent[name], f'{sent[name]} messages on {name}')
    for name, qos in RVIZ_LATE.items():
        listen(name, qos)
    for name in got:
        wanted = sent[name] if name in RVIZ else min(sent[name], 1)
        until(lambda: len(got[name]) >= wanted, f'{wanted} messages on {name}')
    return got
