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
A simulated device: samples on an absolute time grid, as bytes on a serial line, with faults.

It has no thread and no clock: its owner calls ``pump`` with the time, the server with
CLOCK_MONOTONIC, a test with any time.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
import random
from typing import Any
from typing import ClassVar
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import period_from_rate
from rt_robot_os.sim.base import complete
from rt_robot_os.sim.base import NOWHERE
from rt_robot_os.sim.base import RobotSite
from rt_robot_os.sim.base import Simulated
from rt_robot_os.sim.base import Site
from rt_robot_os.sim.faults import check
from rt_robot_os.sim.faults import corrupted
from rt_robot_os.sim.faults import fault_settings
from rt_robot_os.sim.faults import FAULTS
from rt_robot_os.sim.faults import plan_of
from rt_robot_os.sim.line import at_wrong_speed
from rt_robot_os.sim.line import LineTiming
from rt_robot_os.sim.pty_port import PtyPort

_BITS_PER_BYTE: Final = 10
_MAX_FRAGMENT: Final = 3
# After a longer suspension of the whole process the device continues at the current time.
_MAX_CATCH_UP_NS: Final = NS_PER_S


@dataclass(frozen=True)
class SimulatedStatistics:
    """
    Counters of a simulated device.

    :ivar samples: samples made.
    :ivar skipped_samples: samples skipped because the line or the process was too slow.
    :ivar bytes_sent: bytes that the pty has accepted.
    :ivar bytes_dropped: bytes without a reader, or without room.
    """

    samples: int
    skipped_samples: int
    bytes_sent: int
    bytes_dropped: int


def common_settings(rate_hz: float, maximum_hz: float,
                    known: Mapping[str, str] = FAULTS) -> tuple[Field, ...]:
    """
    Declare the settings that every simulated device has.

    :param rate_hz: default of the rate.
    :param known: the possible faults, its ``KNOWN_FAULTS``.
    """
    return (
        Field('rate_hz', float, rate_hz, 'Samples per second.', unit='Hz', minimum=0.01,
              maximum=maximum_hz),
        *fault_settings(known),
    )


class SimulatedDevice(Simulated):
    """
    One simulated device on a serial line.

    :cvar SETTINGS: its settings.
    :cvar BAUD: the usual speed of the device.
    :cvar KNOWN_FAULTS: its possible faults, and their descriptions.
    :ivar name: for errors.
    :ivar port: its port.
    :ivar start_ns: time of its start.
    :ivar world: the world that it measures, advanced with each ``pump``; None without a world.
    :ivar site: its world and mounting.
    :ivar mounting: its mounting on the robot.
    :ivar device: the settings of its driver, as far as known.
    """

    SETTINGS: ClassVar[tuple[Field, ...]] = ()
    BAUD: ClassVar[int] = 9600
    KNOWN_FAULTS: ClassVar[Mapping[str, str]] = FAULTS
    port: PtyPort

    def __init__(
        self, name: str, settings: Mapping[str, Any], port: PtyPort, baud: int | None = None,
        site: Site = NOWHERE,
    ) -> None:
        """
        Check the settings; nothing is plugged in yet.

        :param settings: some of ``SETTINGS``; the others have their default.
        :param baud: speed of the line; None for the usual one, 0 for no limit.
        :param site: its world and mounting.
        :raises ConfigError: a setting is wrong, or the line is too slow for the rate.
        """
        self.name = name
        self.port = port
        self.site, self.world, self.device = site, site.world, site.device
        self.mounting = site.mounting()
        self.settings = complete(self.SETTINGS, settings, name)
        self._plan = plan_of(name, self.settings['faults'], self.KNOWN_FAULTS)
        self.rate_hz: float = self.settings['rate_hz']
        self.random = random.Random(self.settings['seed'])
        self._line_random = random.Random(self.settings['seed'] + 1)
        self._baud = self.BAUD if baud is None else baud
        self._line = LineTiming(self._baud)
        self._started = False
        self._now_ns = 0
        self.start_ns = 0
        self._grid_ns = 0
        self._index = 0
        self._injected: list[tuple[str, float]] = []
        self._last_sample: bytes | None = None
        self._samples = 0
        self._skipped = 0
        self.prepare()

    @classmethod
    def made_for(
        cls, name: str, settings: Mapping[str, Any], place: RobotSite, device: Mapping[str, Any],
    ) -> SimulatedDevice:
        """
        Make the simulated counterpart of a device; nothing is plugged in yet.

        :raises ConfigError: a setting is wrong, or the line is too slow for the rate.
        """
        return cls(name, settings, PtyPort(place.folder / name), device.get('baud'),
                   place.site(device))

    @property
    def path(self) -> Path:
        """Return the path that the driver opens."""
        return self.port.link

    def prepare(self) -> None:
        """
        Prepare for samples; called once, after the settings have been checked.

        :raises ConfigError: a setting is wrong.
        """

    @abstractmethod
    def sample(self, time_s: float) -> bytes:
        """
        Return the bytes of one sample.

        :param time_s: since the start.
        """

    def foreign(self) -> bytes:
        """Return the bytes of another device; the default is a satellite receiver."""
        return b'$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n'

    def handle_command(self, data: bytes) -> None:
        """Handle bytes of the driver; the default ignores them."""

    def reply(self, data: bytes) -> bool:
        """
        Answer the driver, from within :meth:`handle_command`, after what is on the line already.

        :return: False if the line has no room; then nothing is sent.
        """
        return self._line.push(data, self._now_ns)

    def start(self, now_ns: int) -> None:
        """
        Plug the device in; the grid of its samples starts now.

        :raises DeviceError: the port cannot be made.
        """
        self.port.plug()
        self._started = True
        self._now_ns = self.start_ns = self._grid_ns = now_ns
        self._index = 0
        self._plan.start(now_ns)
        self.check_speed()

    def close(self) -> None:
        """Unplug the device; may be called twice."""
        self._started = False
        self.port.unplug()

    def pump(self, now_ns: int) -> None:
        """
        Do everything that is due by now; does not block.

        :raises DeviceError: the port cannot be made again after a fault.
        """
        if not self._started:
            self.start(now_ns)
        self._now_ns = now_ns
        if self.world is not None:
            self.world.advance(now_ns)
        while self._injected:
            self._plan.inject(*self._injected.pop(0), now_ns)
        active = self._plan.active(now_ns)
        if 'unplug' in active:
            self.port.unplug()
        else:
            self.port.plug()
        commands = self.port.read()
        # Another device in its place does not understand the commands.
        if commands and 'wrong' not in active:
            self.handle_command(commands)
        self._make_samples(now_ns)
        data = self._line.take(now_ns)
        if data and 'silent' not in active:
            self._send(data, active)

    def next_event_ns(self) -> int:
        """Return when ``pump`` has to be called next."""
        if not self._started:
            return 0
        short = 'short' in self._plan.active(self._now_ns)
        events = (self._due_ns(), self._plan.next_ns(self._now_ns),
                  self._line.next_ns(_MAX_FRAGMENT if short else None))
        return min(e for e in events if e is not None)

    def inject(self, fault: str, duration_s: float) -> None:
        """
        Start a fault with the next ``pump``.

        :raises ConfigError: the fault or the duration is invalid.
        """
        check(fault, duration_s, self.KNOWN_FAULTS)
        self._injected.append((fault, duration_s))

    def has_fault(self, fault: str) -> bool:
        """Return whether a fault is active at the time of the last ``pump``."""
        return fault in self._plan.active(self._now_ns)

    def set_rate(self, rate_hz: float) -> None:
        """Change the rate; the grid restarts at the time of the last ``pump``."""
        self.rate_hz = rate_hz
        self._grid_ns = self._now_ns
        self._index = 1

    def check_speed(self) -> None:
        """
        Check that the line is fast enough for the samples.

        :raises ConfigError: it is not.
        """
        state = self.random.getstate()
        needed = len(self.sample(0.0)) * _BITS_PER_BYTE * self.rate_hz
        self.random.setstate(state)
        if 0 < self._baud < needed:
            raise ConfigError([
                f'{self.name}: rate_hz {self.rate_hz:g} needs {needed:.0f} baud and the line has '
                f'{self._baud}: lower rate_hz or raise baud'])

    def statistics(self) -> SimulatedStatistics:
        """Return the current counters."""
        return SimulatedStatistics(
            self._samples, self._skipped, self.port.bytes_sent, self.port.bytes_dropped)

    def _due_ns(self) -> int:
        return self._grid_ns + self._index * period_from_rate(self.rate_hz)

    def _make_samples(self, now_ns: int) -> None:
        late = (now_ns - self._due_ns() - _MAX_CATCH_UP_NS) // period_from_rate(self.rate_hz)
        if late > 0:
            self._skipped += late
            self._index += late
        while (due_ns := self._due_ns()) <= now_ns:
            active = self._plan.active(due_ns)
            if 'wrong' in active:
                content = self.foreign()
            elif 'stuck' in active and self._last_sample is not None:
                content = self._last_sample
            else:
                content = self._last_sample = self.sample((due_ns - self.start_ns) / NS_PER_S)
            if self._line.push(content, due_ns):
                self._samples += 1
            else:
                self._skipped += 1
            self._index += 1

    def _send(self, data: bytes, active: frozenset[str]) -> None:
        chance = self._line_random
        if 'baud' in active:
            data = at_wrong_speed(data)
        if 'garbage' in active:
            data = chance.randbytes(len(data))
        if 'corrupt' in active:
            data = corrupted(data, self.settings['corrupt_probability'], chance)
        if 'short' not in active:
            self.port.write(data)
            return
        at = 0
        while at < len(data):
            size = chance.randint(1, _MAX_FRAGMENT)
            self.port.write(data[at:at + size])
            at += size
