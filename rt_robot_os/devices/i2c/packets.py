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
Transactions of an I2C bus as packets of a Unix socket.

A request is ``version address size number data``: the bytes to write, then ``size`` bytes to read.
The answer is ``number errno data``: 0 and the bytes read, or the error of Linux with an
explanation. ``NO_BUS`` instead of an errno: the bus itself cannot be opened, and the data is the
complete error message.
"""

from __future__ import annotations

import struct
from typing import Final

VERSION: Final = 2
MAXIMUM: Final = 4096
NO_BUS: Final = 0xFFFF

_REQUEST: Final = struct.Struct('<BBHH')
_ANSWER: Final = struct.Struct('<HH')


def request(number: int, address: int, data: bytes, size: int) -> bytes:
    """Make a request."""
    return _REQUEST.pack(VERSION, address, size, number) + data


def parse_request(packet: bytes) -> tuple[int, int, bytes, int] | None:
    """
    Decode a request.

    :return: its number, address, bytes to write, number of bytes to read; None if it is not a
        request.
    """
    if len(packet) < _REQUEST.size:
        return None
    version, address, size, number = _REQUEST.unpack_from(packet)
    if version != VERSION or size > MAXIMUM - _ANSWER.size or address > 0x7F:
        return None
    return number, address, packet[_REQUEST.size:], size


def answer(number: int, code: int, data: bytes = b'') -> bytes:
    """
    Encode an answer.

    :param number: of the request.
    :param code: errno, 0 on success.
    """
    return _ANSWER.pack(number, code) + data[:MAXIMUM - _ANSWER.size]


def parse_answer(packet: bytes) -> tuple[int, int, bytes] | None:
    """
    Decode an answer.

    :return: number of the request, errno and the bytes read; None if it is not an answer.
    """
    if len(packet) < _ANSWER.size:
        return None
    number, code = _ANSWER.unpack_from(packet)
    return number, code, packet[_ANSWER.size:]
