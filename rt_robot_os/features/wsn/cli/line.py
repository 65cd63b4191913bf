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
A sink that is there now: on a serial port, or behind a serial forwarder.

A port is a path, or an address that serial drivers take as well, such as ``tcp://host:port`` of a
serial server.
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
from rt_robot_os.features.wsn.cli.captured_packet import FORWARDER
from rt_robot_os.features.wsn.cli.captured_packet import Heard
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

#: Bits a second, unless it is said: of telos under TinyOS 1.x, and of telosb under 2.x.
BAUD: Final = {TINYOS_1.name: 57_600, TINYOS_2.name: 115_200}
#: After so long without a packet it is told what to check.
SILENCE_S: Final = 10.0
_PATIENCE_S: Final = 5.0
_MOST_READ: Final = 65_536
# Nothing waits for longer, so that an end that is asked for comes.
_TURN_S: Final = 0.5


class SinkLine(ABC):
    """
    A sink, to read and to write.

    :ivar reader: of the frames, with the counters of what was rejected.
    """

    reader: FrameReader

    @abstractmethod
    def fileno(self) -> int:
        """Return what becomes readable."""

    @abstractmethod
    def read(self) -> list[Heard]:
        """
        Take what is there, without waiting.

        :raises DeviceError: the other side is gone.
        """

    @abstractmethod
    def write(self) -> float:
        """
        Write what is due now; return in how many seconds to do so again.

        :raises DeviceError: the other side is gone.
        """

    @abstractmethod
    def told_stack(self) -> str:
        """Return the generation of TinyOS as the other side has told it; empty when not."""

    @abstractmethod
    def send(self, packet: bytes, stack: str) -> None:
        """Have a packet of a generation written, see :meth:`outcome`."""

    @abstractmethod
    def outcome(self) -> str:
        """Return what became of what was sent: ``acknowledged``, ``lost``, ``sent``, or empty."""

    @abstractmethod
    def close(self) -> None:
        """Close it; may be repeated."""

    def wait(self) -> None:
        """Wait until there may be something to read or to write, for a while at most."""
        due_s = self.write()
        select.select([self.fileno()], [], [], min(due_s, _TURN_S))


class SerialSinkLine(SinkLine):
    """A mote on a port; what it wants acknowledged is."""

    def __init__(self, where: str, stack: str, baud: int, tries: int) -> None:
        """
        Open a port.

        :param stack: whose protocol is written; ``auto`` writes TinyOS 1.x's until a frame came.
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

    def read(self) -> list[Heard]:
        """Take the packets that are there."""
        data = self._port.read()
        found = [Heard(time.time(), SERIAL, each.protocol, each.token, each.packet)
                 for each in self._link.feed(data)] if data else []
        self.write()
        return found

    def write(self) -> float:
        """Write what is due: acknowledgements, new packets, and those that are tried again."""
        now_ns = time.monotonic_ns()
        self._port.write(self._link.poll(now_ns))
        due_ns = self._link.next_ns
        return _TURN_S if due_ns is None else max(0.0, (due_ns - now_ns) / NS_PER_S)

    def told_stack(self) -> str:
        """Return nothing: frames say it, each."""
        return ''

    def send(self, packet: bytes, stack: str) -> None:
        """Have a packet written until it is acknowledged."""
        self._link.speak(TINYOS_2 if stack == TINYOS_2.name else TINYOS_1)
        self._link.send(packet)

    def outcome(self) -> str:
        """Return what became of a packet."""
        found = self._link.take_outcomes()
        return '' if not found else 'acknowledged' if found[0].acknowledged else 'lost'

    def close(self) -> None:
        """Close the port."""
        self._port.close()


class ForwarderSinkLine(SinkLine):
    """A sink behind a serial forwarder, which does not tell what became of a packet."""

    def __init__(self, where: str, stack: str, platform: str) -> None:
        """
        Connect; waits for some seconds.

        :raises ConfigError: the address is wrong.
        :raises DeviceError: nobody is there.
        """
        self.reader = FrameReader()  # there are no frames, so nothing is counted
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

    def read(self) -> list[Heard]:
        """Take the packets that are there."""
        try:
            data = self._socket.recv(_MOST_READ)
        except BlockingIOError:
            return []
        except OSError as error:
            raise self._gone(error.strerror or str(error)) from error
        if not data:
            raise self._gone('the forwarder closed the connection')
        protocols = {TINYOS_1.name: TINYOS_1.plain, TINYOS_2.name: TINYOS_2.plain}
        found = [Heard(time.time(), FORWARDER, protocols[self._client.stack], -1, packet)
                 for packet in self._client.feed(data)]
        if self._client.problem:
            raise DeviceError(f'{self._where}: {self._client.problem}')
        self.write()
        return found

    def write(self) -> float:
        """Write what is due: greetings and packets."""
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

    def told_stack(self) -> str:
        """Return the forwarder's generation, once it has greeted."""
        return self._client.stack if self._client.ready else ''

    def send(self, packet: bytes, stack: str) -> None:
        """Have a packet sent once the forwarder has greeted, which is waited for."""
        end_s = time.monotonic() + _PATIENCE_S
        while not self._client.ready:
            if time.monotonic() > end_s:
                raise DeviceError(f'{self._where} does not greet: check that it is a serial '
                                  'forwarder, and that its mote sends something')
            self.wait()
            self.read()
        self._client.send(packet)
        self.write()
        self._sent = 'sent'

    def outcome(self) -> str:
        """Return what became of a packet: the forwarder does not say."""
        found, self._sent = self._sent, ''
        return found

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()

    def _gone(self, cause: str) -> DeviceError:
        return DeviceError(f'{self._where} is gone: {cause}')


def open_line(where: str, stack: str = AUTO, platform: str = '', baud: int = 0,
              tries: int = TRIES) -> SinkLine:
    """
    Open a sink.

    :param where: a path, ``sf://host:port``, or an address of a serial server.
    :param baud: of a serial line; 0 is the usual one of the stack.
    :raises RtRobotError: it cannot be opened; the message names cause and remedy.
    """
    if where.startswith(SCHEME):
        return ForwarderSinkLine(where, stack, platform)
    return SerialSinkLine(where, stack, baud, tries)


def listen(line: SinkLine, seconds: float, tell: Callable[[str], object]) -> Iterator[Heard]:
    """
    Give what comes, for some seconds or, with 0, for ever.

    :param tell: is told once what to check, when for some time no packet has come.
    :raises DeviceError: the other side is gone.
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
        return ('bytes come, but no packets: check --baud (57600 under TinyOS 1.x on telos and '
                'micaz, 19200 on mica, 115200 under TinyOS 2.x), and that a base station runs')
    return ('nothing has come so far: check that the mote runs a base station, that nodes are '
            'switched on, and that no other program reads the port')
