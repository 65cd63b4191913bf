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
The port of an emulated I2C bus: a Unix socket that a driver of another process opens.

Each device has its own path to the shared socket, like links to ``/dev/i2c-1``. An answer is sent
at the time at which the transfer would end on the wire, so a driver waits as long as on a real
bus.
"""

from __future__ import annotations

import os
from pathlib import Path
import select
import socket
from typing import Final
from typing import Protocol

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.i2c.packets import answer
from rt_robot_os.devices.i2c.packets import MAXIMUM
from rt_robot_os.devices.i2c.packets import parse_request
from rt_robot_os.devices.i2c.simulated_bus import EmulatedBus

_MAX_CONNECTIONS: Final = 128
_MAX_ROUNDS: Final = 64
_HUNG_UP: Final = select.EPOLLHUP | select.EPOLLERR


class Carrier(Protocol):
    """Performs the transactions."""

    def transfer(
        self, address: int, data: bytes, size: int, now_ns: int,
    ) -> tuple[int, bytes, int]:
        """
        Perform one transaction.

        :return: errno (0 on success), the bytes read or the text of the error, and the delay of
            the answer.
        """


class I2cPort:
    """
    A bus and its socket.

    :ivar bus: the emulated chips.
    :ivar socket_path: path of the socket.
    """

    def __init__(self, socket_path: Path, carrier: Carrier | None = None,
                 listener: socket.socket | None = None) -> None:
        """
        Store the path; nothing is opened.

        :param carrier: performs the transactions; by default the emulated chips.
        :param listener: a socket that exists already, so that clients can connect before the
            server runs.
        """
        self.bus = EmulatedBus()
        self._carrier: Carrier = carrier or self.bus
        self.socket_path = socket_path
        self._given = listener
        self._links: list[Path] = []
        self._listener: socket.socket | None = None
        self._poll: select.epoll | None = None
        self._connections: dict[int, socket.socket] = {}
        self._answers: list[tuple[int, int, bytes]] = []
        self._busy_until_ns = 0

    def link(self, name: str) -> Path:
        """Return the path of a device; it is created when the bus is plugged in."""
        path = self.socket_path.with_name(name)
        if path not in self._links:
            self._links.append(path)
        return path

    @property
    def plugged(self) -> bool:
        """Return whether the socket exists."""
        return self._listener is not None

    def fileno(self) -> int:
        """Return a file descriptor that is readable when a client sends something; or -1."""
        return -1 if self._poll is None else self._poll.fileno()

    def has_reader(self) -> bool:
        """Return whether that file descriptor can be waited on."""
        return self._poll is not None

    def plug(self) -> None:
        """
        Make the socket and the paths to it.

        :raises DeviceError: they cannot be made.
        """
        if self._listener is None:
            given, self._given = self._given, None
            self._listener = given or self._make_listener()
            self._listener.setblocking(False)
            self._poll = select.epoll()
            self._poll.register(self._listener, select.EPOLLIN)
        for path in self._links:
            self._make_link(path)

    def unplug(self) -> None:
        """Remove the socket and the connections; may be repeated."""
        if self._listener is None or self._poll is None:
            return
        for path in filter(self._is_ours, self._links):
            path.unlink(missing_ok=True)
        self.socket_path.unlink(missing_ok=True)
        for connection in self._connections.values():
            connection.close()
        self._listener.close()
        self._poll.close()
        self._listener = self._poll = None
        self._connections.clear()
        self._answers.clear()

    def serve(self, now_ns: int) -> None:
        """Serve requests and send the answers that are due; does not block."""
        for _ in range(_MAX_ROUNDS):
            events = self._poll.poll(0) if self._poll is not None else []
            if not events:
                break
            for descriptor, what in events:
                connection = self._connections.get(descriptor)
                if connection is None:
                    self._accept()
                elif what & _HUNG_UP:
                    # The client has abandoned the request, and may have sent another.
                    self._drop(descriptor)
                else:
                    self._take(connection, now_ns)
        due = [each for each in self._answers if each[0] <= now_ns]
        if due:
            self._answers = [each for each in self._answers if each[0] > now_ns]
            for _, descriptor, packet in due:
                self._send(descriptor, packet)

    def next_ns(self) -> int | None:
        """Return when the next answer is due; None if there is none."""
        return min((each[0] for each in self._answers), default=None)

    def _make_listener(self) -> socket.socket:
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        try:
            self.socket_path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            self.socket_path.unlink(missing_ok=True)
            listener.bind(str(self.socket_path))
            listener.listen(_MAX_CONNECTIONS)
        except OSError as error:
            listener.close()
            raise DeviceError(f'{self.socket_path} cannot be made ({error}): choose another '
                              'folder') from error
        return listener

    def _accept(self) -> None:
        if self._listener is None or self._poll is None:
            return
        try:
            connection, _ = self._listener.accept()
        except OSError:
            return  # the client has disconnected already
        if len(self._connections) >= _MAX_CONNECTIONS:
            connection.close()
            return
        connection.setblocking(False)
        self._connections[connection.fileno()] = connection
        self._poll.register(connection, select.EPOLLIN)

    def _take(self, connection: socket.socket, now_ns: int) -> None:
        try:
            packet = connection.recv(MAXIMUM)
        except BlockingIOError:
            return
        except OSError:
            packet = b''
        wanted = parse_request(packet)
        if wanted is None:
            self._drop(connection.fileno())
            return
        number, address, written, size = wanted
        code, data, duration_ns = self._carrier.transfer(address, written, size, now_ns)
        self._busy_until_ns = max(self._busy_until_ns, now_ns) + duration_ns
        self._answers.append((self._busy_until_ns, connection.fileno(),
                              answer(number, code, data)))

    def _send(self, descriptor: int, packet: bytes) -> None:
        connection = self._connections.get(descriptor)
        if connection is None:
            return
        try:
            connection.send(packet)
        except OSError:
            self._drop(descriptor)

    def _drop(self, descriptor: int) -> None:
        connection = self._connections.pop(descriptor, None)
        if connection is not None and self._poll is not None:
            self._poll.unregister(descriptor)
            connection.close()
        self._answers = [each for each in self._answers if each[1] != descriptor]

    def _is_ours(self, path: Path) -> bool:
        try:
            return os.readlink(path) == self.socket_path.name
        except OSError:
            return False  # it does not exist, or is not a link

    def _make_link(self, path: Path) -> None:
        try:
            if self._is_ours(path):
                return
            if os.path.lexists(path):
                if not path.is_symlink():
                    raise FileExistsError(f'{path} is a file of another program')
                path.unlink()
            path.symlink_to(self.socket_path.name)
        except OSError as error:
            raise DeviceError(
                f'{path} cannot be made ({error}): choose another folder') from error
