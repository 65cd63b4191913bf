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

"""Retransmission of a packet to the parent until it is acknowledged."""

from __future__ import annotations

from collections.abc import Callable

from rt_robot_os.features.wsn.routing.protocol import BROADCAST
from rt_robot_os.features.wsn.routing.protocol import Node


class Packet:
    """
    A data packet for the sink.

    :ivar destination: the current parent, or ``BROADCAST`` without one.
    :ivar am_type: of the active message.
    :ivar payload: of the active message.
    """

    __slots__ = ('destination', 'am_type', 'payload')

    def __init__(self, destination: int, am_type: int, payload: bytes) -> None:
        self.destination = destination
        self.am_type = am_type
        self.payload = payload


class Retransmitter:
    """
    Sends one packet at a time, with immediate retransmissions, as MultiHopLQI does.

    :ivar packet: that is being sent; during ``finished``, the last one.
    :param destination: returns the parent for a retransmission.
    :param finished: called when a packet was acknowledged or dropped; a new one may be sent then.
    :param retransmissions: largest number for a packet.
    :param counters: of the protocol; it updates ``resends`` and ``given_up``.
    """

    __slots__ = ('packet', '_counters', '_destination', '_finished', '_retransmissions', '_left',
                 '_sender', '_running')

    def __init__(self, node: Node, destination: Callable[[], int],
                 finished: Callable[[], None], retransmissions: int,
                 counters: dict[str, int]) -> None:
        self.packet: Packet | None = None
        self._counters = counters
        self._destination = destination
        self._finished = finished
        self._retransmissions = retransmissions
        self._left = 0
        self._running = False
        self._sender = node.sender(self._done)

    @property
    def busy(self) -> bool:
        """Return whether a packet is being sent."""
        return self._running

    def send(self, packet: Packet) -> bool:
        """
        Send a packet.

        :return: False while the previous one is being sent.
        """
        if self._running:
            return False
        self.packet = packet
        self._left = self._retransmissions
        self._running = self._transmit(packet)
        return self._running

    def clear(self) -> None:
        """Remove the packet."""
        self.packet = None
        self._running = False

    def _transmit(self, packet: Packet) -> bool:
        return self._sender.send(packet.destination, packet.am_type, packet.payload, True)

    def _done(self, acknowledged: bool) -> None:
        packet = self.packet
        if packet is None or not self._running:
            return
        if not acknowledged and packet.destination != BROADCAST:
            if self._left:
                self._left -= 1
                packet.destination = self._destination()
                self._count('resends')
                if self._transmit(packet):
                    return
            self._count('given_up')
        self._running = False
        self._finished()
        if not self._running:
            self.packet = None

    def _count(self, name: str) -> None:
        self._counters[name] = self._counters.get(name, 0) + 1
