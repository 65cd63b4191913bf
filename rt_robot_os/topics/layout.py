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
Layouts: ROS 2 messages of a fixed shape as bytes that need no conversion.

A slot of a topic holds a message in the wire format of ROS 2, so the ROS node publishes it, and
the recorder writes it, unmodified. Real-time tasks read and write its numbers in place.
"""

from __future__ import annotations

from collections.abc import Mapping
import struct
from typing import Any
from typing import Final

import numpy as np

from rt_robot_os.base.errors import LayoutError
from rt_robot_os.topics._cdr import ENCAPSULATION
from rt_robot_os.topics._cdr import HEADER_BYTES
from rt_robot_os.topics._cdr import PRIMITIVES
from rt_robot_os.topics._cdr import require_little_endian
from rt_robot_os.topics._check import Checker
from rt_robot_os.topics._compile import compile_message
from rt_robot_os.topics._nodes import LayoutField
from rt_robot_os.topics._nodes import MessageNode
from rt_robot_os.topics._nodes import walk
from rt_robot_os.topics._nodes import write
from rt_robot_os.topics._packer import Packer
from rt_robot_os.topics._shape import brief
from rt_robot_os.topics._view import assign
from rt_robot_os.topics._view import to_plain
from rt_robot_os.topics._view import View
from rt_robot_os.topics._view_class import ViewFactory
from rt_robot_os.topics.resolve import resolve

__all__ = ['Layout', 'LayoutField', 'Packer']

_STAMPED: Final = ('std_msgs/msg/Header', 'builtin_interfaces/msg/Time')
_COUNT: Final = struct.Struct('<I')


class Layout:
    """
    A message type with a fixed shape; made by :meth:`compile`.

    The bytes are XCDR1, little-endian. They equal those of
    ``rclpy.serialization.serialize_message`` in every significant byte; padding, which CDR leaves
    undefined, is zero. The length is the exact one, which rmw_fastrtps sends. The result of
    ``serialize_message`` may be longer: it has the length that rmw_fastrtps estimates, which is
    rounded up to a multiple of 4 for types without strings and sequences, and includes alignment
    that is never written for empty sequences of 8-byte numbers. ``deserialize_message`` and
    ``publish`` of raw bytes accept both.

    All offsets are in bytes from the first byte of the data, encapsulation included.

    :ivar type_name: such as ``sensor_msgs/msg/Imu``.
    :ivar size: bytes of the message; of that with an empty tail, when it has one.
    :ivar max_size: bytes of the longest message; ``size`` when it has no tail.
    :ivar tail: name of the variable last field, or None.
    :ivar tail_offset: of its first element, or None.
    :ivar tail_item_size: bytes of an element; 1 for text; 0 without a tail.
    :ivar tail_maximum: its maximum number of elements, or bytes of text.
    :ivar stamp_offset: of a leading ``header.stamp`` (or a first field of type Time), two 32 bit
        numbers ``sec`` and ``nanosec``; None when the message does not begin with one.
    :ivar prototype: the ``size`` bytes of a message as declared.
    """

    __slots__ = ('type_name', 'size', 'max_size', 'tail', 'tail_offset', 'tail_item_size',
                 'tail_maximum', 'stamp_offset', 'prototype', '_message', '_fields', '_checker',
                 '_factory', '_tail_start', '_tail_count_offset', '_tail_count_maximum')

    def __init__(self, message: MessageNode) -> None:
        self._message = message
        self._fields = tuple(walk(message))
        self._factory = ViewFactory()
        self.type_name = message.spec.type_name
        self.size = self.max_size = HEADER_BYTES + message.end
        self.tail: str | None = None
        self.tail_offset: int | None = None
        self.tail_item_size = self.tail_maximum = self._tail_count_offset = self._tail_start = 0
        self._tail_count_maximum = -1
        if self._fields and self._fields[-1].tail:
            self._set_tail(self._fields[-1])
        first = message.spec.fields[0] if message.spec.fields else None
        stamped = first is not None and not first.container and (
            first.type_name in _STAMPED)
        self.stamp_offset = HEADER_BYTES if stamped else None
        prototype = bytearray(self.size)
        prototype[:HEADER_BYTES] = ENCAPSULATION
        write(message, prototype)
        self.prototype = bytes(prototype)
        self._checker = Checker(self.type_name, self.size, self.prototype, self._fields)

    def _set_tail(self, tail: LayoutField) -> None:
        text = tail.type_name == 'string'
        self.tail, self.tail_offset, self.tail_maximum = tail.name, tail.offset, tail.count
        self.tail_item_size = 1 if text else PRIMITIVES[tail.type_name].size
        self._tail_start = tail.offset
        self._tail_count_offset = tail.offset if tail.count_offset is None else tail.count_offset
        self._tail_count_maximum = tail.count + text  # for a string including its NUL
        if tail.count:
            self.max_size = tail.offset + tail.nbytes

    @classmethod
    def compile(cls, message: Any,  # noqa: A003
                shape: Mapping[str, Any] | None = None, *, tail: int | None = None) -> Layout:
        """
        Lay out a message type; not for the real-time loop.

        :param message: ``'sensor_msgs/Imu'``, ``'sensor_msgs/msg/Imu'`` or the message class.
        :param shape: the fixed values, by field: the value of a string, the length of a sequence,
            or the list of its elements (for a sequence of messages: their shapes). Fields of
            nested messages are written ``'header.frame_id'`` or as nested mappings. A number, or a
            list of them, is an initial value. Other fields are as in a new ROS message: strings
            and sequences empty, numbers 0 or their default.
        :param tail: the last field, a string or a sequence of numbers, has a variable length up to
            this many bytes or elements.
        :raises LayoutError: the type, the field, the value and the remedy.
        """
        require_little_endian()
        return cls(compile_message(resolve(message), shape, tail))

    def new_buffer(self) -> memoryview:
        """
        Make a buffer for the longest message that holds :attr:`prototype`; writable.

        The address of the first byte after the encapsulation is a multiple of 8, so that NumPy
        arrays in the buffer are aligned.
        """
        room = np.zeros(self.max_size + 16, np.uint8)
        start = -(room.ctypes.data + HEADER_BYTES) % 8
        buffer = memoryview(room)[start:start + self.max_size]
        buffer[:self.size] = self.prototype
        return buffer

    def view(self, buffer: Any) -> Any:
        """
        Bind the names of the fields to a buffer; not for the real-time loop.

        Numbers and nested messages are read and assigned with the names of the ROS message. Arrays
        and sequences of numbers are NumPy arrays in the buffer (booleans ``bool``, octets
        ``uint8``), sequences of messages are indexed. Strings are those of the declaration. One
        view serves all messages in its buffer; using it is safe in the loop.

        :param buffer: at least :attr:`size` bytes; the tail uses the rest. Untrusted bytes must
            pass :meth:`check` first. A read-only buffer results in a read-only view.
        :raises LayoutError: the buffer is too short.
        """
        data = memoryview(buffer).cast('B')
        if len(data) < self.size:
            raise LayoutError(f'{self.type_name}: a buffer of {len(data)} bytes is too short for '
                              f'a view; it takes {self.size} (Layout.new_buffer() gives one)')
        return self._factory.bind(self._message, data[HEADER_BYTES:self.max_size])

    def packer(self, *field_names: str) -> Packer:
        """
        Make an object that writes and reads several fields at once; not for the real-time loop.

        :param field_names: numbers, arrays, or whole nested messages without their strings.
        :raises LayoutError: a field does not exist or has no numbers.
        """
        return Packer(self.type_name, self._fields, field_names)

    def check(self, data: Any) -> str | None:
        """
        Validate untrusted CDR, for instance from a raw ROS 2 subscription.

        Padding may have any value, and may follow the message.

        :param data: bytes, encapsulation included.
        :return: why they do not match this layout, or None when they do.
        """
        return self._checker.problem(memoryview(data).cast('B'))

    def length(self, data: Any) -> int:
        """
        Return the length of a message, by the count of its tail; safe in the real-time loop.

        :param data: a message of this layout; untrusted bytes must pass :meth:`check`.
        :raises LayoutError: the count exceeds the maximum of the layout.
        """
        if self._tail_count_maximum < 0:
            return self.size
        count: int = _COUNT.unpack_from(data, self._tail_count_offset)[0]
        if count > self._tail_count_maximum:
            raise LayoutError(f'{self.type_name}.{self.tail} has a count of {count}, above its '
                              f'declared tail of {self.tail_maximum}; check() such bytes')
        return self._tail_start + count * self.tail_item_size if count else self.size

    def set_tail_bytes(self, buffer: Any, length: int) -> None:
        """
        Set the number of used bytes of a buffer's tail; does nothing for a layout without one.

        :param length: bytes of whole elements, at most the size of the tail.
        """
        if self.tail is not None and self.tail_item_size:
            _COUNT.pack_into(buffer, self._tail_count_offset, length // self.tail_item_size)

    @property
    def length_rule(self) -> tuple[int, int, int, int, int, int]:
        """
        Return the numbers that :meth:`length` uses.

        :return: ``size``, ``max_size``; offset of the count of the tail, the maximum count, or -1
            without a tail; offset of the first element, bytes of each.
        """
        return (self.size, self.max_size, self._tail_count_offset, self._tail_count_maximum,
                self._tail_start, self.tail_item_size)

    @property
    def bulk(self) -> tuple[int, int, int]:
        """
        Return the position of the tail, or of the longest sequence or array of numbers.

        :return: offset, maximum bytes, bytes of an element; 0 bytes when there is none.
        """
        if self.tail is not None and self.tail_offset is not None and self.tail_maximum:
            if self._fields[-1].type_name == 'string':
                return self.tail_offset, 0, 1  # text ends with a NUL: assign it
            room = self.max_size - self.tail_offset
            return self.tail_offset, room - room % self.tail_item_size, self.tail_item_size
        longest = max((f for f in self._fields if f.type_name in PRIMITIVES),
                      key=lambda f: f.nbytes, default=None)
        if longest is None:
            return self.size, 0, 1
        return longest.offset, longest.nbytes, PRIMITIVES[longest.type_name].size

    def fields(self) -> tuple[LayoutField, ...]:
        """List all fields in the order of their bytes, for documentation and tools."""
        return self._fields

    def from_dict(self, values: Mapping[str, Any]) -> bytes:
        """
        Make a message from plain values; for tools, not for the real-time loop.

        :param values: nested mappings as returned by :meth:`to_dict`; missing fields are as
            declared.
        :raises LayoutError: a field is unknown, or its value is invalid.
        """
        if not isinstance(values, Mapping):
            raise LayoutError(f'{self.type_name} cannot be made from {brief(values)}; give a '
                              'mapping of field names to values')
        buffer = self.new_buffer()
        assign(self.view(buffer), values)
        return bytes(buffer[:self.length(buffer)])

    def to_dict(self, data: Any) -> dict[str, Any]:
        """
        Convert a message to plain Python values; for tools, not for the real-time loop.

        :param data: a message of this layout, or a view of one.
        :return: nested dictionaries and lists of numbers (octets are integers) and strings.
        """
        view = data if isinstance(data, View) else self.view(data)
        return to_plain(view)

    def __repr__(self) -> str:
        tail = f' + {self.tail}[:{self.tail_maximum}]' if self.tail is not None else ''
        return f'<Layout {self.type_name}, {self.size} bytes{tail}>'
