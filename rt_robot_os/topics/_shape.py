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

"""The shape given at declaration: strings, lengths and initial values, as a nested mapping."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any

from rt_robot_os.base.errors import LayoutError


def nest(type_name: str, shape: Mapping[str, Any] | None) -> dict[str, Any]:
    """
    Convert dotted keys to nested mappings.

    :param type_name: for error messages.
    :param shape: ``{'header.frame_id': 'imu'}`` or ``{'header': {'frame_id': 'imu'}}``, or both.
    :raises LayoutError: a field is given twice, or a key is not a string.
    """
    result: dict[str, Any] = {}
    if shape is not None:
        _merge(type_name, '', result, shape)
    return result


def _merge(type_name: str, path: str, target: dict[str, Any], shape: Any) -> None:
    if not isinstance(shape, Mapping):
        raise LayoutError(f'{type_name}: {path or "the shape"} is given as {brief(shape)}; '
                          'write a mapping of field names to values')
    for key, value in shape.items():
        if not isinstance(key, str):
            raise LayoutError(f'{type_name}: key {key!r} in {path or "the shape"}; field names '
                              'are strings')
        *parents, last = key.split('.')
        place, where = target, path
        for part in parents:
            where = dotted(where, part)
            place = place.setdefault(part, {})
            if not isinstance(place, dict):
                raise LayoutError(f'{type_name}: field {where!r} is given twice; keep one')
        where = dotted(where, last)
        known = place.get(last)
        if isinstance(value, Mapping) and isinstance(known, dict | None):
            _merge(type_name, where, place.setdefault(last, {}), value)
        elif last in place:
            raise LayoutError(f'{type_name}: field {where!r} is given twice, as {brief(known)} '
                              f'and {brief(value)}; keep one')
        else:
            place[last] = value


def dotted(path: str, name: str) -> str:
    """Join the name of a field to that of the enclosing message."""
    return f'{path}.{name}' if path else name


def brief(value: Any) -> str:
    """Format a value for an error message, shortened."""
    text = repr(value)
    return text if len(text) <= 80 else f'{text[:77]}...'


def suggest(name: str, known: Iterable[str]) -> str:
    """Suggest the name that is similar to a wrong one, or list all names."""
    names = list(known)
    if not names:
        return 'it has no fields'
    close = get_close_matches(name, names, 1)
    return f'did you mean {close[0]!r}?' if close else f'its fields are {", ".join(names)}'
