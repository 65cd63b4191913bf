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
The client's side of uploads: samples that are too long for a packet, in shared memory of the core.

Each large topic that the client advertises has an upload buffer: a memory file of the core with a
few slots. The client writes a sample into a free slot and hands it over; the core returns the slot
when it has published the sample.
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
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.link.protocol import SAMPLE_BYTES_MAXIMUM
from rt_robot_os.link.protocol import SLOT
from rt_robot_os.linux.memory_file import Loans
from rt_robot_os.linux.memory_file import MemoryFile


class SampleTooLong(LinkError):
    """The sample is longer than the topic allows."""


class ClientUploadBuffer:
    """
    The slots in which a client publishes on one topic; thread-safe.

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
        # It also preserves the order: a short sample must not overtake a long one.
        self._lock = threading.Lock()

    def publish(self, cdr: bytes | memoryview, stamp_ns: int, send: Callable[[bytes], None]
                ) -> bool:
        """
        Send a sample to the core: in a packet if it fits one and no slot is in use.

        :param send: sends a packet, or raises LinkError.
        :return: False when the core holds all slots.
        :raises SampleTooLong: the sample does not fit a slot.
        :raises LinkError: the connection is closed, or ``send`` raises it.
        """
        length = len(cdr)
        with self._lock:
            if self._memory.fd < 0:
                raise LinkError('the connection to the core is closed')
            if length <= SAMPLE_BYTES_MAXIMUM and not self._loans.out:
                send(header(PacketKind.DATA, self._channel, stamp_ns=stamp_ns) + cdr)
                return True
            if length > self._size:
                raise SampleTooLong(f'a sample of {length} bytes; at most {self._size} fit: '
                                    'declare the topic with a longer tail')
            slot = self._loans.acquire()
            if slot < 0:
                return False
            self._memory.slots[slot][:length] = cdr
            # Before sending: the answer may come before the next line.
            self._loans.lend(slot)
            try:
                send(header(PacketKind.SLOT, self._channel, stamp_ns=stamp_ns)
                     + SLOT.pack(self._number, slot, length))
            except BaseException:
                self._loans.put_back(slot)
                raise
            return True

    def returned(self, packet: bytes) -> None:
        """
        Receive a slot that the core returns.

        :raises LinkError: the core does not hold this slot.
        """
        if len(packet) != HEADER_BYTES + GIVE_BACK.size:
            raise LinkError(f'the core returns a slot in {len(packet)} bytes')
        number, slot = GIVE_BACK.unpack_from(packet, HEADER_BYTES)
        if number != self._number or not self._loans.returned(slot):
            raise LinkError(f'the core returns slot {slot} of {number}, which it does not hold')

    def close(self) -> None:
        """Unmap the memory; may be called twice."""
        with self._lock:
            self._memory.close()


class ClientUploadBuffers:
    """
    The upload buffers of one connection.

    :ivar by_channel: each by the channel of its topic.
    """

    def __init__(self) -> None:
        self.by_channel: dict[int, ClientUploadBuffer] = {}

    def take(self, packet: memoryview, fds: Sequence[int]) -> None:
        """
        Map the memory of an upload buffer, which came with a packet.

        :raises LinkError: it is not a memory file, or does not match the packet.
        """
        channel, number, size, memory = received_memory(packet, fds, PacketKind.UPLOAD)
        old = self.by_channel.get(channel)
        self.by_channel[channel] = ClientUploadBuffer(channel, number, size, memory)
        if old is not None:
            old.close()

    def returned(self, channel: int, packet: bytes) -> None:
        """
        Receive a slot that the core returns.

        :raises LinkError: the core does not hold this slot.
        """
        buffer = self.by_channel.get(channel)
        if buffer is None:
            raise LinkError(f'the core returns a slot of channel {channel}, which has no upload '
                            'buffer')
        buffer.returned(packet)

    def close(self) -> None:
        """Unmap all buffers; may be called twice."""
        for buffer in list(self.by_channel.values()):
            buffer.close()
