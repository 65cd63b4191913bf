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
The fields of a ROS 2 interface, from the introspection of its Python class, without rclpy.

The message classes provide their fields (``get_fields_and_field_types``, ``SLOT_TYPES``) and the
values of a new message; nothing else is read, and no type support is loaded.
"""

from __future__ import annotations

from dataclasses import dataclass
from difflib import get_close_matches
from importlib import import_module
from keyword import iskeyword
import re
from typing import Any

from rt_robot_os.base.errors import LayoutError
from rt_robot_os.topics._cdr import Primitive
from rt_robot_os.topics._cdr import PRIMITIVES

_TYPE_NAME = re.compile(r'([a-z][a-z0-9_]*)/(?:msg/)?([A-Za-z][A-Za-z0-9]*)')


@dataclass(frozen=True, eq=False)
class FieldSpec:
    """
    One field of an interface.

    :ivar container: ``''``, ``'array'`` or ``'sequence'``.
    :ivar limit: length of an array, bound of a sequence, None for no bound.
    :ivar item: its element: a primitive, a message, or None for strings.
    :ivar text_limit: bound of the strings in bytes, None for no bound.
    :ivar default: the value in a new message.
    """

    name: str
    type_name: str
    container: str
    limit: int | None
    item: Primitive | MessageSpec | None
    text_limit: int | None
    default: Any


@dataclass(frozen=True, eq=False)
class MessageSpec:
    """
    One interface.

    :ivar type_name: such as ``sensor_msgs/msg/Imu``.
    """

    type_name: str
    fields: tuple[FieldSpec, ...]


def resolve(message: Any) -> MessageSpec:
    """
    Find an interface and read its fields.

    :param message: ``'sensor_msgs/Imu'``, ``'sensor_msgs/msg/Imu'`` or the message class.
    :raises LayoutError: it does not exist, or has an unsupported field.
    """
    cls = message_class(message) if isinstance(message, str) else message
    if not hasattr(cls, 'get_fields_and_field_types') or not hasattr(cls, 'SLOT_TYPES'):
        raise LayoutError(f'{cls!r} is not a ROS 2 message type; give a name such as '
                          "'sensor_msgs/msg/Imu' or the class")
    return _read(cls if isinstance(cls, type) else type(cls), {})


def message_class(name: str) -> Any:
    """
    Find the Python class of a message type; not for the real-time loop.

    :param name: ``'sensor_msgs/Imu'`` or ``'sensor_msgs/msg/Imu'``.
    :raises LayoutError: it does not exist.
    """
    match = _TYPE_NAME.fullmatch(name)
    if match is None:
        raise LayoutError(f'message type {name!r}: write it as package/msg/Type, '
                          "such as 'sensor_msgs/msg/Imu'")
    package, short = match.groups()
    try:
        module = import_module(f'{package}.msg')
    except ImportError as error:
        raise LayoutError(f'message type {name!r}: cannot import {package}.msg ({error}); install '
                          f'the ROS 2 package {package!r}, or source the workspace that has '
                          'it') from error
    cls = getattr(module, short, None)
    if cls is None:
        known = [key for key, value in vars(module).items() if hasattr(value, 'SLOT_TYPES')]
        close = get_close_matches(short, known, 3, 0.5) or sorted(known)
        raise LayoutError(f'message type {name!r}: package {package!r} has no message {short!r}; '
                          f'it has {", ".join(close)}')
    return cls


def _read(cls: Any, known: dict[Any, MessageSpec]) -> MessageSpec:
    if cls in known:
        return known[cls]
    parts = cls.__module__.split('.')
    type_name = '/'.join((*parts[:2], cls.__name__))
    fresh = cls()
    fields = tuple(
        _read_field(type_name, name, slot_type, getattr(fresh, name), known)
        for name, slot_type in zip(cls.get_fields_and_field_types(), cls.SLOT_TYPES, strict=True))
    spec = known[cls] = MessageSpec(type_name, fields)
    return spec


def _read_field(owner: str, name: str, slot_type: Any, default: Any,
                known: dict[Any, MessageSpec]) -> FieldSpec:
    if not name.isidentifier() or iskeyword(name) or name.startswith('_'):
        raise LayoutError(f'{owner}: field {name!r} cannot be an attribute in Python; rename it '
                          'in the interface')
    # By class name, so that the parser's package need not be importable.
    kind, container, limit = type(slot_type).__name__, '', None
    if kind == 'Array':
        container, limit = 'array', slot_type.size
    elif kind.endswith('Sequence'):
        container, limit = 'sequence', getattr(slot_type, 'maximum_size', None)
    element = slot_type.value_type if container else slot_type
    kind = type(element).__name__
    if kind == 'NamespacedType':
        message = _read(_class_of(owner, name, element), known)
        return FieldSpec(name, message.type_name, container, limit, message, None, default)
    if kind in ('UnboundedString', 'BoundedString'):
        bound = getattr(element, 'maximum_size', None)
        return FieldSpec(name, 'string', container, limit, None, bound, default)
    type_name = getattr(element, 'typename', 'wstring')
    if type_name not in PRIMITIVES:
        raise LayoutError(f'{owner}: field {name!r} is a {type_name}, which slots do not hold; '
                          'use string, or a number type, in the interface')
    return FieldSpec(name, type_name, container, limit, PRIMITIVES[type_name], None, default)


def _class_of(owner: str, name: str, element: Any) -> Any:
    module = '.'.join(element.namespaces)
    try:
        return getattr(import_module(module), element.name)
    except (ImportError, AttributeError) as error:
        raise LayoutError(f'{owner}: field {name!r} is a {module}.{element.name}, which cannot be '
                          f'imported ({error}); install the ROS 2 package '
                          f'{element.namespaces[0]!r}') from error
