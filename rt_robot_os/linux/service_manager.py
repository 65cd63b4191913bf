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
Notification of the service manager: the protocol of sd_notify(3).

The manager sets ``NOTIFY_SOCKET`` to a datagram socket, and ``WATCHDOG_USEC`` to the timeout for
``WATCHDOG=1`` after which it restarts the service. The core is often a child of the process that
the manager started: the unit needs ``NotifyAccess=all`` then.
"""

from __future__ import annotations

from collections.abc import Mapping
import socket


class ServiceManager:
    """
    The manager that started this process, if there is one.

    :param environment: with its variables.
    :ivar watchdog_ns: its watchdog timeout; 0 when it has none.
    :ivar failed: number of messages that could not be sent.
    """

    def __init__(self, environment: Mapping[str, str]) -> None:
        self.failed = 0
        self.watchdog_ns = 0
        self._socket: socket.socket | None = None
        address = environment.get('NOTIFY_SOCKET', '')
        if not address.startswith(('/', '@')):
            return
        text = environment.get('WATCHDOG_USEC', '')
        if text.isascii() and text.isdigit() and len(text) < 18:
            self.watchdog_ns = int(text) * 1000
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
        self._socket.setblocking(False)
        # A leading @ stands for the zero byte of an abstract name.
        self._address = '\0' + address[1:] if address.startswith('@') else address

    @property
    def present(self) -> bool:
        """Return whether there is a service manager."""
        return self._socket is not None

    def notify(self, *lines: str) -> None:
        """
        Send assignments such as ``READY=1``; never waits, safe in the real-time loop.

        Does nothing without a manager; messages that it does not read are counted.
        """
        if self._socket is None:
            return
        try:
            self._socket.sendto('\n'.join(lines).encode(), self._address)
        except OSError:
            self.failed += 1

    def close(self) -> None:
        """Close the socket; may be called twice."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None
