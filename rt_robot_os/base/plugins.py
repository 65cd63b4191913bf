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
Names of plug-ins: those of this package and those of entry points, imported only when asked for.

Users add their own from a package of theirs, here a module::

    entry_points={'rt_robot_os.modules': ['my_filter = my_package.my_filter:MyFilter']}

A plug-in that cannot be imported is reported when it is named; it does not disturb the others.
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
    Look through all installed packages, once, since that takes tens of milliseconds.

    :param path: folders that Python imports from; others are looked through anew.
    :return: our entry-point groups -> name -> ``module:Class``.
    """
    # Late: most processes only ask for names of this package.
    from importlib.metadata import entry_points
    found = entry_points()
    # A value may name extras behind the class: `module:Class [extra]`.
    return {group: {point.name: point.value.partition('[')[0].strip()
                    for point in found.select(group=group)}
            for group in found.groups if group.startswith(_GROUPS)}


def entry_point_targets(*groups: str) -> dict[str, str]:
    """
    Return what other packages add to entry-point groups: name -> ``module:Class``.

    :param groups: the later ones win.
    """
    found = installed(tuple(sys.path))
    return {name: target for group in groups for name, target in found.get(group, {}).items()}


def load_object(what: str, target: str) -> object:
    """
    Import what a target ``module:name`` names.

    :param what: what it is in errors, such as ``driver 'my_lidar'``.
    :raises ConfigError: it cannot be imported, or is broken.
    """
    module, _, attribute = target.partition(':')
    try:
        return getattr(import_module(module), attribute)
    except ImportError as error:
        raise ConfigError([
            f'{what} ({target}) cannot be imported: {error}; install what is '
            'missing']) from error
    except Exception as error:  # the code of others may raise anything while it is imported
        raise ConfigError([
            f'{what} ({target}) is broken: {type(error).__name__}: {error}; '
            'report it to its author']) from error


class PluginRegistry(Generic[T]):
    """
    The classes of one kind, by name.

    :ivar group: entry-point group from which other packages add to it.
    """

    def __init__(self, group: str, base: type[T], noun: str, own: Mapping[str, str]) -> None:
        """
        Keep the names; nothing is imported.

        :param base: what each class must derive from.
        :param noun: what a plug-in is called in errors, such as ``driver``.
        :param own: name -> ``module:Class`` of this package; these names cannot be taken over.
        """
        self.group = group
        self._base = base
        self._noun = noun
        self._own = own

    def __contains__(self, name: str) -> bool:
        """Return whether there is one of that name, be it broken."""
        return name in self._own or name in self._others()

    def names(self) -> tuple[str, ...]:
        """Return all names, sorted; those of broken plug-ins too."""
        return tuple(sorted({**self._others(), **self._own}))

    def foreign_names(self) -> tuple[str, ...]:
        """Return the names of other packages, sorted; those of broken plug-ins too."""
        return tuple(sorted(set(self._others()) - set(self._own)))

    def load(self, name: str) -> type[T]:
        """
        Import a class.

        :raises ConfigError: there is no such name, or its plug-in is broken.
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
        """Import every plug-in and say what is wrong, one line a problem."""
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
        """Return ``module:Class`` of a name; empty when there is none."""
        return self._own.get(name) or self._others().get(name, '')

    def _others(self) -> dict[str, str]:
        return entry_point_targets(self.group)
