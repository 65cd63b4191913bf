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
A real I2C bus, such as ``/dev/i2c-1``, through smbus2.

If the adapter supports it, each transaction is one ``I2C_RDWR`` call that contains the address.
Adapters with SMBus only (those of PC boards, and the kernel's i2c-stub) use SMBus block transfers
of at most 32 bytes. Those need the address set beforehand, which is a property of the open file,
so every address has its own file. Only the bridge opens one, because each call blocks until the
transfer has ended.
"""

from __future__ import annotations

import errno
import fcntl
import os
from typing import Any
from typing import Final

import smbus2

SMBUS_BLOCK: Final = 32
# Linux waits one second for a bus that is held low, during which no other device could be read.
# The longest transfer of a driver takes 12 ms at 100 kHz; the rest is for chips that stretch the
# clock.
_TIMEOUT_MS: Final = 50
_I2C_TIMEOUT: Final = 0x0702  # its unit is 10 ms
_SYSFS: Final = '/sys/bus/i2c/devices'


class LinuxTransport:
    """An open bus; see :class:`rt_robot_os.devices.i2c.bus.I2cTransport`."""

    def __init__(self, path: str) -> None:
        """
        Open the bus.

        :raises OSError: it cannot be opened.
        """
        self._path = path
        self._bus = _open(path)
        self._combined = bool(self._bus.funcs & smbus2.I2cFunc.I2C)
        self._by_address: dict[int, Any] = {}

    def transfer(self, address: int, data: bytes, size: int) -> bytes:
        """
        Perform one transaction.

        :raises OSError: with the errno of Linux; EBUSY if a Linux driver has the device, which
            I2C_RDWR would not report.
        """
        bus = self._by_address.get(address)
        if bus is None:
            bus = self._meet(address)
        if not self._combined:
            return _smbus(bus, address, data, size)
        messages = [smbus2.i2c_msg.write(address, data)] if data else []
        if not size:
            bus.i2c_rdwr(*messages)
            return b''
        answer = smbus2.i2c_msg.read(address, size)
        bus.i2c_rdwr(*messages, answer)
        return bytes(answer)

    def close(self) -> None:
        """Close the files; may be called twice and does not raise."""
        for bus in (*self._by_address.values(), self._bus):
            try:
                bus.close()
            except OSError:
                pass  # it was unplugged: there is nothing to close
        self._by_address.clear()

    def _meet(self, address: int) -> Any:
        """Prepare for the first transaction with a device."""
        held = _kernel_driver(self._path, address)
        if held:
            raise OSError(errno.EBUSY, f'the Linux driver {held} has the device')
        bus = self._bus if self._combined else _open(self._path)
        self._by_address[address] = bus
        return bus


def _open(path: str) -> Any:
    bus = smbus2.SMBus()
    try:
        bus.open(path)
    except OSError:
        bus.close()  # the opened file is not a bus
        raise
    descriptor: Any = bus.fd
    try:
        fcntl.ioctl(descriptor, _I2C_TIMEOUT, _TIMEOUT_MS // 10)
    except OSError:
        pass  # the default of one second remains
    return bus


def _smbus(bus: Any, address: int, data: bytes, size: int) -> bytes:
    """Perform the same transfer with SMBus calls."""
    if size > SMBUS_BLOCK or len(data) > SMBUS_BLOCK + 1 or (size and len(data) != 1):
        raise OSError(errno.EOPNOTSUPP, os.strerror(errno.EOPNOTSUPP))
    if size:
        return bytes(bus.read_i2c_block_data(address, data[0], size))
    if len(data) == 1:
        bus.write_byte(address, data[0])
    elif len(data) == 2:
        bus.write_byte_data(address, data[0], data[1])
    else:
        bus.write_i2c_block_data(address, data[0], data[1:])
    return b''


def _kernel_driver(path: str, address: int) -> str:
    """Return the name of the Linux driver that has a device, if any."""
    number = os.path.basename(os.path.realpath(path)).rpartition('-')[2]
    try:
        return os.path.basename(os.readlink(f'{_SYSFS}/{number}-{address:04x}/driver'))
    except OSError:
        return ''
