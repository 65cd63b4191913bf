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

"""Publish the mountings of the configuration on ``/tf_static``."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSDurabilityPolicy
from rclpy.qos import QoSProfile
from rclpy.qos import QoSReliabilityPolicy

from rt_robot_os.link.conversions import TRANSFORMS
from rt_robot_os.ros.conversions import is_lacking
from rt_robot_os.settings.model import MountedFrame
from rt_robot_os.settings.static_frames import DEPTH
from rt_robot_os.settings.static_frames import static_transforms
from rt_robot_os.settings.static_frames import TOPIC
from rt_robot_os.topics.resolve import message_class


class StaticTransforms:
    """
    The publisher of the mountings; without frames, or without tf2_msgs, it does nothing.

    :ivar lacking: tf2_msgs is not installed, although there are frames to publish.
    """

    def __init__(self, node: Node, frames: Iterable[MountedFrame]) -> None:
        self._node = node
        self._frames = tuple(frames)
        self.lacking = bool(self._frames) and is_lacking()
        self._publisher: Any = None
        if self._frames and not self.lacking:
            self._publisher = node.create_publisher(message_class(TRANSFORMS), TOPIC, QoSProfile(
                depth=DEPTH, reliability=QoSReliabilityPolicy.RELIABLE,
                durability=QoSDurabilityPolicy.TRANSIENT_LOCAL))

    def publish(self, wall_ns: int) -> None:
        """
        Publish all mountings in one message.

        :param wall_ns: ROS time.
        """
        if self._publisher is not None:
            self._publisher.publish(static_transforms(self._frames, wall_ns))

    def destroy(self) -> None:
        """Remove the publisher from the node."""
        if self._publisher is not None:
            self._node.destroy_publisher(self._publisher)
            self._publisher = None

    def counters(self) -> list[tuple[str, dict[str, Any]]]:
        """Return the mountings for /diagnostics."""
        if not self._frames:
            return []
        frames = {each.frame_id: f'on {each.mounting.parent}' for each in self._frames}
        warning = 'the ROS package tf2_msgs is not installed' if self.lacking else ''
        return [(f'mountings -> {TOPIC}', {'warning': warning, **frames})]
