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
CDR on the wire: encapsulation, alignment, primitive types.

This is XCDR1, little-endian: four bytes of encapsulation, then the fields in order, each primitive
aligned to its own size counted from the first byte after the encapsulation, never to more than 8.
"""

from __future__ import annotations

from dataclasses import dataclass
import struct
import sys
from types import MappingProxyType
from typing import Any
from typing import Final

from rt_robot_os.base.errors import LayoutError

HEADER_BYTES: Final = 4
ENCAPSULATION: Final = b'\x00\x01\x00\x00'
ALIGNMENT_MAXIMUM: Final = 8

# A larger slot is an error in the configuration (an 8K image is 100 MB).
BYTES_MAXIMUM: Final = 1 << 28
# Each message or string of a sequence needs objects in every view.
ELEMENTS_MAXIMUM: Final = 1 << 16


@dataclass(frozen=True)
class Primitive:
    """
    One primitive type.

    :ivar name: as ROS introspection spells it: ``double``, ``octet``.
    :ivar code: of :mod:`struct` and :class:`memoryview`, for one value.
    :ivar size: bytes, which is also its alignment.
    :ivar dtype: of NumPy, for arrays and sequences.
    :ivar wanted: description of valid values, for error messages.
    """

    name: str
    code: str
    size: int
    dtype: str
    wanted: str

    def pack(self, value: Any) -> bytes:
        """
        Encode a value of a shape.

        :raises ValueError: it is of the wrong type or out of range.
        """
        if self.code == 'c' and isinstance(value, int) and not isinstance(value, bool):
            value = bytes((value,))
        if isinstance(value, bool) != (self.code == '?'):
            raise ValueError(self.wanted)
        try:
            return struct.pack(f'<{self.code}', value)
        except (struct.error, OverflowError, TypeError) as error:
            raise ValueError(self.wanted) from error


def _integer(name: str, code: str, size: int) -> Primitive:
    bits = size * 8
    if code.isupper():
        kind, low, high = 'u', 0, (1 << bits) - 1
    else:
        kind, low, high = 'i', -(1 << bits - 1), (1 << bits - 1) - 1
    return Primitive(name, code, size, f'<{kind}{size}', f'an integer from {low} to {high}')


# ``char`` is an 8 bit character of IDL; a ``char`` of a .msg file arrives here as uint8.
PRIMITIVES: Final = MappingProxyType({primitive.name: primitive for primitive in (
    Primitive('boolean', '?', 1, '?', 'true or false'),
    Primitive('octet', 'c', 1, '<u1', 'one byte such as b"\\x01", or an integer up to 255'),
    Primitive('float', 'f', 4, '<f4', 'a number that fits 32 bit floating point'),
    Primitive('double', 'd', 8, '<f8', 'a number'),
    _integer('uint8', 'B', 1), _integer('int8', 'b', 1),
    _integer('uint16', 'H', 2), _integer('int16', 'h', 2),
    _integer('uint32', 'I', 4), _integer('int32', 'i', 4),
    _integer('uint64', 'Q', 8), _integer('int64', 'q', 8),
)})

COUNT: Final = PRIMITIVES['uint32']


def align(position: int, size: int) -> int:
    """
    Return the aligned position of a primitive.

    :param position: first free byte, counted from the end of the encapsulation.
    :param size: of the primitive: 1, 2, 4 or 8.
    :return: the first aligned position that is not below it.
    """
    return position + -position % size


def encode_string(text: str) -> bytes:
    """
    Encode a string with its terminating NUL, without the length before it.

    :raises ValueError: CDR and the C code of ROS 2 do not support it.
    """
    if '\0' in text:
        raise ValueError('a string without NUL characters')
    try:
        return text.encode() + b'\0'
    except UnicodeEncodeError as error:
        raise ValueError('a string that can be encoded as UTF-8') from error


def require_little_endian() -> None:
    """
    Reject hosts whose byte order is not that of the slots.

    :raises LayoutError: the host is big-endian.
    """
    if sys.byteorder != 'little':
        raise LayoutError(f'this host is {sys.byteorder}-endian: layouts hold little-endian CDR '
                          'in native views; run the core on a little-endian host (x86-64, ARM64)')
