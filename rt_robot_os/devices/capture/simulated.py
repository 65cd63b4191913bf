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
Simulated cameras and microphones: a socket that starts a real capture process for each driver.

The process is that of a real camera; only its source is simulated: a moving pattern with the
number of the frame in its pixels, or a tone. So faults of processes occur here as well.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
import signal
from typing import Any
from typing import ClassVar
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.devices.capture.host import CaptureHost
from rt_robot_os.devices.capture.spawn import CAPTURE
from rt_robot_os.sim.base import complete
from rt_robot_os.sim.base import NOWHERE
from rt_robot_os.sim.base import RobotSite
from rt_robot_os.sim.base import Simulated
from rt_robot_os.sim.base import Site
from rt_robot_os.sim.faults import FaultPlan
from rt_robot_os.sim.faults import parse_schedule

CAPTURE_FAULTS: Final = {
    'silent': 'its process hangs',
    'crash': 'its process dies, as with a crashing library; repeatedly until the fault ends',
    'unplug': 'the port disappears, and returns under the same path',
}
_ROUND_NS: Final = 50 * NS_PER_MS


class CapturePlug(CaptureHost):
    """The port of a simulated camera."""

    def has_reader(self) -> bool:
        """Return whether a driver can connect."""
        return self.fileno() >= 0

    def plug(self) -> None:
        """
        Make the path.

        :raises DeviceError: it cannot be made.
        """
        self.open()

    def unplug(self) -> None:
        """Remove the path and end the processes."""
        self.close()

    def signal(self, signo: int) -> None:
        """Send all workers a signal."""
        for worker in self.workers:
            worker.send_signal(signo)


class SimulatedCapture(Simulated):
    """
    A camera or a microphone.

    :cvar FAULTS: its possible faults.
    :cvar WORKER: the module of its process.
    :ivar faults: its schedule of faults.
    """

    SETTINGS: ClassVar[tuple[Field, ...]] = (
        Field('faults', list, (), f'schedule of {", ".join(CAPTURE_FAULTS)}, such as '
              '"unplug at 5 for 2" (seconds)'),)
    FAULTS: ClassVar[Mapping[str, str]] = CAPTURE_FAULTS
    WORKER: ClassVar[str] = CAPTURE

    def __init__(self, name: str, settings: Mapping[str, Any], path: Path,
                 site: Site = NOWHERE) -> None:
        """
        Store the settings; nothing is plugged in.

        :param site: its world and mounting.
        :raises ConfigError: a setting is wrong.
        """
        values = complete(self.SETTINGS, settings, name)
        self.name = name
        self.site, self.world = site, site.world
        self.port = CapturePlug(path, worker=self.WORKER)
        self.faults = FaultPlan(parse_schedule(values['faults'], self.FAULTS), self.FAULTS)
        self._started = False
        self._active: frozenset[str] = frozenset()
        self._now_ns = 0

    @classmethod
    def made_for(cls, name: str, settings: Mapping[str, Any], place: RobotSite,
                 device: Mapping[str, Any]) -> SimulatedCapture:
        """
        Make the simulated counterpart of a device; nothing is plugged in yet.

        :raises ConfigError: a setting is wrong.
        """
        return cls(name, settings, place.folder / name, place.site(device))

    @property
    def path(self) -> Path:
        """Return the path that the driver opens."""
        path: Path = self.port.path
        return path

    def check_speed(self) -> None:
        """Do nothing: memory is fast enough."""

    def pump(self, now_ns: int) -> None:
        """
        Start the requested processes, and apply the faults that are due.

        :raises DeviceError: the port cannot be made again after a fault.
        """
        self._now_ns = now_ns
        if not self._started:
            self._started = True
            self.faults.start(now_ns)
        if self.world is not None:
            self.world.advance(now_ns)
        active = self.faults.active(now_ns)
        before, self._active = self._active, active
        if 'unplug' in active:
            self.port.unplug()
            return
        self.port.plug()
        self.port.serve()
        if 'crash' in active:
            self.port.signal(signal.SIGKILL)
        if 'silent' in active:
            self.port.signal(signal.SIGSTOP)
        elif 'silent' in before:
            self.port.signal(signal.SIGCONT)

    def next_event_ns(self) -> int:
        """Return when ``pump`` has to be called next."""
        edge = self.faults.next_ns(self._now_ns)
        return min(self._now_ns + _ROUND_NS, edge or self._now_ns + _ROUND_NS)

    def close(self) -> None:
        """Unplug the device; may be called twice."""
        self.port.signal(signal.SIGCONT)
        self.port.unplug()

    def inject(self, fault: str, duration_s: float) -> None:
        """
        Begin a fault with the next ``pump``.

        :raises ConfigError: no such fault, or no such duration.
        """
        self.faults.inject(fault, duration_s, self._now_ns)
