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

"""What it costs the ROS node to publish a sample: mirrored as it is, or built as a message."""

# mypy: allow-untyped-calls

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
import time
from typing import Any

import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.link import TopicInfo
from rt_robot_os.link.stamp_mapper import StampMapper
from rt_robot_os.ros.mirrors import OutwardMirror
from rt_robot_os.settings import MirrorSettings
from rt_robot_os.tools.bench.case import Samples
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.subjects.operation_cost import IMU
from rt_robot_os.tools.bench.subjects.operation_cost import IMU_SHAPE
from rt_robot_os.topics import Layout
from rt_robot_os.topics.resolve import message_class

_SUBSCRIBER = f'{__name__}:subscriber'
_MATCH_TIMEOUT_S = 15.0
_BLOCK = 100
_PAUSE_S = 0.02
_DEPTH = 10


def node(harness: Harness) -> Measurement:
    """
    Publish blocks of samples in turns, and take the CPU time of the publishing thread.

    ``subscribers`` of the topic, 0 or 1, are in a process of their own.
    """
    a = harness.arguments
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    made = Node('bench', start_parameter_services=False, enable_rosout=False)
    try:
        if not a['subscribers']:
            return _measure(harness, made, 0)
        with harness.helper(_SUBSCRIBER, {}, same_cpu=False):
            return _measure(harness, made, 1)
    finally:
        made.destroy_node()
        rclpy.try_shutdown()


def _measure(harness: Harness, made: Node, subscribers: int) -> Measurement:
    a = harness.arguments
    carry, carried = _carrying(made)
    build, built = _building(made)
    deadline = time.monotonic() + _MATCH_TIMEOUT_S
    while min(p.get_subscription_count() for p in (carried, built)) < subscribers:
        if time.monotonic() > deadline:
            raise RuntimeError('the subscriber in the other process was not found')
        time.sleep(0.05)
    harness.prepare()
    carries: list[int] = []
    builds: list[int] = []
    warm = 3
    end_ns = time.monotonic_ns() + a['warmup_ns'] + a['measure_ns']
    while time.monotonic_ns() < end_ns or len(carries) <= warm:
        carries.append(_block_ns(carry))
        builds.append(_block_ns(build))
    samples: dict[str, Samples] = {'carry_ns': np.array(carries[warm:], np.int64),
                                   'build_ns': np.array(builds[warm:], np.int64)}
    return Measurement(samples)


def _block_ns(publish: Callable[[], None]) -> int:
    begin_ns = time.thread_time_ns()
    for _ in range(_BLOCK):
        publish()
    used_ns = time.thread_time_ns() - begin_ns
    time.sleep(_PAUSE_S)  # the middleware's own threads catch up
    return used_ns // _BLOCK


def _carrying(made: Node) -> tuple[Callable[[], None], Any]:
    layout = Layout.compile(IMU, IMU_SHAPE)
    mirror = OutwardMirror(made, MirrorSettings(
        name='imu', topic='imu/data', message=IMU, ros_topic='imu/carried', depth=_DEPTH),
        StampMapper())
    mirror.connect(TopicInfo('imu/data', 0, IMU, layout.size, layout.max_size,
                             layout.stamp_offset, 16, 0.0))
    sample = memoryview(bytearray(layout.prototype))
    stamp_ns = [NS_PER_S]

    def carry() -> None:
        stamp_ns[0] += NS_PER_MS
        mirror.publish(stamp_ns[0], 0, sample)

    return carry, mirror.publisher


def _building(made: Node) -> tuple[Callable[[], None], Any]:
    kind = message_class(IMU)
    publisher = made.create_publisher(kind, 'imu/built', _DEPTH)
    clock = made.get_clock()

    def build() -> None:
        message = kind()
        message.header.stamp = clock.now().to_msg()
        message.header.frame_id = 'imu_link'
        q, v, a = message.orientation, message.angular_velocity, message.linear_acceleration
        q.x, q.y, q.z, q.w = 0.1, 0.2, 0.3, 0.9
        v.x, v.y, v.z = 0.1, 0.2, 0.3
        a.x, a.y, a.z = 0.1, 0.2, 9.8
        publisher.publish(message)

    return build, publisher


def subscriber(arguments: Mapping[str, Any], ready: Callable[[], None]) -> None:
    """Be the other side: take both topics and do nothing with them."""
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    made = Node('bench_subscriber', start_parameter_services=False, enable_rosout=False)
    for topic in ('imu/carried', 'imu/built'):
        made.create_subscription(message_class(IMU), topic, _nothing, _DEPTH, raw=True)
    ready()
    rclpy.spin(made)


def _nothing(message: object) -> None:
    """Do nothing."""
