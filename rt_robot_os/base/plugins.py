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
Plug-ins by name: those of this package and those of entry points, imported on demand.

Users add plug-ins from their own packages, here a module::

    entry_points={'rt_robot_os.modules': ['my_filter = my_package.my_filter:MyFilter']}

A plug-in that cannot be imported is reported when it is used; it does not affect the others.
"""

from __future__ import annotations

from collections.abc import Mapping
import functools
from importlib import import_module
import sys
from typing import Final
from typing import Generic
from typing import TypeVar

from rt_robot_os.base.errors import ConfigError

T = TypeVar('T')

_GROUPS: Final = 'rt_robot_os.'


@functools.lru_cache(maxsize=4)
def installed(path: tuple[str, ...]) -> Mapping[str, Mapping[str, str]]:
    """
    Search all installed packages, once, since that takes tens of milliseconds.

    :param path: the import path of Python; another path is searched again.
    :return: entry-point groups of this package -> name -> ``module:Class``.
    """
    # Imported late: most processes only use names of this package.
    from importlib.metadata import entry_points
    found = entry_points()
    # A value may name extras after the class: `module:Class [extra]`.
    return {group: {point.name: point.value.partition('[')[0].strip()
                    for point in found.select(group=group)}
            for group in found.groups if group.startswith(_GROUPS)}


def entry_point_targets(*groups: str) -> dict[str, str]:
    """
    Return the plug-ins of other packages in entry-point groups: name -> ``module:Class``.

    :param groups: later ones take precedence.
    """
    found = installed(tuple(sys.path))
    return {name: target for group in groups for name, target in found.get(group, {}).items()}


def load_object(what: str, target: str) -> object:
    """
    Import the object of a target ``module:name``.

    :param what: its description in errors, such as ``driver 'my_lidar'``.
    :raises ConfigError: it cannot be imported, or is broken.
    """
    module, _, attribute = target.partition(':')
    try:
        return getattr(import_module(module), attribute)
    except ImportError as error:
        raise ConfigError([
            f'{what} ({target}) cannot be imported: {error}; install the '
            'missing package']) from error
    except Exception as error:  # foreign code may raise anything during the import
        raise ConfigError([
            f'{what} ({target}) is broken: {type(error).__name__}: {error}; '
            'report it to its author']) from error


class PluginRegistry(Generic[T]):
    """
    The classes of one kind, by name.

    :ivar group: entry-point group of plug-ins from other packages.
    """

    def __init__(self, group: str, base: type[T], noun: str, own: Mapping[str, str]) -> None:
        """
        Store the names; nothing is imported.

        :param base: the required base class.
        :param noun: term for a plug-in in errors, such as ``driver``.
        :param own: name -> ``module:Class`` of this package; others cannot replace these names.
        """
        self.group = group
        self._base = base
        self._noun = noun
        self._own = own

    def __contains__(self, name: str) -> bool:
        """Return whether a name exists, even if its plug-in is broken."""
        return name in self._own or name in self._others()

    def names(self) -> tuple[str, ...]:
        """Return all names, sorted, including those of broken plug-ins."""
        return tuple(sorted({**self._others(), **self._own}))

    def foreign_names(self) -> tuple[str, ...]:
        """Return the names of other packages, sorted, including those of broken plug-ins."""
        return tuple(sorted(set(self._others()) - set(self._own)))

    def load(self, name: str) -> type[T]:
        """
        Import a class.

        :raises ConfigError: the name does not exist, or its plug-in is broken.
        """
        target = self._target(name)
        if not target:
            raise ConfigError([
                f'there is no {self._noun} {name!r}: use one of {", ".join(self.names())}, or '
                f'install the package that adds it to the entry-point group {self.group}'])
        found = load_object(f'{self._noun} {name!r}', target)
        if not (isinstance(found, type) and issubclass(found, self._base)):
            raise ConfigError([
                f'{self._noun} {name!r} ({target}) is broken: not a class derived from '
                f'{self._base.__name__}; report it to its author'])
        return found

    def problems(self) -> tuple[str, ...]:
        """Import every plug-in and return the problems, one line each."""
        found = [
            f'{self._noun} {name!r} of the entry point {target} is not used: this package has one '
            'of that name; rename it'
            for name, target in sorted(self._others().items()) if name in self._own
        ]
        for name in self.names():
            try:
                self.load(name)
            except ConfigError as error:
                found.extend(error.problems)
        return tuple(found)

    def _target(self, name: str) -> str:
        """Return ``module:Class`` of a name; empty when it does not exist."""
        return self._own.get(name) or self._others().get(name, '')

    def _others(self) -> dict[str, str]:
        return entry_point_targets(self.group)
