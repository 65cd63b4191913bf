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

from collections.abc import Callable
from collections.abc import Mapping
from importlib import import_module
import sys
from typing import Any


def lazy_names(package: str, places: Mapping[str, str]) -> Callable[[str], Any]:
    """
    Make the ``__getattr__`` of a package (PEP 562).

    Whoever imports one module of a package runs its ``__init__``, too, which therefore imports
    nothing that not everybody needs: `--help` would take a second otherwise.

    :param package: its ``__name__``.
    :param places: name -> the module that has it, from this package.
    """
    def getattr_of_package(name: str) -> Any:
        if name not in places:
            raise AttributeError(f'module {package!r} has no attribute {name!r}')
        found = getattr(import_module(f'.{places[name]}', package), name)
        setattr(sys.modules[package], name, found)
        return found

    return getattr_of_package
