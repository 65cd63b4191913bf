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

"""
The topics of a bag: the topics of a robot in ROS, with names, types and quality of service.

They follow from the robot's settings, with the same conversions as the mirrors of its node. Of the
topics that only the node publishes, a bag has those that follow from the settings or the reports
of the core: ``/tf_static`` and ``/rosout``.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.link import log_message
from rt_robot_os.link.conversions import Outward
from rt_robot_os.link.conversions import TRANSFORMS
from rt_robot_os.recording.bag_info import TopicFacts
from rt_robot_os.recording.definitions import type_hash
from rt_robot_os.settings import from_json
from rt_robot_os.settings import MirrorSettings
from rt_robot_os.settings import RobotSettings
from rt_robot_os.settings import static_frames
from rt_robot_os.settings.mirror_types import outward
from rt_robot_os.settings.mirror_types import ros_type
from rt_robot_os.settings.names import full_topic
from rt_robot_os.settings.static_frames import published_frames

#: Published only by the node, and also recorded.
STATIC: Final = TopicFacts(
    static_frames.TOPIC, TRANSFORMS, type_hash(TRANSFORMS), durability='transient_local',
    depth=static_frames.DEPTH)
LOG: Final = TopicFacts(
    log_message.TOPIC, log_message.LOG, type_hash(log_message.LOG), durability='transient_local',
    depth=log_message.DEPTH)


@dataclass(frozen=True)
class ShownTopic:
    """
    A topic of a bag to which samples of one topic of the core are written.

    :ivar facts: its name, type and quality of service.
    :ivar convert: converts its messages; None if they are those of the core.
    :ivar joint: several topics of the core are written to it, such as transforms to ``/tf``.
    """

    facts: TopicFacts
    convert: Outward | None = None
    joint: bool = False

    @property
    def latched(self) -> bool:
        """Whether late subscribers receive the last message."""
        return self.facts.durability == 'transient_local'


class TopicGraph:
    """
    The topics of one robot.

    :param settings: with the names of mirrors as resolved by the node.
    :param robot: its name, see :func:`rt_robot_os.linux.paths.robot_name`.
    :param core_names: use the names of the core, and convert nothing.
    :ivar in_ros: the topics of the core of each name in ROS.
    """

    def __init__(self, settings: RobotSettings, robot: str, core_names: bool = False) -> None:
        self.settings = settings
        self._robot = robot
        *namespace, self._node = robot.split('.')
        self._namespace = '/' + '/'.join(namespace)
        self._core_names = core_names
        self._mirrors: dict[str, list[MirrorSettings]] = {}
        self.in_ros: dict[str, list[str]] = {}
        # Mirrors with the same name share one publisher.
        self._first: dict[str, MirrorSettings] = {}
        # A topic from ROS has its name in ROS, unless it is also mirrored to ROS.
        for mirror in sorted(settings.mirrors, key=lambda each: each.direction != 'out'):
            known = self._mirrors.setdefault(mirror.topic, [])
            if mirror.direction == 'out' or not known:
                known.append(mirror)
                name = self._name(mirror)
                self._first.setdefault(name, mirror)
                self.in_ros.setdefault(name, []).append(mirror.topic)

    @property
    def own(self) -> tuple[TopicFacts, ...]:
        """Return the topics without a topic of the core."""
        if self._core_names:
            return ()
        return (*((STATIC,) if published_frames(self.settings) else ()), LOG)

    def is_mirrored(self, topic: str) -> bool:
        """Return whether a topic of the core is mirrored."""
        return topic in self._mirrors

    def has(self, topic: str) -> bool:
        """
        Return whether a topic of the core is recorded by default.

        Those are the mirrored topics; all topics if none is mirrored.
        """
        return self._core_names or topic in self._mirrors or not self._mirrors

    def find(self, text: str, known: Collection[str]) -> tuple[str, ...]:
        """
        Find the topics that a user names.

        :param text: a name in ROS, or in the core.
        :param known: the topics of the core.
        :return: topics of the core, or the full name of a topic without one; empty if unknown.
        """
        name = text.strip('/')
        if text.startswith('/') and f'/{name}' in self.in_ros:
            return tuple(self.in_ros[f'/{name}'])
        if f'/{name}' in {facts.name for facts in self.own}:
            return f'/{name}',
        return (name,) if name in known else tuple(self.in_ros.get(f'/{name}', ()))

    def shown(self, topic: str, type_name: str) -> tuple[ShownTopic, ...]:
        """
        Return the bag topics of a topic of the core.

        :param type_name: its type in the core.
        """
        mirrors = self._mirrors.get(topic, [])
        if self._core_names:
            return ShownTopic(self._facts(f'/{topic}', type_name, mirrors[0] if mirrors else None,
                                          topic)),
        if not mirrors:
            name = full_topic(topic, self._namespace, self._node)
            if name in self.in_ros:
                name = full_topic(f'~/{topic}', self._namespace, self._node)
            return ShownTopic(self._facts(name, type_name, None, topic)),
        found: list[ShownTopic] = []
        for mirror in mirrors:
            try:
                convert = outward(mirror)
            except ValueError:
                continue  # it can only be converted from ROS
            # A replay compares with the first topic that has the bytes of the core.
            is_raw = convert is None and all(each.convert is not None for each in found)
            name = self._name(mirror)
            found.append(ShownTopic(
                self._facts(name, ros_type(mirror), self._first[name], topic if is_raw else ''),
                convert,
                len(self.in_ros[name]) > 1))
        return tuple(found)

    def logger(self, source: str) -> str:
        """Return the logger name of a part of the core, as in the node."""
        return log_message.logger_name(self._robot, source)

    def _name(self, mirror: MirrorSettings) -> str:
        return full_topic(mirror.ros_topic, self._namespace, self._node)

    @staticmethod
    def _facts(name: str, type_name: str, mirror: MirrorSettings | None, core_topic: str
               ) -> TopicFacts:
        facts = TopicFacts(name, type_name, type_hash(type_name), core_topic=core_topic)
        if mirror is None:
            return facts
        # A topic from ROS gets a publisher that matches every subscription.
        reliability = mirror.reliability if mirror.direction == 'out' else 'reliable'
        return TopicFacts(name, type_name, facts.type_hash, reliability, mirror.durability,
                          mirror.depth, core_topic)


def read_graph(settings: str | None, robot: str, core_names: bool = False
               ) -> tuple[TopicGraph, str]:
    """
    Read the graph of a robot.

    :param settings: of the core, as JSON; None if unknown.
    :return: the graph, and why it has no mirrors; '' if the settings could be read.
    """
    try:
        if settings is not None:
            return TopicGraph(from_json(settings), robot, core_names), ''
        problem = 'the settings of the robot are unknown'
    except ConfigError as error:
        problem = str(error)
    return TopicGraph(RobotSettings(), robot, core_names), (
        f'{problem}: topics have the names and types of the core')
