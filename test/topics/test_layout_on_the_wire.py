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

"""Layouts on the wire: a real publisher takes our bytes, real subscriptions read them."""

from __future__ import annotations

from importlib import import_module
from typing import Any
import warnings

import pytest

from rt_robot_os.topics.layout import Layout

rclpy = pytest.importorskip('rclpy', reason='rclpy is not installed: nothing to publish with')
serialization = import_module('rclpy.serialization')
with warnings.catch_warnings():
    # The type supports import a parser of ROS 2's own, which uses modules Python deprecates.
    warnings.simplefilter('ignore', DeprecationWarning)
    import_module('rosidl_generator_py')


def test_rclpy_publishes_our_bytes_and_both_kinds_of_subscription_receive_them() -> None:
    from std_msgs.msg import Bool
    from std_msgs.msg import String
    context = rclpy.Context()
    rclpy.init(context=context)
    node = rclpy.create_node('layout_test', context=context)
    executor = import_module('rclpy.executors').SingleThreadedExecutor(context=context)
    executor.add_node(node)
    try:
        for cls, shape in ((Bool, {}), (String, {'data': 'four'})):
            layout = Layout.compile(cls, shape)
            raw: list[bytes] = []
            typed: list[Any] = []
            topic = f'layout_{cls.__name__.lower()}'
            publisher = node.create_publisher(cls, topic, 10)
            node.create_subscription(cls, topic, raw.append, 10, raw=True)
            node.create_subscription(cls, topic, typed.append, 10)
            for _ in range(100):
                if publisher.get_subscription_count() == 2:
                    break
                executor.spin_once(timeout_sec=0.05)
            else:
                pytest.skip('subscriptions are not discovered: no DDS in this environment')
            publisher.publish(layout.prototype)
            publisher.publish(typed_message := serialization.deserialize_message(
                layout.prototype, cls))
            for _ in range(100):
                if len(raw) == len(typed) == 2:
                    break
                executor.spin_once(timeout_sec=0.05)
            assert typed == [typed_message] * 2
            assert [layout.check(data) for data in raw] == [None, None]
            assert [len(data) for data in raw] == [layout.size] * 2
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.shutdown(context=context)
