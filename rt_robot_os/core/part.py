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
Parts of the real-time process that core/ does not know: recorders, gateways, maps of others.

A part is a class, and the entry-point group ``rt_robot_os.core_parts`` names it::

    entry_points={'rt_robot_os.core_parts': ['map = my_package.map_part:MapPart']}

    class MapPart(CorePart):
        def __init__(self, host):
            host.requests.add('map_size', lambda session, arguments: {'cells': self.cells})
            host.kernel.add_task('map', self.update, priority=5, rate_hz=1.0)

Every installed part is made in each core, when its devices and modules are there and nothing runs.
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
from rt_robot_os.core.watch import Watch
from rt_robot_os.kernel import Kernel
from rt_robot_os.link.requests import Requests
from rt_robot_os.settings import RobotSettings
from rt_robot_os.topics import Bus


# Tells people something: how severe, of what, the text.
Note = Callable[[Severity, str, str], None]


@dataclass(frozen=True)
class Host:
    """
    What a core offers to a part of it.

    :ivar settings: of the robot, checked; a part that is not wanted there does nothing.
    :ivar kernel: to add tasks to.
    :ivar bus: to declare, publish and subscribe topics.
    :ivar requests: what clients may ask; a part adds its own.
    :ivar statistics: what is told of the core; a part adds its counters.
    :ivar watch: what the lowest task looks after, ten times a second.
    :ivar note: tells people something; safe in the real-time loop.
    """

    settings: RobotSettings
    kernel: Kernel
    bus: Bus
    requests: Requests
    statistics: Statistics
    watch: Watch
    note: Note


class CorePart:
    """A part of the real-time process."""

    def __init__(self, host: Host) -> None:
        """
        Declare what the part has: tasks, topics, requests; nothing is opened here.

        :raises RtRobotError: it does not fit this robot: the core does not start.
        """

    def open(self) -> None:  # noqa: A003
        """Open what it needs, after modules were prepared; nothing runs yet, it may take long."""

    def close(self) -> None:
        """Let go of everything, opened or not, after the kernel has stopped; bounded in time."""


class Parts:
    """
    The parts of a core from beginning to end.

    :param kinds: their classes, which may be anybody's.
    :raises ConfigError: one of them cannot be made.
    :ivar all: those that were made.
    """

    def __init__(self, kinds: Iterable[type[CorePart]], host: Host) -> None:
        self.all: list[CorePart] = []
        for kind in kinds:
            with _named(kind, 'made'):
                self.all.append(kind(host))

    def open(self) -> None:  # noqa: A003
        """
        Open all of them.

        :raises ConfigError: one of them cannot be opened.
        """
        for part in self.all:
            with _named(type(part), 'opened'):
                part.open()

    def close(self, call: Callable[[str, Callable[[], None]], object]) -> None:
        """
        Close all of them, the last one first; may be called twice.

        :param call: calls what closes the part of a name, within bounds of its own.
        """
        while self.all:
            part = self.all.pop()
            call(type(part).__name__, part.close)


@contextmanager
def _named(kind: type[CorePart], done: str) -> Iterator[None]:
    try:
        yield
    except Exception as error:
        # A core that is started again would fare no better.
        what = str(error) if isinstance(error, RtRobotError) else (
            f'{type(error).__name__}: {error}')
        raise ConfigError([f'part of the core {kind.__name__} could not be {done}: {what}']
                          ) from error


CORE_PARTS: Final[PluginRegistry[CorePart]] = PluginRegistry(
    'rt_robot_os.core_parts', CorePart, 'part of the core', {})


def installed_parts() -> tuple[type[CorePart], ...]:
    """
    Return the parts that are installed, by name in order.

    :raises ConfigError: one of them cannot be imported.
    """
    return tuple(CORE_PARTS.load(name) for name in CORE_PARTS.names())
