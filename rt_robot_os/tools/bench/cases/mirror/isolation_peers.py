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

"""The ROS side of a core: a node that mirrors its topics, and a storm of participants."""

# mypy: allow-untyped-calls

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from rt_robot_os.link.stamp_mapper import StampMapper
from rt_robot_os.ros.mirrors import OutwardMirror
from rt_robot_os.settings import MirrorSettings
from rt_robot_os.tools.bench.cases.mirror.isolation import topic
from rt_robot_os.tools.bench.subjects.link_client import connect
from rt_robot_os.tools.bench.subjects.link_client import stay
from rt_robot_os.tools.bench.subjects.operation_cost import IMU

_DEPTH = 10
_PARTICIPANTS = 4


def node(arguments: Mapping[str, Any], ready: Callable[[], None]) -> None:
    """Be a node that publishes the first ``mirrored`` topics of the core as they are."""
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    made = Node('bench_robot', start_parameter_services=False, enable_rosout=False)
    path, mapper = Path(arguments['path']), StampMapper()
    mirrors = [OutwardMirror(made, MirrorSettings(
        name=f'imu{i}', topic=topic(i), message=IMU, depth=_DEPTH), mapper)
        for i in range(arguments['mirrored'])]
    ready()
    link = connect(path)
    for i, mirror in enumerate(mirrors):
        mirror.connect(link.topics[topic(i)])
        link.sample_handlers[link.topics[topic(i)].channel] = mirror.publish
        link.mirror(topic(i))
    stay(link)


def storm(arguments: Mapping[str, Any], ready: Callable[[], None]) -> None:
    """Let participants with a publisher and a subscription each join and leave all the time."""
    from rt_robot_os.topics.resolve import message_class
    kind = message_class(IMU)
    alive: deque[tuple[Context, Node]] = deque()
    count = 0
    while True:
        context = Context()
        rclpy.init(args=[], context=context)
        made = Node(f'storm{count}', context=context)
        made.create_publisher(kind, topic(count % 50), _DEPTH)
        made.create_subscription(kind, topic(count % 50), lambda message: None, _DEPTH)
        alive.append((context, made))
        count += 1
        if count == 1:
            ready()
        if len(alive) > _PARTICIPANTS:
            old_context, old = alive.popleft()
            old.destroy_node()
            rclpy.try_shutdown(context=old_context)
