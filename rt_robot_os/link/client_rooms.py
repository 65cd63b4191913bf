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
How a client publishes samples that are too long for a packet: in memory that the core lends it.

Each large topic that the client advertises has a room: a memory file of the core with a few slots.
The client writes a sample into a free one and hands it over; the core gives it back when it has
published the sample.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence
import threading

from rt_robot_os.base.errors import LinkError
from rt_robot_os.link.client_memories import received_memory
from rt_robot_os.link.protocol import GIVE_BACK
from rt_robot_os.link.protocol import header
from rt_robot_os.link.protocol import HEADER_BYTES
from rt_robot_os.link.protocol import Kind
from rt_robot_os.link.protocol import SAMPLE_BYTES_MAXIMUM
from rt_robot_os.link.protocol import SLOT
from rt_robot_os.linux.memory_file import Loans
from rt_robot_os.linux.memory_file import MemoryFile


class SampleTooLong(LinkError):
    """The topic has no room for such a sample."""


class ClientRoom:
    """
    The slots for what a client publishes in one topic; several threads may.

    :param channel: of the topic.
    :param number: of the memory.
    :param size: bytes of a slot.
    """

    def __init__(self, channel: int, number: int, size: int, memory: MemoryFile) -> None:
        self._channel = channel
        self._number = number
        self._size = size
        self._memory = memory
        self._loans = Loans(len(memory.slots))
        # Also keeps the order: a short sample must not overtake a long one.
        self._lock = threading.Lock()

    def publish(self, cdr: bytes | memoryview, stamp_ns: int, send: Callable[[bytes], None]
                ) -> bool:
        """
        Hand a sample to the core: in a packet if it fits one and none before is on its way.

        :param send: sends a packet, or raises LinkError.
        :return: False when the core has all slots.
        :raises SampleTooLong: it does not fit a slot.
        :raises LinkError: the connection is closed, or what ``send`` raises.
        """
        length = len(cdr)
        with self._lock:
            if self._memory.fd < 0:
                raise LinkError('the connection to the core is closed')
            if length <= SAMPLE_BYTES_MAXIMUM and not self._loans.out:
                send(header(Kind.DATA, self._channel, stamp_ns=stamp_ns) + cdr)
                return True
            if length > self._size:
                raise SampleTooLong(f'a sample of {length} bytes; there is room for {self._size}: '
                                    'declare the topic with a longer tail')
            slot = self._loans.acquire()
            if slot < 0:
                return False
            self._memory.slots[slot][:length] = cdr
            # Before it is sent: the answer may come before the next line.
            self._loans.lend(slot)
            try:
                send(header(Kind.SLOT, self._channel, stamp_ns=stamp_ns)
                     + SLOT.pack(self._number, slot, length))
            except BaseException:
                self._loans.put_back(slot)
                raise
            return True

    def returned(self, packet: bytes) -> None:
        """
        Take back a slot.

        :raises LinkError: the core has not got it.
        """
        if len(packet) != HEADER_BYTES + GIVE_BACK.size:
            raise LinkError(f'the core gives back a slot in {len(packet)} bytes')
        number, slot = GIVE_BACK.unpack_from(packet, HEADER_BYTES)
        if number != self._number or not self._loans.returned(slot):
            raise LinkError(f'the core gives back slot {slot} of {number}, which it has not got')

    def close(self) -> None:
        """Unmap the memory; may be called twice."""
        with self._lock:
            self._memory.close()


class ClientRooms:
    """
    The rooms of one connection.

    :ivar by_channel: each by the channel of its topic.
    """

    def __init__(self) -> None:
        self.by_channel: dict[int, ClientRoom] = {}

    def take(self, packet: memoryview, fds: Sequence[int]) -> None:
        """
        Take the memory of a room, which came with a packet.

        :raises LinkError: it is no memory file, or not as the packet says.
        """
        channel, number, size, memory = received_memory(packet, fds, Kind.ROOM)
        old = self.by_channel.get(channel)
        self.by_channel[channel] = ClientRoom(channel, number, size, memory)
        if old is not None:
            old.close()

    def returned(self, channel: int, packet: bytes) -> None:
        """
        Take back a slot.

        :raises LinkError: the core has not got it.
        """
        room = self.by_channel.get(channel)
        if room is None:
            raise LinkError(f'the core gives back a slot of channel {channel}, which has no room')
        room.returned(packet)

    def close(self) -> None:
        """Unmap all of them; may be called twice."""
        for room in list(self.by_channel.values()):
            room.close()
