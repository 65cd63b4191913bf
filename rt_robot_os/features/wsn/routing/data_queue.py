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

"""Data packets of a node: a forwarding queue and a cache that detects duplicates."""

from __future__ import annotations

from collections import deque
from collections import OrderedDict
from collections.abc import Callable
from collections.abc import Hashable
from typing import Final
from typing import NamedTuple
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rt_robot_os.features.wsn.routing.protocol import Node

#: Uniform delay between two tries; multiplied by the number of tries, up to _MOST_PAUSES.
_PAUSE_NS: Final = (4_000_000, 12_000_000)
_MOST_PAUSES: Final = 6
#: Delay before the next try without a route.
_NO_ROUTE_PAUSE_NS: Final = 250_000_000


class QueuedPacket(NamedTuple):
    """
    A packet in the queue.

    :ivar am_type: of the active message.
    :ivar payload: of the active message.
    :ivar since_ns: when it was queued, on the node's clock.
    """

    am_type: int
    payload: bytes
    since_ns: int


class DataQueue:
    """
    FIFO queue of packets; each is sent until it is acknowledged or too old.

    Counts ``queue_full``, ``resends`` and ``given_up``.

    :param next_hop: returns the current next hop; None without a route.
    :param tried: called after each try with the next hop and whether it acknowledged.
    :param size: largest number of packets.
    :param lifetime_ns: age at which a packet is dropped.
    """

    def __init__(self, node: Node, next_hop: Callable[[], int | None],
                 tried: Callable[[int, bool], None], size: int, lifetime_ns: int,
                 counters: dict[str, int]) -> None:
        self._node = node
        self._next_hop = next_hop
        self._tried = tried
        self._size = size
        self._lifetime_ns = lifetime_ns
        self._counters = counters
        self._packets: deque[QueuedPacket] = deque()
        self._sender = node.sender(self._done)
        self._timer = node.timer(self.send_next)
        self._sent_to: int | None = None
        self._tries = 0
        self._pausing = False

    def __len__(self) -> int:
        """Return the number of packets."""
        return len(self._packets)

    def push(self, am_type: int, payload: bytes) -> bool:
        """
        Send a packet.

        :return: False when the queue is full; the packet is lost.
        """
        if len(self._packets) >= self._size:
            self._count('queue_full')
            return False
        self._packets.append(QueuedPacket(am_type, payload, self._node.now_ns()))
        if not self._pausing:
            self.send_next()
        return True

    def clear(self) -> None:
        """Remove all packets."""
        self._packets.clear()
        self._timer.stop()
        self._sent_to = None
        self._tries = 0
        self._pausing = False

    def send_next(self) -> None:
        """Send the next packet, if there is one and a route."""
        if self._sent_to is not None:
            return
        self._pausing = False
        self._drop_old()
        if not self._packets:
            return
        to = self._next_hop()
        packet = self._packets[0]
        if to is not None and self._sender.send(to, packet.am_type, packet.payload, True):
            self._sent_to = to
            if self._tries:
                self._count('resends')
        else:
            self._pause(_NO_ROUTE_PAUSE_NS)

    def _done(self, acknowledged: bool) -> None:
        to = self._sent_to
        if to is None:
            return
        self._sent_to = None
        if acknowledged:
            self._packets.popleft()
            self._tries = 0
            self._tried(to, True)
            self.send_next()
            return
        self._tries += 1
        self._tried(to, False)
        pause_ns = self._node.random.randint(*_PAUSE_NS)
        self._pause(pause_ns * min(self._tries, _MOST_PAUSES))

    def _pause(self, duration_ns: int) -> None:
        self._pausing = True
        self._timer.start(duration_ns)

    def _drop_old(self) -> None:
        born_ns = self._node.now_ns() - self._lifetime_ns
        while self._packets and self._packets[0].since_ns < born_ns:
            self._packets.popleft()
            self._tries = 0
            self._count('given_up')

    def _count(self, name: str) -> None:
        self._counters[name] = self._counters.get(name, 0) + 1


class DuplicateCache:
    """
    Keys of the packets of the last seconds, to detect duplicates.

    Sequence numbers start again when a node boots, so an entry expires after the time for which
    copies of a packet can be in transit.

    :param most: largest number of entries; beyond it the oldest is evicted.
    :param memory_ns: time after which an entry expires.
    """

    __slots__ = ('_most', '_memory_ns', '_times')

    def __init__(self, most: int, memory_ns: int) -> None:
        self._most = most
        self._memory_ns = memory_ns
        self._times: OrderedDict[Hashable, int] = OrderedDict()

    def contains(self, key: Hashable, now_ns: int) -> bool:
        """Return whether the key was added and has not expired."""
        then_ns = self._times.get(key)
        return then_ns is not None and now_ns - then_ns <= self._memory_ns

    def add(self, key: Hashable, now_ns: int) -> None:
        """Add a key, or renew it."""
        self._times[key] = now_ns
        self._times.move_to_end(key)
        if len(self._times) > self._most:
            self._times.popitem(last=False)
