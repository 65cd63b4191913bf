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

"""JSON whose layout is checked as it is read: each error names the field and what it must be."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

_KINDS = {dict: 'an object', list: 'a list', str: 'a string', bool: 'a truth value',
          type(None): 'null', int: 'a number', float: 'a number'}


class LayoutError(ValueError):
    """A field is missing, or of another kind; the message names it."""


class Checked:
    """
    A value of JSON; what is taken out of an object or a list is one again.

    :param value: as ``json`` read it.
    :param place: the name of the field, for errors: ``cases[3].target``.
    """

    def __init__(self, value: Any, place: str) -> None:
        self._value = value
        self._place = place

    def __contains__(self, key: str) -> bool:
        """Return whether an object has a field."""
        return key in self._of(dict)

    def __getitem__(self, key: str | int) -> Checked:
        """
        Return a field of an object, or an entry of a list.

        :raises LayoutError: it is missing, or this is no object or list.
        """
        if isinstance(key, str):
            fields = self._of(dict)
            if key not in fields:
                there = ', '.join(map(repr, list(fields)[:8])) or 'none'
                raise LayoutError(f'{self._place} has no field {key!r}; its fields are: {there}')
            return Checked(fields[key], f'{self._place}.{key}')
        entries = self._of(list)
        if key >= len(entries):
            raise LayoutError(f'{self._place} has {len(entries)} entries: at least {key + 1} are '
                              'needed')
        return Checked(entries[key], f'{self._place}[{key}]')

    def __iter__(self) -> Iterator[Checked]:
        """
        Return the entries of a list.

        :raises LayoutError: it is none.
        """
        return (Checked(entry, f'{self._place}[{number}]')
                for number, entry in enumerate(self._of(list)))

    def entries(self, count: int) -> list[Checked]:
        """
        Return the entries of a list of a known length.

        :raises LayoutError: it is none, or has another length.
        """
        found = list(self)
        if len(found) != count:
            raise LayoutError(f'{self._place} has {len(found)} entries: it must have {count}')
        return found

    def _of(self, kind: type) -> Any:
        if not isinstance(self._value, kind):
            raise LayoutError(f'{self._place} is {_KINDS[type(self._value)]}: it must be '
                              f'{_KINDS[kind]}')
        return self._value

    def __float__(self) -> float:
        """
        Return a number.

        :raises LayoutError: it is none.
        """
        if isinstance(self._value, bool) or not isinstance(self._value, (int, float)):
            raise LayoutError(f'{self._place} is {_KINDS[type(self._value)]}: it must be a number')
        return float(self._value)
