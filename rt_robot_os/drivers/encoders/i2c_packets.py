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
Transactions of an emulated I2C bus as packets of a Unix socket.

A request is ``version address size data``: the bytes to write, then ``size`` bytes to read. The
answer is ``errno data``: 0 and the bytes read, or the error that Linux would give.
"""

from __future__ import annotations

import struct
from typing import Final

VERSION: Final = 1
MAXIMUM: Final = 4096

_REQUEST: Final = struct.Struct('<BBH')
_ANSWER: Final = struct.Struct('<H')


def request(address: int, data: bytes, size: int) -> bytes:
    """Make a request."""
    return _REQUEST.pack(VERSION, address, size) + data


def parse_request(packet: bytes) -> tuple[int, bytes, int] | None:
    """
    Take a request apart.

    :return: address, bytes to write, number of bytes to read; None when it is no request.
    """
    if len(packet) < _REQUEST.size:
        return None
    version, address, size = _REQUEST.unpack_from(packet)
    if version != VERSION or size > MAXIMUM or address > 0x7F:
        return None
    return address, packet[_REQUEST.size:], size


def answer(number: int, data: bytes = b'') -> bytes:
    """
    Make an answer.

    :param number: errno, 0 when all went well.
    """
    return _ANSWER.pack(number) + data


def parse_answer(packet: bytes) -> tuple[int, bytes] | None:
    """
    Take an answer apart.

    :return: errno and the bytes read; None when it is no answer.
    """
    if len(packet) < _ANSWER.size:
        return None
    return _ANSWER.unpack_from(packet)[0], packet[_ANSWER.size:]
