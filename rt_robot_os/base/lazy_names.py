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

"""Lazy imports: public names of a package that are imported on first access."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping
from importlib import import_module
import sys
from types import ModuleType
from typing import Any

_PLACES: dict[str, Mapping[str, str]] = {}


class _LazyPackage(ModuleType):
    """A package with lazily imported names."""

    def __getattr__(self, name: str) -> Any:
        """
        Import a public name.

        :raises AttributeError: the package has no such name.
        """
        place = _PLACES[self.__name__].get(name)
        if place is None:
            raise AttributeError(f'module {self.__name__!r} has no attribute {name!r}')
        found = getattr(import_module(f'.{place}', self.__name__), name)
        setattr(self, name, found)
        return found

    def __setattr__(self, name: str, value: object) -> None:
        """Set an attribute; an imported submodule does not replace a public name."""
        if not (isinstance(value, ModuleType) and name in _PLACES[self.__name__]):
            super().__setattr__(name, value)

    def __dir__(self) -> Iterable[str]:
        """List the present names and the lazy ones."""
        return sorted({*super().__dir__(), *_PLACES[self.__name__]})


def lazy_names(package: str, places: Mapping[str, str]) -> None:
    """
    Import public names of a package on first access.

    Importing one module of a package also runs its ``__init__``. So that imports nothing that is
    not always needed: otherwise ``--help`` would take a second.

    :param package: its ``__name__``; call this at the end of its ``__init__``.
    :param places: name -> the module of this package that defines it.
    """
    _PLACES[package] = places
    sys.modules[package].__class__ = _LazyPackage
