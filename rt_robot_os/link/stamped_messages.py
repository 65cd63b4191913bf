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
Messages that ROS has with and without a header: add and remove the header as CDR bytes.

In the core a velocity command is a ``geometry_msgs/msg/Twist``: the ``frame_id`` of a header has
any length, and a topic of the core a fixed one. Nav2 and ros2_control may need a ``TwistStamped``.
"""

from __future__ import annotations

import struct
from typing import Final

from rt_robot_os.base.units import NS_PER_S

_DOUBLE: Final = 8
#: Bytes of the body by type; each of these types consists of doubles only.
STAMPED_BYTES: Final = {
    f'geometry_msgs/msg/{name}': doubles * _DOUBLE for name, doubles in (
        ('Accel', 6), ('Point', 3), ('Pose', 7), ('Quaternion', 4), ('Twist', 6), ('Vector3', 3),
        ('Wrench', 6))}
FRAME_ID_BYTES_MAXIMUM: Final = 255

_ENCAPSULATION: Final = 4
_HEADS: Final = {b'\x00\x00': struct.Struct('>iII'), b'\x00\x01': struct.Struct('<iII')}
_LITTLE_ENDIAN: Final = b'\x00\x01\x00\x00'


def stamped_type(message: str) -> str:
    """Return the name of the type with a header, such as ``geometry_msgs/msg/TwistStamped``."""
    return f'{message}Stamped'


def take_off(cdr: bytes, body_bytes: int) -> tuple[int, bytes]:
    """
    Split a message with a header.

    :param cdr: with its four bytes of encapsulation.
    :param body_bytes: of the message without it.
    :return: the stamp in nanoseconds, 0 when there is none; the message, as CDR.
    :raises ValueError: the bytes are not such a message.
    """
    head = _HEADS.get(bytes(cdr[:2]))
    if head is None:
        raise ValueError(f'the encapsulation {bytes(cdr[:2]).hex(" ")} is not that of plain CDR')
    at = _ENCAPSULATION + head.size
    if len(cdr) < at:
        raise ValueError(f'{len(cdr)} bytes are too few for a header')
    seconds, nanoseconds, length = head.unpack_from(cdr, _ENCAPSULATION)
    at += length
    at += -(at - _ENCAPSULATION) % _DOUBLE
    if len(cdr) < at + body_bytes:
        raise ValueError(f'{len(cdr)} bytes are too few for a frame_id of {length} and a message '
                         f'of {body_bytes}')
    return seconds * NS_PER_S + nanoseconds, bytes(cdr[:_ENCAPSULATION]) + bytes(
        cdr[at:at + body_bytes])


class HeaderWriter:
    """
    Add a header to outgoing messages.

    :param frame_id: of all messages.
    """

    def __init__(self, frame_id: str) -> None:
        text = frame_id.encode() + b'\0'
        pad = -(_HEADS[b'\x00\x01'].size + len(text)) % _DOUBLE
        self._head = _HEADS[b'\x00\x01']
        self._length = len(text)
        self._text = text + bytes(pad)

    def put_on(self, cdr: memoryview, stamp_ns: int) -> bytes:
        """
        Join header and message.

        :param cdr: the message, little-endian, with its encapsulation.
        :param stamp_ns: since 1970.
        """
        head = self._head.pack(*divmod(stamp_ns, NS_PER_S), self._length)
        return _LITTLE_ENDIAN + head + self._text + bytes(cdr[_ENCAPSULATION:])
