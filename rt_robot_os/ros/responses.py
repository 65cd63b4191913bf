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

"""
Responses of services that DDS does not take at first.

Fast DDS takes the response to a caller only when it has discovered the reader of that caller. On a
busy machine a caller may have discovered the service before that. After 0.1 s the middleware gives
up: rclpy warns, drops the response, and the caller waits for ever. So such a response is sent
again until it is taken, or the caller has left.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from typing import Final
import warnings

from rclpy.clock import Clock
from rclpy.clock import ClockType
from rclpy.node import Node

_REFUSED: Final = 'failed to send response'
RETRY_S: Final = 0.2
#: Discovery takes seconds on a busy machine; a caller that has not met the node by then is lost.
TRIES_MAXIMUM: Final = 100
#: Responses that may wait at the same time; of more the newest are lost.
WAITING_MAXIMUM: Final = 64


class Responses:
    """
    Send responses again that were not taken.

    :param node: whose services are meant: all that it has when this is made.
    :param tell: takes a line about each response that is lost.
    :ivar repeated: responses that were sent more than once.
    :ivar lost: responses that were given up.
    """

    def __init__(self, node: Node, tell: Callable[[str], None]) -> None:
        self.repeated = self.lost = 0
        self._node = node
        self._tell = tell
        self._waiting = 0
        self._clock = Clock(clock_type=ClockType.STEADY_TIME)
        # A warning is all that rclpy makes of it; as an error it can be caught. For good: changing
        # filters back and forth is not safe beside other threads.
        warnings.filterwarnings('error', _REFUSED, RuntimeWarning)
        service: Any  # the executor calls the method of the object, whatever it is
        for service in node.services:
            service.send_response = self._sender(service.send_response, service.srv_name)

    def _sender(self, send: Callable[[Any, Any], None], name: str
                ) -> Callable[[Any, Any], None]:
        def send_surely(response: Any, header: Any) -> None:
            if not _is_taken(send, response, header):
                self._repeat(lambda: _is_taken(send, response, header), name)

        return send_surely

    def _repeat(self, attempt: Callable[[], bool], name: str) -> None:
        if self._waiting >= WAITING_MAXIMUM:
            self._lose(name)
            return
        self.repeated += 1
        self._waiting += 1
        tries = 0

        def again() -> None:
            nonlocal tries
            tries += 1
            is_taken = attempt()
            if not is_taken and tries < TRIES_MAXIMUM:
                return
            self._waiting -= 1
            self._node.destroy_timer(timer)
            if not is_taken:
                self._lose(name)

        timer = self._node.create_timer(RETRY_S, again, clock=self._clock)

    def _lose(self, name: str) -> None:
        self.lost += 1
        self._tell(f'a response of {name} was lost: its caller was not discovered')


def _is_taken(send: Callable[[Any, Any], None], response: Any, header: Any) -> bool:
    try:
        send(response, header)
    except (RuntimeWarning, SystemError) as error:
        if isinstance(error, SystemError) and not isinstance(error.__cause__, RuntimeWarning):
            raise
        return False
    return True
