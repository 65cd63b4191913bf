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
The serial forwarder protocol: packets of one sink, shared over TCP; without I/O.

Both sides start with two bytes: ``T`` and a version (0x20, 0x21) under TinyOS 1.x, ``U`` and 0x20
under TinyOS 2.x. The smaller version counts; with 0x21 both then send their platform, four bytes.
Packets follow, each after its length in one byte, without CRC: TCP has its own.
:class:`ForwarderClient` is the client of ``sf://host:port``, for any byte stream::

    client = ForwarderClient()
    socket.sendall(client.take_output())
    for packet in client.feed(socket.recv(4096)):
        decoder.decode(packet, client.stack)
    client.send(packet)                     # then take_output() again
"""

from __future__ import annotations

from typing import Final
from urllib.parse import urlsplit

from rt_robot_os.features.wsn.packets.framing import TINYOS_1
from rt_robot_os.features.wsn.packets.framing import TINYOS_2
from rt_robot_os.features.wsn.packets.tos_msg import MICA
from rt_robot_os.features.wsn.packets.tos_msg import TELOS

AUTO: Final = 'auto'
SCHEME: Final = 'sf://'
#: Default ports.
PORTS: Final = {TINYOS_1.name: 9001, TINYOS_2.name: 9002}
VERSION_PLAIN: Final = 0x20
VERSION_PLATFORM: Final = 0x21
#: Platform numbers of version 0x21; others are accepted as well.
PLATFORM_IDS: Final = {MICA: 1, TELOS: 2}
LONGEST: Final = 255
#: Largest number of unsent bytes; further packets are dropped and counted.
MOST_OUTPUT: Final = 65_536

_LETTERS: Final = {ord('T'): TINYOS_1.name, ord('U'): TINYOS_2.name}
_GREETING_SIZE: Final = 2
_PLATFORM_SIZE: Final = 4


class ForwarderEnd:
    """
    One side of a connection; never raises on received bytes, safe in the real-time loop.

    :ivar stack: ``tinyos1`` or ``tinyos2``; empty while unknown.
    :ivar ready: the handshake is complete.
    :ivar problem: why the connection is unusable; empty if it is usable. Connect again.
    :ivar packets: number of received packets.
    :ivar sent: number of sent packets.
    :ivar dropped: number of packets dropped because the output was full.
    :ivar rejected_bytes: number of received bytes outside the protocol.
    :ivar peer_platform: platform number of the other side; 0 unknown.
    """

    def __init__(self, stack: str, version: int = VERSION_PLATFORM, platform: str = '') -> None:
        """
        Start a connection.

        :param stack: of the packets; empty: that of the other side.
        :param version: offered under TinyOS 1.x, 0x20 or 0x21.
        :param platform: of the motes under TinyOS 1.x; empty is unknown.
        """
        self.stack = ''
        self.ready = False
        self.problem = ''
        self.packets = 0
        self.sent = 0
        self.dropped = 0
        self.rejected_bytes = 0
        self.peer_platform = 0
        self._version = version
        self._platform = PLATFORM_IDS.get(platform, 0)
        self._peer_version = 0
        self._pending = b''
        self._output = bytearray()
        if stack:
            self.begin(stack)

    @property
    def pending_bytes(self) -> int:
        """Return the number of bytes of an incomplete packet."""
        return len(self._pending)

    @property
    def has_output(self) -> bool:
        """Return whether there are unsent bytes."""
        return bool(self._output)

    def begin(self, stack: str) -> None:
        """Start the handshake; does nothing if it has started."""
        if self.stack:
            return
        self.stack = stack
        if stack == TINYOS_2.name:
            self._version = VERSION_PLAIN
            self._output += bytes((ord('U'), VERSION_PLAIN))
        else:
            self._output += bytes((ord('T'), self._version))

    def feed(self, data: bytes) -> list[bytes]:
        """
        Process the next bytes from the other side.

        :return: the packets that they complete, in order.
        """
        self._pending += data
        if not self.ready:
            self._handshake()
            if not self.ready:
                return []
        found = []
        buffer, at = self._pending, 0
        while at < len(buffer) and at + buffer[at] < len(buffer):
            end = at + 1 + buffer[at]
            if end > at + 1:
                found.append(buffer[at + 1:end])
            at = end
        self._pending = buffer[at:]
        self.packets += len(found)
        return found

    def send(self, packet: bytes) -> bool:
        """
        Queue a packet for sending, after the handshake.

        :return: False when it was dropped, which is counted.
        :raises ValueError: it is empty or has more than 255 bytes.
        """
        if not 0 < len(packet) <= LONGEST:
            raise ValueError(f'a packet of {len(packet)} bytes: must have 1 to {LONGEST}')
        if not self.ready or len(self._output) + 1 + len(packet) > MOST_OUTPUT:
            self.dropped += 1
            return False
        self._output += bytes((len(packet),)) + packet
        self.sent += 1
        return True

    def take_output(self) -> bytes:
        """Return the bytes to send now."""
        found = bytes(self._output)
        self._output.clear()
        return found

    def _handshake(self) -> None:
        if self.problem:
            self._reject()
            return
        if not self._peer_version:
            if len(self._pending) < _GREETING_SIZE:
                return
            wrong = self._answer_greeting(self._pending[0], self._pending[1])
            if wrong:
                self.problem = wrong
                self._reject()
                return
            self._pending = self._pending[_GREETING_SIZE:]
        if min(self._version, self._peer_version) < VERSION_PLATFORM:
            self.ready = True
        elif len(self._pending) >= _PLATFORM_SIZE:
            self.peer_platform = int.from_bytes(self._pending[:_PLATFORM_SIZE], 'little')
            self._pending = self._pending[_PLATFORM_SIZE:]
            self.ready = True

    def _answer_greeting(self, letter: int, version: int) -> str:
        """Answer the first two bytes; return the problem with them."""
        stack = _LETTERS.get(letter)
        if stack is None or version < VERSION_PLAIN:
            return (f'the other side is not a serial forwarder: it started with {letter:02x} '
                    f'{version:02x}; check host and port')
        if self.stack and stack != self.stack:
            return (f'the other side uses {stack}, not {self.stack}: change the stack, or the '
                    'port')
        self.begin(stack)
        self._peer_version = version
        if min(self._version, version) >= VERSION_PLATFORM:
            self._output += self._platform.to_bytes(_PLATFORM_SIZE, 'little')
        return ''

    def _reject(self) -> None:
        self.rejected_bytes += len(self._pending)
        self._pending = b''


class ForwarderClient(ForwarderEnd):
    """
    The client side: reads a remote sink, and writes to it.

    The forwarder starts the handshake, so the generation may be unknown.
    """

    def __init__(self, stack: str = AUTO, version: int = VERSION_PLATFORM, platform: str = ''
                 ) -> None:
        """
        Start a connection.

        :param stack: ``tinyos1``, ``tinyos2``; ``auto``: that of the forwarder.
        """
        super().__init__('' if stack == AUTO else stack, version, platform)


def forwarder_address(text: str, stack: str = AUTO) -> tuple[str, int]:
    """
    Parse ``sf://host:port``; the port is optional.

    :param stack: for the default port; that of TinyOS 1.x for ``auto``.
    :return: host and port.
    :raises ValueError: with the correct form.
    """
    wrong = ''
    try:
        parts = urlsplit(text)
        host, port = parts.hostname or '', parts.port
        if parts.path not in ('', '/') or parts.query or parts.fragment or '@' in parts.netloc:
            wrong = 'nothing may follow the port'
    except ValueError as error:
        host, port, wrong = '', None, str(error)
    if not text.startswith(SCHEME) or not host or port == 0 or wrong:
        raise ValueError(f'{text!r} must look like sf://host:port, such as sf://localhost:9002'
                         + (f' ({wrong})' if wrong else ''))
    return host, port or PORTS.get(stack, PORTS[TINYOS_1.name])
