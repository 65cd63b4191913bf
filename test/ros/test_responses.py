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

"""A response that DDS does not take at first reaches its caller all the same."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
import time
from typing import Any
import warnings

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')
pytest.importorskip('std_srvs', reason='ROS 2 messages are not installed')

import rclpy  # noqa: E402, I100
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402

from rt_robot_os.ros import responses  # noqa: E402
from rt_robot_os.ros.responses import Responses  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

GENEROUS_S = 20.0


class Late:
    """Refuse responses as rclpy does while a caller is not discovered: with a warning."""

    def __init__(self, send: Callable[[Any, Any], None], refusals: int, as_native: bool) -> None:
        self.send = send
        self.left = refusals
        self.as_native = as_native

    def __call__(self, response: Any, header: Any) -> None:
        if not self.left:
            self.send(response, header)
            return
        self.left -= 1
        try:
            warnings.warn('failed to send response (timeout): client will not receive response',
                          RuntimeWarning)
        except RuntimeWarning as warning:
            if self.as_native:  # native code that has set an exception and returns a result
                raise SystemError('returned a result with an exception set') from warning
            raise


class World:
    """A node with a service, and another that calls it."""

    def __init__(self) -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node, self.caller = (Node(name, context=self.context, use_global_arguments=False)
                                  for name in ('robot', 'caller'))
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.executor.add_node(self.caller)
        self.service = self.node.create_service(Trigger, 'test', self._answer)
        self.client = self.caller.create_client(Trigger, 'test')
        self.until(self.client.service_is_ready)
        self.lines: list[str] = []

    def _answer(self, request: Any, response: Any) -> Any:
        response.message = 'done'
        return response

    def until(self, condition: Callable[[], Any]) -> None:
        deadline = time.monotonic() + GENEROUS_S
        while not condition():
            assert time.monotonic() < deadline, 'it did not happen'
            self.executor.spin_once(timeout_sec=0.02)


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> Iterator[World]:
    monkeypatch.setattr(responses, 'RETRY_S', 0.01)
    made = World()
    with warnings.catch_warnings():  # the filter that is set is for a whole process
        yield made
    made.executor.shutdown()
    for node in (made.node, made.caller):
        node.destroy_node()
    rclpy.try_shutdown(context=made.context)


@pytest.mark.parametrize('as_native', [False, True])
def test_a_response_is_sent_until_it_is_taken(world: World, as_native: bool) -> None:
    world.service.send_response = Late(world.service.send_response, 3, as_native)
    made = Responses(world.node, world.lines.append)
    timers = len(list(world.node.timers))
    future = world.client.call_async(Trigger.Request())
    world.until(future.done)
    assert future.result().message == 'done'
    assert (made.repeated, made.lost, world.lines) == (1, 0, [])
    assert len(list(world.node.timers)) == timers


def test_a_response_that_is_never_taken_is_reported(
        world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(responses, 'TRIES_MAXIMUM', 3)
    late = world.service.send_response = Late(world.service.send_response, 100, False)
    made = Responses(world.node, world.lines.append)
    future = world.client.call_async(Trigger.Request())
    world.until(lambda: made.lost)
    assert not future.done() and late.left == 96
    assert world.lines == ['a response of test was lost: its caller was not discovered']
