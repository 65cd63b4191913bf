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

"""Public names of a package that are imported when they are first asked for."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping
from importlib import import_module
import sys
from types import ModuleType
from typing import Any

_PLACES: dict[str, Mapping[str, str]] = {}


class _LazyPackage(ModuleType):
    """A package of which not everything is imported yet."""

    def __getattr__(self, name: str) -> Any:
        """
        Import a public name.

        :raises AttributeError: there is none of that name.
        """
        place = _PLACES[self.__name__].get(name)
        if place is None:
            raise AttributeError(f'module {self.__name__!r} has no attribute {name!r}')
        found = getattr(import_module(f'.{place}', self.__name__), name)
        setattr(self, name, found)
        return found

    def __setattr__(self, name: str, value: object) -> None:
        """Set an attribute; a module that is imported does not hide a public name like its own."""
        if not (isinstance(value, ModuleType) and name in _PLACES[self.__name__]):
            super().__setattr__(name, value)

    def __dir__(self) -> Iterable[str]:
        """Name what is there, and what would be imported."""
        return sorted({*super().__dir__(), *_PLACES[self.__name__]})


def lazy_names(package: str, places: Mapping[str, str]) -> None:
    """
    Have public names of a package imported when they are first asked for.

    Whoever imports one module of a package runs its ``__init__``, too, which therefore imports
    nothing that not everybody needs: `--help` would take a second otherwise.

    :param package: its ``__name__``; called at the end of its ``__init__``.
    :param places: name -> the module that has it, from this package.
    """
    _PLACES[package] = places
    sys.modules[package].__class__ = _LazyPackage
