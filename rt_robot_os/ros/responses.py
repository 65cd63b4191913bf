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
Send responses of services again that DDS did not accept.

Fast DDS accepts a response only after it has discovered the reader of the caller. On a busy
machine a caller may have discovered the service before that. After 0.1 s the middleware gives up:
rclpy warns, drops the response, and the caller waits forever. So such a response is sent again
until it is accepted, or the caller has left.
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
#: Discovery takes seconds on a busy machine; later a caller counts as lost.
TRIES_MAXIMUM: Final = 100
#: The most responses that may wait at the same time; further ones are lost.
WAITING_MAXIMUM: Final = 64


class Responses:
    """
    Send responses again that were not accepted.

    :param node: with the services: all that it has at this time.
    :param log: called with a line for each response that is lost.
    :ivar repeated: responses that were sent more than once.
    :ivar lost: responses that were dropped.
    """

    def __init__(self, node: Node, log: Callable[[str], None]) -> None:
        self.repeated = self.lost = 0
        self._node = node
        self._log = log
        self._waiting = 0
        self._clock = Clock(clock_type=ClockType.STEADY_TIME)
        # rclpy only warns; as an error it can be caught. The filter stays, because changing
        # filters is not thread-safe.
        warnings.filterwarnings('error', _REFUSED, RuntimeWarning)
        service: Any  # the executor calls the attribute, which may be replaced
        for service in node.services:
            service.send_response = self._sender(service.send_response, service.srv_name)

    def _sender(self, send: Callable[[Any, Any], None], name: str
                ) -> Callable[[Any, Any], None]:
        def send_reliably(response: Any, header: Any) -> None:
            if not _is_accepted(send, response, header):
                self._repeat(lambda: _is_accepted(send, response, header), name)

        return send_reliably

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
            is_accepted = attempt()
            if not is_accepted and tries < TRIES_MAXIMUM:
                return
            self._waiting -= 1
            self._node.destroy_timer(timer)
            if not is_accepted:
                self._lose(name)

        timer = self._node.create_timer(RETRY_S, again, clock=self._clock)

    def _lose(self, name: str) -> None:
        self.lost += 1
        self._log(f'a response of {name} was lost: its caller was not discovered')


def _is_accepted(send: Callable[[Any, Any], None], response: Any, header: Any) -> bool:
    try:
        send(response, header)
    except (RuntimeWarning, SystemError) as error:
        if isinstance(error, SystemError) and not isinstance(error.__cause__, RuntimeWarning):
            raise
        return False
    return True
