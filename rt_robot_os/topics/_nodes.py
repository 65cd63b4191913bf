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

"""
The positions of all parts of a message with a fixed shape: a tree of nodes.

Offsets in a message are relative to its *base*: its first byte rounded down to a multiple of 8.
Alignment depends only on the position relative to the base, so equal elements of a sequence share
one node.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Union

from rt_robot_os.topics._cdr import HEADER_BYTES
from rt_robot_os.topics._cdr import Primitive
from rt_robot_os.topics.resolve import MessageSpec


@dataclass(frozen=True, eq=False)
class ScalarNode:
    """One number; ``raw`` is its first value."""

    name: str
    primitive: Primitive
    offset: int
    raw: bytes


@dataclass(frozen=True, eq=False)
class StringNode:
    """A fixed string; ``raw`` has its length and the NUL."""

    name: str
    offset: int
    text: str
    raw: bytes


@dataclass(frozen=True, eq=False)
class StringsNode:
    """An array or sequence of fixed strings; ``count_offset`` is None for an array."""

    name: str
    count_offset: int | None
    items: tuple[StringNode, ...]


@dataclass(frozen=True, eq=False)
class NumbersNode:
    """An array or sequence of numbers; ``raw`` has the first values, or is empty for zeros."""

    name: str
    primitive: Primitive
    count_offset: int | None
    offset: int
    count: int
    raw: bytes


@dataclass(frozen=True, eq=False)
class MemberNode:
    """A nested message, whose base is ``base`` bytes after that of the enclosing one."""

    name: str
    base: int
    message: MessageNode


@dataclass(frozen=True, eq=False)
class MembersNode:
    """An array or sequence of messages."""

    name: str
    count_offset: int | None
    type_name: str
    items: tuple[MemberNode, ...]


@dataclass(frozen=True, eq=False)
class TailNode:
    """
    The variable last field: at most ``maximum`` numbers, or bytes of text when not numeric.

    :ivar offset: of the first element; the count before it is at ``count_offset``.
    """

    name: str
    primitive: Primitive | None
    count_offset: int
    offset: int
    maximum: int


Node = Union[ScalarNode, StringNode, StringsNode, NumbersNode, MemberNode, MembersNode, TailNode]


@dataclass(frozen=True, eq=False)
class MessageNode:
    """
    A message.

    :ivar phase: of its first byte after its base, 0 to 7.
    :ivar end: of its last byte, plus one; with an empty tail.
    """

    spec: MessageSpec
    phase: int
    end: int
    fields: tuple[Node, ...]


@dataclass(frozen=True)
class LayoutField:
    """
    One field of a layout, as :meth:`rt_robot_os.topics.layout.Layout.fields` lists it.

    Offsets are in bytes from the first byte of the data, encapsulation included.

    :ivar name: such as ``header.stamp.sec``, ``name[0]``, ``status[1].level``.
    :ivar type_name: of one element: ``double``, ``string``, ``geometry_msgs/msg/Pose``.
    :ivar offset: of the first byte of the value (of the first character, for a string).
    :ivar count: number of elements; of characters in bytes for a string; at most, for a tail.
    :ivar nbytes: from ``offset`` on, with the NUL of a string; 0 when the elements are listed
        individually, as for sequences of strings and messages.
    :ivar count_offset: of the 32 bit count that precedes a string or a sequence, else None.
    :ivar fixed: the value of a fixed string, else None.
    :ivar tail: whether it is the variable tail.
    """

    name: str
    type_name: str
    offset: int
    count: int
    nbytes: int
    count_offset: int | None = None
    fixed: str | None = None
    tail: bool = False


def walk(message: MessageNode, base: int = HEADER_BYTES, prefix: str = '') -> list[LayoutField]:
    """
    List the fields of a message in the order of their bytes.

    :param base: of the message, from the first byte of the data.
    """
    result: list[LayoutField] = []
    for node in message.fields:
        _walk_node(node, base, prefix + node.name, result)
    return result


def _walk_node(node: Node, base: int, name: str, result: list[LayoutField]) -> None:
    if isinstance(node, ScalarNode):
        primitive = node.primitive
        result.append(LayoutField(name, primitive.name, base + node.offset, 1, primitive.size))
    elif isinstance(node, StringNode):
        size = len(node.raw) - 4
        result.append(LayoutField(name, 'string', base + node.offset + 4, size - 1, size,
                                  base + node.offset, node.text))
    elif isinstance(node, NumbersNode):
        primitive = node.primitive
        result.append(LayoutField(name, primitive.name, base + node.offset, node.count,
                                  node.count * primitive.size, _shifted(node.count_offset, base)))
    elif isinstance(node, TailNode):
        kind, size, extra = 'string', 1, 1
        if node.primitive is not None:
            kind, size, extra = node.primitive.name, node.primitive.size, 0
        result.append(LayoutField(name, kind, base + node.offset, node.maximum,
                                  node.maximum * size + extra, base + node.count_offset,
                                  tail=True))
    elif isinstance(node, MemberNode):
        result.extend(walk(node.message, base + node.base, f'{name}.'))
    else:
        _walk_items(node, base, name, result)


def _walk_items(node: StringsNode | MembersNode, base: int, name: str,
                result: list[LayoutField]) -> None:
    if node.count_offset is not None:
        kind = node.type_name if isinstance(node, MembersNode) else 'string'
        result.append(LayoutField(name, kind, base + node.count_offset + 4, len(node.items), 0,
                                  base + node.count_offset))
    items: tuple[Node, ...] = node.items
    for index, item in enumerate(items):
        _walk_node(item, base, f'{name}[{index}]', result)


def write(message: MessageNode, target: bytearray, base: int = HEADER_BYTES) -> None:
    """Write counts, fixed strings and initial values into zeroed bytes."""
    for node in message.fields:
        _write_node(node, target, base)


def _write_node(node: Node, target: bytearray, base: int) -> None:
    if isinstance(node, ScalarNode | StringNode):
        _put(target, base + node.offset, node.raw)
    elif isinstance(node, MemberNode):
        write(node.message, target, base + node.base)
    elif isinstance(node, NumbersNode):
        _put_count(target, base, node.count_offset, node.count)
        _put(target, base + node.offset, node.raw)
    elif isinstance(node, TailNode):
        if node.primitive is None:  # an empty string has its NUL
            _put_count(target, base, node.count_offset, 1)
    else:
        _put_count(target, base, node.count_offset, len(node.items))
        for item in node.items:
            _write_node(item, target, base)


def _put_count(target: bytearray, base: int, offset: int | None, count: int) -> None:
    if offset is not None:
        _put(target, base + offset, count.to_bytes(4, 'little'))


def _put(target: bytearray, start: int, raw: bytes) -> None:
    target[start:start + len(raw)] = raw


def _shifted(offset: int | None, base: int) -> int | None:
    return None if offset is None else base + offset
