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

"""Find module classes by name: those of this package, of other packages, or ``package:Class``."""

from __future__ import annotations

from collections.abc import Mapping
import importlib
from importlib.metadata import entry_points
from typing import Final

from rt_robot_os.errors import ConfigError
from rt_robot_os.modules.base import Module

ENTRY_POINT_GROUP: Final = 'rt_robot_os.modules'

MODULES: Final[Mapping[str, str]] = {
    'twist_guard': 'rt_robot_os.modules.twist_guard:TwistGuard',
}


def names() -> tuple[str, ...]:
    """Give the names that a configuration may use, sorted."""
    found = {point.name for point in entry_points(group=ENTRY_POINT_GROUP)}
    return tuple(sorted(found | set(MODULES)))


def module_class(name: str) -> type[Module]:
    """
    Find a module class; not for the real-time loop.

    :param name: a registered name, or ``'package.module:Class'``.
    :raises ConfigError: there is none of that name, or it cannot be imported.
    """
    target = MODULES.get(name)
    if target is None:
        for point in entry_points(group=ENTRY_POINT_GROUP):
            if point.name == name:
                target = point.value
    if target is None and ':' in name:
        target = name
    if target is None:
        raise ConfigError([f'unknown module type {name!r}; there are {", ".join(names())}, or '
                           "write 'package.module:Class' for your own"])
    path, _, attribute = target.partition(':')
    try:
        found = getattr(importlib.import_module(path), attribute)
    except (ImportError, AttributeError) as error:
        raise ConfigError([f'module type {name!r}: {target} cannot be loaded: {error}']) from error
    if not (isinstance(found, type) and issubclass(found, Module)):
        raise ConfigError([f'module type {name!r}: {target} is no subclass of '
                           'rt_robot_os.modules.Module'])
    return found
