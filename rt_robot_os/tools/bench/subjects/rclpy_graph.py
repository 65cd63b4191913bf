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

"""An rclpy node, its executors, and the way to run and end them, the same for all cases."""

# mypy: allow-untyped-calls

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import rclpy
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock
from rclpy.clock import ClockType
from rclpy.executors import MultiThreadedExecutor
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from rt_robot_os.base.units import NS_PER_S

# By itself it takes one thread for each CPU that it may use, which is one.
_THREADS = 4


def make_executor(name: str) -> Any:
    """
    Make an executor.

    :param name: ``single``, ``multi`` or ``events``.
    :raises ImportError: this rclpy has no such executor.
    """
    if name == 'multi':
        return MultiThreadedExecutor(num_threads=_THREADS)
    if name == 'events':
        from rclpy.experimental import EventsExecutor
        return EventsExecutor()
    return SingleThreadedExecutor()


class RclpyGraph:
    """One node and one executor; timers on CLOCK_MONOTONIC, each in a group of its own."""

    def __init__(self, node: Node, executor: Any) -> None:
        self.node = node
        self._executor = executor
        self._clock = Clock(clock_type=ClockType.STEADY_TIME)
        self._over = Future()
        executor.add_node(node)

    def timer(self, period_ns: int, callback: Callable[[], None]) -> Any:
        """Call something periodically."""
        return self.node.create_timer(
            period_ns / NS_PER_S, callback, callback_group=MutuallyExclusiveCallbackGroup(),
            clock=self._clock)

    def spin(self, duration_ns: int) -> None:
        """Run the callbacks for a duration, or until :meth:`end`."""
        self._over = Future()
        timer = self.timer(duration_ns, self.end)
        # Without a time limit the EventsExecutor of rclpy 7.1 does not come back.
        self._executor.spin_until_future_complete(
            self._over, timeout_sec=2 * duration_ns / NS_PER_S)
        self.node.destroy_timer(timer)

    def end(self) -> None:
        """End :meth:`spin`; for a callback."""
        if not self._over.done():
            self._over.set_result(None)


@contextmanager
def graph(executor: str) -> Iterator[RclpyGraph]:
    """
    Make a node with an executor, and end both.

    :param executor: see :func:`make_executor`.
    """
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = Node('bench', start_parameter_services=False, enable_rosout=False)
    try:
        yield RclpyGraph(node, make_executor(executor))
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
