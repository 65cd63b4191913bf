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
A live sink: on a serial port, or behind a serial forwarder.

A port is a path, or an address that serial drivers accept as well, such as ``tcp://host:port`` of
a serial server.
"""

from __future__ import annotations

from abc import ABC
from abc import abstractmethod
from collections.abc import Callable
from collections.abc import Iterator
import select
import socket
import time
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.wsn.cli.captured_packet import CapturedPacket
from rt_robot_os.features.wsn.cli.captured_packet import FORWARDER
from rt_robot_os.features.wsn.cli.captured_packet import SERIAL
from rt_robot_os.features.wsn.packets.decode import AUTO
from rt_robot_os.features.wsn.packets.forwarder import forwarder_address
from rt_robot_os.features.wsn.packets.forwarder import ForwarderClient
from rt_robot_os.features.wsn.packets.forwarder import SCHEME
from rt_robot_os.features.wsn.packets.framing import FrameReader
from rt_robot_os.features.wsn.packets.framing import TINYOS_1
from rt_robot_os.features.wsn.packets.framing import TINYOS_2
from rt_robot_os.features.wsn.packets.serial_link import Link
from rt_robot_os.features.wsn.packets.serial_link import TRIES

#: Default baud rates: of telos under TinyOS 1.x, and of telosb under 2.x.
BAUD: Final = {TINYOS_1.name: 57_600, TINYOS_2.name: 115_200}
#: Time without a packet after which a hint is printed.
SILENCE_S: Final = 10.0
_PATIENCE_S: Final = 5.0
_MOST_READ: Final = 65_536
# Longest wait, so that signals are handled.
_TURN_S: Final = 0.5


class SinkLine(ABC):
    """
    A sink, to read and to write.

    :ivar reader: of the frames, with the counters of rejected ones.
    """

    reader: FrameReader

    @abstractmethod
    def fileno(self) -> int:
        """Return what becomes readable."""

    @abstractmethod
    def read(self) -> list[CapturedPacket]:
        """
        Return the packets that have arrived, without waiting.

        :raises DeviceError: the connection is lost.
        """

    @abstractmethod
    def write(self) -> float:
        """
        Write what is due now; return the seconds until the next write.

        :raises DeviceError: the connection is lost.
        """

    @abstractmethod
    def peer_stack(self) -> str:
        """Return the generation of TinyOS that the other side reported; empty if it has not."""

    @abstractmethod
    def send(self, packet: bytes, stack: str) -> None:
        """Send a packet of a generation; see :meth:`outcome`."""

    @abstractmethod
    def outcome(self) -> str:
        """Return the result of sending: ``acknowledged``, ``lost``, ``sent``, or empty."""

    @abstractmethod
    def close(self) -> None:
        """Close the line; may be repeated."""

    def wait(self) -> None:
        """Wait until the line may be readable or writable, for a limited time."""
        due_s = self.write()
        select.select([self.fileno()], [], [], min(due_s, _TURN_S))


class SerialSinkLine(SinkLine):
    """A mote on a port; acknowledges its packets on request."""

    def __init__(self, where: str, stack: str, baud: int, tries: int) -> None:
        """
        Open a port.

        :param stack: of the written protocol; ``auto`` is TinyOS 1.x until the first frame.
        :raises DeviceError: it cannot be opened.
        """
        # Late: `--help` needs none of it.
        from rt_robot_os.devices.serial.port import open_port
        from rt_robot_os.devices.serial.port import prepare_port
        prepare_port(where)
        self._port = open_port(where, baud or BAUD.get(stack, BAUD[TINYOS_1.name]))
        self._link = Link(TINYOS_2 if stack == TINYOS_2.name else TINYOS_1, tries)
        self.reader = self._link.reader

    def fileno(self) -> int:
        """Return what becomes readable."""
        return self._port.fileno()

    def read(self) -> list[CapturedPacket]:
        """Return the packets that have arrived."""
        data = self._port.read()
        found = [CapturedPacket(time.time(), SERIAL, each.protocol, each.token, each.packet)
                 for each in self._link.feed(data)] if data else []
        self.write()
        return found

    def write(self) -> float:
        """Write what is due: acknowledgements, new packets and retransmissions."""
        now_ns = time.monotonic_ns()
        self._port.write(self._link.poll(now_ns))
        due_ns = self._link.next_ns
        return _TURN_S if due_ns is None else max(0.0, (due_ns - now_ns) / NS_PER_S)

    def peer_stack(self) -> str:
        """Return an empty string: each frame has its generation."""
        return ''

    def send(self, packet: bytes, stack: str) -> None:
        """Send a packet until it is acknowledged."""
        self._link.speak(TINYOS_2 if stack == TINYOS_2.name else TINYOS_1)
        self._link.send(packet)

    def outcome(self) -> str:
        """Return the result of sending."""
        found = self._link.take_outcomes()
        return '' if not found else 'acknowledged' if found[0].acknowledged else 'lost'

    def close(self) -> None:
        """Close the port."""
        self._port.close()


class ForwarderSinkLine(SinkLine):
    """A sink behind a serial forwarder, which does not report acknowledgements."""

    def __init__(self, where: str, stack: str, platform: str) -> None:
        """
        Connect; waits for some seconds.

        :raises ConfigError: the address is invalid.
        :raises DeviceError: the connection failed.
        """
        self.reader = FrameReader()  # unused: there are no frames
        self._where = where
        self._client = ForwarderClient(stack, platform=platform)
        self._sent = ''
        try:
            host, port = forwarder_address(where, stack)
        except ValueError as error:
            raise ConfigError([str(error)]) from error
        try:
            self._socket = socket.create_connection((host, port), _PATIENCE_S)
        except OSError as error:
            raise DeviceError(f'{where}: {error.strerror or error}: check host and port, and that '
                              'a serial forwarder runs there') from error
        self._socket.setblocking(False)

    def fileno(self) -> int:
        """Return what becomes readable."""
        return self._socket.fileno()

    def read(self) -> list[CapturedPacket]:
        """Return the packets that have arrived."""
        try:
            data = self._socket.recv(_MOST_READ)
        except BlockingIOError:
            return []
        except OSError as error:
            raise self._gone(error.strerror or str(error)) from error
        if not data:
            raise self._gone('the forwarder closed the connection')
        protocols = {TINYOS_1.name: TINYOS_1.plain, TINYOS_2.name: TINYOS_2.plain}
        found = [CapturedPacket(time.time(), FORWARDER, protocols[self._client.stack], -1, packet)
                 for packet in self._client.feed(data)]
        if self._client.problem:
            raise DeviceError(f'{self._where}: {self._client.problem}')
        self.write()
        return found

    def write(self) -> float:
        """Write what is due: handshake and packets."""
        data = self._client.take_output()
        try:
            if data:
                self._socket.setblocking(True)
                self._socket.settimeout(_PATIENCE_S)
                self._socket.sendall(data)
                self._socket.setblocking(False)
        except OSError as error:
            raise self._gone(error.strerror or str(error)) from error
        return _TURN_S

    def peer_stack(self) -> str:
        """Return the forwarder's generation, once the handshake is complete."""
        return self._client.stack if self._client.ready else ''

    def send(self, packet: bytes, stack: str) -> None:
        """Wait for the handshake, and send a packet."""
        end_s = time.monotonic() + _PATIENCE_S
        while not self._client.ready:
            if time.monotonic() > end_s:
                raise DeviceError(f'{self._where} does not complete the handshake: check that it '
                                  'is a serial forwarder, and that its mote sends packets')
            self.wait()
            self.read()
        self._client.send(packet)
        self.write()
        self._sent = 'sent'

    def outcome(self) -> str:
        """Return the result of sending: the forwarder reports no acknowledgements."""
        found, self._sent = self._sent, ''
        return found

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()

    def _gone(self, cause: str) -> DeviceError:
        return DeviceError(f'connection to {self._where} lost: {cause}')


def open_line(where: str, stack: str = AUTO, platform: str = '', baud: int = 0,
              tries: int = TRIES) -> SinkLine:
    """
    Open a sink.

    :param where: a path, ``sf://host:port``, or an address of a serial server.
    :param baud: of a serial line; 0 is the default of the stack.
    :raises RtRobotError: it cannot be opened; the message names cause and remedy.
    """
    if where.startswith(SCHEME):
        return ForwarderSinkLine(where, stack, platform)
    return SerialSinkLine(where, stack, baud, tries)


def listen(line: SinkLine, seconds: float, tell: Callable[[str], object]
           ) -> Iterator[CapturedPacket]:
    """
    Yield packets, for some seconds or, with 0, without end.

    :param tell: called once with a hint, when no packet has arrived for some time.
    :raises DeviceError: the connection is lost.
    """
    begun_s = time.monotonic()
    end_s = begun_s + seconds if seconds else float('inf')
    is_silent = True
    while (now_s := time.monotonic()) < end_s:
        for each in line.read():
            is_silent = False
            yield each
        if is_silent and now_s > begun_s + SILENCE_S:
            is_silent = False
            tell(_advice(line.reader))
        line.wait()


def _advice(reader: FrameReader) -> str:
    if reader.rejected_bytes + reader.pending_bytes:
        return ('bytes arrive, but no packets: check --baud (57600 under TinyOS 1.x on telos and '
                'micaz, 19200 on mica, 115200 under TinyOS 2.x), and that a base station runs')
    return ('no bytes have arrived: check that the mote runs a base station, that nodes are '
            'switched on, and that no other program reads the port')
