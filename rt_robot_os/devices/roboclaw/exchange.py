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
The request queue of a RoboClaw: one request in flight, the others wait for their turn.

It never blocks: the driver asks for the next request to send, and reports answers. A request
without an answer is repeated, and fails after a few times. After a failure nothing is sent for
longer than the unit keeps a partial request, so that a late answer is not used for the next
request. Only urgent requests are sent while an answer is in flight; the unit answers in the order
of the requests.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.roboclaw.wire import GAP_S
from rt_robot_os.devices.roboclaw.wire import RoboClawDecoder
from rt_robot_os.devices.roboclaw.wire import RoboClawRequest

TRIES: Final = 3
# Each turn adds several; more than this wait only if the unit does not answer.
MOST_WAITING: Final = 16
# One, and some urgent ones.
_MOST_FLYING: Final = 4

# Time of a request that was sent before the time was known.
_NOW: Final = -1
_QUIET_NS: Final = round(1.5 * GAP_S * NS_PER_S)

Make = Callable[[], RoboClawRequest]


class RequestQueue:
    """
    The requests for one unit; safe in the real-time loop.

    :ivar timeouts: requests without a complete answer in time.
    :ivar retries: requests that were repeated, after a time-out or a wrong answer.
    :ivar given_up: requests that failed finally.
    """

    def __init__(self, decoder: RoboClawDecoder, answer_ns: int) -> None:
        """
        Start with nothing to send.

        :param answer_ns: how long an answer may take to be complete.
        """
        self.timeouts = self.retries = self.given_up = 0
        self._decoder = decoder
        self._answer_ns = answer_ns
        self._waiting: deque[Make] = deque()
        # With the number of times that each has been sent.
        self._flying: deque[tuple[Make, int]] = deque()
        self._again: deque[tuple[Make, int]] = deque()
        self._last: Make | None = None
        self._sent_ns = 0
        self._quiet_ns = 0

    @property
    def is_idle(self) -> bool:
        """Return whether nothing waits and nothing is in flight."""
        return not (self._flying or self._again or self._waiting)

    def clear(self) -> None:
        """Reset everything: the port was just opened."""
        self._decoder.reset()
        self._waiting.clear()
        self._flying.clear()
        self._again.clear()
        self._quiet_ns = 0

    def add(self, make: Make) -> None:
        """
        Add a request to the queue.

        :param make: called to make it each time it is sent.
        """
        if len(self._waiting) < MOST_WAITING:
            self._waiting.append(make)
        else:
            self.given_up += 1

    def put_first(self, make: Make) -> None:
        """
        Put a request first; if it waits already, it moves ahead.

        After it another one is sent first, so that it starves no other.
        """
        if make in self._waiting:
            self._waiting.remove(make)
        self._waiting.insert(1 if make == self._last else 0, make)

    def interrupt(self, make: Make) -> bytes:
        """
        Return an urgent request: the caller sends it immediately, whatever is in flight.

        Its time-out starts with the next :meth:`due`.
        """
        if self._decoder.failed:
            self._put_back()
        elif len(self._flying) >= _MOST_FLYING:
            self.given_up += len(self._flying)
            self._flying.clear()
            self._decoder.abandon()
        return self._send(make, 0, _NOW)

    def due(self, now_ns: int) -> bytes:
        """Return the bytes to send now, usually none."""
        if self._flying:
            if self._sent_ns == _NOW:
                self._sent_ns = now_ns
            if not self._decoder.failed:
                if now_ns - self._sent_ns < self._answer_ns:
                    return b''
                self.timeouts += 1
                self._decoder.learn()
            self._put_back()
            self._quiet_ns = now_ns + _QUIET_NS
        if now_ns < self._quiet_ns:
            return b''
        if self._again:
            self.retries += 1
            return self._send(*self._again.popleft(), now_ns)
        if not self._waiting:
            return b''
        make = self._last = self._waiting.popleft()
        return self._send(make, 0, now_ns)

    def answered(self) -> None:
        """Record the answer to the request that was sent first."""
        if self._flying:
            self._flying.popleft()

    def _send(self, make: Make, tries: int, now_ns: int) -> bytes:
        request = make()
        self._decoder.expect(request, behind=bool(self._flying))
        self._flying.append((make, tries + 1))
        self._sent_ns = now_ns
        return request.data

    def _put_back(self) -> None:
        """Repeat all requests in flight, the last one first."""
        self._decoder.abandon()
        while self._flying:
            make, tries = self._flying.popleft()
            if tries < TRIES and len(self._again) < MOST_WAITING:
                self._again.appendleft((make, tries))
            else:
                self.given_up += 1
