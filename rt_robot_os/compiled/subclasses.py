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

"""Let a compiled class be subclassed by one that is not; without mypyc's package at run time."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mypy_extensions import mypyc_attr as mypyc_attr
else:
    from collections.abc import Callable
    from typing import TypeVar

    ClassT = TypeVar('ClassT', bound=type)

    def mypyc_attr(**attributes: object) -> Callable[[ClassT], ClassT]:
        """Tell mypyc about a class; where it is run, it changes nothing."""
        return lambda one: one
