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
Send samples that are too long for a packet to one client, through a memory file.

The sample is copied from the topic into a free slot, in pieces of 64 KiB, and a small packet names
the slot. The client reads it in place and returns the slot. A client that returns no slot loses
samples, which are counted as ``full``; the core never waits.
"""

from __future__ import annotations

import socket
from typing import Any

from rt_robot_os.base.errors import LinkError
from rt_robot_os.link.mirror import Mirror
from rt_robot_os.link.mirror import Policy
from rt_robot_os.link.protocol import HEADER
from rt_robot_os.link.protocol import header
from rt_robot_os.link.protocol import HEADER_BYTES
from rt_robot_os.link.protocol import MEMORY
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.link.protocol import SLOT
from rt_robot_os.link.protocol import VERSION
from rt_robot_os.linux.memory_file import Loans
from rt_robot_os.linux.memory_file import MemoryFile
from rt_robot_os.linux.memory_file import send_with_fd
from rt_robot_os.linux.memory_file import slot_stride
from rt_robot_os.topics import Bus

# One with the client, one on its way, and two for a client that is late sometimes.
SLOTS = 4
CLIENT_MEMORY_MAXIMUM = 256 << 20


def memory_bytes(size: int) -> int:
    """Return how much memory the mirror of a topic needs for samples of a size."""
    return SLOTS * slot_stride(size)


class LargeMirror(Mirror):
    """
    One topic of large samples to one client; used by the link's task alone.

    :param arguments: as for :class:`Mirror`.
    :param number: of the memory among those of the client.
    :param connection: to the client.
    :ivar loans: the slots that the client holds; it returns them in the task for commands.
    :ivar memory_bytes: size of the memory file.
    :raises LinkError: the memory file cannot be created.
    """

    def __init__(self, bus: Bus, topic: str, *arguments: Any, number: int,
                 connection: socket.socket) -> None:
        size = bus.topic(topic).layout.max_size
        try:
            self._memory = MemoryFile.create(f'rt_robot_os {topic}', SLOTS, size)
        except OSError as error:
            raise LinkError(f'topic {topic!r}: no memory file of {SLOTS} times {size} bytes: '
                            f'{error.strerror or error}') from error
        try:
            super().__init__(bus, topic, *arguments, buffer=self._memory.slots[0])
        except BaseException:
            self._memory.close()
            raise
        self.memory_bytes = memory_bytes(size)
        self.loans = Loans(SLOTS)
        self._number = number
        self._size = size
        self._connection = connection
        self._send = connection.send
        self._announced = False
        self._packet = bytearray(HEADER_BYTES + SLOT.size)

    def set_policy(self, policy: Policy, max_rate_hz: float, delay_ms: float = 0.0) -> None:
        """
        Change what is sent from now on.

        :param delay_ms: ignored: waiting samples would need more slots, and each of them has its
            own packet anyway.
        """
        super().set_policy(policy, max_rate_hz)

    def _send_unread(self, now_ns: int, unread: int) -> None:
        try:
            if not self._announced:
                self._announce()
            self._lend(now_ns)
        except BlockingIOError:
            pass  # the socket is full even for the memory: the samples wait in the topic

    def _announce(self) -> None:
        send_with_fd(self._connection, header(PacketKind.MEMORY, self._channel) + MEMORY.pack(
            self._number, SLOTS, self._size), self._memory.fd)
        self._announced = True

    def _lend(self, now_ns: int) -> None:
        subscription = self.subscription
        latest = self._latest
        while subscription.unread:
            if self._interval_ns and self._is_early(now_ns):
                if latest:
                    return
                self._pass_over()
                continue
            slot = self.loans.acquire()
            if slot < 0 and self.patient:
                return  # the sample waits in the topic until it is overwritten there
            if slot < 0:
                self.full += subscription.skip(latest)
                return
            subscription.buffer = self._memory.slots[slot]
            if not (subscription.latest() if latest else subscription.take()):
                self.loans.put_back(slot)
                return
            if self._interval_ns:
                self._count_interval()
            if not self._hand_over(slot):
                if self.patient:
                    subscription.put_back()
                else:
                    self.full += 1
                return
            self.sent += 1

    def _hand_over(self, slot: int) -> bool:
        subscription = self.subscription
        HEADER.pack_into(
            self._packet, 0, PacketKind.SLOT, VERSION, self._channel,
            (self.full + subscription.lost) & 0xFFFFFFFF, subscription.stamp_ns,
            subscription.seq)
        SLOT.pack_into(self._packet, HEADER_BYTES, self._number, slot, subscription.length)
        # Before sending: the answer may come before the next line.
        self.loans.lend(slot)
        try:
            self._send(self._packet)
        except BlockingIOError:
            self.loans.put_back(slot)
            return False
        return True

    def close(self, gone: bool = False) -> None:
        """
        Stop reading the topic and release the memory.

        :param gone: the client has closed the connection and reads nothing more.
        """
        super().close(gone)
        self.subscription.buffer = memoryview(b'')
        if gone:
            self._memory.discard()
        self._memory.close()
