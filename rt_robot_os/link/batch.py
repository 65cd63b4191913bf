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
Samples on their way to one client, combined into one packet.

Sending a packet costs more than filling it, above all when it wakes the client: about 15 us in a
virtual machine, for an interrupt of another processor.
"""

from __future__ import annotations

import socket

from rt_robot_os.link.protocol import HEADER
from rt_robot_os.link.protocol import HEADER_BYTES
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.link.protocol import RECORD
from rt_robot_os.link.protocol import RECORD_HEAD
from rt_robot_os.link.protocol import SAMPLE_BYTES_MAXIMUM
from rt_robot_os.link.protocol import VERSION

# No task can start during a system call, so the packet is kept short.
BATCH_BYTES = 16 * 1024
_HEAD_BYTES = RECORD_HEAD.size
_FIRST = HEADER_BYTES + _HEAD_BYTES
_ALONE = HEADER_BYTES + RECORD.size
# struct packs an int faster than a member of an Enum.
_DATA, _BATCH = int(PacketKind.DATA), int(PacketKind.BATCH)


class Batch:
    """
    The next packet to a client; filled and sent by the link's task alone.

    A packet that the client's full socket refuses is kept: its samples are not lost, and no other
    sample is accepted until it is sent.

    :param connection: to the client, not blocking.
    """

    __slots__ = ('_send', '_buffer', '_view', '_end', '_count')

    def __init__(self, connection: socket.socket) -> None:
        self._send = connection.send
        self._buffer = bytearray(_FIRST + SAMPLE_BYTES_MAXIMUM)
        self._view = memoryview(self._buffer)
        self._end = HEADER_BYTES
        self._count = 0

    def reserve(self, length: int) -> memoryview | None:
        """
        Return space for a sample; sends the packet first if it would get too long.

        :param length: bytes of the sample at most.
        :return: where to write it; None when the client's socket is full.
        :raises OSError: the connection is closed.
        """
        start = self._end + _HEAD_BYTES
        end = start + length
        if end > BATCH_BYTES and self._count:
            if not self.send():
                return None
            start, end = _FIRST, _FIRST + length
        return self._view[start:end]

    def add(self, channel: int, missed: int, stamp_ns: int, seq: int, length: int) -> None:
        """Add the sample that was written to :meth:`reserve`, with its length."""
        at = self._end
        RECORD_HEAD.pack_into(self._buffer, at, HEADER_BYTES + length, _DATA, VERSION, channel,
                              missed & 0xFFFFFFFF, stamp_ns, seq)
        end = at + _HEAD_BYTES + length
        self._end = end + -end % 8
        self._count += 1

    def send(self) -> bool:
        """
        Send the packet; never waits.

        :return: whether nothing is left.
        :raises OSError: the connection is closed.
        """
        count = self._count
        if not count:
            return True
        try:
            if count == 1:
                (length,) = RECORD.unpack_from(self._buffer, HEADER_BYTES)
                self._send(self._view[_ALONE:_ALONE + length])
            else:
                HEADER.pack_into(self._buffer, 0, _BATCH, VERSION, 0, 0, 0, count)
                self._send(self._view[:self._end])
        except BlockingIOError:
            return False
        self._end = HEADER_BYTES
        self._count = 0
        return True
