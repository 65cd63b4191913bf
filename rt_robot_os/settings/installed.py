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


"""The catalogue of the installation: the registries of drivers, modules and simulators."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Hashable
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field
import functools
from pathlib import Path
from typing import Any
from typing import TYPE_CHECKING

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import PartTopics
from rt_robot_os.settings.catalogue import Catalogue
from rt_robot_os.settings.catalogue import PartKind
from rt_robot_os.settings.problems import did_you_mean

if TYPE_CHECKING:
    from rt_robot_os.base.plugins import PluginRegistry
    from rt_robot_os.topics.ports import PortOwner


@dataclass(frozen=True)
class _Registry:
    """
    A registry with the interface of :class:`rt_robot_os.settings.catalogue.Lookup`.

    :ivar noun: what it contains.
    :ivar registry: imports the registry.
    :ivar described: makes a kind from a name.
    :ivar open_ended: names with a colon are imported without being registered.
    :ivar found: a cache, because a search in all installed packages takes long.
    """

    noun: str
    registry: Callable[[], PluginRegistry[Any]]
    described: Callable[[str], PartKind]
    open_ended: bool = False
    found: dict[str, PartKind] = field(default_factory=dict)

    def names(self) -> Sequence[str]:
        return self.registry().names()

    def find(self, name: str) -> PartKind:
        if name in self.found:
            return self.found[name]
        if name not in self.registry() and not (self.open_ended and ':' in name):
            raise ConfigError([f'no such {self.noun}, {did_you_mean(name, self.names())}'])
        try:
            kind = self.found[name] = self.described(name)
            return kind
        except ConfigError:
            raise
        except Exception as error:  # a class from elsewhere may fail in any way
            raise ConfigError([f'this {self.noun} cannot be imported: {error!r}']) from error


def _drivers() -> PluginRegistry[Any]:
    from rt_robot_os.devices.registry import DRIVERS
    return DRIVERS


def _driver(name: str) -> PartKind:
    from rt_robot_os.devices.registry import DRIVERS
    cls = DRIVERS.load(name)
    return _with_ports(cls, mountings=cls.mountings, shares_port=cls.SHARES_PORT,
                       answers=cls.ANSWERS, has_safe_state=cls.has_safe_state())


def _modules() -> PluginRegistry[Any]:
    from rt_robot_os.modules.registry import MODULES
    return MODULES


def _module(name: str) -> PartKind:
    from rt_robot_os.modules.registry import module_class
    cls = module_class(name)
    return _with_ports(cls, has_safe_state=cls.has_safe_state(), is_coroutine=cls.is_coroutine(),
                       rate_hz=cls.RATE_HZ)


def _with_ports(cls: type[PortOwner], **facts: Any) -> PartKind:
    def topics(section: str, values: Mapping[str, Any]) -> PartTopics:
        part = cls(section, values)
        return PartTopics(part.publications(), part.reads())

    return PartKind(cls.fields(), topics, **facts)


def _simulators() -> PluginRegistry[Any]:
    from rt_robot_os.devices.simulators import SIMULATORS
    return SIMULATORS


def _simulator(name: str) -> PartKind:
    from rt_robot_os.devices.simulators import SIMULATORS
    from rt_robot_os.sim.base import RobotSite
    cls = SIMULATORS.load(name)

    def check(section: str, values: Mapping[str, Any], device: Mapping[str, Any]) -> None:
        # The port opens nothing before it is plugged in.
        cls.made_for(section, values, RobotSite(Path()), device).check_speed()

    return PartKind(tuple(cls.SETTINGS), check=check)


def _layout(message: str, fixed: Mapping[str, Any], tail: int | None) -> Hashable:
    from rt_robot_os.topics import Layout
    layout = Layout.compile(message, fixed, tail=tail)
    return layout.type_name, bytes(layout.prototype), layout.max_size


@functools.cache
def installed() -> Catalogue:
    """Return the catalogue of this installation; a driver or module is imported on demand."""
    return Catalogue(
        drivers=_Registry('driver', _drivers, _driver),
        modules=_Registry('module', _modules, _module, open_ended=True),
        simulators=_Registry('simulator', _simulators, _simulator),
        layout=_layout)
