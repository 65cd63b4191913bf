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


"""Access to one number or string of a message by its path, such as ``linear_acceleration.z``."""

from __future__ import annotations

from collections.abc import Callable
import re
import struct
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.errors import LayoutError
from rt_robot_os.topics._cdr import PRIMITIVES
from rt_robot_os.topics._nodes import LayoutField
from rt_robot_os.topics._shape import suggest
from rt_robot_os.topics.layout import Layout

_INDEX: Final = re.compile(r'(.+)\[(\d+)\]')
_COUNT: Final = struct.Struct('<I')


class FieldReader(NamedTuple):
    """
    The reader of a field.

    :ivar is_text: it is a string, otherwise a number; True and False are 1 and 0.
    :ivar read: reads it from the buffer of a subscription; returns None when this message has no
        such element. Safe in the real-time loop.
    """

    is_text: bool
    read: Callable[[Any], float | str | None]


def field_reader(layout: Layout, path: str) -> FieldReader:
    """
    Find a field; not for the real-time loop.

    :param path: such as ``data``, ``linear_acceleration.z``, ``ranges[3]``, ``points[2].x``.
    :raises LayoutError: the field does not exist, or is neither a number nor a variable string;
        the message lists the fields.
    """
    fields = {field.name: field for field in layout.fields()}
    found, index = fields.get(path), 0
    if found is None and (indexed := _INDEX.fullmatch(path)):
        found, index = fields.get(indexed[1]), int(indexed[2])
        if found is not None and (found.type_name not in PRIMITIVES or index >= found.count):
            raise LayoutError(_beyond(layout, found))
    elif found is not None and found.type_name in PRIMITIVES and (
            found.count != 1 or found.count_offset is not None):
        raise LayoutError(f'{layout.type_name}: {path} has {_many(found)}: write {path}[0]')
    if found is None or (found.type_name not in PRIMITIVES and found.type_name != 'string'):
        raise LayoutError(_nothing(layout, path))
    if found.fixed is not None:
        raise LayoutError(f'{layout.type_name}: {path} is always {found.fixed!r}')
    if found.type_name == 'string':
        if not found.nbytes or not found.tail:
            raise LayoutError(_nothing(layout, path))
        return FieldReader(True, _text_reader(found))
    return FieldReader(False, _number_reader(found, index))


def _many(field: LayoutField) -> str:
    return f'up to {field.count} elements' if field.tail else f'{field.count} elements'


def _beyond(layout: Layout, field: LayoutField) -> str:
    if field.type_name not in PRIMITIVES:
        return f'{layout.type_name}: {field.name} is not a list of numbers'
    if not field.count:
        return (f'{layout.type_name}: {field.name} is empty here: its length is fixed by the '
                'declaration')
    return f'{layout.type_name}: {field.name} has {_many(field)}, the last is [{field.count - 1}]'


def _nothing(layout: Layout, path: str) -> str:
    names = [field.name for field in layout.fields()]
    within = [name for name in names if name.startswith((f'{path}.', f'{path}['))]
    if within:
        return f'{layout.type_name}: {path} has several numbers: {", ".join(within[:8])}'
    known = [field.name for field in layout.fields()
             if field.fixed is None and field.type_name in PRIMITIVES or field.tail]
    if not path:
        return f'{layout.type_name}: which field? {suggest("", known)}'
    return f'{layout.type_name} has no field {path!r}: {suggest(path, known)}'


def _number_reader(field: LayoutField, index: int) -> Callable[[Any], float | None]:
    primitive = PRIMITIVES[field.type_name]
    unpack = struct.Struct(f'<{"B" if primitive.code == "c" else primitive.code}').unpack_from
    offset = field.offset + index * primitive.size
    if not field.tail or field.count_offset is None:
        return lambda buffer: float(unpack(buffer, offset)[0])
    count, count_offset = _COUNT.unpack_from, field.count_offset

    def read(buffer: Any) -> float | None:
        if count(buffer, count_offset)[0] <= index:
            return None
        return float(unpack(buffer, offset)[0])
    return read


def _text_reader(field: LayoutField) -> Callable[[Any], str | None]:
    start = field.offset
    count_offset = start - 4 if field.count_offset is None else field.count_offset

    def read(buffer: Any) -> str:
        length = _COUNT.unpack_from(buffer, count_offset)[0]
        return bytes(buffer[start:start + max(0, length - 1)]).decode('utf-8', 'replace')
    return read
