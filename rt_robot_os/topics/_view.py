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

"""The base of message views, and the assignment of whole messages."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping
from itertools import chain
from typing import Any

import numpy as np

from rt_robot_os.base.errors import LayoutError
from rt_robot_os.topics._set import refuse_text
from rt_robot_os.topics._shape import brief
from rt_robot_os.topics._shape import suggest


class View:
    """
    A message in a buffer, with the field names of the ROS message.

    Reading and assigning is safe in the real-time loop. There is no ``__getattr__`` for a better
    error message: with it, CPython does not specialise the access to properties, which then takes
    twice as long. The classes are named after the message, so Python's own error is clear.
    """

    __slots__ = ()

    _type_name = ''
    _fields: tuple[str, ...] = ()
    _types: Mapping[str, str] = {}

    def __iter__(self) -> Iterator[Any]:
        for name in self._fields:
            value = getattr(self, name)
            if isinstance(value, View):
                yield from value
            elif isinstance(value, ViewList):
                yield from chain.from_iterable(value)
            else:
                yield value

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray[Any, Any]:
        return np.array(tuple(self), dtype)

    def __repr__(self) -> str:
        values = ', '.join(f'{name}={_show(getattr(self, name))}' for name in self._fields)
        return f'{self._type_name.rpartition("/")[2]}({values})'


class Items(tuple[Any, ...]):
    """A fixed tuple of elements; assigning to an index or a slice changes their content."""

    label = ''

    def __setitem__(self, index: int | slice, value: Any) -> None:
        places = range(len(self))[index]
        if isinstance(places, int):
            self._put(places, value)
            return
        values = _as_list(value)
        if values is None or len(values) != len(places):
            given = brief(value) if values is None else f'{len(values)} values'
            raise LayoutError(f'{self.label} has a fixed number of elements: {len(places)} of '
                              f'them cannot be set to {given}')
        for place, item in zip(places, values, strict=True):
            self._put(place, item)

    def _put(self, place: int, value: Any) -> None:
        raise NotImplementedError


class ViewList(Items):
    """The views of an array or sequence of messages; an element is assigned like a field."""

    def _put(self, place: int, value: Any) -> None:
        assign(self[place], value)


class FixedTexts(Items):
    """The strings of an array or sequence, fixed at declaration."""

    def _put(self, place: int, value: Any) -> None:
        if value != self[place]:
            refuse_text(f'{self.label}[{place}]', self[place], value)


def assign(view: View, value: Any) -> None:
    """
    Assign a whole message.

    :param value: a ROS message or view of the same type, a mapping of field names to values, or
        an iterable with a value for each leaf or for each field.
    :raises LayoutError: it is of another type, or a value is invalid.
    """
    if isinstance(value, Mapping):
        for name, item in value.items():
            if name not in view._fields:
                raise LayoutError(f'{view._type_name} has no field {name!r}: '
                                  f'{suggest(str(name), view._fields)}')
            setattr(view, name, item)
        return
    names = _field_names(value)
    if names is not None:
        if names != view._fields:
            raise LayoutError(f'a {view._type_name} cannot be set to {brief(value)}: its fields '
                              f'are {", ".join(view._fields)}')
        for name in names:
            setattr(view, name, getattr(value, name))
        return
    _assign_iterable(view, value)


def _assign_iterable(view: View, value: Any) -> None:
    values = _as_list(value)
    if values is None:
        raise LayoutError(f'a {view._type_name} cannot be set to {brief(value)}: give its values '
                          'in order, a mapping, or a message of that type')
    leaves = sum(1 for _ in view)
    if len(values) == leaves:
        _assign_leaves(view, iter(values))
    elif len(values) == len(view._fields):
        for name, item in zip(view._fields, values, strict=True):
            setattr(view, name, item)
    else:
        raise LayoutError(f'a {view._type_name} cannot be set to {len(values)} values: it has '
                          f'{leaves} in its {len(view._fields)} fields '
                          f'({", ".join(view._fields)})')


def _assign_leaves(view: View, values: Iterator[Any]) -> None:
    for name in view._fields:
        field = getattr(view, name)
        if isinstance(field, View):
            _assign_leaves(field, values)
        elif isinstance(field, ViewList):
            for item in field:
                _assign_leaves(item, values)
        else:
            setattr(view, name, next(values))


def _as_list(value: Any) -> list[Any] | None:
    if isinstance(value, str | bytes):
        return None
    try:
        return list(value)
    except TypeError:
        return None


def _field_names(value: Any) -> tuple[str, ...] | None:
    if isinstance(value, View):
        return value._fields
    describe = getattr(value, 'get_fields_and_field_types', None)
    return tuple(describe()) if describe is not None else None


def _show(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return np.array2string(value, separator=', ', threshold=12, edgeitems=3)
    return repr(value)


def to_plain(view: View) -> dict[str, Any]:
    """Convert a message to dictionaries, lists, numbers and strings."""
    return {name: _plain(getattr(view, name)) for name in view._fields}


def _plain(value: Any) -> Any:
    if isinstance(value, View):
        return to_plain(value)
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    return value[0] if isinstance(value, bytes) else value
