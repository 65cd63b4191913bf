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
The I2C bus: transactions with a chip at an address, over whatever carries them.

A driver sees :class:`I2cBus` and nothing else. What is below is chosen by what the path is: a
character device is a real bus (``i2c_linux.py``), a Unix socket is an emulated one whose chips
live in another process (``i2c_socket.py``); tests hand over one that lives in the same process.

A transaction is one call that nobody gets in between: on a real bus one ``ioctl``. It waits until
the bytes have gone over the wire, 9 bits a byte. Linux waits for that without letting signals
through, so **on a real bus a transaction is not preempted**; the kernel of this package measures
the delay and charges it to the task. Read few bytes at a time, and run the bus at 400 kHz.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from dataclasses import field
import errno
from importlib import import_module
import os
import re
import stat
from typing import Final
from typing import Protocol

from rt_robot_os.errors import DeviceError

FIRST_ADDRESS: Final = 0x08
LAST_ADDRESS: Final = 0x77

_BUS_NUMBER: Final = re.compile(r'/dev/i2c-(\d+)').fullmatch
_NO_ANSWER: Final = (errno.ENXIO, errno.EREMOTEIO)
# After these the open file is of no use any more.
_GONE: Final = (errno.ENODEV, errno.EBADF, errno.EPIPE, errno.ECONNRESET, errno.ESHUTDOWN)


class I2cTransport(Protocol):
    """What carries the bytes; errors are those of Linux."""

    def transfer(self, address: int, data: bytes, size: int) -> bytes:
        """
        Do one transaction: write, then after a repeated start read.

        :param data: written first; empty only reads.
        :param size: bytes to read; 0 only writes.
        :raises OSError: with the errno that Linux has for it.
        """

    def close(self) -> None:
        """Let go; does not raise."""


class I2cBus:
    """
    One bus as one device sees it.

    :ivar path: where it is, as the device's configuration says.
    :ivar transfers: transactions that went well.
    :ivar failures: transactions that did not.
    :ivar gone: the bus itself went away; it has to be opened anew.
    """

    def __init__(self, path: str, transport: I2cTransport) -> None:
        """
        Take over what carries the bytes.

        :param path: for the errors.
        """
        self.path = path
        self.transfers = 0
        self.failures = 0
        self.gone = False
        self._transport = transport

    def read_block(self, address: int, register: int, size: int) -> bytes:
        """
        Read registers, the first one named, in one transaction.

        :raises DeviceError: it failed; the message says what to do.
        """
        return self.transfer(address, bytes((register,)), size)

    def write_block(self, address: int, register: int, data: bytes) -> None:
        """
        Write registers, the first one named, in one transaction.

        :raises DeviceError: it failed; the message says what to do.
        """
        self.transfer(address, bytes((register,)) + data, 0)

    def transfer(self, address: int, data: bytes, size: int) -> bytes:
        """
        Write, then after a repeated start read, in one transaction; blocks until it is done.

        :param size: bytes to read.
        :return: exactly that many.
        :raises DeviceError: it failed; the message says what to do.
        """
        try:
            answer = self._transport.transfer(address, data, size)
        except OSError as error:
            self.failures += 1
            self.gone = self.gone or is_gone(error)
            raise _transfer_error(self.path, address, error) from error
        if len(answer) != size:
            self.failures += 1
            raise DeviceError(f'{_place(self.path, address)}: {len(answer)} bytes came where '
                              f'{size} were asked for: the I2C adapter is defective')
        self.transfers += 1
        return answer


@dataclass
class _Open:
    """An open bus and who is on it."""

    transport: I2cTransport
    users: list[I2cBus] = field(default_factory=list)


class I2cBuses:
    """
    The buses that are open, each once however many devices are on it.

    A device takes its bus when it is opened and gives it back when it is closed. What it gets is
    its own, so that errors name the port as it is in its configuration; what is below is shared.
    """

    def __init__(self, opener: Callable[[str], I2cTransport] | None = None) -> None:
        """
        Begin with none.

        :param opener: opens what carries the bytes; by default what the path is.
        """
        self._opener = opener
        self._open: dict[str, _Open] = {}
        self._left: list[_Open] = []

    def take(self, path: str) -> I2cBus:
        """
        Open a bus, or share it when it is open.

        :raises DeviceError: it cannot be opened; the message says what to do.
        """
        real = os.path.realpath(path)
        found = self._open.get(real)
        if found is not None and any(bus.gone for bus in found.users):
            # Those who are still on it will notice, and open the new one.
            self._left.append(self._open.pop(real))
            found = None
        if found is None:
            found = self._open[real] = _Open((self._opener or open_transport)(path))
        bus = I2cBus(path, found.transport)
        found.users.append(bus)
        return bus

    def give_back(self, bus: I2cBus) -> None:
        """Say that a device needs its bus no more; the last one closes what is below."""
        for each in (*self._open.values(), *self._left):
            if bus in each.users:
                each.users.remove(bus)
                if not each.users:
                    each.transport.close()
        self._open = {real: each for real, each in self._open.items() if each.users}
        self._left = [each for each in self._left if each.users]

    @property
    def open_count(self) -> int:
        """Give the number of open buses."""
        return len(self._open) + len(self._left)


# The open files of this process: as global as /dev is.
BUSES: Final = I2cBuses()


def preload() -> None:
    """Import what opening a bus needs, where it is installed: nothing is imported in the loop."""
    for name in ('i2c_socket', 'i2c_linux'):
        try:
            import_module(f'rt_robot_os.drivers.{name}')
        except ImportError:
            pass  # opening a bus that needs it says so


def open_transport(path: str) -> I2cTransport:
    """
    Open a bus by what its path is: a character device or a socket.

    :raises DeviceError: it cannot be opened; the message says what to do.
    """
    # Imported here, since who has a socket needs no smbus2, and the other way round.
    try:
        mode = os.stat(path).st_mode
        if stat.S_ISSOCK(mode):
            from rt_robot_os.drivers.i2c_socket import SocketTransport
            return SocketTransport(path)
        if stat.S_ISCHR(mode):
            from rt_robot_os.drivers.i2c_linux import LinuxTransport
            return LinuxTransport(path)
    except ImportError as error:
        raise DeviceError(
            f'I2C bus {path}: the Python package smbus2 cannot be imported ({error}): '
            'sudo apt install python3-smbus2, or pip install smbus2') from error
    except OSError as error:
        raise _open_error(path, error) from error
    raise DeviceError(f'{path} is not an I2C bus: check the port (ls /dev/i2c-* lists them)')


def is_gone(error: OSError) -> bool:
    """Say whether the open bus is of no use any more after this error."""
    return error.errno in _GONE


def _open_error(path: str, error: OSError) -> DeviceError:
    if isinstance(error, DeviceError):
        return error
    if error.errno in (errno.EACCES, errno.EPERM):
        return DeviceError(
            f'I2C bus {path} may not be opened: add the user to the group i2c '
            '(sudo usermod -aG i2c $USER; on some systems it is dialout) and log in again')
    if error.errno in (errno.ENOENT, errno.ENODEV, errno.ENXIO, errno.ENOTDIR):
        return DeviceError(
            f'I2C bus {path} does not exist: ls /dev/i2c-* lists the buses; when there are none, '
            'enable I2C (sudo modprobe i2c-dev; on a Raspberry Pi also dtparam=i2c_arm=on)')
    if error.errno == errno.ENOTTY:
        return DeviceError(f'{path} is not an I2C bus: check the port (ls /dev/i2c-* lists them)')
    return DeviceError(f'I2C bus {path} cannot be opened ({_cause(error)}): check the path')


def _transfer_error(path: str, address: int, error: OSError) -> DeviceError:
    return DeviceError(f'{_place(path, address)}: {_remedy(path, address, error)}')


def _remedy(path: str, address: int, error: OSError) -> str:
    number = error.errno
    if number in _NO_ANSWER:
        match = _BUS_NUMBER(path)
        who = f' (i2cdetect -y {match[1]} shows who is there)' if match else ''
        return (f'no device answers: check its power, SDA, SCL and pull-up resistors, and the '
                f'address{who}')
    if number in _GONE:
        return f'the bus is gone ({_cause(error)}): check the adapter; it will be opened again'
    if number == errno.ETIMEDOUT:
        return ('the transfer timed out, something holds SDA or SCL low: switch the power of the '
                'devices off and on, check the wiring and the pull-up resistors')
    if number == errno.EBUSY:
        return (f'busy ({error.strerror}): a driver of Linux that has the device must be unloaded '
                f'or taken out of the device tree (/sys/bus/i2c/devices/*-{address:04x}/driver)')
    if number == errno.EAGAIN:
        return 'arbitration was lost: another master is on the bus, or noise; shorten the wires'
    if number in (errno.EOPNOTSUPP, errno.EINVAL):
        return f'the adapter cannot do this transfer ({_cause(error)}): use another adapter'
    return f'the transfer failed ({_cause(error)}): check the wiring and the pull-up resistors'


def _place(path: str, address: int) -> str:
    return f'I2C bus {path}, address 0x{address:02x}'


def _cause(error: OSError) -> str:
    if error.errno is None:
        return str(error)
    return f'{errno.errorcode.get(error.errno, error.errno)}: {os.strerror(error.errno)}'
