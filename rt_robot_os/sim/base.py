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

"""The interface of every simulated device, on a pty or on an emulated bus."""

from __future__ import annotations

from abc import ABC
from abc import abstractmethod
from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from typing import ClassVar
from typing import Final
from typing import Protocol
from typing import TYPE_CHECKING
from typing import TypeVar

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field
from rt_robot_os.motion.mounting import in_base
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.motion.mounting import mounting_of

if TYPE_CHECKING:
    from rt_robot_os.sim.world.world import World


class Plug(Protocol):
    """The port of a simulated device: the server waits on it."""

    def fileno(self) -> int:
        """Return a file descriptor that is readable when the driver has sent something."""

    def has_reader(self) -> bool:
        """Return whether that file descriptor can be waited on."""

    def plug(self) -> None:
        """
        Make the path of the port.

        :raises DeviceError: it cannot be made.
        """

    def unplug(self) -> None:
        """Remove the path."""


@dataclass(frozen=True)
class Site:
    """
    The world and the mounting of a simulated device.

    :ivar world: the world that it measures; None without a world.
    :ivar device: the settings of its driver, as far as known.
    :ivar mountings: the mountings of the frames of all devices, by name.
    """

    world: World | None = None
    device: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    mountings: Mapping[str, Mounting] = dataclasses.field(default_factory=dict)

    def mounting(self, index: int = 0) -> Mounting:
        """
        Return the mounting of the device on the robot, through the frames that carry it.

        :param index: index of the frame, for a device with several.
        """
        own = mounting_of(self.device, index)
        if own.parent not in self.mountings:
            return own
        return own.seen_from(in_base(self.mountings, own.parent))


P = TypeVar('P', bound=Plug)

NOWHERE: Final = Site()


class RobotSite:
    """
    What the simulated devices of one robot share: the folder of their ports, and the world.

    :ivar folder: of the paths of the ports.
    :ivar world: the world of all devices; None without a world.
    :ivar mountings: the mountings of the frames of all devices, by name.
    """

    def __init__(self, folder: Path, world: World | None = None,
                 mountings: Mapping[str, Mounting] | None = None) -> None:
        """Store the folder; nothing is opened."""
        self.folder = folder
        self.world = world
        self.mountings = mountings or {}
        self._shared_ports: dict[str, Plug] = {}

    def site(self, device: Mapping[str, Any]) -> Site:
        """
        Return the site of a device.

        :param device: the settings of its driver.
        """
        return Site(self.world, device, self.mountings)

    def shared_port(self, name: str, kind: Callable[[Path], P]) -> P:
        """
        Return a port that several devices of the robot share; made on first use.

        :param name: of its path in the folder.
        :param kind: makes it.
        """
        if name not in self._shared_ports:
            self._shared_ports[name] = kind(self.folder / name)
        return self._shared_ports[name]  # type: ignore[return-value]


class Simulated(ABC):
    """
    One simulated device.

    :cvar SETTINGS: its settings.
    :ivar name: for errors.
    :ivar port: its port.
    """

    SETTINGS: ClassVar[tuple[Field, ...]] = ()
    name: str
    port: Any

    @classmethod
    @abstractmethod
    def made_for(
        cls, name: str, settings: Mapping[str, Any], place: RobotSite, device: Mapping[str, Any],
    ) -> Simulated:
        """
        Make the simulated counterpart of a device; nothing is plugged in yet.

        :param settings: some of ``SETTINGS``; the others have their default.
        :param device: the settings of the driver, as far as known.
        :raises ConfigError: a setting is wrong.
        """

    @property
    @abstractmethod
    def path(self) -> Path:
        """Return the path that the driver opens."""

    @abstractmethod
    def check_speed(self) -> None:
        """
        Check that the line is fast enough for the samples.

        :raises ConfigError: it is not.
        """

    @abstractmethod
    def pump(self, now_ns: int) -> None:
        """
        Do everything that is due by now; does not block.

        :raises DeviceError: the port cannot be made again after a fault.
        """

    @abstractmethod
    def next_event_ns(self) -> int:
        """Return when ``pump`` has to be called next."""

    @abstractmethod
    def close(self) -> None:
        """Unplug the device; may be called twice."""

    @abstractmethod
    def inject(self, fault: str, duration_s: float) -> None:
        """
        Start a fault with the next ``pump``.

        :raises ConfigError: the fault or the duration is invalid.
        """


def complete(fields: Sequence[Field], given: Mapping[str, Any], name: str) -> dict[str, Any]:
    """
    Check settings and fill in defaults.

    :param name: name of the device, for errors.
    :return: a value of the declared type for each field.
    :raises ConfigError: with every problem found.
    """
    known = {field.name: field for field in fields}
    problems = [
        f'{name}: there is no setting {key!r} of a simulated device: use one of '
        f'{", ".join(known)}' for key in given if key not in known
    ]
    values = {}
    for field in fields:
        value = given.get(field.name, field.default)
        wanted = field.problem(value)
        if wanted is None:
            values[field.name] = field.coerce(value)
        else:
            problems.append(f'{name}: {field.name} is {value!r}: it must be {wanted}')
    if problems:
        raise ConfigError(problems)
    return values
