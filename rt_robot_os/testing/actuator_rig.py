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


"""An actuator under the SensorManager, its simulated device on a real pty, the virtual clock."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
import os
from pathlib import Path
import select
import time
from typing import Any

from rt_robot_os.base.reports import Reports
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.actuator import Actuator
from rt_robot_os.devices.manager import SensorManager
from rt_robot_os.devices.serial.port import open_port
from rt_robot_os.devices.serial.port import Port
from rt_robot_os.devices.state import RecoverySettings
from rt_robot_os.kernel import FailurePolicy
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.linux.terminal import unread_bytes
from rt_robot_os.sim.base import Site
from rt_robot_os.sim.device import SimulatedDevice
from rt_robot_os.sim.pty_port import PtyPort
from rt_robot_os.testing.fakes import settings_of
from rt_robot_os.topics import Bus

POLL_HZ = 50.0
_LINE_HZ = 1000.0
_WAIT_S = 5.0
_FULL = 4095  # a terminal buffers no more for its reader; the rest follows when it reads


class _Wire:
    """Counts the bytes in both directions, because a pty delivers them with a delay."""

    def __init__(self, link: Path) -> None:
        self.plug = _CountingPty(link)
        self.written = 0
        self._port: Port | None = None
        self._sent_before = 0

    def open(self, path: str, baud: int) -> Port:  # noqa: A003
        self.written = self.plug.received = 0
        self._port = open_port(path, baud)
        self._sent_before = self.plug.bytes_sent
        return _CountingPort(self._port, self)

    def driver_has_all(self) -> bool:
        """Return whether the driver can read, or has read, all bytes sent to it."""
        port = self._port
        if port is None or not self.plug.plugged:
            return True
        try:
            unread = unread_bytes(port.fileno())
        except OSError:  # closed, or the earlier port is gone
            return True
        sent = self.plug.bytes_sent - self._sent_before
        return unread >= _FULL or port.bytes_read + unread >= sent


class _CountingPty(PtyPort):
    received = 0

    def read(self) -> bytes:
        data = super().read()
        self.received += len(data)
        return data


class _CountingPort:
    def __init__(self, port: Port, wire: _Wire) -> None:
        self._port = port
        self._wire = wire

        self.bytes_read = self.dropped_write_bytes = 0

    def fileno(self) -> int:
        return self._port.fileno()

    def read(self) -> bytes:
        data = self._port.read()
        self.bytes_read = self._port.bytes_read
        return data

    def write(self, data: bytes) -> None:
        self._port.write(data)
        dropped, self.dropped_write_bytes = (
            self.dropped_write_bytes, self._port.dropped_write_bytes)
        self._wire.written += len(data) - self.dropped_write_bytes + dropped

    def close(self) -> None:
        self._port.close()


class ActuatorRig:
    """
    A robot of one actuator, polled at 50 Hz and opened immediately.

    :param folder: for the pty's path, such as pytest's ``tmp_path``.
    :param fill: fills in a command, given a message and a speed in the driver's own unit.
    :param settings: of the driver, other than the defaults.
    :ivar simulated: the simulated device.
    :ivar kernel: on the virtual clock.
    :ivar managed: the device under the manager.
    :ivar each: called each millisecond, after the device was pumped.
    """

    def __init__(self, folder: Path, driver: type[Actuator], simulated: type[SimulatedDevice],
                 fill: Callable[[Any, float], None], sim: Mapping[str, Any],
                 **settings: Any) -> None:
        self._wire = _Wire(folder / 'device')
        values = settings_of(driver, **{
            'port': str(self._wire.plug.link), 'baud': simulated.BAUD, **settings})
        self.simulated = simulated('simulated', sim, self._wire.plug, site=Site(device=values))
        self.device = driver('dut', values)
        made: Any = self.device
        made.make_port = self._wire.open
        self.kernel = Kernel(VirtualClock(start_ns=100 * NS_PER_S))
        self.bus = Bus(self.kernel)
        self.reports = Reports()
        self.manager = SensorManager(self.kernel, self.bus, self.reports)
        self.device.log.connect(self.reports, self.kernel.now_ns)
        self.managed = self.manager.add(
            self.device, rate_hz=POLL_HZ, priority=50, recovery=RecoverySettings(
                timeout_ns=NS_PER_S, retry_ns=NS_PER_S // 20, retry_maximum_ns=NS_PER_S // 10))
        topic = self.device.topic_of('command')
        self.bus.declare(topic, type(self.device).command.message)
        self.manager.connect()
        self._commands = self.bus.publisher(topic)
        self._fill = fill
        self.each: Callable[[], object] | None = None
        self._hold: FailurePolicy | None = None
        self._steer: tuple[float, int, int] | None = None
        self.kernel.add_task('line', self.pump, priority=1, rate_hz=_LINE_HZ)
        self.kernel.add_task('steer', self._command, priority=40, rate_hz=POLL_HZ,
                             phase_ns=NS_PER_MS)
        self.simulated.pump(self.kernel.now_ns())

    def pump(self) -> None:
        """Let the device read all bytes sent to it, and send what is due."""
        now_ns, wire = self.kernel.now_ns(), self._wire
        self.simulated.pump(now_ns)
        end_s = time.monotonic() + _WAIT_S
        while wire.plug.plugged and wire.plug.received < wire.written:
            assert time.monotonic() < end_s, 'bytes of the driver did not arrive'
            select.select([wire.plug.fileno()], [], [], _WAIT_S)
            self.simulated.pump(now_ns)
        while not wire.driver_has_all():  # no virtual time passes while Linux delivers them
            assert time.monotonic() < end_s, 'bytes of the device did not arrive'
            os.sched_yield()
        if self.each is not None:
            self.each()

    def publish(self, speed: float, stamp_ns: int = 0) -> None:
        """Publish one command."""
        self._fill(self._commands.msg, speed)
        self._commands.publish(stamp_ns)

    def steer(self, speed: float | None, offset_ns: int = 0, only: int = -1) -> None:
        """
        Publish a command every 20 ms from now on; None: no more.

        :param offset_ns: of its stamp from now.
        :param only: number of commands; -1 for no limit.
        """
        self._steer = None if speed is None else (speed, offset_ns, only)

    def run(self, milliseconds: int) -> None:
        """
        Let time pass.

        :raises AssertionError: a job failed; the message says where.
        """
        self.kernel.run(milliseconds * NS_PER_MS)
        assert not self.kernel.failures, str(self.kernel.failures[-1])

    def counters(self) -> dict[str, Any]:
        """Return the counters of ``/diagnostics``."""
        return self.managed.statistics().device.more

    def unplug(self) -> None:
        """Unplug it; the device continues to move."""
        self._wire.plug.unplug()

    def close(self) -> None:
        """Close the device as the core does, pump the simulated device, and unplug it."""
        self.manager.close()
        self.pump()
        self.simulated.close()

    def hold(self, policy: FailurePolicy) -> None:
        """Apply a failure policy to the polling task at the next 20 ms, as the watchdog would."""
        self._hold = policy

    def _command(self) -> None:
        if self._hold is not None and self.managed.task is not None:
            self.kernel.hold(self.managed.task, self._hold, 'a test')
            self._hold = None
        if self._steer is not None and self._steer[2] != 0:
            speed, offset_ns, left = self._steer
            self._steer = speed, offset_ns, left - 1
            self.publish(speed, self.kernel.now_ns() + offset_ns if offset_ns else 0)
