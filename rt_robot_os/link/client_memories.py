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

"""The memory files through which a client of the link receives large samples."""

from __future__ import annotations

from collections.abc import Sequence
import os

from rt_robot_os.base.errors import LinkError
from rt_robot_os.link.protocol import GIVE_BACK
from rt_robot_os.link.protocol import header
from rt_robot_os.link.protocol import HEADER_BYTES
from rt_robot_os.link.protocol import MEMORY
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.link.protocol import parse_header
from rt_robot_os.link.protocol import SLOT
from rt_robot_os.linux.memory_file import MemoryFile


def give_back(packet: bytes) -> bytes:
    """Make the answer to a ``SLOT`` packet."""
    number, slot, _ = SLOT.unpack_from(packet, HEADER_BYTES)
    channel = parse_header(packet).channel
    return header(PacketKind.GIVE_BACK, channel) + GIVE_BACK.pack(number, slot)


def received_memory(packet: memoryview, fds: Sequence[int], kind: PacketKind
                    ) -> tuple[int, int, int, MemoryFile]:
    """
    Map the memory file that came with a packet.

    :return: channel of the topic, number of the memory, bytes of a slot, the file.
    :raises LinkError: it is not a memory file, or does not match the packet; it is closed then.
    """
    if len(packet) != HEADER_BYTES + MEMORY.size or packet[0] != kind or len(fds) != 1:
        for fd in fds:
            os.close(fd)
        raise LinkError(f'{len(fds)} file descriptors came with a packet of {len(packet)} '
                        'bytes that does not announce a memory file')
    number, count, size = MEMORY.unpack_from(packet, HEADER_BYTES)
    try:
        memory = MemoryFile.received(fds[0], count, size)
    except (OSError, OverflowError, ValueError) as error:
        raise LinkError(f'the core sent an unusable memory file: {error}') from error
    return parse_header(packet).channel, number, size, memory


class ClientMemories:
    """The memory files of one connection; one for each large topic that is mirrored."""

    def __init__(self) -> None:
        self._by_channel: dict[int, tuple[int, int, MemoryFile]] = {}

    def take(self, packet: memoryview, fds: Sequence[int]) -> None:
        """
        Take the file that came with a packet; it replaces that of an earlier mirror of the topic.

        :raises LinkError: it is no memory file, or not as the packet says.
        """
        channel, number, size, memory = received_memory(packet, fds, PacketKind.MEMORY)
        old = self._by_channel.pop(channel, None)
        if old is not None:
            old[2].close()
        self._by_channel[channel] = (number, size, memory)

    def sample(self, packet: bytes) -> memoryview | None:
        """
        Return the sample that a ``SLOT`` packet names, in place.

        :return: None when it belongs to a memory of before.
        :raises LinkError: there is no such slot, or not so much in it.
        """
        if len(packet) != HEADER_BYTES + SLOT.size:
            raise LinkError(f'a packet of {len(packet)} bytes names no slot')
        number, slot, length = SLOT.unpack_from(packet, HEADER_BYTES)
        channel = parse_header(packet).channel
        known, size, memory = self._by_channel.get(channel, (0, 0, None))
        if memory is None or known != number:
            return None
        if slot >= len(memory.slots) or length > size:
            raise LinkError(f'the core names slot {slot} with {length} bytes; there are '
                            f'{len(memory.slots)} of {size}')
        sample: memoryview = memory.slots[slot][:length]
        return sample

    def close(self) -> None:
        """Unmap everything; may be called twice."""
        for _, _, memory in self._by_channel.values():
            memory.close()
        self._by_channel = {}
