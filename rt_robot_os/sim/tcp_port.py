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
The port of a simulated device on a network: a server for one client, instead of a pty.

As on a pty nothing blocks: bytes without a client are dropped and counted.
"""

from __future__ import annotations

import os
import socket

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.sim.pty_port import PtyPort

_MAX_READ = 4096


class TcpPlug(PtyPort):
    """
    A TCP port of this machine that accepts connections, one at a time; it replaces a pty.

    :ivar url: the ``port`` of a driver.
    """

    def __init__(self, number: int) -> None:
        """
        Store the number; nothing is opened.

        :param number: of the port, on the loopback interface; 0 selects a free one, once.
        """
        super().__init__(os.devnull)
        self._number = number
        self._listener: socket.socket | None = None
        self._client: socket.socket | None = None

    @property
    def url(self) -> str:
        """Return the ``port`` of a driver."""
        return f'tcp://127.0.0.1:{self._number}'

    @property
    def plugged(self) -> bool:
        """Return whether connections are accepted."""
        return self._listener is not None

    def fileno(self) -> int:
        """Return the file descriptor of the connection, -1 without one."""
        return -1 if self._client is None else self._client.fileno()

    def plug(self) -> None:
        """
        Start to accept connections.

        :raises DeviceError: another program has the port.
        """
        if self._listener is not None:
            return
        try:
            self._listener = socket.create_server(('127.0.0.1', self._number), backlog=1)
        except OSError as error:
            raise DeviceError(f'{self.url} cannot be opened ({error}): choose another') from error
        self._listener.setblocking(False)
        self._number = self._listener.getsockname()[1]

    def unplug(self) -> None:
        """Close the connection and accept no more; may be repeated."""
        self._hang_up()
        listener, self._listener = self._listener, None
        if listener is not None:
            listener.close()

    def has_reader(self) -> bool:
        """Return whether a client is connected; accepts a waiting one."""
        if self._client is None and self._listener is not None:
            try:
                self._client = self._listener.accept()[0]
            except OSError:
                return False
            self._client.setblocking(False)
            self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return self._client is not None

    def write(self, data: bytes) -> None:
        """Send without blocking; bytes that do not fit are dropped and counted."""
        sent = 0
        if self.has_reader() and self._client is not None:
            try:
                sent = self._client.send(data)
            except BlockingIOError:
                pass
            except OSError:
                self._hang_up()
        self.bytes_sent += sent
        self.bytes_dropped += len(data) - sent

    def read(self) -> bytes:
        """Return the bytes of the driver, without blocking; empty if there are none."""
        if not self.has_reader() or self._client is None:
            return b''
        try:
            data = self._client.recv(_MAX_READ)
        except BlockingIOError:
            return b''
        except OSError:
            data = b''
        if not data:
            self._hang_up()
        return data

    def _hang_up(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            client.close()
