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

"""A driver, its simulated chip and the bus between them in one process, with time in hand."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from contextlib import contextmanager
import errno
import os
from pathlib import Path
import select
import time
from typing import Any

from driver_fakes import bind
from driver_fakes import settings_of
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.i2c.bus import DirectConnection
from rt_robot_os.devices.i2c.bus import I2cBus
from rt_robot_os.devices.i2c.bus import I2cBuses
from rt_robot_os.devices.i2c.bus import I2cTransport
from rt_robot_os.devices.i2c.bus import Transfer
from rt_robot_os.devices.i2c.device import I2cDevice
from rt_robot_os.devices.i2c.simulated_bus import LocalTransport
from rt_robot_os.devices.i2c.simulated_device import SimulatedChip
from rt_robot_os.devices.i2c.simulated_port import I2cPort

MS = 1_000_000
S = 1_000_000_000
START_NS = 50 * S


class I2cRig:
    """A chip and the driver that reads it."""

    def __init__(self, simulator: type[SimulatedChip], driver: type[I2cDevice],
                 sim: dict[str, Any], settings: dict[str, Any]) -> None:
        self.now_ns = START_NS
        self.port = I2cPort(Path('/nowhere/i2c-sim'))
        wanted = settings_of(driver, port='/dev/i2c-7', **settings)
        self.chip: Any = simulator('sim', sim, self.port, wanted['address'])
        self.chip.start(self.now_ns)
        self.device: Any = driver('dut', wanted)
        self.device.buses = I2cBuses(self.open_bus)
        self.device.clock_ns = lambda: self.now_ns
        self.opened = 0
        self.bus_ns = 0
        self.publishers = bind(self.device)

    def open_bus(self, path: str) -> LocalTransport:
        self.opened += 1
        return LocalTransport(self.port.bus, lambda: self.now_ns, self._spend)

    def _spend(self, duration_ns: int) -> None:
        self.bus_ns += duration_ns

    def run(self, duration_ms: float, step_ms: float = 1.0,
            each: Callable[[int], None] | None = None) -> int:
        """Let time pass and poll; gives the number of samples published."""
        samples = 0
        for _ in range(round(duration_ms / step_ms)):
            self.now_ns += round(step_ms * MS)
            samples += self.device.read(self.now_ns)
            if each is not None:
                each(self.now_ns)
        return samples

    def run_until_error(self, duration_ms: float) -> str:
        """Poll until the device says that it is gone; gives what it says."""
        try:
            self.run(duration_ms)
        except DeviceError as error:
            return str(error)
        return ''


@contextmanager
def i2c_rig(simulator: type[SimulatedChip], driver: type[I2cDevice],
            sim: dict[str, Any] | None = None, *, is_open: bool = True,
            **settings: Any) -> Iterator[I2cRig]:
    """Connect a simulated chip with its driver."""
    made = I2cRig(simulator, driver, sim or {}, settings)
    if is_open:
        made.device.open()
    yield made
    made.device.close()


class LateConnection:
    """A bus whose answers are there with the next look, as those of another process."""

    def __init__(self, transport: I2cTransport) -> None:
        self.direct = DirectConnection(transport)
        self.waiting = False

    @property
    def gone(self) -> bool:
        return self.direct.gone

    def begin(self, address: int, data: bytes, size: int) -> None:
        self.waiting = True
        self.direct.begin(address, data, size)

    def answer(self) -> bytes | None:
        if self.waiting:
            self.waiting = False
            return None
        return self.direct.answer()

    def fileno(self) -> int | None:
        return None

    def close(self) -> None:
        self.direct.close()


class LateBuses(I2cBuses):
    """Buses whose answers come late."""

    def acquire(self, path: str) -> I2cBus:
        bus = super().acquire(path)
        assert isinstance(bus.connection, DirectConnection)
        bus.connection = LateConnection(bus.connection.transport)
        return bus


class ScriptedTransport:
    """A bus that gives what a test wants."""

    def __init__(self, answer: Callable[[bytes, int], bytes]) -> None:
        self.answer = answer
        self.closed = 0

    def transfer(self, address: int, data: bytes, size: int) -> bytes:
        return self.answer(data, size)

    def close(self) -> None:
        self.closed += 1


def failing(number: int) -> Callable[[bytes, int], bytes]:
    """Answer with an error of Linux."""
    def answer(data: bytes, size: int) -> bytes:
        raise OSError(number, os.strerror(number))
    return answer


ERRORS = (errno.EREMOTEIO, errno.ENXIO, errno.ETIMEDOUT, errno.EIO, errno.EBUSY, errno.EAGAIN,
          errno.ENODEV, errno.EOPNOTSUPP, errno.EINVAL, errno.ECONNRESET, errno.ENOMEM)


def transact(bus: I2cBus, address: int, data: bytes, size: int) -> bytes:
    """Do one transaction and wait for it."""
    bus.begin(Transfer(address, data, size), time.monotonic_ns())
    return answer_of(bus)


def answer_of(bus: I2cBus) -> bytes:
    """Wait for an answer."""
    while (answer := bus.answer(0)) is None:
        descriptor = bus.connection.fileno()
        assert descriptor is not None
        assert select.select([descriptor], [], [], 60)[0], 'no answer'
    return answer


def wait_until(condition: Callable[[], bool]) -> None:
    """Look until something holds."""
    deadline = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)
