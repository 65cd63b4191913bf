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
A serial forwarder without I/O: one serial line, several clients.

Packets of the mote go to all clients; packets of clients go to the mote, with acknowledgements and
retransmissions. A client that does not read loses packets, without blocking others.
"""

from __future__ import annotations

from typing import Final

from rt_robot_os.features.wsn.packets.forwarder import AUTO
from rt_robot_os.features.wsn.packets.forwarder import ForwarderEnd
from rt_robot_os.features.wsn.packets.forwarder import LONGEST
from rt_robot_os.features.wsn.packets.forwarder import VERSION_PLATFORM
from rt_robot_os.features.wsn.packets.framing import Frame
from rt_robot_os.features.wsn.packets.framing import PROTOCOLS
from rt_robot_os.features.wsn.packets.framing import TINYOS_1
from rt_robot_os.features.wsn.packets.framing import TINYOS_2
from rt_robot_os.features.wsn.packets.serial_link import Link
from rt_robot_os.features.wsn.packets.serial_link import TRIES
from rt_robot_os.features.wsn.packets.serial_link import WAIT_NS

MOST_CLIENTS: Final = 16
#: Largest queue of packets for the mote; while it is not empty, clients should not be read.
CAPACITY: Final = 64


class Forwarder:
    """
    The server; times are arguments.

    :ivar link: the serial line.
    :ivar from_mote: number of packets from the mote.
    :ivar foreign: number of packets of another generation than the line's, or of none.
    :ivar too_long: number of packets too long for the clients' protocol, or for a frame.
    :ivar refused_clients: number of clients beyond the limit.
    :ivar clients_dropped: number of packets lost by clients that did not read.
    """

    def __init__(self, stack: str = AUTO, platform: str = '', version: int = VERSION_PLATFORM,
                 tries: int = TRIES, wait_ns: int = WAIT_NS, most_clients: int = MOST_CLIENTS
                 ) -> None:
        """
        Start without clients.

        :param stack: ``tinyos1``, ``tinyos2``; ``auto`` is that of the first frame, for which
            clients wait.
        :param platform: of the motes, for clients under TinyOS 1.x.
        """
        self.stack = ''
        self.link = Link(TINYOS_1, tries, wait_ns, CAPACITY)
        self.from_mote = 0
        self.foreign = 0
        self.too_long = 0
        self.refused_clients = 0
        self.clients_dropped = 0
        self._platform = platform
        self._version = version
        self._most_clients = most_clients
        self._clients: dict[int, ForwarderEnd] = {}
        self._numbers = 0
        if stack != AUTO:
            self._begin(stack)

    @property
    def clients(self) -> int:
        """Return the number of connected clients."""
        return len(self._clients)

    def connect(self) -> int | None:
        """Add a client; return its number, or None beyond the limit."""
        if len(self._clients) >= self._most_clients:
            self.refused_clients += 1
            return None
        self._numbers += 1
        self._clients[self._numbers] = ForwarderEnd(self.stack, self._version, self._platform)
        return self._numbers

    def disconnect(self, number: int) -> None:
        """Remove a client; may be repeated."""
        client = self._clients.pop(number, None)
        if client is not None:
            self.clients_dropped += client.dropped

    def feed_client(self, number: int, data: bytes) -> str:
        """
        Process bytes of a client.

        :return: why it must be disconnected; empty otherwise.
        """
        client = self._clients[number]
        for packet in client.feed(data):
            if client.stack != self.stack:
                self.foreign += 1
                continue
            try:
                self.link.send(packet)  # refused ones are counted there
            except ValueError:
                self.too_long += 1
        return client.problem

    def take_output(self, number: int) -> bytes:
        """Return the bytes to send to a client now; the queue is bounded."""
        return self._clients[number].take_output()

    def feed_mote(self, data: bytes) -> None:
        """Process bytes of the serial line."""
        for each in self.link.feed(data):
            known = PROTOCOLS.get(each.protocol)
            if known is not None and not self.stack:
                self._begin(known.name)
            if known is None or known.name != self.stack:
                self.foreign += 1
            else:
                self._share(each)

    def poll_mote(self, now_ns: int) -> bytes:
        """Return the bytes to write to the serial line now."""
        return self.link.poll(now_ns)

    @property
    def next_ns(self) -> int | None:
        """Return when ``poll_mote`` is due: 0 immediately, None never."""
        return self.link.next_ns

    def _begin(self, stack: str) -> None:
        self.stack = stack
        self.link.speak(TINYOS_1 if stack == TINYOS_1.name else TINYOS_2)
        for client in self._clients.values():
            client.begin(stack)

    def _share(self, frame: Frame) -> None:
        self.from_mote += 1
        if not 0 < len(frame.packet) <= LONGEST:
            self.too_long += 1
            return
        for client in self._clients.values():
            if client.ready and client.stack == self.stack:
                client.send(frame.packet)
