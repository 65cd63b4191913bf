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


"""Collect the problems of a configuration, with their texts and suggestions."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Iterator
from collections.abc import Sequence
import difflib
import itertools
from typing import Any

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field
from rt_robot_os.settings.tree import Origin
from rt_robot_os.settings.tree import show

# The most lines that are reported; further problems are only counted.
MOST_LINES = 500

_LONGEST_GUESS = 64
_ALIKE = 0.6
# Up to this number of names each is compared.
_FEW = 100
_MOST_SHOWN = 100


class Problems:
    """
    The problems found so far, reported in the order of the files.

    :param files: the files as the user gave them, in order.
    """

    def __init__(self, files: Iterable[str] = ()) -> None:
        self._order = {name: index for index, name in enumerate(dict.fromkeys(files))}
        self._found: list[tuple[int, int, str]] = []
        self._dropped = 0

    def __bool__(self) -> bool:
        return bool(self._found)

    def add(self, origin: Origin, text: str) -> None:
        """Add a problem at a place."""
        if len(self._found) >= MOST_LINES:
            self._dropped += 1
            return
        rank = self._order.get(origin.file, len(self._order))
        self._found.append((rank, origin.line, _one_line(f'{origin}: {text}')))

    def value(self, origin: Origin, name: str, value: Any, remedy: str) -> None:
        """Add a value that is not valid, and the remedy."""
        self.add(origin, f'{name} = {show(value)}: {remedy}')

    def lines(self) -> tuple[str, ...]:
        """Return one line per problem, each once, sorted by file and line."""
        ordered = sorted(self._found, key=lambda found: found[:2])
        lines = tuple(dict.fromkeys(text for _, _, text in ordered))
        if self._dropped:
            lines += (f'and {self._dropped} more problems',)
        return lines

    def raise_any(self) -> None:
        """
        Raise if there are problems.

        :raises ConfigError: with all problems.
        """
        if self._found:
            raise ConfigError(self.lines())


def _one_line(text: str) -> str:
    """Escape characters, so that an error is one line that any terminal can show."""
    return ''.join(c if c.isprintable() else c.encode('unicode_escape').decode() for c in text)


def problem_of(field: Field, value: Any) -> str | None:
    """
    Check one value against its declaration, each item of a list included.

    :return: None if the value is valid, otherwise ``must be ...``.
    """
    wrong = field.problem(value)
    texts = value if isinstance(value, list | tuple) else [value]
    if wrong is None and all(_is_text(each) for each in texts if isinstance(each, str)):
        return None
    hint = ''
    if field.kind is list and not isinstance(value, list | tuple) and not field.problem([value]):
        hint = f': write [{show(value)}]'
    return f'must be {field.wanted()}{hint}'


def _is_text(value: str) -> bool:
    return all(c.isprintable() or c in '\n\t' for c in value)


def description_of(field: Field) -> str:
    """Return the description, capitalised and without a full stop."""
    text = field.description.removesuffix('.')
    return text[:1].upper() + text[1:]


class Names:
    """
    Known names, for suggestions.

    The cost of a suggestion does not depend on their number: of many names only those are found
    that differ by one character. Each name is indexed by itself without one of its characters.
    """

    def __init__(self, known: Iterable[str] = ()) -> None:
        self._known: dict[str, None] = {}
        self._filed: dict[str, list[str]] = {}
        for name in known:
            self.add(name)

    def __iter__(self) -> Iterator[str]:
        return iter(self._known)

    def __len__(self) -> int:
        return len(self._known)

    def add(self, name: str) -> None:
        """Add a name."""
        if name in self._known:
            return
        self._known[name] = None
        if len(name) <= _LONGEST_GUESS:
            for rest in _shortened(name):
                filed = self._filed.setdefault(rest, [])
                if len(filed) < _FEW:
                    filed.append(name)

    def nearest(self, name: str, but: str | None = None) -> str | None:
        """
        Return the most similar name.

        :param but: a name to exclude.
        """
        if len(name) > _LONGEST_GUESS:
            return None
        if len(self._known) <= _FEW:
            near: Iterable[str] = self._known
        else:
            near = dict.fromkeys(other for rest in _shortened(name)
                                 for other in self._filed.get(rest, ()))
        return _closest(name, [each for each in near if each != but])


def _shortened(name: str) -> set[str]:
    return {name, *(name[:index] + name[index + 1:] for index in range(len(name)))}


def _closest(name: str, known: Sequence[str]) -> str | None:
    close = difflib.get_close_matches(name, known, n=1, cutoff=_ALIKE)
    return close[0] if close else None


def nearest(name: str, known: Iterable[str]) -> str | None:
    """Return the most similar of the known names; for many queries use :class:`Names`."""
    return None if len(name) > _LONGEST_GUESS else _closest(name, list(known))


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return a suggestion of the most similar name, or a list of all names."""
    names = known if isinstance(known, Names) else sorted(set(known))
    guess = names.nearest(name) if isinstance(names, Names) else nearest(name, names)
    if guess:
        return f'did you mean {guess!r}?'
    shown = sorted(itertools.islice(names, _MOST_SHOWN))
    more = f' and {len(names) - len(shown)} more' if len(names) > len(shown) else ''
    return f"known: {', '.join(shown)}{more}" if shown else 'there are none'
