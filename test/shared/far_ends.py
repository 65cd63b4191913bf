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

"""What stands at the far end of a port in tests: a pty, a TCP server, UDP either way."""

from __future__ import annotations

from pathlib import Path
import select
import socket
from typing import Any

import pytest
from rt_robot_os.sim.pty_port import PtyPort


def has_v6() -> bool:
    """Say whether this machine can talk to itself by IPv6."""
    try:
        with socket.socket(socket.AF_INET6, socket.SOCK_STREAM) as trial:
            trial.bind(('::1', 0))
            return True
    except OSError:
        return False


needs_v6 = pytest.mark.skipif(not has_v6(), reason='this machine has no IPv6')


class Far:
    """The far end of a port: the device."""

    port = ''

    def write(self, data: bytes) -> None:
        """Send to the driver."""
        raise NotImplementedError

    def read(self, count: int) -> bytes:
        """Wait for that many bytes of the driver."""
        raise NotImplementedError

    def go(self) -> None:
        """Go away."""
        raise NotImplementedError


class PtyFar(Far):
    def __init__(self, folder: Path) -> None:
        self._plug = PtyPort(folder / 'port')
        self._plug.plug()
        self.port = str(self._plug.link)

    def write(self, data: bytes) -> None:
        self._plug.write(data)

    def read(self, count: int) -> bytes:
        found = b''
        while len(found) < count:
            assert select.select([self._plug.fileno()], [], [], 10)[0]
            found += self._plug.read()
        return found

    def go(self) -> None:
        self._plug.unplug()


class TcpFar(Far):
    family = socket.AF_INET
    host = '127.0.0.1'
    scheme = 'tcp'

    def __init__(self, folder: Path) -> None:
        self.listener = socket.create_server(
            (self.host, 0), family=self.family)
        host = f'[{self.host}]' if ':' in self.host else self.host
        self.port = f'{self.scheme}://{host}:{self.listener.getsockname()[1]}'
        self._socket: socket.socket | None = None

    @property
    def socket(self) -> socket.socket:
        if self._socket is None:
            self.listener.settimeout(60)
            self._socket = self.listener.accept()[0]
            self._socket.settimeout(60)
        return self._socket

    def write(self, data: bytes) -> None:
        self.socket.sendall(data)

    def read(self, count: int) -> bytes:
        found = b''
        while len(found) < count:
            found += self.socket.recv(count - len(found))
        return found

    def go(self) -> None:
        self.listener.close()
        if self._socket is not None:
            self._socket.close()


class Tcp6Far(TcpFar):
    family = socket.AF_INET6
    host = '::1'


class UdpFar(Far):
    def __init__(self, folder: Path) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(('127.0.0.1', 0))
        self.socket.settimeout(60)
        self.port = f'udp://127.0.0.1:{self.socket.getsockname()[1]}'
        self._driver: Any = None

    def write(self, data: bytes) -> None:
        if self._driver is None:  # it answers to who writes to it
            self._driver = self.socket.recvfrom(100)[1]
        for at in range(0, len(data), 1000):
            self.socket.sendto(data[at:at + 1000], self._driver)

    def read(self, count: int) -> bytes:
        found = b''
        while len(found) < count:
            found += self.socket.recv(65536)
        return found

    def go(self) -> None:
        self.socket.close()


class ListenFar(UdpFar):
    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(('127.0.0.1', 0))
            self._driver = free.getsockname()
        self.port = f'udp-listen://:{self._driver[1]}'
