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
A simulated chip on an emulated I2C bus, with faults.

Its time is that of each transaction and each ``pump``.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
import errno
import os
from pathlib import Path
import random
from typing import Any
from typing import ClassVar
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.i2c.simulated_bus import CLOCK_HZ
from rt_robot_os.devices.i2c.simulated_port import I2cPort
from rt_robot_os.sim.base import complete
from rt_robot_os.sim.base import NOWHERE
from rt_robot_os.sim.base import RobotSite
from rt_robot_os.sim.base import Simulated
from rt_robot_os.sim.base import Site
from rt_robot_os.sim.faults import check
from rt_robot_os.sim.faults import corrupted
from rt_robot_os.sim.faults import fault_settings
from rt_robot_os.sim.faults import I2C_FAULTS
from rt_robot_os.sim.faults import plan_of

_IDLE_NS: Final = 50 * NS_PER_MS


def common_settings() -> tuple[Field, ...]:
    """Declare the settings of every simulated chip."""
    return (
        Field('clock_hz', int, CLOCK_HZ,
              'Clock frequency of the bus in transfers with it.', unit='Hz',
              minimum=1000, maximum=3_400_000),
        *fault_settings(I2C_FAULTS),
    )


class SimulatedChip(Simulated):
    """
    One simulated chip.

    :cvar ADDRESS: its usual address.
    :cvar FOREIGN: register -> value of another chip, which answers while the fault wrong is
        active.
    :ivar clock_hz: clock frequency of the transfers with it.
    :ivar random: for noise.
    :ivar measuring: False while the fault silent is active.
    :ivar world: the world that it measures, updated to the time of each transfer; None without a
        world.
    :ivar site: its world and mounting.
    :ivar mounting: its mounting on the robot.
    :ivar device: the settings of its driver, as far as known.
    """

    ADDRESS: ClassVar[int] = 0x76
    FOREIGN: ClassVar[Mapping[int, int]] = {0x75: 0x68}
    port: I2cPort

    def __init__(self, name: str, settings: Mapping[str, Any], port: I2cPort,
                 address: int | None = None, site: Site = NOWHERE) -> None:
        """
        Check the settings and put the chip on the bus.

        :param address: None for the usual one.
        :param site: its world and mounting.
        :raises ConfigError: a setting is wrong, or the address is taken.
        """
        self.name = name
        self.port = port
        self.site, self.world, self.device = site, site.world, site.device
        self.mounting = site.mounting()
        self.address = self.ADDRESS if address is None else address
        self.settings = complete(self.SETTINGS, settings, name)
        self._plan = plan_of(name, self.settings['faults'], I2C_FAULTS)
        self.clock_hz: int = self.settings['clock_hz']
        self.random = random.Random(self.settings['seed'])
        self._line_random = random.Random(self.settings['seed'] + 1)
        self.measuring = True
        self._stuck_at: float | None = None
        self._path = port.link(name)
        self._started = False
        self._powered = False
        self._start_ns = 0
        self._now_ns = 0
        self._injected: list[tuple[str, float]] = []
        self.prepare()
        port.bus.add(self)

    @classmethod
    def made_for(
        cls, name: str, settings: Mapping[str, Any], place: RobotSite, device: Mapping[str, Any],
    ) -> SimulatedChip:
        """
        Make the simulated counterpart of a device; nothing is plugged in yet.

        :raises ConfigError: a setting is wrong, or the address is taken.
        """
        port = place.shared_port('i2c-sim', I2cPort)
        return cls(name, settings, port, device.get('address'), place.site(device))

    # ---- to be defined by a chip--------------------------------------------------------------

    def prepare(self) -> None:
        """
        Prepare the chip; called once, after the settings have been checked.

        :raises ConfigError: a setting is wrong.
        """

    @abstractmethod
    def power_on(self, now_ns: int) -> None:
        """Start with the registers of the chip after power-on."""

    @abstractmethod
    def advance(self, now_ns: int) -> None:
        """Advance the chip to this time: finish conversions, fill its FIFO."""

    @abstractmethod
    def exchange(self, data: bytes, size: int, now_ns: int) -> bytes:
        """Receive the written bytes, then return the read ones."""

    # ---- the bus -----------------------------------------------------------------------------

    def transfer(self, data: bytes, size: int, now_ns: int) -> bytes:
        """
        Perform one transaction, with the active faults.

        :raises OSError: it does not acknowledge.
        """
        active = self.update(now_ns)
        if 'nack' in active or not self._powered:
            raise OSError(errno.EREMOTEIO, os.strerror(errno.EREMOTEIO))
        if 'wrong' in active:
            at = data[0] if data else 0
            return bytes(self.FOREIGN.get((at + i) & 0xFF, 0) for i in range(size))
        answer = self.exchange(data, size, now_ns)
        chance = self._line_random
        if 'garbage' in active:
            answer = chance.randbytes(len(answer))
        if 'corrupt' in active:
            answer = corrupted(answer, self.settings['corrupt_probability'], chance)
        return answer

    def holds_bus(self, now_ns: int) -> bool:
        """Return whether it blocks the bus."""
        return self._started and 'hold' in self._plan.active(now_ns)

    def removes_bus(self, now_ns: int) -> bool:
        """Return whether the bus is gone with it."""
        return self._started and 'vanish' in self._plan.active(now_ns)

    def time_s(self, now_ns: int) -> float:
        """Return the time since the start; it stands still while the fault stuck is active."""
        return (now_ns - self._start_ns) / NS_PER_S if self._stuck_at is None else self._stuck_at

    def start(self, now_ns: int) -> None:
        """Start: the schedule of the faults counts from now."""
        self._started = True
        self._start_ns = self._now_ns = now_ns
        self._plan.start(now_ns)

    def update(self, now_ns: int) -> frozenset[str]:
        """Bring faults and chip up to date."""
        if not self._started:
            self.start(now_ns)
        self._now_ns = now_ns
        if self.world is not None:
            self.world.advance(now_ns)
        while self._injected:
            self._plan.inject(*self._injected.pop(0), now_ns)
        active = self._plan.active(now_ns)
        if 'stuck' not in active:
            self._stuck_at = None
        elif self._stuck_at is None:
            self._stuck_at = self.time_s(now_ns)
        self.measuring = 'silent' not in active
        powered = 'unplug' not in active
        if powered and not self._powered:
            self.power_on(now_ns)
        self._powered = powered
        if powered:
            self.advance(now_ns)
        return active

    # ---- the simulator -----------------------------------------------------------------------

    @property
    def path(self) -> Path:
        """Return the path that the driver opens."""
        return self._path

    def check_speed(self) -> None:
        """Do nothing: the load of the bus depends on the driver."""

    def pump(self, now_ns: int) -> None:
        """
        Do everything that is due by now; does not block.

        :raises DeviceError: the port cannot be made again after a fault.
        """
        self.update(now_ns)
        if self.port.bus.absent(now_ns):
            self.port.unplug()
        else:
            self.port.plug()
        self.port.serve(now_ns)

    def next_event_ns(self) -> int:
        """Return when ``pump`` has to be called next."""
        events = (self._plan.next_ns(self._now_ns), self.port.next_ns(), self._now_ns + _IDLE_NS)
        return min(e for e in events if e is not None) if self._started else 0

    def close(self) -> None:
        """Unplug the bus; may be called twice."""
        self._started = False
        self.port.unplug()

    def inject(self, fault: str, duration_s: float) -> None:
        """
        Begin a fault with the next ``pump``.

        :raises ConfigError: no such fault, or no such duration.
        """
        check(fault, duration_s, I2C_FAULTS)
        self._injected.append((fault, duration_s))


class RegisterChip(SimulatedChip):
    """
    A chip with a map of registers and an auto-incrementing pointer.

    :cvar PAIRS: several bytes written are pairs of register and value, as with Bosch chips;
        otherwise they go to consecutive registers.
    :cvar FIXED: registers without auto-increment, such as that of a FIFO.
    """

    PAIRS: ClassVar[bool] = False
    FIXED: ClassVar[frozenset[int]] = frozenset()

    def power_on(self, now_ns: int) -> None:
        """Start with the registers of the chip after power-on."""
        self.registers = bytearray(256)
        self._pointer = 0

    def exchange(self, data: bytes, size: int, now_ns: int) -> bytes:
        """Receive register and values, then return registers."""
        if data:
            self._pointer = data[0]
        if self.PAIRS:
            for at in range(0, len(data) - 1, 2):
                self.write(data[at], data[at + 1], now_ns)
        else:
            for value in data[1:]:
                self.write(self._pointer, value, now_ns)
                self._move()
        found = bytearray()
        for _ in range(size):
            found.append(self.read(self._pointer, now_ns))
            self._move()
        return bytes(found)

    def write(self, register: int, value: int, now_ns: int) -> None:
        """Write a register; a chip overrides it for registers with an effect."""
        self.registers[register] = value

    def read(self, register: int, now_ns: int) -> int:
        """Read a register; a chip overrides it for registers with an effect."""
        return self.registers[register]

    def _move(self) -> None:
        if self._pointer not in self.FIXED:
            self._pointer = (self._pointer + 1) & 0xFF
