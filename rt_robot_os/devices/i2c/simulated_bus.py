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
An emulated I2C bus with emulated chips.

It has no thread and no clock: every transaction is told the time. :class:`LocalTransport` puts it
under a driver of the same process, in tests on virtual time; ``simulated_port.py`` puts a socket in
front of it, for a driver in another process.
"""

from __future__ import annotations

from collections.abc import Callable
import errno
import os
from typing import Final
from typing import Protocol

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S

CLOCK_HZ: Final = 400_000
_BITS: Final = 9  # eight and the acknowledgement
_HELD_NS: Final = 50 * NS_PER_MS  # the time-out that the driver sets on a real adapter


class Chip(Protocol):
    """
    A chip on the bus.

    :ivar name: for errors.
    :ivar address: on the bus.
    :ivar clock_hz: clock of the transfers with it.
    """

    name: str
    address: int
    clock_hz: int

    def transfer(self, data: bytes, size: int, now_ns: int) -> bytes:
        """
        Take what is written, then give what is read.

        :raises OSError: it does not acknowledge.
        """

    def holds_bus(self, now_ns: int) -> bool:
        """Return whether it holds the bus, so that nobody can use it."""

    def takes_bus(self, now_ns: int) -> bool:
        """Return whether the bus goes away with it."""


def transfer_ns(written: int, read: int, clock_hz: int = CLOCK_HZ) -> int:
    """
    Compute how long a transaction takes on the wire.

    :param written: bytes, without the address.
    :param read: bytes, without the address; 0 only writes.
    """
    bits = 2 + (_BITS * (1 + written) if written or not read else 0)
    if read:
        bits += 1 + _BITS * (1 + read)
    return bits * NS_PER_S // clock_hz


class EmulatedBus:
    """
    The chips by address.

    :ivar transfers: transactions that were acknowledged.
    :ivar failures: transactions that were not.
    """

    def __init__(self) -> None:
        """Begin without chips."""
        self.transfers = 0
        self.failures = 0
        self._chips: dict[int, Chip] = {}

    def add(self, chip: Chip) -> None:
        """
        Put a chip on the bus.

        :raises ConfigError: its address is taken.
        """
        other = self._chips.setdefault(chip.address, chip)
        if other is not chip:
            raise ConfigError([f'{chip.name}: address 0x{chip.address:02x} is that of '
                               f'{other.name}: give each its own'])

    def absent(self, now_ns: int) -> bool:
        """Return whether the bus itself is away."""
        return any(chip.takes_bus(now_ns) for chip in self._chips.values())

    def transfer(
        self, address: int, data: bytes, size: int, now_ns: int,
    ) -> tuple[int, bytes, int]:
        """
        Do one transaction.

        :return: errno (0 when it went well), the bytes read, and how long it takes.
        """
        chip = self._chips.get(address)
        clock_hz = CLOCK_HZ if chip is None else chip.clock_hz
        if self.absent(now_ns):
            self.failures += 1
            return errno.ENODEV, b'', 0
        if any(each.holds_bus(now_ns) for each in self._chips.values()):
            self.failures += 1
            return errno.ETIMEDOUT, b'', _HELD_NS
        try:
            if chip is None:
                raise OSError(errno.EREMOTEIO, 'nobody has this address')
            answer = chip.transfer(data, size, now_ns)
        except OSError as error:
            self.failures += 1
            return error.errno or errno.EIO, b'', transfer_ns(0, 0, clock_hz)
        self.transfers += 1
        return 0, answer, transfer_ns(len(data), size, clock_hz)


class LocalTransport:
    """An emulated bus in this process; see :class:`rt_robot_os.devices.i2c.bus.I2cTransport`."""

    def __init__(
        self, bus: EmulatedBus, clock_ns: Callable[[], int],
        spend: Callable[[int], None] | None = None,
    ) -> None:
        """
        Keep bus and clock.

        :param clock_ns: the time, such as that of a virtual clock.
        :param spend: lets the time of a transfer pass; by default it takes none.
        """
        self._bus = bus
        self._clock_ns = clock_ns
        self._spend = spend

    def transfer(self, address: int, data: bytes, size: int) -> bytes:
        """
        Do one transaction.

        :raises OSError: with the errno that Linux has for it.
        """
        number, answer, duration_ns = self._bus.transfer(address, data, size, self._clock_ns())
        if self._spend is not None:
            self._spend(duration_ns)
        if number:
            raise OSError(number, os.strerror(number))
        return answer

    def close(self) -> None:
        """Do nothing: the bus is somebody else's."""
