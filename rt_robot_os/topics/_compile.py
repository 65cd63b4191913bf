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

"""Compile an interface and a shape to nodes, or report precisely what is not supported."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from typing import Any
from typing import NoReturn

import numpy as np

from rt_robot_os.base.errors import LayoutError
from rt_robot_os.topics import _nodes as nodes
from rt_robot_os.topics._cdr import align
from rt_robot_os.topics._cdr import BYTES_MAXIMUM
from rt_robot_os.topics._cdr import COUNT
from rt_robot_os.topics._cdr import ELEMENTS_MAXIMUM
from rt_robot_os.topics._cdr import encode_string
from rt_robot_os.topics._cdr import HEADER_BYTES
from rt_robot_os.topics._cdr import Primitive
from rt_robot_os.topics._shape import brief
from rt_robot_os.topics._shape import dotted
from rt_robot_os.topics._shape import nest
from rt_robot_os.topics._shape import suggest
from rt_robot_os.topics.resolve import FieldSpec
from rt_robot_os.topics.resolve import MessageSpec

_TEXTS = (str, bytes, bytearray)


def compile_message(spec: MessageSpec, shape: Mapping[str, Any] | None,
                    tail: int | None) -> nodes.MessageNode:
    """
    Lay out a message.

    :param shape: the fixed values, see :class:`rt_robot_os.topics.layout.Layout`.
    :param tail: maximum length of a variable last field, or None.
    :raises LayoutError: the type, the field, the value and the remedy.
    """
    return _Compiler(spec.type_name).message(spec, nest(spec.type_name, shape), 0, '', tail)


class _Compiler:
    """One compilation; caches the default elements that it has placed already."""

    def __init__(self, type_name: str) -> None:
        self.type_name = type_name
        self._placed: dict[tuple[MessageSpec, int], nodes.MessageNode] = {}
        self._elements = 0

    def fail(self, path: str, text: str) -> NoReturn:
        raise LayoutError(f'{self.type_name}: field {path!r} {text}')

    def message(self, spec: MessageSpec, shape: dict[str, Any], phase: int, path: str,
                tail: int | None = None) -> nodes.MessageNode:
        plain = not shape and tail is None
        if plain and (spec, phase) in self._placed:
            return self._placed[spec, phase]
        names = [field.name for field in spec.fields]
        for name in shape:
            if name not in names:
                self.fail(dotted(path, name), f'does not exist in {spec.type_name}: '
                                              f'{suggest(name, names)}')
        # In ROS 2 a message without fields has one byte, as IDL has no empty structures.
        position, placed = phase + (not names), []
        node: nodes.Node
        for name, field in zip(names, spec.fields, strict=True):
            where, value = dotted(path, name), shape.get(name)
            if tail is not None and name == names[-1]:
                node, position = self._tail(field, name in shape, position, where, tail)
            else:
                node, position = self._field(field, value, position, where)
            self._bound(position, where)
            placed.append(node)
        if tail is not None and not names:
            raise LayoutError(f'{spec.type_name}: tail={tail} but the message has no fields; '
                              'leave tail out')
        result = nodes.MessageNode(spec, phase, position, tuple(placed))
        if plain:
            self._placed[spec, phase] = result
        return result

    def _bound(self, position: int, path: str) -> None:
        if position + HEADER_BYTES > BYTES_MAXIMUM:
            self.fail(path, f'makes the message {position} bytes long; a slot holds at most '
                            f'{BYTES_MAXIMUM}: declare it shorter')

    def _field(self, field: FieldSpec, value: Any, position: int,
               path: str) -> tuple[nodes.Node, int]:
        if field.container:
            return self._elements_of(field, value, position, path)
        if isinstance(field.item, MessageSpec):
            return self._member(field.name, field.item, value, position, path)
        if isinstance(field.item, Primitive):
            offset = align(position, field.item.size)
            raw = self._scalar(field.item, field.default if value is None else value, path)
            return (nodes.ScalarNode(field.name, field.item, offset, raw),
                    offset + field.item.size)
        return self._string(field, field.default if value is None else value, position, path)

    def _scalar(self, primitive: Primitive, value: Any, path: str) -> bytes:
        try:
            return primitive.pack(value)
        except ValueError as error:
            self.fail(path, f'({primitive.name}) cannot be {brief(value)}: give {error}')

    def _string(self, field: FieldSpec, value: Any, position: int,
                path: str) -> tuple[nodes.StringNode, int]:
        if not isinstance(value, str):
            self.fail(path, f'(string) cannot be {brief(value)}: give its string')
        try:
            raw = encode_string(value)
        except ValueError as error:
            self.fail(path, f'(string) cannot be {brief(value)}: give {error}')
        if field.text_limit is not None and len(raw) - 1 > field.text_limit:
            self.fail(path, f'holds at most {field.text_limit} bytes and {brief(value)} has '
                            f'{len(raw) - 1}: give a shorter string')
        offset = align(position, COUNT.size)
        raw = COUNT.pack(len(raw)) + raw
        return nodes.StringNode(field.name, offset, value, raw), offset + len(raw)

    def _member(self, name: str, spec: MessageSpec, value: Any, position: int,
                path: str) -> tuple[nodes.MemberNode, int]:
        if value is not None and not isinstance(value, Mapping):
            self.fail(path, f'({spec.type_name}) cannot be {brief(value)}: give a mapping of '
                            'field names to values')
        phase = position % 8
        base = position - phase
        message = self.message(spec, nest(self.type_name, value), phase, path)
        return nodes.MemberNode(name, base, message), base + message.end

    def _elements_of(self, field: FieldSpec, value: Any, position: int,
                     path: str) -> tuple[nodes.Node, int]:
        count, items = self._count(field, value, path)
        count_offset = None
        if field.container == 'sequence':
            count_offset = align(position, COUNT.size)
            position = count_offset + COUNT.size
        if isinstance(field.item, Primitive):
            return self._numbers(field, field.item, count, items, count_offset, position, path)
        self._elements += count
        if self._elements > ELEMENTS_MAXIMUM:
            self.fail(path, f'with {count} elements brings the message to {self._elements} '
                            f'strings and messages; a layout holds at most {ELEMENTS_MAXIMUM}')
        if isinstance(field.item, MessageSpec):
            members = []
            for index in range(count):
                member, position = self._member(field.name, field.item, items and items[index],
                                                position, f'{path}[{index}]')
                members.append(member)
                self._bound(position, path)
            return nodes.MembersNode(field.name, count_offset, field.type_name,
                                     tuple(members)), position
        texts = []
        for index in range(count):
            text, position = self._string(field, items[index] if items else '', position,
                                          f'{path}[{index}]')
            texts.append(text)
        return nodes.StringsNode(field.name, count_offset, tuple(texts)), position

    def _count(self, field: FieldSpec, value: Any, path: str) -> tuple[int, Any]:
        """Return the length of an array or sequence, and its elements if they are given."""
        if value is None:
            value = field.default if not isinstance(field.item, MessageSpec) else (
                field.limit if field.container == 'array' else len(field.default))
        numbers = isinstance(field.item, Primitive)
        if isinstance(value, int | np.integer) and not isinstance(value, bool):
            count, items = int(value), None
        elif _is_list(value) or (numbers and isinstance(value, bytes | bytearray)):
            count, items = len(value), value
        else:
            self.fail(path, f'(several of {field.type_name}) cannot be {brief(value)}: give the '
                            'list of its elements, or how many there are')
        if count < 0:
            self.fail(path, f'cannot have {count} elements: give 0 or more')
        if field.container == 'array' and count != field.limit:
            self.fail(path, f'is an array of {field.limit} and cannot have {count} elements')
        if field.limit is not None and count > field.limit:
            self.fail(path, f'holds at most {field.limit} elements, not {count}: give fewer')
        return count, items

    def _numbers(self, field: FieldSpec, primitive: Primitive, count: int, items: Any,
                 count_offset: int | None, position: int,
                 path: str) -> tuple[nodes.NumbersNode, int]:
        if count == 0:  # as in Fast CDR: nothing follows the count, not even padding
            return nodes.NumbersNode(field.name, primitive, count_offset, position, 0,
                                     b''), position
        offset = align(position, primitive.size)
        end = offset + count * primitive.size
        self._bound(end, path)
        raw = b''
        if items is not None:
            raw = b''.join(self._scalar(primitive, _plain(item), f'{path}[{index}]')
                           for index, item in enumerate(items))
        return nodes.NumbersNode(field.name, primitive, count_offset, offset, count, raw), end

    def _tail(self, field: FieldSpec, shaped: bool, position: int, path: str,
              maximum: Any) -> tuple[nodes.TailNode, int]:
        is_text = field.item is None and not field.container
        if not is_text and not (field.container == 'sequence'
                                and isinstance(field.item, Primitive)):
            self.fail(path, f'is the last one and cannot be a tail (tail={maximum!r}): only a '
                            'string or a sequence of numbers can; fix its length in the shape')
        if shaped:
            self.fail(path, f'is the tail (tail={maximum!r}) and is fixed in the shape as well: '
                            'remove one of them')
        if not isinstance(maximum, int) or isinstance(maximum, bool) or maximum < 0:
            self.fail(path, f'cannot be a tail of {brief(maximum)}: give the largest length, '
                            '0 or more')
        limit = field.text_limit if is_text else field.limit
        if limit is not None and maximum > limit:
            self.fail(path, f'holds at most {limit} elements: give a tail of {limit} or less, '
                            f'not {maximum}')
        count_offset = align(position, COUNT.size)
        end = count_offset + COUNT.size
        primitive = field.item if isinstance(field.item, Primitive) else None
        offset = align(end, primitive.size) if primitive is not None else end
        self._bound(offset + maximum * (primitive.size if primitive is not None else 1), path)
        return (nodes.TailNode(field.name, primitive, count_offset, offset, maximum),
                end + is_text)


def _is_list(value: Any) -> bool:
    return (isinstance(value, Sequence) and not isinstance(value, _TEXTS)
            or hasattr(value, 'tolist'))


def _plain(item: Any) -> Any:
    convert: Callable[[], Any] | None = getattr(item, 'tolist', None)
    return convert() if convert is not None else item
