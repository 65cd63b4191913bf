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

"""The few things that plain CDR consists of, for messages whose shape is not fixed."""

from __future__ import annotations

import struct
from typing import Final

from rt_robot_os.base.units import NS_PER_S

ENCAPSULATION: Final = 4
LITTLE_ENDIAN: Final = b'\x00\x01\x00\x00'

_COUNT: Final = struct.Struct('<I')
_TIME: Final = struct.Struct('<iI')
_DOUBLE: Final = 8


def padding(at: int, alignment: int) -> int:
    """Return how many bytes are missing to the next multiple, counted behind the encapsulation."""
    return -at % alignment


def text_bytes(text: str) -> bytes:
    """Write a text with its length, which counts the NUL."""
    octets = text.encode()
    return _COUNT.pack(len(octets) + 1) + octets + b'\0'


def string_message(text: str) -> bytes:
    """Write a ``std_msgs/msg/String``."""
    return LITTLE_ENDIAN + text_bytes(text)


def string_in(cdr: bytes | memoryview) -> str:
    """
    Read a ``std_msgs/msg/String``.

    :raises ValueError: it is none.
    """
    return CdrReader(bytes(cdr)).text()


class CdrReader:
    """
    Read fields one after the other.

    :param cdr: little-endian, with its encapsulation; may hold anything.
    :raises ValueError: here and below: they are no such message.
    :ivar cdr: the bytes.
    :ivar at: where the next field begins, in the bytes.
    """

    def __init__(self, cdr: bytes) -> None:
        if cdr[:2] != LITTLE_ENDIAN[:2] or len(cdr) < ENCAPSULATION:
            raise ValueError(f'the encapsulation {bytes(cdr[:4]).hex(" ")} is not that of '
                             'little-endian CDR')
        self.cdr = cdr
        self.at = ENCAPSULATION

    def skip(self, alignment: int, size: int) -> int:
        """
        Pass over a field.

        :return: where it begins.
        """
        start = self.at + padding(self.at - ENCAPSULATION, alignment)
        if start + size > len(self.cdr):
            raise ValueError(f'{len(self.cdr)} bytes end within the message')
        self.at = start + size
        return start

    def count(self) -> int:
        """Read a number of items, or of bytes."""
        count: int = _COUNT.unpack_from(self.cdr, self.skip(_COUNT.size, _COUNT.size))[0]
        return count

    def stamp_ns(self) -> int:
        """Read a ``builtin_interfaces/msg/Time``."""
        seconds, nanoseconds = _TIME.unpack_from(self.cdr, self.skip(_COUNT.size, _TIME.size))
        return int(seconds) * NS_PER_S + int(nanoseconds)

    def text(self) -> str:
        """Read a text."""
        length = self.count()
        start = self.skip(1, length)
        return self.cdr[start:start + max(0, length - 1)].decode(errors='replace')

    def doubles(self, count: int) -> tuple[float, ...]:
        """Read numbers."""
        if not count:
            return ()  # nothing is aligned for them
        start = self.skip(_DOUBLE, count * _DOUBLE)
        return struct.unpack_from(f'<{count}d', self.cdr, start)


def labelled_numbers(cdr: memoryview) -> tuple[str, tuple[float, ...]]:
    """
    Read a ``std_msgs/msg/Float64MultiArray``.

    :return: the label of the first dimension, and the numbers.
    :raises ValueError: it is none.
    """
    reader = CdrReader(bytes(cdr))
    label = ''
    for dimension in range(reader.count()):
        text = reader.text()
        label = label if dimension else text
        reader.skip(4, 8)
    reader.skip(4, 4)
    return label, reader.doubles(reader.count())
