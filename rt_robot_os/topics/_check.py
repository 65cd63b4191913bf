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

"""Validate untrusted CDR bytes against a layout; never raises for their content."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from rt_robot_os.topics._cdr import ENCAPSULATION
from rt_robot_os.topics._cdr import HEADER_BYTES
from rt_robot_os.topics._cdr import PRIMITIVES
from rt_robot_os.topics._nodes import LayoutField
from rt_robot_os.topics._shape import brief

_OTHER_ENCODINGS: Final = {
    0: 'big-endian CDR', 2: 'a big-endian parameter list', 3: 'a parameter list',
    6: 'big-endian XCDR2', 7: 'XCDR2', 8: 'big-endian delimited XCDR2', 9: 'delimited XCDR2',
    10: 'a big-endian XCDR2 parameter list', 11: 'an XCDR2 parameter list',
}
# Some middlewares pad a message to a multiple of 4 bytes.
_PADDING_MAXIMUM: Final = 3
# rmw_fastrtps estimates the length of a message before it serialises it, and rclpy returns that
# many bytes. For an empty sequence of 8-byte numbers the estimate includes alignment that is not
# written: 4 bytes, which a later alignment may double. (For types without strings and sequences it
# is rounded up to a multiple of 4.)
_ESTIMATE_BYTES: Final = 8


class Checker:
    """The constraints of a layout on the bytes of a message."""

    __slots__ = ('_type_name', '_size', '_fixed', '_booleans', '_tail', '_surplus')

    def __init__(self, type_name: str, size: int, prototype: bytes,
                 fields: Sequence[LayoutField]) -> None:
        self._type_name = type_name
        self._size = size
        self._fixed = [
            (field.count_offset, _fixed_end(field), prototype[field.count_offset:
                                                              _fixed_end(field)], field)
            for field in fields if field.count_offset is not None and not field.tail]
        self._booleans = [(field.offset, field.offset + field.nbytes, field.name)
                          for field in fields if field.type_name == 'boolean' and not field.tail]
        tails = [field for field in fields if field.tail]
        self._tail = tails[0] if tails else None
        empty = sum(1 for field in fields if field.type_name in PRIMITIVES
                    and PRIMITIVES[field.type_name].size == 8
                    and (field.tail or field.nbytes == 0))
        self._surplus = _PADDING_MAXIMUM + _ESTIMATE_BYTES * empty

    def problem(self, data: memoryview) -> str | None:
        """
        Return why bytes do not match the layout.

        :param data: of format ``B``, encapsulation included.
        :return: None when they match.
        """
        problem = self._wrong_encoding(data)
        if problem is None:
            for start, end, expected, field in self._fixed:
                if data[start:end] != expected:
                    problem = _describe(data, start, end, field)
                    break
            else:
                problem = self._wrong_length(data)
        if problem is None:
            for start, end, name in self._booleans:
                if max(data[start:end], default=0) > 1:
                    problem = f'field {name!r} is a boolean and has a byte other than 0 and 1'
                    break
        return None if problem is None else f'{self._type_name}: {problem}'

    def _wrong_encoding(self, data: memoryview) -> str | None:
        if len(data) < HEADER_BYTES:
            return f'{len(data)} bytes are not CDR: too short for the 4 of the encapsulation'
        if data[:2] == ENCAPSULATION[:2]:
            return None
        found = _OTHER_ENCODINGS.get(data[0] << 8 | data[1], 'of no known encoding')
        remedy = 'the sender has to use little-endian CDR (XCDR1)'
        return f'the encapsulation {bytes(data[:HEADER_BYTES]).hex(" ")} is {found}; {remedy}'

    def _wrong_length(self, data: memoryview) -> str | None:
        end, tail = self._size, self._tail
        if tail is not None and tail.type_name == 'string' and (
                len(data) >= tail.offset and _count(data, tail) == 0):
            return f'field {tail.name!r} has length 0; in CDR the length counts the NUL'
        if len(data) < self._size:
            return f'{len(data)} bytes are too short: this layout has {self._size}'
        if tail is not None:
            count = _tail_count(data, tail)
            if count > tail.count:
                return (f'field {tail.name!r} has {count} elements; the tail of this layout '
                        f'holds at most {tail.count}: declare it longer')
            end = _tail_end(data, tail, self._size)
            if end > len(data):
                return f'{len(data)} bytes end within field {tail.name!r}, which goes to {end}'
            if tail.type_name == 'string' and data[end - 1]:
                return f'field {tail.name!r} is not terminated by a NUL'
            if tail.type_name == 'boolean' and max(data[tail.offset:end], default=0) > 1:
                return f'field {tail.name!r} has a boolean other than 0 and 1'
        if len(data) > end + self._surplus:
            return (f'{len(data)} bytes are too long: this message has {end}, and up to '
                    f'{self._surplus} of padding')
        return None


def _tail_count(data: memoryview, tail: LayoutField) -> int:
    """Return the number of elements, or bytes of text, of a tail."""
    return _count(data, tail) - (tail.type_name == 'string')


def _tail_end(data: memoryview, tail: LayoutField, size: int) -> int:
    """
    Return the end of a message with a tail.

    :param size: of the message with an empty tail.
    """
    raw = _count(data, tail)
    if tail.type_name == 'string':
        return tail.offset + raw
    return tail.offset + raw * PRIMITIVES[tail.type_name].size if raw else size


def _count(data: memoryview, tail: LayoutField) -> int:
    start = tail.offset if tail.count_offset is None else tail.count_offset
    return int.from_bytes(data[start:start + 4], 'little')


def _fixed_end(field: LayoutField) -> int:
    if field.fixed is not None:
        return field.offset + field.nbytes
    return field.offset if field.count_offset is None else field.count_offset + 4


def _describe(data: memoryview, start: int, end: int, field: LayoutField) -> str:
    if len(data) < start + 4:
        return f'{len(data)} bytes end before field {field.name!r}'
    count = int.from_bytes(data[start:start + 4], 'little')
    if field.fixed is None:
        return (f'field {field.name!r} has {count} elements where this layout has {field.count}; '
                f'declare it with {count}, or send {field.count}')
    text = bytes(data[start + 4:start + 4 + min(count, 200)]).partition(b'\0')[0]
    found = text.decode('utf-8', 'replace')
    if found == field.fixed:
        return (f'field {field.name!r} is truncated, or not terminated by one NUL: {len(data)} '
                'bytes')
    return (f'field {field.name!r} is {brief(found)} where this layout has '
            f'{brief(field.fixed)}; declare it with the other string, or send this one')
