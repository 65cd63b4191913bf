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
Services of the process that devices name, such as the one that starts captures.

A service is started before the core enters real-time mode, for all devices that name it in their
``SERVICES``. Other packages add services by the entry-point group ``rt_robot_os.device_services``.
"""

from __future__ import annotations

from abc import ABC
from abc import abstractmethod
from collections.abc import Iterable
from pathlib import Path
from typing import Any
from typing import Final

from rt_robot_os.base.plugins import PluginRegistry
from rt_robot_os.devices.device import Device


class Service(ABC):
    """One service, most often a child process."""

    @abstractmethod
    def start(self, path: Path) -> Any:
        """
        Start it, and wait until it is ready.

        :param path: for a socket of its own; an old one may exist.
        :return: the value for devices, in their ``services``.
        :raises DeviceError: it cannot be started.
        """

    def check(self) -> str:
        """
        Restart it if it has ended; called by the task of lowest priority, must not wait.

        :return: what to report; empty if nothing has changed.
        """
        return ''

    @abstractmethod
    def stop(self) -> None:
        """End it; may be called twice."""


SERVICES: Final[PluginRegistry[Service]] = PluginRegistry(
    'rt_robot_os.device_services',
    Service,  # type: ignore[type-abstract]
    'service of devices',
    {'captures': 'rt_robot_os.devices.capture.service:CaptureService',
     'journals': 'rt_robot_os.features.alarms.journal_device.service:JournalService'},
)


class RunningServices:
    """The services that the devices of a robot name; none runs before :meth:`start`."""

    def __init__(self) -> None:
        self._running: list[Service] = []

    def start(self, drivers: Iterable[type[Device]], path: Path) -> dict[str, Any]:
        """
        Start the services that the drivers name, each once.

        :param path: of the link's socket; those of the services are in the same folder.
        :return: the values for devices, by the name of the service.
        :raises ConfigError: there is no such service.
        :raises DeviceError: one cannot be started.
        """
        names = dict.fromkeys(name for driver in drivers for name in driver.SERVICES)
        offered = {}
        for name in names:
            service = SERVICES.load(name)()
            self._running.append(service)
            offered[name] = service.start(path.with_suffix(f'.{name}'))
        return offered

    def check(self) -> list[str]:
        """Restart those that have ended, and return what to report; does not wait."""
        return [text for service in self._running if (text := service.check())]

    def stop(self) -> None:
        """End them, the last one first; may be called twice."""
        while self._running:
            self._running.pop().stop()
