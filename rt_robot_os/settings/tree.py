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


"""The content of a YAML file with line numbers: the form between text and settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field
import math
from typing import Any
from typing import Final

COMMAND_LINE: Final = 'command line'
NO_VALUE: Final = 'has no value: write one or leave the key out'

_SHOWN_CHARACTERS = 100


@dataclass(frozen=True, slots=True)
class Origin:
    """
    The place of a key or a value.

    :ivar file: the path as the user gave it, or ``COMMAND_LINE``.
    :ivar line: counted from 1; 0 if there are no lines.
    """

    file: str
    line: int = 0

    def __str__(self) -> str:
        return f'{self.file}:{self.line}' if self.line else self.file


@dataclass(frozen=True, slots=True)
class Leaf:
    """
    A value: bool, int, float, string, or a tuple of these.

    :ivar fault: why ROS 2 refuses the value; empty if it does not. With ``NO_VALUE`` it is None.
    :ivar lines: the line of each item, when the value is a tuple.
    """

    origin: Origin
    value: Any
    fault: str = ''
    lines: tuple[int, ...] = ()

    def item_origin(self, index: int) -> Origin:
        """Return the place of an item of a list."""
        if index < len(self.lines):
            return Origin(self.origin.file, self.lines[index])
        return self.origin


@dataclass(frozen=True, slots=True)
class RawMap:
    """A mapping as written: in order, possibly with repeated keys."""

    origin: Origin
    items: list[tuple[str, Origin, Leaf | RawMap]] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Branch:
    """A section: each key once, dotted keys expanded."""

    origin: Origin
    children: dict[str, Leaf | Branch] = field(default_factory=dict)


def merge(base: Branch, later: Branch) -> Branch:
    """Merge two sections: of two values for one key the later one wins."""
    children = dict(base.children)
    for key, node in later.children.items():
        old = children.get(key)
        if isinstance(old, Branch) and isinstance(node, Branch):
            children[key] = merge(old, node)
        else:
            children[key] = node
    return Branch(later.origin if not base.children else base.origin, children)


def flatten(branch: Branch, prefix: str = '') -> dict[str, Leaf]:
    """List every value of a section by its dotted name."""
    found: dict[str, Leaf] = {}
    for key, node in branch.children.items():
        name = f'{prefix}{key}'
        if isinstance(node, Branch):
            found.update(flatten(node, f'{name}.'))
        else:
            found[name] = node
    return found


def show(value: Any) -> str:
    """Format a value as YAML, short enough for one line of an error."""
    text = _written(value)
    if len(text) > _SHOWN_CHARACTERS:
        return text[:_SHOWN_CHARACTERS - 3] + '...'
    return text


def _written(value: Any) -> str:
    if isinstance(value, bool):
        return 'true' if value else 'false'
    if isinstance(value, float) and not math.isfinite(value):
        return '.nan' if math.isnan(value) else ('.inf' if value > 0 else '-.inf')
    if isinstance(value, list | tuple):
        return f"[{', '.join(_written(item) for item in value[:_SHOWN_CHARACTERS])}]"
    if isinstance(value, Mapping):
        return 'a section'
    return repr(value)
