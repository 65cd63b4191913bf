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

"""A driver and its simulated device on a real pty, with time controlled by the test."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.devices.device import Device
from rt_robot_os.sim.base import Site
from rt_robot_os.sim.device import SimulatedDevice
from rt_robot_os.sim.pty_port import PtyPort
from rt_robot_os.sim.world.world import World
from rt_robot_os.testing.fakes import bind
from rt_robot_os.testing.fakes import settings_of
from rt_robot_os.testing.fakes import wait_readable

START_NS = 50_000_000_000


class Rig:
    """
    A simulated device and the driver that reads it.

    :ivar publishers: one for each publication; :class:`rt_robot_os.testing.RecordingPublisher`
        unless the test passes others.
    :ivar now_ns: the time.
    """

    def __init__(self, simulated: SimulatedDevice, device: Device,
                 publishers: Callable[[Device], list[Any]] = bind) -> None:
        self.simulated = simulated
        self.device = device
        self.publishers = publishers(device)
        self.now_ns = START_NS
        self._missed = 0
        device.clock_ns = lambda: self.now_ns
        simulated.pump(self.now_ns)
        device.open()

    def sync(self) -> int:
        """Let the driver read all bytes of the simulated device."""
        samples = 0
        port = self.simulated.port
        while self.device.statistics().bytes_read + self._missed < port.bytes_sent:
            wait_readable(self.device)
            samples += self.device.read(self.now_ns)
        return samples

    def run(self, duration_ms: float, step_ms: float = 1.0,
            each: Callable[[int], None] | None = None) -> int:
        """
        Let time pass.

        :param each: called after each step with the time.
        :return: number of samples published.
        """
        samples = 0
        for _ in range(round(duration_ms / step_ms)):
            self.now_ns += round(step_ms * NS_PER_MS)
            self.simulated.pump(self.now_ns)
            samples += self.sync()
            if each is not None:
                each(self.now_ns)
        return samples

    def reopen(self) -> None:
        """Reopen the port, as the SensorManager does."""
        self.device.close()
        self.device.open()
        self._missed = self.simulated.port.bytes_sent - self.device.statistics().bytes_read


@contextmanager
def rig(
    folder: Path, simulated: type[SimulatedDevice], driver: type[Device], *,
    sim: Mapping[str, Any] | None = None, baud: int | None = None,
    publishers: Callable[[Device], list[Any]] = bind, world: World | None = None, **settings: Any,
) -> Iterator[Rig]:
    """
    Connect a simulated device with its driver.

    :param folder: for the pty's path, such as pytest's ``tmp_path``.
    :param sim: settings of the simulated device.
    :param baud: speed of the line; None for the usual one.
    :param world: the world that the simulated device measures.
    :param settings: of the driver, other than the defaults.
    """
    port = PtyPort(folder / 'device')
    given = settings_of(
        driver, **{'port': str(port.link), 'baud': baud or simulated.BAUD, **settings})
    device = simulated('sim', sim or {}, port, baud, Site(world, given))
    driven = driver('dut', given)
    made = Rig(device, driven, publishers)
    try:
        yield made
    finally:
        driven.close()
        device.close()
