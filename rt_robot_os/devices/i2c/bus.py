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
The I2C bus: transactions with a chip at an address, started now and answered later.

A transaction is one indivisible call: on a real bus one ``ioctl``. Linux blocks in it without
handling signals, so it is never made in the real-time process: a real bus is served by a bridge, a
separate process (``command.py``), and an emulated one by the simulator. Both are behind a Unix
socket (``socket_bus.py``). A driver's transaction is one packet that is sent, and its answer one
packet that has arrived or not. Nothing blocks, whatever the bus or its process does. Tests use a
bus in their own process, which answers immediately.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from dataclasses import field
import os
import stat
from typing import Final
from typing import Protocol

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.i2c.bridge import I2cBridge
from rt_robot_os.devices.i2c.bus_errors import is_gone
from rt_robot_os.devices.i2c.bus_errors import open_error
from rt_robot_os.devices.i2c.bus_errors import place
from rt_robot_os.devices.i2c.bus_errors import transfer_error
from rt_robot_os.devices.i2c.socket_bus import SocketConnection

FIRST_ADDRESS: Final = 0x08
LAST_ADDRESS: Final = 0x77

# Longer than the time-out of an adapter, because several devices may wait for one bus.
ANSWER_TIMEOUT_NS: Final = 300 * NS_PER_MS


@dataclass(frozen=True)
class Transfer:
    """
    One transaction: write, then after a repeated start read.

    :ivar address: of the chip.
    :ivar data: written first; empty for a transaction that only reads.
    :ivar size: bytes to read; 0 for a transaction that only writes.
    """

    address: int
    data: bytes
    size: int


class I2cTransport(Protocol):
    """A bus in the same process, which answers immediately; errors are those of Linux."""

    def transfer(self, address: int, data: bytes, size: int) -> bytes:
        """
        Do one transaction.

        :raises OSError: with the errno that Linux has for it.
        """

    def close(self) -> None:
        """Release the bus; does not raise."""


class I2cConnection(Protocol):
    """Transports the transactions of one device, at most one at a time."""

    @property
    def gone(self) -> bool:
        """Return whether it has failed, and must be reopened."""

    def begin(self, address: int, data: bytes, size: int) -> None:
        """
        Start a transaction, without blocking; an unfinished one is discarded.

        :raises OSError: with the errno that Linux has for it.
        """

    def answer(self) -> bytes | None:
        """
        Return the answer to the last transaction, None while there is none; does not block.

        :raises OSError: it failed, with the errno that Linux has for it.
        """

    def fileno(self) -> int | None:
        """Return the descriptor that becomes readable with an answer; None for immediate ones."""

    def close(self) -> None:
        """Release the bus; does not raise."""


class DirectConnection:
    """A device's access to a bus in the same process."""

    def __init__(self, transport: I2cTransport) -> None:
        """Store the bus, which others may share."""
        self.gone = False
        self.transport = transport
        self._answer: bytes | OSError | None = None

    def begin(self, address: int, data: bytes, size: int) -> None:
        """Perform the transaction; :meth:`answer` returns its result."""
        try:
            self._answer = self.transport.transfer(address, data, size)
        except OSError as error:
            self.gone = self.gone or is_gone(error)
            self._answer = error

    def answer(self) -> bytes | None:
        """
        Return the answer.

        :raises OSError: it failed.
        """
        answer, self._answer = self._answer, None
        if isinstance(answer, OSError):
            raise answer
        return answer

    def fileno(self) -> int | None:
        """Return None: there is nothing to wait for."""
        return None

    def close(self) -> None:
        """Do nothing: the bus is closed with the last of its users."""


class I2cBus:
    """
    One bus for one device; safe in the real-time loop, never blocks.

    :ivar path: the path in the device's configuration.
    :ivar transfers: successful transactions.
    :ivar failures: failed transactions.
    :ivar connection: transports them.
    """

    def __init__(self, path: str, connection: I2cConnection) -> None:
        """
        Store the connection.

        :param path: for errors.
        """
        self.path = path
        self.transfers = 0
        self.failures = 0
        self.connection = connection
        self._under_way: Transfer | None = None
        self._begun_ns = 0
        self._refused: OSError | None = None

    def begin(self, transfer: Transfer, now_ns: int) -> None:
        """Start a transaction; :meth:`answer` raises its errors."""
        self._under_way = transfer
        self._begun_ns = now_ns
        self._refused = None
        try:
            self.connection.begin(transfer.address, transfer.data, transfer.size)
        except OSError as error:
            self._refused = error

    def answer(self, now_ns: int) -> bytes | None:
        """
        Return the answer to the started transaction.

        :return: the requested number of bytes; None while there is no answer.
        :raises DeviceError: it failed; the message contains the remedy.
        """
        transfer = self._under_way
        if transfer is None:
            return None
        try:
            if self._refused is not None:
                raise self._refused
            answer = self.connection.answer()
        except OSError as error:
            raise self._failed(transfer, error) from error
        if answer is None:
            if now_ns - self._begun_ns > ANSWER_TIMEOUT_NS:
                raise self._failed(transfer, DeviceError(
                    f'{place(self.path, transfer.address)}: no answer for '
                    f'{ANSWER_TIMEOUT_NS / NS_PER_S:g} s from the process that serves the bus '
                    '(i2c_bridge, or the simulator): it hangs, was stopped, or is starved; it '
                    'will be tried again'))
            return None
        if len(answer) != transfer.size:
            raise self._failed(transfer, DeviceError(
                f'{place(self.path, transfer.address)}: {len(answer)} bytes arrived instead of '
                f'the requested {transfer.size}: the I2C adapter is defective'))
        self._under_way = None
        self.transfers += 1
        return answer

    @property
    def gone(self) -> bool:
        """Return whether the bus itself is gone; it must be reopened."""
        return self.connection.gone

    def _failed(self, transfer: Transfer, error: OSError) -> DeviceError:
        self._under_way = None
        self.failures += 1
        return transfer_error(self.path, transfer.address, error)


@dataclass
class _Open:
    """An open bus of this process and its users."""

    transport: I2cTransport | None
    users: list[I2cBus] = field(default_factory=list)


class I2cBuses:
    """
    The open buses, each opened once for all its devices.

    A device acquires its bus when it is opened and releases it when it is closed. Each device gets
    its own :class:`I2cBus`, so that errors name the port as in its configuration, and a time-out
    of one device does not affect the others; the connection below is shared.
    """

    def __init__(self, opener: Callable[[str], I2cTransport] | None = None) -> None:
        """
        Start without an open bus.

        :param opener: opens a bus in this process; by default the kind of the path decides.
        """
        self._opener = opener
        self._open: dict[str, _Open] = {}
        self._left: list[_Open] = []
        self._bridges: dict[str, I2cBridge] = {}

    def prepare(self, path: str) -> None:
        """
        Start the bridge of a real bus and block until it serves; not for the loop.

        Errors are reported when the bus is acquired.
        """
        if self._opener is None and _mode(path) == stat.S_IFCHR:
            self._bridge(path).start(wait=True)

    def acquire(self, path: str) -> I2cBus:
        """
        Open a bus, or share it if it is open; does not block.

        :raises DeviceError: it cannot be opened; the message contains the remedy.
        """
        real = os.path.realpath(path)
        found = self._open.get(real)
        if found is not None and any(bus.gone for bus in found.users):
            # Devices that still use it detect this, and open the new one.
            self._left.append(self._open.pop(real))
            found = None
        opener = self._opener
        if found is None:
            found = _Open(opener(path) if opener is not None else None)
        connection: I2cConnection
        if found.transport is not None:
            connection = DirectConnection(found.transport)
        else:
            connection = self._connect(path)
        bus = I2cBus(path, connection)
        found.users.append(bus)
        self._open[real] = found
        return bus

    def release(self, bus: I2cBus) -> None:
        """Release the bus of a device; the last release closes the connection."""
        for each in (*self._open.values(), *self._left):
            if bus in each.users:
                each.users.remove(bus)
                bus.connection.close()
                if not each.users and each.transport is not None:
                    each.transport.close()
        self._open = {real: each for real, each in self._open.items() if each.users}
        self._left = [each for each in self._left if each.users]

    def close(self) -> None:
        """End the bridges; they end with this process too."""
        for bridge in self._bridges.values():
            bridge.stop()
        self._bridges.clear()

    @property
    def open_count(self) -> int:
        """Return the number of open buses."""
        return len(self._open) + len(self._left)

    def _connect(self, path: str) -> SocketConnection:
        try:
            mode = _mode(path)
            if mode == stat.S_IFCHR:
                bridge = self._bridge(path)
                bridge.start()
                return SocketConnection(str(bridge.socket_path))
            if mode == stat.S_IFSOCK:
                return SocketConnection(path)
            os.stat(path)
        except OSError as error:
            raise open_error(path, error) from error
        raise DeviceError(f'{path} is not an I2C bus: check the port (ls /dev/i2c-* lists them)')

    def _bridge(self, path: str) -> I2cBridge:
        real = os.path.realpath(path)
        return self._bridges.setdefault(real, I2cBridge(real))


# The open buses of this process: as global as /dev is.
BUSES: Final = I2cBuses()


def _mode(path: str) -> int:
    """Return the type of a file; 0 if it does not exist."""
    try:
        return stat.S_IFMT(os.stat(path).st_mode)
    except (OSError, ValueError):
        return 0
