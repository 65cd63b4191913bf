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

"""What mapping publishes is there for a viewer that comes late, as the robot mirrors it."""

from __future__ import annotations

from collections.abc import Iterator
import time
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')
pytest.importorskip('visualization_msgs', reason='ROS 2 messages are not installed')

from nav_msgs.msg import OccupancyGrid  # noqa: E402, I100
from nav_msgs.msg import Path  # noqa: E402
import rclpy  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import QoSDurabilityPolicy  # noqa: E402
from rclpy.qos import QoSProfile  # noqa: E402
from rclpy.qos import QoSReliabilityPolicy  # noqa: E402

from rt_robot_os.features.mapping.graph_markers import EdgeKind  # noqa: E402
from rt_robot_os.features.mapping.graph_markers import graph_numbers  # noqa: E402
from rt_robot_os.link import TopicInfo  # noqa: E402
from rt_robot_os.link.stamp_mapper import StampMapper  # noqa: E402
from rt_robot_os.ros.mirrors import OutwardMirror  # noqa: E402
from rt_robot_os.settings import default_path  # noqa: E402
from rt_robot_os.settings import load  # noqa: E402
from rt_robot_os.topics import Layout  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402

NUMBERS = 'std_msgs/msg/Float64MultiArray'
GENEROUS_S = 20.0


@pytest.fixture
def nodes() -> Iterator[tuple[Node, Node, SingleThreadedExecutor]]:
    context = rclpy.Context()
    rclpy.init(context=context)
    robot, viewer = (Node(name, context=context, use_global_arguments=False)
                     for name in ('robot', 'viewer'))
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(robot)
    executor.add_node(viewer)
    yield robot, viewer, executor
    executor.shutdown()
    for node in robot, viewer:
        node.destroy_node()
    rclpy.try_shutdown(context=context)


def sample(layout: Layout, **fields: Any) -> memoryview:
    buffer = layout.new_buffer()
    message = layout.view(buffer)
    for name, value in fields.items():
        setattr(message, name, value)
    return buffer[:layout.length(buffer)]


def test_who_comes_late_gets_map_way_and_graph(
        nodes: tuple[Node, Node, SingleThreadedExecutor]) -> None:
    robot, viewer, executor = nodes
    mirrors = {each.topic: each for each in load([default_path('service_robot.yaml')]).mirrors}
    numbers = Layout.compile(NUMBERS, {}, tail=100)
    grid = Layout.compile('nav_msgs/msg/OccupancyGrid', {'header.frame_id': 'map'}, tail=100)
    cells = sample(grid, data=[0, 100, -1, 0])
    grid.view(cells).info.width = grid.view(cells).info.height = 2
    samples = {
        'map': (grid, cells),
        'slam/path': (numbers, sample(numbers, data=[0.0, 0.0, 0.0, 1.0, 2.0, 0.5])),
        'slam/graph': (numbers, sample(numbers, data=graph_numbers(
            [(0.0, 0.0), (1.0, 0.0)], [(0, 1, EdgeKind.LOOP)])))}
    for number, (topic, (layout, cdr)) in enumerate(samples.items()):
        mirror = OutwardMirror(robot, mirrors[topic], StampMapper())
        mirror.connect(TopicInfo(topic, number, mirrors[topic].message, 2, layout.max_size,
                                 layout.stamp_offset, 1, 0))
        mirror.publish(time.monotonic_ns(), 0, cdr)
        assert mirror.published == 1
    heard: dict[str, Any] = {}
    latched = QoSProfile(depth=1, reliability=QoSReliabilityPolicy.RELIABLE,
                         durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
    for topic, kind in (('map', OccupancyGrid), ('slam/path', Path), ('slam/graph', MarkerArray)):
        viewer.create_subscription(
            kind, topic, lambda message, topic=topic: heard.update({topic: message}), latched)
    deadline = time.monotonic() + GENEROUS_S
    while len(heard) < 3:
        assert time.monotonic() < deadline, f'only {sorted(heard)} came'
        executor.spin_once(timeout_sec=0.02)
    found = heard['map']
    assert list(found.data) == [0, 100, -1, 0] and found.info.width == 2
    # The time of day, not that of the core's clock.
    assert abs(found.header.stamp.sec - time.time()) < 60 and found.header.frame_id == 'map'
    assert [(each.pose.position.x, each.pose.position.y) for each in heard['slam/path'].poses] == [
        (0.0, 0.0), (1.0, 2.0)]
    assert {each.ns for each in heard['slam/graph'].markers} == {'keyframes', 'loops'}
