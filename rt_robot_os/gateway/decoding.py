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

"""Decodes any ROS 2 message to plain values, by the field types of its class."""

from __future__ import annotations

import functools
import math
import struct
from typing import Any
from typing import Final

from rt_robot_os.messages.cdr import CdrReader
from rt_robot_os.topics.resolve import FieldSpec
from rt_robot_os.topics.resolve import MessageSpec
from rt_robot_os.topics.resolve import resolve

#: Most elements of a sequence that are shown; pictures have their own path.
ITEMS_MOST: Final = 4096


@functools.lru_cache(maxsize=256)
def _spec(type_name: str) -> MessageSpec:
    return resolve(type_name)


def decode_message(type_name: str, cdr: bytes) -> dict[str, Any]:
    """
    Read a message of any type.

    :return: its fields; numbers that are not finite are None, long sequences are truncated.
    :raises ValueError: the bytes are not such a message.
    :raises LayoutError: the type is not installed here.
    """
    return _message(_spec(type_name), CdrReader(cdr))


def _message(spec: MessageSpec, reader: CdrReader) -> dict[str, Any]:
    return {each.name: _field(each, reader) for each in spec.fields}


def _field(field: FieldSpec, reader: CdrReader) -> Any:
    if not field.container:
        return _item(field, reader)
    count = field.limit if field.container == 'array' else reader.count()
    assert count is not None  # an array has a length
    item = field.item
    if item is None or isinstance(item, MessageSpec):
        if count > ITEMS_MOST:
            raise ValueError(f'{count} items in {field.name}')
        return [_item(field, reader) for _ in range(count)]
    if not count:
        return []
    start = reader.skip(item.size, item.size * count)
    code = 'B' if item.code == 'c' else item.code
    shown = min(count, ITEMS_MOST)
    return [finite(each) for each in struct.unpack_from(f'<{shown}{code}', reader.cdr, start)]


def _item(field: FieldSpec, reader: CdrReader) -> Any:
    item = field.item
    if item is None:
        return reader.text()
    if isinstance(item, MessageSpec):
        return _message(item, reader)
    code = 'B' if item.code == 'c' else item.code
    return finite(struct.unpack_from(f'<{code}', reader.cdr, reader.skip(item.size, item.size))[0])


def finite(value: Any) -> Any:
    """Return a value; None for a number that JSON does not have."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
