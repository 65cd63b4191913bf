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
The clock of a client that polls its socket, so that a packet does not wake it.

Waking a process that waits for a packet costs the sender more than the packet itself: about 15 us
in a virtual machine, for an interrupt of another processor.
"""

from __future__ import annotations

import math
import select
import socket
import time

from rt_robot_os.base.units import NS_PER_MS

# What arrives until the next poll must fill at most a quarter of the smallest socket buffer.
_FETCH_BYTES = 64 << 10
SHORTEST_NS = NS_PER_MS


class FetchClock:
    """
    The times at which a client polls its socket.

    It starts with short intervals and polls more often when much arrives: the socket never fills.

    :param connection: to the core.
    :ivar interval_ns: from one poll to the next, up to a millisecond more; 0: the client waits
        for packets instead.
    """

    __slots__ = ('interval_ns', '_end', '_step_ns', '_last_ns')

    def __init__(self, connection: socket.socket) -> None:
        self.interval_ns = 0
        self._step_ns = SHORTEST_NS
        self._last_ns = 0
        # No event is requested: poll(2) then reports only the end of the connection.
        self._end = select.poll()
        self._end.register(connection, 0)

    def left_ns(self) -> int:
        """Return the time until the next poll; negative when it is overdue."""
        return self._last_ns + min(self._step_ns, self.interval_ns) - time.monotonic_ns()

    def wait(self, timeout_s: float) -> bool:
        """Wait for the next poll or the end of the connection; return whether either is due."""
        # poll(2) counts whole milliseconds.
        left_ms, limit_ms = math.ceil(self.left_ns() / NS_PER_MS), math.ceil(timeout_s * 1000)
        return (left_ms <= 0 or bool(self._end.poll(min(left_ms, limit_ms)))
                or left_ms <= limit_ms)

    def fetched(self, size: int) -> None:
        """
        Note that the socket was read until it was empty.

        :param size: bytes that were read.
        """
        if not self.interval_ns:
            return
        now_ns = time.monotonic_ns()
        step_ns = min(2 * self._step_ns, self.interval_ns)
        if size:
            step_ns = min(step_ns, (now_ns - self._last_ns) * _FETCH_BYTES // size)
        self._step_ns = max(SHORTEST_NS, step_ns)
        self._last_ns = now_ns
