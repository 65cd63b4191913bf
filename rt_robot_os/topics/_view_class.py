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
Generate the class of a message view, as :mod:`dataclasses` does, and bind it to a buffer.

A number is read and written through a :class:`memoryview` cast to its type, by an index that is a
constant in the code: the fastest access in CPython, including the range check. A nested
message whose leaves are all numbers is assigned by one statement in its owner.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any
from typing import cast
from typing import Final

import numpy as np

from rt_robot_os.topics import _nodes as nodes
from rt_robot_os.topics import _set
from rt_robot_os.topics import _view
from rt_robot_os.topics._cdr import Primitive

Leaves = tuple[tuple[str, int], ...]

# Above this the generated statement would be too long.
_UNROLL_MAXIMUM: Final = 32

_NAMESPACE: Final = {
    '_property': property, '_iter': iter, '_View': _view.View, '_assign': _view.assign,
    '_ERRORS': _set.ERRORS, '_set_scalar': _set.set_scalar,
    '_set_numbers': _set.set_numbers, '_set_tail': _set.set_tail, '_refuse_text': _set.refuse_text,
    '_get_text': _set.get_text_tail, '_set_text': _set.set_text_tail,
}


class ViewFactory:
    """The generated classes of one layout; equal messages share one."""

    def __init__(self) -> None:
        self._classes: dict[Any, type[_view.View]] = {}

    def bind(self, message: nodes.MessageNode, payload: memoryview, base: int = 0) -> _view.View:
        """
        Make a view of a message; not for the real-time loop.

        :param payload: the bytes after the encapsulation, of format ``B``.
        :param base: of the message in the payload.
        """
        view = self._class(message)()
        for code, size in _codes(message).items():
            part = payload[base:base + message.end]
            part = part[:part.nbytes // size * size]
            setattr(view, f'_m_{code_name(code)}', part.cast(cast(Any, code)))
        for node in message.fields:
            if not isinstance(node, nodes.ScalarNode):
                setattr(view, f'_f_{node.name}', self._bind_node(message, node, payload, base))
        return view

    def _bind_node(self, owner: nodes.MessageNode, node: nodes.Node, payload: memoryview,
                   base: int) -> Any:
        if isinstance(node, nodes.MemberNode):
            return self.bind(node.message, payload, base + node.base)
        if isinstance(node, nodes.MembersNode):
            views = [self.bind(item.message, payload, base + item.base) for item in node.items]
            return _labelled(_view.ViewList(views), owner, node)
        if isinstance(node, nodes.NumbersNode):
            return _numbers(payload, base + node.offset, node.count, node.primitive)
        if isinstance(node, nodes.StringsNode):
            return _labelled(_view.FixedTexts([item.text for item in node.items]), owner, node)
        if isinstance(node, nodes.TailNode):
            start = base + node.offset
            if node.primitive is None:
                return payload[start:start + node.maximum + 1]
            room = max(0, payload.nbytes - start) // node.primitive.size
            return _numbers(payload, start, min(room, node.maximum), node.primitive)
        return node.text if isinstance(node, nodes.StringNode) else None

    def _class(self, message: nodes.MessageNode) -> type[_view.View]:
        key = (message.spec, tuple(_field_key(node) for node in message.fields))
        found = self._classes.get(key)
        if found is None:
            found = self._classes[key] = _generate(message)
        return found


def _labelled(items: _view.Items, owner: nodes.MessageNode, node: nodes.Node) -> _view.Items:
    items.label = f'{owner.spec.type_name}.{node.name}'
    return items


def _numbers(payload: memoryview, start: int, count: int,
             primitive: Primitive) -> np.ndarray[Any, Any]:
    if count == 0:  # may be beyond the end
        return np.empty(0, primitive.dtype)
    return np.frombuffer(payload, primitive.dtype, count, start)


def code_name(code: str) -> str:
    """Return a :mod:`struct` code as part of an identifier."""
    return 'bool' if code == '?' else code


def _leaves(message: nodes.MessageNode, base: int = 0) -> Iterator[tuple[str, int] | None]:
    """Yield type and index of each number of a message; None for any other field."""
    for node in message.fields:
        if isinstance(node, nodes.ScalarNode):
            yield node.primitive.code, (base + node.offset) // node.primitive.size
        elif isinstance(node, nodes.MemberNode):
            yield from _leaves(node.message, base + node.base)
        else:
            yield None


def _all_numbers(message: nodes.MessageNode, base: int = 0) -> Leaves:
    """Return the numbers of a message that has only numbers and not too many, or nothing."""
    found: list[tuple[str, int]] = []
    for leaf in _leaves(message, base):
        if leaf is None or len(found) == _UNROLL_MAXIMUM:
            return ()
        found.append(leaf)
    return tuple(found)


def _field_key(node: nodes.Node) -> Any:
    """Return a key of everything but the interface that determines the generated code."""
    if isinstance(node, nodes.ScalarNode):
        return node.offset
    if isinstance(node, nodes.MemberNode):
        return _all_numbers(node.message, node.base)
    return node.count_offset if isinstance(node, nodes.TailNode) else None


def _codes(message: nodes.MessageNode) -> dict[str, int]:
    """Return the casts that a view needs, and the sizes of their items."""
    result: dict[str, int] = {}

    def collect(part: nodes.MessageNode) -> None:
        for node in part.fields:
            if isinstance(node, nodes.ScalarNode):
                result[node.primitive.code] = node.primitive.size
            elif isinstance(node, nodes.MemberNode) and _all_numbers(node.message):
                collect(node.message)
            elif isinstance(node, nodes.TailNode):
                result['I'] = 4

    collect(message)
    return result


def _generate(message: nodes.MessageNode) -> type[_view.View]:
    spec = message.spec
    slots = [f'_m_{code_name(code)}' for code in _codes(message)]
    slots += [f'_f_{node.name}' for node in message.fields
              if not isinstance(node, nodes.ScalarNode)]
    lines = ['class _Class(_View):', f'    __slots__ = {tuple(slots)!r}']
    for node in message.fields:
        lines += _source(message, node)
    leaves = _all_numbers(message)
    if leaves:
        lines += ['    def __iter__(self):', *_locals(leaves),
                  f'        return _iter(({_targets(leaves)}))']
    namespace: dict[str, Any] = dict(_NAMESPACE)
    exec('\n'.join(lines), namespace)
    result = cast('type[_view.View]', namespace['_Class'])
    # Python's own error for assigning an unknown attribute shows this name.
    result.__name__ = result.__qualname__ = spec.type_name
    result.__module__ = _view.__name__
    result._type_name = spec.type_name
    result._fields = tuple(node.name for node in message.fields)
    result._types = {field.name: field.type_name for field in spec.fields}
    return result


def _source(message: nodes.MessageNode, node: nodes.Node) -> list[str]:
    name = node.name
    attribute = f'self._f_{name}'
    read = attribute
    if isinstance(node, nodes.ScalarNode):
        index = node.offset // node.primitive.size
        read = f'self._m_{code_name(node.primitive.code)}[{index}]'
        target, _, _ = read.rpartition('[')
        write = ['try:', f'    {read} = value', 'except _ERRORS as error:',
                 f'    _set_scalar(self, {name!r}, {target}, {index}, value, error)']
    elif isinstance(node, nodes.MemberNode):
        leaves = _all_numbers(node.message, node.base)
        write = [f'_assign({attribute}, value)']
        if leaves:
            write = ['try:', *(line[4:] for line in _locals(leaves)),
                     f'    {_targets(leaves)} = value', 'except _ERRORS:', f'    {write[0]}']
    elif isinstance(node, nodes.StringNode):
        label = f'{message.spec.type_name}.{name}'
        write = [f'if value != {attribute}:', f'    _refuse_text({label!r}, {attribute}, value)']
    elif isinstance(node, nodes.NumbersNode):
        write = [f'_set_numbers(self, {name!r}, {attribute}, value)']
    elif isinstance(node, nodes.TailNode):
        count = f'self._m_I[{node.count_offset // 4}]'
        text = node.primitive is None
        read = f'_get_text({attribute}, {count})' if text else f'{attribute}[:{count}]'
        write = [f'{count} = _set_{"text" if text else "tail"}(self, {name!r}, {attribute}, '
                 'value)']
    else:
        write = [f'{attribute}[:] = value']
    return [f'    def _get_{name}(self):', f'        return {read}',
            f'    def _set_{name}(self, value):', *(f'        {line}' for line in write),
            f'    {name} = _property(_get_{name}, _set_{name})']


def _locals(leaves: Leaves) -> list[str]:
    return [f'        {code_name(code)} = self._m_{code_name(code)}'
            for code in dict(leaves)]


def _targets(leaves: Leaves) -> str:
    return ''.join(f'{code_name(code)}[{index}], ' for code, index in leaves)
