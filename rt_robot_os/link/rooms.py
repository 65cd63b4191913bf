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
Take samples from clients that are too long for a packet, through memory that the core lends them.

For each large topic that a client advertises the core makes a memory file with a few slots, and
sends it to the client. The client fills a slot and names it in a packet. The link's task of low
priority copies the sample out in pieces of 64 KiB, judges the copy, publishes it and gives the
slot back. The core maps no memory that a client could shrink, and takes no descriptors from it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from contextlib import suppress
import socket
from typing import Final
from typing import Protocol

from rt_robot_os.base.errors import LinkError
from rt_robot_os.base.errors import TopicError
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.link.entry_times import EntryTimes
from rt_robot_os.link.protocol import GIVE_BACK
from rt_robot_os.link.protocol import Header
from rt_robot_os.link.protocol import header
from rt_robot_os.link.protocol import Kind
from rt_robot_os.link.protocol import MEMORY
from rt_robot_os.link.protocol import SLOT
from rt_robot_os.linux.memory_file import MemoryFile
from rt_robot_os.linux.memory_file import send_with_fd
from rt_robot_os.linux.memory_file import slot_stride
from rt_robot_os.topics import LargePublisher
from rt_robot_os.topics import Topic

# One that the core reads, and one that the client writes meanwhile.
ROOM_SLOTS: Final = 2
# Of all clients together: some 4 % of a CPU.
BYTES_PER_S: Final = 200_000_000
_BURST_NS: Final = 40 * NS_PER_MS
# What a sample costs at least.
_SAMPLE_BYTES_MINIMUM: Final = 1 << 16
# Behind a message there may be padding, and what a middleware estimated too much.
_SPARE_BYTES: Final = 64


def _slot_bytes(topic: Topic) -> int:
    return topic.layout.max_size + _SPARE_BYTES


def room_bytes(topic: Topic) -> int:
    """Return how much memory the room of a topic takes."""
    return ROOM_SLOTS * slot_stride(_slot_bytes(topic))


class Room:
    """
    The slots for what one client publishes in one topic.

    The client's packets come in the task for commands, the rest runs in the link's low one.

    :param publisher: used for nothing else while :attr:`busy`.
    :param number: of the memory among those of the client.
    :param connection: to the client.
    :ivar memory_bytes: how much memory it takes.
    :raises LinkError: there is not so much memory.
    """

    def __init__(self, publisher: LargePublisher, channel: int, number: int,
                 connection: socket.socket) -> None:
        topic = publisher.topic
        self.memory_bytes = room_bytes(topic)
        size = _slot_bytes(topic)
        try:
            self._memory = MemoryFile.create(f'rt_robot_os {topic.name}', ROOM_SLOTS, size)
        except OSError as error:
            raise LinkError(f'topic {topic.name!r}: no memory file of {ROOM_SLOTS} times {size} '
                            f'bytes: {error.strerror or error}') from error
        self._publisher = publisher
        self._number = number
        self._channel = channel
        self._size = size
        self._connection = connection
        self._announced = False
        self._ours = bytearray(ROOM_SLOTS)
        self._owed: list[int] = []

    @property
    def busy(self) -> bool:
        """Return whether a sample is on its way through it."""
        return any(self._ours)

    def handed_over(self, number: int, slot: int, length: int) -> str:
        """
        Note that the client has filled a slot.

        :return: why it cannot have; empty when all is well.
        """
        if not self._announced or number != self._number or slot >= ROOM_SLOTS:
            return f'it fills slot {slot} of memory {number}, which it never got'
        if self._ours[slot]:
            return f'it fills slot {slot} of {number}, which it has handed over'
        if length > self._size:
            return f'it has {length} bytes in a slot of {self._size}'
        self._ours[slot] = 1
        return ''

    def publish(self, slot: int, length: int, stamp_ns: int) -> None:
        """
        Publish what lies in a slot; preemptible.

        :raises TopicError: it does not fit the topic; nothing is published.
        """
        self._publisher.publish_shared(self._memory.slots[slot][:length], stamp_ns)

    def give_back(self, slot: int) -> None:
        """
        Let the client have a slot again, now or as soon as it takes the packet.

        :raises OSError: it is gone.
        """
        self._owed.append(slot)
        self.settle()

    def settle(self) -> None:
        """
        Send the memory and the slots that are owed, as far as the client takes them.

        :raises OSError: it is gone.
        """
        try:
            if not self._announced:
                # Before it is sent: the answer may come before the next line.
                self._announced = True
                self._announce()
            while self._owed:
                self._send_back(self._owed[0])
                self._owed.pop(0)
        except BlockingIOError:
            pass  # it is tried again with the next beat

    def _announce(self) -> None:
        try:
            send_with_fd(self._connection, header(Kind.ROOM, self._channel) + MEMORY.pack(
                self._number, ROOM_SLOTS, self._size), self._memory.fd)
        except BlockingIOError:
            self._announced = False
            raise

    def _send_back(self, slot: int) -> None:
        self._ours[slot] = 0
        try:
            self._connection.send(header(Kind.GIVE_BACK, self._channel)
                                  + GIVE_BACK.pack(self._number, slot))
        except BlockingIOError:
            self._ours[slot] = 1
            raise

    def close(self, left: bool) -> None:
        """
        Let go of the memory.

        :param left: the client has closed the connection and reads nothing any more.
        """
        if left:
            self._memory.discard()
        self._memory.close()


class Uploads:
    """
    The rooms of one client, and the samples that it has handed over.

    :param entries: when samples entered, by the stamps of clients.
    :ivar rooms: by channel.
    :ivar waiting: samples that it has handed over: room, slot, length, stamp.
    :ivar published: samples that went through.
    :ivar turn: the number of its last turn.
    """

    def __init__(self, entries: EntryTimes) -> None:
        self._entries = entries
        self.rooms: dict[int, Room] = {}
        self.published = self.turn = 0
        self.waiting: deque[tuple[Room, int, int, int]] = deque()

    def add(self, room: Room, channel: int) -> None:
        """Let the client use a room, as soon as it takes the packet."""
        self.rooms[channel] = room
        with suppress(OSError):  # it is gone, which the next packet tells
            room.settle()

    def is_busy(self, channel: int) -> bool:
        """Return whether a large sample for a channel is on its way."""
        room = self.rooms.get(channel)
        return room is not None and room.busy

    def handed_over(self, head: Header, body: memoryview, now_ns: int) -> str:
        """
        Note a sample; bounded by the slots.

        :return: why there can be none; empty when all is well.
        """
        room = self.rooms.get(head.channel)
        if room is None or len(body) != SLOT.size:
            return f'it fills a slot of channel {head.channel} in {len(body)} bytes'
        number, slot, length = SLOT.unpack(body)
        wrong = room.handed_over(number, slot, length)
        if not wrong:
            stamp_ns = self._entries.stamp_of(head.stamp_ns, now_ns)
            self.waiting.append((room, slot, length, stamp_ns))
        return wrong

    def publish(self) -> tuple[int, str]:
        """
        Publish the first of them, and give its slot back; preemptible.

        :return: its bytes, and why it was refused; empty when it was not.
        """
        room, slot, length, stamp_ns = self.waiting.popleft()
        refusal = ''
        try:
            room.publish(slot, length, stamp_ns)
            self.published += 1
        except TopicError as error:
            refusal = str(error)
        with suppress(OSError):  # the client is gone
            room.give_back(slot)
        return length, refusal

    def settle(self) -> None:
        """
        Send what the client could not take before.

        :raises OSError: it is gone.
        """
        for room in self.rooms.values():
            room.settle()

    def close(self, left: bool) -> None:
        """
        Let go of all memory, and of what waits in it.

        :param left: the client has closed the connection and reads nothing any more.
        """
        rooms, self.rooms = self.rooms, {}
        self.waiting.clear()
        for room in rooms.values():
            room.close(left)


class Uploader(Protocol):
    """A client that may have handed over samples."""

    @property
    def uploads(self) -> Uploads:
        """Those that wait."""

    def upload(self) -> int:
        """Publish the first of them; return its length in bytes."""


class UploadTurns:
    """
    Whose sample is next: one at a time, of all clients in turn, at a bounded rate.

    A sample that may not begin yet waits in its slot, and its client for the slot.
    """

    def __init__(self) -> None:
        self._next_ns = 0
        self._turns = 0

    def take(self, clients: Sequence[Uploader], now_ns: int) -> bool:
        """
        Publish one sample, if there is any and its time has come.

        :return: whether another may follow at once.
        """
        waiting = [client for client in clients if client.uploads.waiting]
        if not waiting or now_ns < self._next_ns:
            return False
        client = min(waiting, key=lambda client: client.uploads.turn)
        self._turns += 1
        client.uploads.turn = self._turns
        cost = max(client.upload(), _SAMPLE_BYTES_MINIMUM)
        self._next_ns = (max(self._next_ns, now_ns - _BURST_NS)
                         + cost * NS_PER_S // BYTES_PER_S)
        return now_ns >= self._next_ns and any(client.uploads.waiting for client in waiting)
