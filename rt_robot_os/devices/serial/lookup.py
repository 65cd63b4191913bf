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
Look up the names of hosts in another process, because the system's resolver blocks.

The first look-up starts when the device is made and has usually ended when its port is opened.
Later ones refresh the answer in the background. An IP address needs no look-up.
"""

from __future__ import annotations

import ipaddress
import select
import socket
import subprocess
import sys
import time
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.errors import DeviceError

_PATIENCE_S: Final = 2.0
_FRESH_S: Final = 30.0
_PROGRAM: Final = """
import socket, sys
try:
    found = socket.getaddrinfo(sys.argv[1], None, type=socket.SOCK_STREAM)
except OSError as error:
    sys.exit(error.strerror or str(error))
for address in dict.fromkeys(each[4][0] for each in found):
    print(address)
"""


class HostAddress(NamedTuple):
    """
    An IP address.

    :ivar family: AF_INET or AF_INET6.
    :ivar host: with its zone, as in ``fe80::1%eth0``.
    """

    family: int
    host: str

    def sockaddr(self, port: int) -> tuple[Any, ...]:
        """Return the address for socket functions; needs no look-up."""
        return socket.getaddrinfo(self.host, port, self.family, socket.SOCK_STREAM, 0,
                                  socket.AI_NUMERICHOST)[0][4]


def numeric(host: str) -> HostAddress | None:
    """Parse an IP address; empty is any address of this machine; None if it is a name."""
    if not host:
        return HostAddress(socket.AF_INET, '0.0.0.0')
    try:
        version = ipaddress.ip_address(host.partition('%')[0]).version
    except ValueError:
        return None
    return HostAddress(socket.AF_INET if version == 4 else socket.AF_INET6, host)


class HostName:
    """The name of a host and its last known addresses."""

    def __init__(self, name: str) -> None:
        """Store the name; nothing is looked up."""
        self._name = name
        self._process: subprocess.Popen[str] | None = None
        self._found: list[HostAddress] = []
        self._problem = ''
        self._begun_s = 0.0
        self._next = 0

    def prepare(self) -> None:
        """Look it up and wait briefly for the answer; not for the loop."""
        self._begin()
        process = self._process
        if process is not None and process.stdout is not None:
            select.select([process.stdout], [], [], _PATIENCE_S)
            self._finish(_PATIENCE_S)

    def take(self) -> HostAddress:
        """
        Return an address, with each call the next one of the host; does not block.

        :raises DeviceError: the name is unknown, or still being looked up.
        """
        self._finish(None)
        if self._process is None and time.monotonic() - self._begun_s > (
                _FRESH_S if self._found else 0.0):
            problem, self._problem = self._problem, ''
            self._begin()
        else:
            problem = self._problem
        if self._found:
            self._next += 1
            return self._found[(self._next - 1) % len(self._found)]
        if problem:
            raise DeviceError(f'host {self._name!r} is not known ({problem}): check the name and '
                              'the network, or use its IP address')
        raise DeviceError(f'host {self._name!r} is being looked up; if that takes long, check the '
                          'network, or use its IP address')

    def close(self) -> None:
        """End a running look-up; otherwise it ends by itself."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.communicate()

    def _begin(self) -> None:
        if self._process is None:
            self._begun_s = time.monotonic()
            try:
                self._process = subprocess.Popen(
                    [sys.executable, '-I', '-c', _PROGRAM, self._name], text=True,
                    stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
            except (OSError, ValueError) as error:
                self._problem = str(error)

    def _finish(self, seconds: float | None) -> None:
        """Use the answer of a look-up that has ended, or that has taken some seconds."""
        process = self._process
        if process is None:
            return
        try:
            if seconds is None and process.poll() is None:
                return
            answer, problem = process.communicate(timeout=seconds)
        except subprocess.TimeoutExpired:
            return
        self._process = None
        if process.returncode:
            self._problem = problem.strip()[:200] or 'the look-up failed'
            return
        self._problem = ''
        found = [each for each in map(numeric, answer.split()) if each is not None]
        if found != self._found:
            self._found, self._next = found, 0


# Names of hosts are global, like the network.
HOSTS: Final[dict[str, HostName]] = {}


def host_name(name: str) -> HostName:
    """Return the one of a name."""
    return HOSTS.setdefault(name, HostName(name))
