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
Simulated devices, their drivers and the SensorManager on the virtual clock, without ptys.

The bytes are those of the simulated device and the driver; only the line between them is memory,
so that a run is the same each time and takes no longer than it must.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import pytest

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.reports import Reports
from rt_robot_os.base.reports import Severity
from rt_robot_os.base.schema import REQUIRED
from rt_robot_os.devices.managed import ManagedDevice
from rt_robot_os.devices.manager import SensorManager
from rt_robot_os.devices.registry import DRIVERS
from rt_robot_os.devices.serial import device as serial_device
from rt_robot_os.devices.simulators import SIMULATORS
from rt_robot_os.devices.state import RecoverySettings
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.sim.device import SimulatedDevice
from rt_robot_os.topics import Bus

MS = 1_000_000
S = 1_000_000_000
_CAPACITY = 65536
# Settings without a default, but the port.
GIVEN = {'wheel_radius_m': 0.05, 'wheel_separation_m': 0.3, 'ticks_per_revolution': 1440.0}


def _nothing(message: Any, stamp_ns: int) -> None:
    pass


class MemoryPort:
    """The plug end, as ``PtyPort``."""

    def __init__(self, link: str) -> None:
        self.link = link
        self.plugged = False
        self.plugs = 0
        self.bytes_sent = self.bytes_dropped = 0
        self.to_driver = bytearray()
        self.to_device = bytearray()
        self.reader: MemorySerial | None = None

    def plug(self) -> None:
        if not self.plugged:
            self.plugged = True
            self.plugs += 1
            self.to_driver.clear()
            self.to_device.clear()

    def unplug(self) -> None:
        self.plugged = False
        self.reader = None

    def has_reader(self) -> bool:
        return self.reader is not None

    def write(self, data: bytes) -> None:
        if self.reader is None or len(self.to_driver) + len(data) > _CAPACITY:
            self.bytes_dropped += len(data)
        else:
            self.to_driver += data
            self.bytes_sent += len(data)

    def read(self) -> bytes:
        data = bytes(self.to_device)
        self.to_device.clear()
        return data


class MemorySerial:
    """The driver's end, as ``SerialPort``; the bench makes a class of its own of it."""

    ports: dict[str, MemoryPort]

    def __init__(self, path: str, baud: int | None) -> None:
        port = self.ports.get(path)
        if port is None or not port.plugged:
            raise DeviceError(f'port {path} does not exist: check the cable and the path')
        self._port = port
        self._plugs = port.plugs
        self.bytes_read = self.dropped_write_bytes = 0
        port.to_driver.clear()
        port.reader = self

    def _there(self) -> MemoryPort:
        if not self._port.plugged or self._port.plugs != self._plugs:
            raise DeviceError(f'port {self._port.link} is gone: check the cable')
        return self._port

    def fileno(self) -> int:
        return -1

    def read(self) -> bytes:
        port = self._there()
        data = bytes(port.to_driver)
        port.to_driver.clear()
        self.bytes_read += len(data)
        return data

    def write(self, data: bytes) -> None:
        self._there().to_device.extend(data)

    def close(self) -> None:
        if self._port.reader is self:
            self._port.reader = None


class SerialBench:
    """A robot whose devices are all simulated."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.ports: dict[str, MemoryPort] = {}
        monkeypatch.setattr(serial_device.SerialDevice, 'make_port',
                            type('Line', (MemorySerial,), {'ports': self.ports}))
        self.kernel = Kernel(VirtualClock(start_ns=S))
        self.bus = Bus(self.kernel)
        self.reports = Reports()
        self.manager = SensorManager(self.kernel, self.bus, self.reports)
        self.simulated: dict[str, SimulatedDevice] = {}
        self.devices: dict[str, ManagedDevice] = {}
        self.readers: dict[str, Any] = {}
        self.counts: Counter[str] = Counter()
        self.watch: dict[str, Callable[[Any, int], object]] = {}
        self.kernel.add_task('collect', self._collect, priority=2, rate_hz=200.0)

    def add(self, name: str, kind: str, settings: dict[str, Any], sim: dict[str, Any], *,
            rate_hz: float = 200.0, timeout_s: float = 1.0) -> ManagedDevice:
        """Add a device and plug in its simulated device."""
        driver, simulator = DRIVERS.load(kind), SIMULATORS.load(kind)
        fields = driver.fields()
        values = {f.name: f.default for f in fields} | {
            f.name: GIVEN[f.name] for f in fields if f.default is REQUIRED and f.name in GIVEN}
        topics = {f.name: f'{name}/{f.default}' for f in fields
                  if f.name == 'topic' or f.name.endswith('_topic') and f.default}
        values.update({**topics, 'port': name, 'baud': simulator.BAUD, **settings})
        assert REQUIRED not in values.values()
        port: Any = MemoryPort(name)
        self.ports[name] = port
        port.plug()
        self.simulated[name] = simulator(name, sim, port, values['baud'])
        device = driver(name, values)
        self.devices[name] = self.manager.add(
            device, rate_hz=rate_hz, priority=50, recovery=RecoverySettings(
                timeout_ns=round(timeout_s * S), retry_ns=S // 10, retry_maximum_ns=S // 5))
        for read in device.reads():
            self.bus.declare(read.topic, read.message)
        self.devices[name].connect(self.bus)
        for publication in device.publications():
            self.readers[publication.topic] = self.bus.subscribe(publication.topic, 'test')
        self.kernel.add_task(f'{name}/line', lambda: self.simulated[name].pump(
            self.kernel.now_ns()), priority=1, rate_hz=1000.0)
        return self.devices[name]

    def run(self, seconds: float) -> None:
        self.kernel.run(round(seconds * S))

    def take(self, topic: str) -> int:
        """Give the number of samples of a topic since it was asked for last."""
        count, self.counts[topic] = self.counts[topic], 0
        return count

    def _collect(self) -> None:
        for topic, reader in self.readers.items():
            while reader.take():
                self.counts[topic] += 1
                self.watch.get(topic, _nothing)(reader.msg, reader.stamp_ns)

    def errors(self, name: str) -> list[str]:
        return [r.text for r in self.reports.since(0)[2]
                if r.severity is Severity.ERROR and r.source == name]
