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
Plug-ins of the real-time process, such as recorders, gateways or maps of other packages.

A part is a class that is named by the entry-point group ``rt_robot_os.core_parts``::

    entry_points={'rt_robot_os.core_parts': ['map = my_package.map_part:MapPart']}

    class MapPart(CorePart):
        def __init__(self, host):
            host.requests.add('map_size', lambda session, arguments: {'cells': self.cells})
            host.kernel.add_task('map', self.update, priority=5, rate_hz=1.0)

Every core creates every installed part, after its devices and modules and before it runs.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.base.plugins import PluginRegistry
from rt_robot_os.base.reports import Severity
from rt_robot_os.core.statistics import Statistics
from rt_robot_os.core.watch import WatchTask
from rt_robot_os.kernel import Kernel
from rt_robot_os.link.requests import Requests
from rt_robot_os.settings import RobotSettings
from rt_robot_os.topics import Bus


# Logs a report: severity, source, text.
Note = Callable[[Severity, str, str], None]


@dataclass(frozen=True)
class Host:
    """
    The interface of a core for its parts.

    :ivar settings: of the robot, checked; a part that is not enabled there does nothing.
    :ivar kernel: to add tasks.
    :ivar bus: to declare, publish and subscribe topics.
    :ivar requests: the table of requests of clients; a part adds its own.
    :ivar statistics: of the core; a part adds its counters.
    :ivar watch: the lowest task, which calls functions ten times a second.
    :ivar note: logs a report; safe in the real-time loop.
    """

    settings: RobotSettings
    kernel: Kernel
    bus: Bus
    requests: Requests
    statistics: Statistics
    watch: WatchTask
    note: Note


class CorePart:
    """A part of the real-time process."""

    def __init__(self, host: Host) -> None:
        """
        Declare tasks, topics and requests; nothing is opened here.

        :raises RtRobotError: the part does not fit this robot: the core does not start.
        """

    def open(self) -> None:  # noqa: A003
        """Open resources, after modules were prepared; nothing runs yet, so it may take long."""

    def close(self) -> None:
        """Release everything, opened or not, after the kernel has stopped; bounded in time."""


class Parts:
    """
    The life cycle of the parts of a core.

    :param kinds: their classes, which may come from other packages.
    :raises ConfigError: a part cannot be created.
    :ivar all: the parts that were created.
    """

    def __init__(self, kinds: Iterable[type[CorePart]], host: Host) -> None:
        self.all: list[CorePart] = []
        for kind in kinds:
            with _named(kind, 'created'):
                self.all.append(kind(host))

    def open(self) -> None:  # noqa: A003
        """
        Open all parts.

        :raises ConfigError: a part cannot be opened.
        """
        for part in self.all:
            with _named(type(part), 'opened'):
                part.open()

    def close(self, call: Callable[[str, Callable[[], None]], object]) -> None:
        """
        Close all parts in reverse order; may be called twice.

        :param call: calls the function that closes the part of a name, with a time limit.
        """
        while self.all:
            part = self.all.pop()
            call(type(part).__name__, part.close)


@contextmanager
def _named(kind: type[CorePart], done: str) -> Iterator[None]:
    try:
        yield
    except Exception as error:
        # A configuration error, because a restart of the core would fail as well.
        what = str(error) if isinstance(error, RtRobotError) else (
            f'{type(error).__name__}: {error}')
        raise ConfigError([f'part of the core {kind.__name__} could not be {done}: {what}']
                          ) from error


CORE_PARTS: Final[PluginRegistry[CorePart]] = PluginRegistry(
    'rt_robot_os.core_parts', CorePart, 'part of the core', {})


def installed_parts() -> tuple[type[CorePart], ...]:
    """
    Return the installed parts, sorted by name.

    :raises ConfigError: a part cannot be imported.
    """
    return tuple(CORE_PARTS.load(name) for name in CORE_PARTS.names())
