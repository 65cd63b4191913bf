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

"""Chips on an emulated I2C bus, their drivers and the SensorManager on the virtual clock."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rt_robot_os.base.reports import Reports
from rt_robot_os.base.reports import Severity
from rt_robot_os.base.schema import REQUIRED
from rt_robot_os.devices.i2c.bus import I2cBuses
from rt_robot_os.devices.i2c.simulated_bus import LocalTransport
from rt_robot_os.devices.i2c.simulated_port import I2cPort
from rt_robot_os.devices.managed import ManagedDevice
from rt_robot_os.devices.manager import SensorManager
from rt_robot_os.devices.registry import DRIVERS
from rt_robot_os.devices.simulators import SIMULATORS
from rt_robot_os.devices.state import RecoverySettings
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.sim.base import RobotSite
from rt_robot_os.topics import Bus

MS = 1_000_000
S = 1_000_000_000


class I2cRobot:
    """A robot whose devices are chips on one emulated bus; transfers take virtual time."""

    def __init__(self) -> None:
        self.clock = VirtualClock(start_ns=S)
        self.kernel = Kernel(self.clock)
        self.bus = Bus(self.kernel)
        self.reports = Reports()
        self.manager = SensorManager(self.kernel, self.bus, self.reports)
        self.place = RobotSite(Path('/nowhere'))
        self.buses = I2cBuses(lambda path: LocalTransport(
            self.place.shared_port('i2c-sim', I2cPort).bus, self.kernel.now_ns, self.clock.spend))
        self.chips: dict[str, Any] = {}
        self.devices: dict[str, ManagedDevice] = {}
        self.readers: dict[str, Any] = {}

    def add(self, name: str, kind: str, rate_hz: float = 200.0, *,
            sim: dict[str, Any] | None = None, **settings: Any) -> ManagedDevice:
        """Add a device and put its simulated device on the bus."""
        driver: Any = DRIVERS.load(kind)
        values = {f.name: f.default for f in driver.SETTINGS}
        values.update({f.name: f'{name}/{f.name}' for f in driver.SETTINGS
                       if f.name == 'topic' or f.name.endswith('_topic')})
        values.update({'port': 'i2c-sim', **settings})
        assert REQUIRED not in values.values()
        chip: Any = SIMULATORS.load(kind).made_for(name, sim or {}, self.place, values)
        chip.start(self.kernel.now_ns())
        self.chips[name] = chip
        device: Any = driver(name, values)
        device.buses = self.buses
        self.devices[name] = self.manager.add(
            device, rate_hz=rate_hz, priority=50, recovery=RecoverySettings(
                timeout_ns=S, retry_ns=S // 10, retry_maximum_ns=S // 5))
        for publication in device.publications():
            self.readers[publication.topic] = self.bus.subscribe(publication.topic, 'test')
        return self.devices[name]

    def run(self, seconds: float) -> None:
        self.kernel.run(round(seconds * S))

    def inject(self, name: str, fault: str, seconds: float) -> None:
        """Begin a fault now."""
        self.chips[name].inject(fault, seconds)
        self.chips[name].update(self.kernel.now_ns())

    def take(self, topic: str) -> int:
        """Give the number of samples that came since the last call; the ring keeps 16."""
        reader = self.readers[topic]
        lost, count = reader.lost, 0
        while reader.take():
            count += 1
        return int(count + reader.lost - lost)

    def samples(self, name: str, seconds: float) -> int:
        """Run, and give the number of samples of a device."""
        before = self.devices[name].device.statistics().frames
        self.run(seconds)
        return self.devices[name].device.statistics().frames - before

    def errors(self, name: str) -> list[str]:
        return [r.text for r in self.reports.since(0)[2]
                if r.severity is Severity.ERROR and r.source == name]
