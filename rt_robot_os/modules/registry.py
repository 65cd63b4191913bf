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

"""The modules by the name that ``type`` has in the configuration, or ``package.module:Class``."""

from __future__ import annotations

from typing import Final

from rt_robot_os.base.features import modules
from rt_robot_os.base.plugins import PluginRegistry
from rt_robot_os.modules.base import Module

MODULES: Final[PluginRegistry[Module]] = PluginRegistry(
    'rt_robot_os.modules', Module, 'module', modules())


def names() -> tuple[str, ...]:
    """Return the registered names, sorted."""
    return MODULES.names()


def module_class(name: str) -> type[Module]:
    """
    Find a module class; not for the real-time loop.

    :param name: a registered name, or ``package.module:Class`` for one that is not registered.
    :raises ConfigError: there is none of that name, or it cannot be imported.
    """
    if ':' in name:
        return PluginRegistry(MODULES.group, Module, 'module', {name: name}).load(name)
    return MODULES.load(name)
