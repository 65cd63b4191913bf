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


"""The transmit side of a UART: bytes leave one after the other at the speed of the line."""

from __future__ import annotations

from collections import deque
from typing import Final

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S

_BITS_PER_BYTE: Final = 10
# No real port wakes the reader for every byte: a UART buffers 16, USB adapters collect for 1 ms.
_FIFO: Final = 16


class LineTiming:
    """
    Bytes in transmission, bounded.

    :ivar byte_ns: time of a byte on the line, 0 without a speed.
    :ivar waiting: bytes that have not left yet.
    """

    def __init__(self, baud: int, capacity: int = 4096) -> None:
        """
        Make an empty line.

        :param baud: bits per second; 0 for no limit.
        :param capacity: limit of the waiting bytes.
        """
        self.byte_ns = _BITS_PER_BYTE * NS_PER_S // baud if baud else 0
        self.waiting = 0
        self._capacity = capacity
        self._free_ns = 0
        self._queue: deque[tuple[int, bytes]] = deque()
        self._sent = 0
        self._chunk = max(_FIFO, NS_PER_MS // self.byte_ns) if self.byte_ns else capacity

    def push(self, data: bytes, due_ns: int) -> bool:
        """
        Put bytes at the end.

        :param due_ns: the first leaves then, or after the previous bytes.
        :return: False if there is no room; then none of them is added.
        """
        if self.waiting + len(data) > self._capacity:
            return False
        if data:
            start_ns = max(due_ns, self._free_ns)
            self._queue.append((start_ns, data))
            self._free_ns = start_ns + len(data) * self.byte_ns
            self.waiting += len(data)
        return True

    def take(self, now_ns: int) -> bytes:
        """Remove and return the bytes that have left by now."""
        parts = []
        while self._queue:
            start_ns, data = self._queue[0]
            if start_ns > now_ns:
                break
            left = (now_ns - start_ns) // self.byte_ns if self.byte_ns else len(data)
            if left > self._sent:
                parts.append(data[self._sent:left])
                self._sent = min(left, len(data))
            if self._sent < len(data):
                break
            self._queue.popleft()
            self._sent = 0
        taken = b''.join(parts)
        self.waiting -= len(taken)
        return taken

    def next_ns(self, chunk: int | None = None) -> int | None:
        """
        Return when to call :meth:`take` next; None if the line is idle.

        :param chunk: bytes to wait for; by default a number that suits the speed.
        """
        if not self._queue:
            return None
        start_ns, data = self._queue[0]
        upto = min(self._sent + (chunk or self._chunk), len(data))
        return start_ns + upto * self.byte_ns


def at_wrong_speed(data: bytes, factor: float = 2.0) -> bytes:
    """
    Return the bytes that a receiver at another speed decodes.

    It waits for a start bit that is still low in its middle, then samples eight bits in their
    middle, at its own speed; a wrong stop bit does not suppress the byte, as on Linux by default.

    :param factor: length of the receiver's bit in bits of the sender; 2 is half of its speed.
    """
    level = [bit for byte in data for bit in (0, *(byte >> i & 1 for i in range(8)), 1)]
    size = len(level)
    heard = bytearray()
    at = 0
    while True:
        while at < size and level[at]:
            at += 1
        if at >= size:
            return bytes(heard)
        middle = at + int(factor * 0.5)
        if middle < size and level[middle]:
            at = middle  # too short for a start bit
            continue
        places = [at + int(factor * (i + 1.5)) for i in range(8)]
        heard.append(sum(1 << i for i, place in enumerate(places)
                         if place >= size or level[place]))
        at += int(factor * 9.5)
        # A start bit begins with an edge from idle.
        while at < size and not level[at]:
            at += 1
