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
The SensorManager: opens every device in its list, polls each by its own priority, and recovers.

A device is polled by its own task: first its ``write``, then its ``read``, which publishes. It may
also be read on interrupt: a second task of the same priority (so the two never preempt each other)
reads when bytes arrive. ``write`` stays on the periodic grid of the first task, which reads too,
so a missing interrupt only delays the sample. The second task also serves publications on inputs
that wake the device, and its deadlines: it brings a device that moves something to rest even when
the first task is held. Everything that may take long (opening and closing a port) runs in one task
of low priority that all others preempt, so a failed device never delays another.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from types import MappingProxyType
from typing import Any

from rt_robot_os.base.reports import Reports
from rt_robot_os.devices.device import Device
from rt_robot_os.devices.managed import ManagedDevice
from rt_robot_os.devices.state import of_arrival
from rt_robot_os.devices.state import RecoverySettings
from rt_robot_os.devices.state import SensorStatistics
from rt_robot_os.kernel import Kernel
from rt_robot_os.topics import Bus
from rt_robot_os.topics import MAX_SUBSCRIBERS

RECOVERY_RATE_HZ = 20.0


class SensorManager:
    """
    All devices of a robot; add them, then run the kernel.

    :param recovery_priority: of the task that opens and closes ports; below all important tasks.
    :param services: the services for devices that name them, by name.
    """

    def __init__(self, kernel: Kernel, bus: Bus, reports: Reports,
                 recovery_priority: int = 3,
                 services: Mapping[str, Any] = MappingProxyType({})) -> None:
        self._kernel = kernel
        self._bus = bus
        self._reports = reports
        self._services = services
        self._devices: dict[str, ManagedDevice] = {}
        kernel.add_task('sensors/recovery', self._recover, priority=recovery_priority,
                        rate_hz=RECOVERY_RATE_HZ)

    def add(self, device: Device, *, rate_hz: float, priority: int,
            recovery: RecoverySettings = RecoverySettings(),
            interrupt: bool = False,
            declared: Mapping[str, Any] = MappingProxyType({}),
            max_subscribers: int = MAX_SUBSCRIBERS) -> ManagedDevice:
        """
        Declare the topics of a device and the task that polls it; nothing is opened yet.

        :param rate_hz: how often it is polled.
        :param priority: of its polling task, and of the one that reads on interrupt.
        :param interrupt: also read it when bytes arrive.
        :param declared: further declarations of its task, see ``Kernel.add_task``.
        :param max_subscribers: limit of the subscriptions of each of its topics.
        :raises TaskError: a task of its name exists.
        :raises TopicError: one of its topics is already declared with another type.
        """
        publications = device.publications()
        for spec in publications:
            self._bus.add(spec, max_subscribers)
        managed = ManagedDevice(device, self._kernel, recovery, self._reports)
        device.services = {name: self._services[name] for name in device.SERVICES
                           if name in self._services}
        device.resources = {each.name: each for each in declared.get('resources', ())}
        on_safe_state = managed.safe_state if device.has_safe_state() else None
        managed.task = self._kernel.add_task(
            device.name, managed.poll, priority=priority, rate_hz=rate_hz,
            on_restart=managed.restart, on_safe_state=on_safe_state, **declared)
        device.clock_ns = self._kernel.now_ns
        device.bind([self._bus.publisher(p.topic, managed.task) for p in publications])
        if interrupt or device.is_released:
            managed.add_arrival(self._kernel.add_task(
                f'{device.name}/arrival', managed.serve_arrival, priority=priority,
                on_restart=managed.restart,
                on_safe_state=on_safe_state if managed.guards else None,
                **of_arrival(declared, managed.guards)), interrupt)
        self._devices[device.name] = managed
        return managed

    def connect(self) -> None:
        """
        Connect the inputs of all devices, once every topic of the robot is declared.

        :raises TopicError: the topic of an input is not declared, or has another type.
        """
        for managed in self._devices.values():
            managed.connect(self._bus)

    @property
    def devices(self) -> Sequence[ManagedDevice]:
        """All devices in the order in which they were added."""
        return tuple(self._devices.values())

    def close(self, call: Callable[[str, Callable[[], None]], object] | None = None) -> None:
        """
        Close every device; may be called twice.

        :param call: calls the function that closes the named device, with a time limit.
        """
        for name, managed in self._devices.items():
            if call is None:
                managed.close()
            else:
                call(name, managed.close)

    def rest(self, call: Callable[[str, Callable[[], None]], object]) -> None:
        """
        Bring all devices that move something to rest, with ports open; no task may run any more.

        :param call: as for :meth:`close`.
        """
        for name, managed in self._devices.items():
            if managed.guards:
                call(name, managed.rest)

    def statistics(self) -> tuple[SensorStatistics, ...]:
        """Return the statistics of all devices."""
        return tuple(managed.statistics() for managed in self._devices.values())

    def _recover(self) -> None:
        for managed in self._devices.values():
            managed.recover()
