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

"""A ROS node that mirrors the topics of a core as the node of a robot does."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from rt_robot_os.clients.ros.mirrors import Mirrors
from rt_robot_os.link.stamp_mapper import StampMapper
from rt_robot_os.settings import MirrorSettings
from rt_robot_os.tools.bench.link_client import connect
from rt_robot_os.tools.bench.link_client import stay
from rt_robot_os.tools.bench.workers.micro import IMU
from rt_robot_os.tools.bench.workers.mirror_load import mirrored

_DEPTH = 10


def node(arguments: Mapping[str, Any], ready: Callable[[], None]) -> None:
    """Be that node, with nobody who listens."""
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
