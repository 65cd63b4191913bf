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

"""The transactions of the bridge on a real I2C bus: one after the other; blocks on the bus."""

from __future__ import annotations

import errno
import os
import stat

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.needs import lacking
from rt_robot_os.devices.i2c.bus import I2cTransport
from rt_robot_os.devices.i2c.bus_errors import is_gone
from rt_robot_os.devices.i2c.bus_errors import open_error
from rt_robot_os.devices.i2c.packets import NO_BUS
from rt_robot_os.devices.i2c.socket_bus import SocketTransport


class RealBus:
    """
    Performs the transactions of a socket on a real bus, and reopens that when it was gone.

    :ivar transfers: successful transactions.
    :ivar failures: failed transactions.
    """

    def __init__(self, path: str) -> None:
        """Store the path; the bus is opened with the first transaction, or by :meth:`open`."""
        self.transfers = 0
        self.failures = 0
        self._path = path
        self._transport: I2cTransport | None = None

    def open(self) -> I2cTransport:  # noqa: A003
        """
        Open the bus unless it is open.

        :raises DeviceError: it cannot be opened; the message contains the remedy.
        """
        if self._transport is None:
            self._transport = open_transport(self._path)
        return self._transport

    def transfer(
        self, address: int, data: bytes, size: int, now_ns: int,
    ) -> tuple[int, bytes, int]:
        """
        Perform one transaction.

        :return: errno (0 on success), the bytes read or the text of the error, and 0: no delay of
            the answer.
        """
        try:
            answer = self.open().transfer(address, data, size)
        except DeviceError as error:
            self.failures += 1
            return NO_BUS, str(error).encode(), 0
        except OSError as error:
            self.failures += 1
            if is_gone(error):
                self.close()
            return error.errno or errno.EIO, (error.strerror or '').encode(), 0
        self.transfers += 1
        return 0, answer, 0

    def close(self) -> None:
        """Release the bus; may be called twice."""
        transport, self._transport = self._transport, None
        if transport is not None:
            transport.close()


def open_transport(path: str) -> I2cTransport:
    """
    Open a blocking bus: a real one, or one that another process serves.

    :raises DeviceError: it cannot be opened; the message contains the remedy.
    """
    try:
        mode = os.stat(path).st_mode
        if stat.S_ISSOCK(mode):
            return SocketTransport(path)
        if stat.S_ISCHR(mode):
            problem = lacking(f'I2C bus {path}', 'smbus2')
            if problem:
                raise DeviceError(problem)
            from rt_robot_os.devices.i2c.linux_bus import LinuxTransport
            return LinuxTransport(path)
    except DeviceError:  # an OSError, too
        raise
    except OSError as error:
        raise open_error(path, error) from error
    raise DeviceError(f'{path} is not an I2C bus: check the port (ls /dev/i2c-* lists them)')
