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
The drivers, modules, simulators and message types that a configuration may name.

:func:`installed` queries the registries, late; tests use their own catalogue.
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
    """Return no topics."""
    return PartTopics()


def no_check(name: str, values: Mapping[str, Any], device: Mapping[str, Any]) -> None:
    """Find nothing wrong."""


def no_mountings(values: Mapping[str, Any]) -> Mapping[str, Mounting]:
    """Return no mountings."""
    return {}


@dataclass(frozen=True, slots=True)
class PartKind:
    """
    A driver, a module or a simulator, as the settings need it.

    :ivar fields: its own settings.
    :ivar topics: returns its topics, from the name of its section and the checked settings.
    :ivar check: of a simulator; raises ConfigError when its settings do not fit together, or do
        not fit those of the device.
    :ivar mountings: of a device; returns the mountings of its frames, from the checked settings.
    :ivar shares_port: several devices may share one port (a bus).
    :ivar rate_hz: of a module; its default rate; None: that of all modules.
    :ivar answers: the device answers requests, so it is read on interrupt.
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
        """List the known names, without importing code of other packages."""

    def find(self, name: str) -> PartKind:
        """
        Look a name up.

        :raises ConfigError: it is unknown, or cannot be imported; the text completes
            ``imu.type = 'x': ...``.
        """


@dataclass(frozen=True, slots=True)
class Catalogue:
    """
    Everything that a configuration may name.

    :ivar simulators: by the driver's name.
    :ivar layout: computes the layout of a message type with its fixed fields and tail; equal
        results mean the same shape; raises LayoutError.
    """

    drivers: Lookup
    modules: Lookup
    simulators: Lookup
    layout: Callable[[str, Mapping[str, Any], int | None], Hashable]
