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
What can be configured: drivers, modules, simulators and message types, looked up by name.

Settings know none of them; :func:`installed` asks the registries, late, and tests bring their own.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Hashable
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from typing import Protocol

from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import PartTopics
from rt_robot_os.motion.mounting import Mounting


def no_topics(name: str, values: Mapping[str, Any]) -> PartTopics:
    """Use no topic."""
    return PartTopics()


def no_check(name: str, values: Mapping[str, Any], device: Mapping[str, Any]) -> None:
    """Find nothing wrong."""


def no_mountings(values: Mapping[str, Any]) -> Mapping[str, Mounting]:
    """Have no frame."""
    return {}


@dataclass(frozen=True, slots=True)
class PartKind:
    """
    A driver, a module or a simulator, as far as settings care.

    :ivar fields: its own settings.
    :ivar topics: its topics, from the name of its section and the checked settings.
    :ivar check: of a simulator, raises ConfigError when its settings do not fit together or do not
        fit those of the device.
    :ivar mountings: of a device, where its frames are, from the checked settings.
    :ivar shares_port: several devices may be on one port (a bus).
    :ivar rate_hz: of a module, at which it runs when its section does not say; None: as all.
    :ivar answers: it waits for answers, so it is read on interrupt.
    """

    fields: tuple[Field, ...] = ()
    topics: Callable[[str, Mapping[str, Any]], PartTopics] = no_topics
    check: Callable[[str, Mapping[str, Any], Mapping[str, Any]], None] = no_check
    mountings: Callable[[Mapping[str, Any]], Mapping[str, Mounting]] = no_mountings
    shares_port: bool = False
    answers: bool = False
    has_safe_state: bool = False
    is_coroutine: bool = False
    rate_hz: float | None = None


class Lookup(Protocol):
    """Kinds by name."""

    def names(self) -> Sequence[str]:
        """List the names that are known without importing anything foreign."""

    def find(self, name: str) -> PartKind:
        """
        Find one.

        :raises ConfigError: there is none, or it cannot be imported; the text completes
            ``imu.type = 'x': ...``.
        """


@dataclass(frozen=True, slots=True)
class Catalogue:
    """
    All that a configuration may name.

    :ivar simulators: by the driver's name.
    :ivar layout: lays a message type out with its fixed fields and tail; equal results mean the
        same shape, LayoutError that it cannot be.
    """

    drivers: Lookup
    modules: Lookup
    simulators: Lookup
    layout: Callable[[str, Mapping[str, Any], int | None], Hashable]
