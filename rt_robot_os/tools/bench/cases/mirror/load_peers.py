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

"""A ROS node that mirrors the topics of a core as the node of a robot does, and rclpy alone."""

# mypy: allow-untyped-calls

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from pathlib import Path
import time
from typing import Any

import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from rt_robot_os.link.stamp_mapper import StampMapper
from rt_robot_os.ros.mirrors import Mirrors
from rt_robot_os.settings import MirrorSettings
from rt_robot_os.tools.bench.cases.mirror.load_subjects import mirrored
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.subjects.link_client import connect
from rt_robot_os.tools.bench.subjects.link_client import stay
from rt_robot_os.tools.bench.subjects.operation_cost import IMU
from rt_robot_os.tools.bench.subjects.operation_cost import IMU_SHAPE
from rt_robot_os.topics import Layout
from rt_robot_os.topics.resolve import message_class

_DEPTH = 10
# As often as the core sends, and the first times do not count.
_PAUSE_S = 0.005
_WARM = 20


def node(arguments: Mapping[str, Any], ready: Callable[[], None]) -> None:
    """Be that node, without subscribers."""
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    made = Node('bench_robot', start_parameter_services=False, enable_rosout=False)
    mapper = StampMapper()
    mirrors = Mirrors(made, tuple(MirrorSettings(
        name=f'imu{i}', topic=mirrored(i), message=IMU, depth=_DEPTH,
        delay_ms=arguments['delay_ms'])
        for i in range(arguments['topics'])), mapper)
    ready()
    link = connect(Path(arguments['path']))
    mirrors.active = True
    mirrors.connect(link)
    stay(link, mapper.compare)


def raw(harness: Harness) -> Measurement:
    """Give the bytes of an Imu to ``topics`` publishers in turn, and nothing else: the floor."""
    a = harness.arguments
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    made = Node('bench', start_parameter_services=False, enable_rosout=False)
    publish = [made.create_publisher(message_class(IMU), mirrored(i), _DEPTH).handle.publish_raw
               for i in range(a['topics'])]
    cdr = bytes(Layout.compile(IMU, IMU_SHAPE).prototype)
    harness.prepare()
    costs: list[int] = []
    end_ns = time.monotonic_ns() + a['measure_ns']
    while time.monotonic_ns() < end_ns or len(costs) <= _WARM:
        begin_ns = time.thread_time_ns()
        for one in publish:
            one(cdr)
        costs.append((time.thread_time_ns() - begin_ns) // len(publish))
        time.sleep(_PAUSE_S)
    made.destroy_node()
    rclpy.try_shutdown()
    return Measurement({'raw_ns': np.array(costs[_WARM:], np.int64)})
