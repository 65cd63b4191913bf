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
Base classes of messages with named fields that can be packed and unpacked.

A named tuple cannot have class constants besides its fields, so the fields are in a class of
their own, and the message inherits from both::

    class _SurgeFields(NamedTuple):
        message_type: int
        reading: int


    class SurgeMsg(Message, _SurgeFields):
        __slots__ = ()
        AM_TYPE = 17
        LAYOUT = Struct('<HH')
"""

from __future__ import annotations

from struct import Struct
from typing import Any
from typing import cast
from typing import ClassVar
from typing import TypeVar

_Self = TypeVar('_Self', bound='Message')


class Message:
    """
    A message whose fields are at the start of its bytes; further bytes are ignored.

    :cvar AM_TYPE: type of the active message; absent for a header of several types.
    :cvar LAYOUT: of the fields.
    """

    __slots__ = ()
    AM_TYPE: ClassVar[int]
    LAYOUT: ClassVar[Struct]

    def pack(self) -> bytes:
        """Return the bytes."""
        return self.LAYOUT.pack(*cast('tuple[int, ...]', self))

    @classmethod
    def unpack(cls: type[_Self], data: bytes) -> _Self:
        """
        Parse the bytes.

        :raises ValueError: there are too few.
        """
        make = cast(Any, cls)
        return cast(_Self, make(*_leading(cls, data)))


class Header(Message):
    """A message whose last field, ``data``, contains all bytes after the others."""

    __slots__ = ()

    def pack(self) -> bytes:
        """Return the bytes."""
        *fields, data = cast('tuple[Any, ...]', self)
        return self.LAYOUT.pack(*fields) + cast(bytes, data)

    @classmethod
    def unpack(cls: type[_Self], data: bytes) -> _Self:
        """
        Parse the bytes.

        :raises ValueError: there are too few.
        """
        make = cast(Any, cls)
        return cast(_Self, make(*_leading(cls, data), data[cls.LAYOUT.size:]))


def _leading(message: type[Message], data: bytes) -> tuple[int, ...]:
    layout = message.LAYOUT
    if len(data) < layout.size:
        raise ValueError(f'too short: {len(data)} bytes, {message.__name__} has {layout.size}')
    return layout.unpack_from(data)
