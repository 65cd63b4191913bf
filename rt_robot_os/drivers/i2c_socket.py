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
An emulated I2C bus whose chips live in another process, behind a Unix socket.

Every address has a connection of its own: a task that preempts another in the middle of a
transaction, to talk to another chip, cannot take the other's answer.
"""

from __future__ import annotations

import errno
import os
import socket
from typing import Final

from rt_robot_os.drivers.encoders.i2c_packets import MAXIMUM
from rt_robot_os.drivers.encoders.i2c_packets import parse_answer
from rt_robot_os.drivers.encoders.i2c_packets import request

# Longer than that of a real bus: the chips are in an ordinary process, of a busy machine perhaps.
_TIMEOUT_S: Final = 0.3


class SocketTransport:
    """A bus behind a socket; see :class:`rt_robot_os.drivers.i2c.I2cTransport`."""

    def __init__(self, path: str) -> None:
        """
        Look whether anybody is there.

        :raises OSError: nobody is.
        """
        self._path = path
        self._spare: socket.socket | None = self._connect()
        self._connections: dict[int, socket.socket] = {}

    def transfer(self, address: int, data: bytes, size: int) -> bytes:
        """
        Do one transaction.

        :raises OSError: with the errno that Linux has for it.
        """
        # Taken out for as long as it lasts: when it is cut short, by a time-out or by the kernel
        # aborting the task, the answer may come later, and is not that of the next one.
        connection = self._connections.pop(address, None)
        if connection is None:
            connection, self._spare = self._spare or self._connect(), None
        try:
            connection.send(request(address, data, size))
            packet = connection.recv(MAXIMUM)
        except TimeoutError:
            connection.close()
            raise OSError(errno.ETIMEDOUT, os.strerror(errno.ETIMEDOUT)) from None
        except BaseException:
            connection.close()
            raise
        self._connections[address] = connection
        parsed = parse_answer(packet)
        if parsed is None:
            raise OSError(errno.ECONNRESET, os.strerror(errno.ECONNRESET))
        number, answer = parsed
        if number:
            raise OSError(number, os.strerror(number))
        return answer

    def close(self) -> None:
        """Close the connections; may be called twice and does not raise."""
        for connection in (*self._connections.values(), self._spare):
            if connection is not None:
                connection.close()
        self._connections.clear()
        self._spare = None

    def _connect(self) -> socket.socket:
        connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        try:
            connection.settimeout(_TIMEOUT_S)
            connection.connect(self._path)
        except OSError as error:
            connection.close()
            if error.errno == errno.ECONNREFUSED:
                raise OSError(errno.ENODEV, os.strerror(errno.ENODEV)) from error
            raise
        return connection
