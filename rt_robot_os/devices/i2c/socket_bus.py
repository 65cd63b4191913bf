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
An I2C bus in another process, behind a Unix socket: the simulator's, or a bridge to a real one.

Every device has its own connection, so devices do not wait for each other. Nothing here blocks: a
request is one packet that is sent or fails, the answer one that has arrived or not.
"""

from __future__ import annotations

import errno
import os
import select
import socket
import time
from typing import Final

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.i2c.packets import MAXIMUM
from rt_robot_os.devices.i2c.packets import NO_BUS
from rt_robot_os.devices.i2c.packets import parse_answer
from rt_robot_os.devices.i2c.packets import request

_NUMBERS: Final = 1 << 16
# Limit of the answers to abandoned requests that one call skips.
_LATE_ANSWERS: Final = 8
_PATIENCE_S: Final = 0.3


class SocketConnection:
    """
    A device's access to a bus behind a socket.

    See :class:`~rt_robot_os.devices.i2c.bus.I2cConnection`.

    Requests are numbered: when one was abandoned, by a time-out or because the kernel aborted the
    task within it, its answer may arrive later, and must not be used for the next one.
    """

    def __init__(self, path: str) -> None:
        """
        Connect.

        :raises OSError: no process serves it.
        """
        self.gone = False
        self._number = 0
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._socket.setblocking(False)
        try:
            self._socket.connect(path)
        except OSError as error:
            self._socket.close()
            if error.errno == errno.ECONNREFUSED:
                raise OSError(errno.ENODEV, os.strerror(errno.ENODEV)) from error
            if error.errno == errno.EAGAIN:
                raise DeviceError(f'I2C bus {path}: too many connections wait for the process '
                                  'that serves it: it hangs or was stopped; it will be tried '
                                  'again') from error
            raise

    def begin(self, address: int, data: bytes, size: int) -> None:
        """
        Send a request; safe in the loop.

        :raises OSError: it cannot be sent.
        """
        self._number = (self._number + 1) % _NUMBERS
        try:
            self._socket.send(request(self._number, address, data, size))
        except BlockingIOError:
            raise OSError(errno.ECONNRESET, os.strerror(errno.ECONNRESET)) from None
        except OSError:
            self.gone = True
            raise

    def answer(self) -> bytes | None:
        """
        Return the answer if it has arrived; safe in the loop.

        :raises OSError: the transaction failed, or the process has ended.
        """
        for _ in range(_LATE_ANSWERS):
            try:
                packet = self._socket.recv(MAXIMUM)
            except BlockingIOError:
                return None
            except OSError:
                self.gone = True
                raise
            parsed = parse_answer(packet)
            if parsed is None:
                self.gone = True
                raise OSError(errno.ECONNRESET, os.strerror(errno.ECONNRESET))
            number, code, answer = parsed
            if number != self._number:
                continue
            if code == NO_BUS:
                raise DeviceError(answer.decode('utf-8', 'replace'))
            if code:
                raise OSError(code, answer.decode('utf-8', 'replace') or os.strerror(code))
            return answer
        return None

    def fileno(self) -> int:
        """Return the descriptor that becomes readable with an answer."""
        return self._socket.fileno()

    def close(self) -> None:
        """Close the connection; may be called twice and does not raise."""
        self._socket.close()


class SocketTransport:
    """The same for programs that may block; never in the loop."""

    def __init__(self, path: str) -> None:
        """
        Connect.

        :raises OSError: no process serves it.
        """
        self._connection = SocketConnection(path)

    def transfer(self, address: int, data: bytes, size: int) -> bytes:
        """
        Perform one transaction, and block until it has ended.

        :raises OSError: it failed, with the errno of Linux.
        """
        connection = self._connection
        connection.begin(address, data, size)
        deadline = time.monotonic() + _PATIENCE_S
        while (answer := connection.answer()) is None:
            left = deadline - time.monotonic()
            if left <= 0:
                raise OSError(errno.ETIMEDOUT, os.strerror(errno.ETIMEDOUT))
            select.select([connection.fileno()], [], [], left)
        return answer

    def close(self) -> None:
        """Close the connection; may be called twice and does not raise."""
        self._connection.close()
