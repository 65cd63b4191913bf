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
Services of the process that devices ask for by name, such as what starts captures.

A service is started before the core asks for real time, for all devices that name it in their
``SERVICES``. That of another package is added by the entry-point group
``rt_robot_os.device_services``.
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
        Start it, and wait until it can be used.

        :param path: where a socket of its own may be; a leftover may lie there.
        :return: what devices get of it, in their ``services``.
        :raises DeviceError: it cannot be started.
        """

    def check(self) -> str:
        """
        Start it again if it has ended; called by the lowest task, must not wait.

        :return: what to report; empty when nothing has changed.
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
    """The services that the devices of a robot ask for; nothing runs before :meth:`start`."""

    def __init__(self) -> None:
        self._running: list[Service] = []

    def start(self, drivers: Iterable[type[Device]], path: Path) -> dict[str, Any]:
        """
        Start what the drivers ask for, each service once.

        :param path: of the link's socket; those of the services lie beside it.
        :return: what devices get, by the name of the service.
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
        """Start those again that have ended, and return what to report; does not wait."""
        return [text for service in self._running if (text := service.check())]

    def stop(self) -> None:
        """End them, the last one first; may be called twice."""
        while self._running:
            self._running.pop().stop()
