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

"""Print the messages of a topic, as `ros2 topic echo` does."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
import sys
import time
from typing import Any

import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions

from rt_robot_os.topics.resolve import message_class

_ITEMS_SHOWN = 16
_POLL_S = 0.1


def lines_of(value: Any, name: str = '', indent: int = 0) -> Iterator[str]:
    """Format a message as lines of YAML; long arrays are truncated."""
    pad = '  ' * indent
    if hasattr(value, 'get_fields_and_field_types'):
        if name:
            yield f'{pad}{name}:'
            indent += 1
        for field in value.get_fields_and_field_types():
            yield from lines_of(getattr(value, field), field, indent)
    elif isinstance(value, list | tuple) and value and hasattr(
            value[0], 'get_fields_and_field_types'):
        yield f'{pad}{name}:'
        for item in value:
            first, *rest = lines_of(item, indent=indent + 2)
            yield f'{pad}  - {first.strip()}'
            yield from rest
    elif isinstance(value, bool):
        yield f'{pad}{name}: {str(value).lower()}'  # YAML, as `ros2 topic echo`
    elif isinstance(value, str | bytes | int | float):
        yield f'{pad}{name}: {value!r}'
    else:
        items = np.asarray(value).tolist()
        cut = ', ...' if len(items) > _ITEMS_SHOWN else ''
        yield f'{pad}{name}: [{", ".join(map(str, items[:_ITEMS_SHOWN]))}{cut}]'


def _type_of(node: Node, topic: str, timeout_s: float, stopping: Callable[[], bool]
             ) -> str | None:
    deadline = time.monotonic() + timeout_s
    while time.monotonic() < deadline and not stopping():
        for name, types in node.get_topic_names_and_types():
            if name == topic:
                return str(types[0])
        rclpy.spin_once(node, timeout_sec=_POLL_S)
    return None


class _Printer:
    def __init__(self, hz: bool, count: int) -> None:
        self.hz = hz
        self.left = count or -1
        self._seen = 0
        self._since_s = time.monotonic()

    def __call__(self, message: Any) -> None:
        if not self.hz:
            print('\n'.join(lines_of(message)), '---', sep='\n', flush=True)
            self.left -= 1
            return
        self._seen += 1
        elapsed_s = time.monotonic() - self._since_s
        if elapsed_s >= 1.0:
            print(f'{self._seen / elapsed_s:.1f} Hz', flush=True)
            self._seen, self._since_s = 0, time.monotonic()
            self.left -= 1


def echo(topic: str, *, hz: bool, count: int, timeout_s: float,
         stopping: Callable[[], bool]) -> int:
    """
    Print a topic until stopped, or ``count`` times.

    :param stopping: returns whether to stop; called ten times a second. The caller handles
        signals: rclpy's own handlers would shut the context down while entities are created.
    :return: the exit code; 1 if the topic is not published.
    :raises BrokenPipeError: the output is no longer read.
    """
    topic = topic if topic.startswith('/') else f'/{topic}'
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node('rt_robot_os_echo')
    try:
        type_name = _type_of(node, topic, timeout_s, stopping)
        if stopping():
            return 0
        if type_name is None:
            print(f'echo: {topic} is not published (waited {timeout_s:g} s); known topics: '
                  + ', '.join(sorted(n for n, _ in node.get_topic_names_and_types())),
                  file=sys.stderr)
            return 1
        printer = _Printer(hz, count)
        # Best effort matches publishers of either reliability.
        node.create_subscription(message_class(type_name), topic, printer, qos_profile_sensor_data)
        while printer.left and not stopping():
            rclpy.spin_once(node, timeout_sec=_POLL_S)
        return 0
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
