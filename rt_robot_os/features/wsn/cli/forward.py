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

"""The command `wsn forward`: a serial forwarder of TinyOS for a serial port."""

from __future__ import annotations

import argparse
from contextlib import suppress
import select
import signal
import socket
import time
from typing import Any
from typing import Final
from typing import TYPE_CHECKING

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.errors import StartError
from rt_robot_os.base.programs import OK
from rt_robot_os.base.programs import warn
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.wsn.cli.line import BAUD
from rt_robot_os.features.wsn.cli.options import add_baud
from rt_robot_os.features.wsn.cli.options import add_stack
from rt_robot_os.features.wsn.packets.decode import AUTO
from rt_robot_os.features.wsn.packets.forwarder import PORTS
from rt_robot_os.features.wsn.packets.forwarding import Forwarder
from rt_robot_os.features.wsn.packets.framing import TINYOS_1

if TYPE_CHECKING:
    from rt_robot_os.devices.serial.port import Port

_RETRY_S: Final = 1.0
_TURN_S: Final = 0.5
_MOST_READ: Final = 512
# Largest number of waiting packets for the mote; with more, clients are not read.
_ENOUGH_WAITING: Final = 8

_EPILOG: Final = """
Programs connect to sf://HOST:PORT; each gets all packets, and its packets go to the mote with
an acknowledgement. Only programs of this machine may connect, unless --listen names another
address: there is no password, so every program that connects can send to the nodes.

  wsn forward /dev/ttyUSB0 --stack tinyos2 --listen 9002
  wsn forward /dev/ttyUSB0 --listen 0.0.0.0:9001

An unplugged port is opened again when it is back; clients stay connected.
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser of the program."""
    parser = commands.add_parser(
        'forward', allow_abbrev=False,
        help='share a serial port with other programs, as a serial forwarder', epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('port', metavar='PORT', help='a serial port')
    parser.add_argument('--listen', type=_address, metavar='[HOST:]PORT',
                        help='address for programs (default: 9002 of this machine with '
                        '--stack tinyos2, else 9001); port 0 selects a free one')
    add_stack(parser)
    add_baud(parser)
    parser.set_defaults(run=run)


class Server:
    """
    The forwarder with its sockets.

    :param forwarder: the protocol, without I/O.
    :param listener: accepts clients.
    :ivar patience_s: longest wait of a turn, so that signals are handled.
    """

    def __init__(self, forwarder: Forwarder, listener: socket.socket, where: str, baud: int
                 ) -> None:
        self._forwarder = forwarder
        self._listener = listener
        self.patience_s = _TURN_S
        self._where = where
        self._baud = baud
        self._port: Port | None = None
        self._retry_s = 0.0
        self._clients: dict[int, socket.socket] = {}
        # Unsent bytes of each client, before those in the queue of the forwarder.
        self._unsent: dict[int, bytes] = {}

    def open(self) -> None:  # noqa: A003
        """
        Open the port.

        :raises DeviceError: it cannot be opened.
        """
        # Late: `--help` needs none of it.
        from rt_robot_os.devices.serial.port import open_port
        from rt_robot_os.devices.serial.port import prepare_port
        prepare_port(self._where)
        self._port = open_port(self._where, self._baud)

    def close(self) -> None:
        """Close all sockets and the port; may be repeated."""
        for number in list(self._clients):
            self._hang_up(number, '')
        self._listener.close()
        if self._port is not None:
            self._port.close()

    def turn(self) -> None:
        """Wait for input or a deadline, and process it."""
        port, now_s = self._port, time.monotonic()
        if port is None and now_s >= self._retry_s:
            self._open_again()
            port = self._port
        for number in self._clients:
            self._unsent[number] = self._unsent[number] or self._forwarder.take_output(number)
        reading: list[Any] = [self._listener, *([] if port is None else [port])]
        if self._forwarder.link.waiting < _ENOUGH_WAITING:
            reading += self._clients.values()
        writing = [self._clients[number] for number, data in self._unsent.items() if data]
        readable, writable, _ = select.select(reading, writing, [], self._patience_s())
        if self._listener in readable:
            self._accept()
        for number, client in list(self._clients.items()):
            if client in writable:
                self._send(number, client)
            if client in readable and number in self._clients:
                self._receive(number, client)
        self._serve_port(port is not None and port in readable)

    def _patience_s(self) -> float:
        due_ns = self._forwarder.next_ns
        if self._port is None or due_ns is None:
            return self.patience_s
        return min(self.patience_s, max(0.0, (due_ns - time.monotonic_ns()) / NS_PER_S))

    def _serve_port(self, readable: bool) -> None:
        if self._port is None:
            return
        try:
            if readable:
                self._forwarder.feed_mote(self._port.read())
            self._port.write(self._forwarder.poll_mote(time.monotonic_ns()))
        except DeviceError as error:
            warn('wsn', error)
            self._port.close()
            self._port = None
            self._forwarder.link.reset()
            self._retry_s = time.monotonic() + _RETRY_S

    def _open_again(self) -> None:
        try:
            self.open()
            warn('wsn', f'port {self._where} is back')
        except DeviceError:
            self._retry_s = time.monotonic() + _RETRY_S

    def _accept(self) -> None:
        try:
            client, address = self._listener.accept()
        except OSError:
            return
        number = self._forwarder.connect()
        if number is None:
            warn('wsn', f'{address[0]} was refused: {self._forwarder.clients} programs are '
                 'connected, the largest number')
            client.close()
            return
        client.setblocking(False)
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._clients[number], self._unsent[number] = client, b''
        warn('wsn', f'{address[0]} connected as {number}')

    def _send(self, number: int, client: socket.socket) -> None:
        try:
            sent = client.send(self._unsent[number])
        except BlockingIOError:
            return
        except OSError as error:
            self._hang_up(number, error.strerror or str(error))
            return
        self._unsent[number] = self._unsent[number][sent:]

    def _receive(self, number: int, client: socket.socket) -> None:
        try:
            data = client.recv(_MOST_READ)
        except BlockingIOError:
            return
        except OSError as error:
            self._hang_up(number, error.strerror or str(error))
            return
        problem = self._forwarder.feed_client(number, data) if data else 'it closed'
        if problem:
            self._hang_up(number, problem)

    def _hang_up(self, number: int, why: str) -> None:
        self._clients.pop(number).close()
        self._unsent.pop(number)
        self._forwarder.disconnect(number)
        if why:
            warn('wsn', f'client {number} is disconnected: {why}')


def run(arguments: argparse.Namespace) -> int:
    """
    Forward until Ctrl-C or SIGTERM.

    :return: the exit code.
    :raises RtRobotError: the port or the address cannot be opened.
    """
    if '://' in arguments.port and arguments.port.startswith('sf:'):
        raise ConfigError([f'{arguments.port!r} is already a serial forwarder: connect to it'])
    stack = arguments.stack
    platform = '' if arguments.platform == AUTO else arguments.platform
    forwarder = Forwarder(stack, platform)
    listener = _listener(arguments.listen or ('', PORTS.get(stack, PORTS[TINYOS_1.name])))
    server = Server(forwarder, listener, arguments.port,
                    arguments.baud or BAUD.get(stack, BAUD[TINYOS_1.name]))
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        server.open()
        host, number = listener.getsockname()[:2]
        warn('wsn', f'{arguments.port} is shared at sf://{f"[{host}]" if ":" in host else host}:'
             f'{number}')
        with suppress(KeyboardInterrupt):
            while True:
                server.turn()
    finally:
        signal.signal(signal.SIGTERM, before)
        server.close()
    link = forwarder.link
    warn('wsn', f'{forwarder.from_mote} packets from the mote, {link.acknowledged} to it '
         f'acknowledged, {link.given_up} given up, {link.refused} refused; '
         f'{forwarder.clients_dropped} dropped for slow clients; {link.reader.rejected_frames} '
         f'frames with a wrong CRC')
    return OK


def _listener(address: tuple[str, int]) -> socket.socket:
    host, number = address
    try:
        family = socket.AF_INET6 if ':' in host else socket.AF_INET
        return socket.create_server((host or '127.0.0.1', number), family=family, backlog=4)
    except (OSError, OverflowError) as error:
        raise StartError(f'cannot listen on {host or "127.0.0.1"}:{number} ({error}): choose '
                         'another port with --listen') from error


def _address(text: str) -> tuple[str, int]:
    host, _, number = text.rpartition(':')
    try:
        port = int(number)
    except ValueError:
        port = -1
    if not 0 <= port <= 65535:
        raise argparse.ArgumentTypeError(f'{text!r}: must be PORT or HOST:PORT, such as 9002')
    return host.strip('[]'), port
