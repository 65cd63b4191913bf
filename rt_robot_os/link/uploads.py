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
The core's side of uploads: samples of clients that are too long for a packet, in shared memory.

For each large topic that a client advertises the core creates a memory file with a few slots, and
sends it to the client. The client fills a slot and names it in a packet. The link's low-priority
task copies the sample in pieces of 64 KiB, validates the copy, publishes it and returns the slot.
The core maps no memory that a client could shrink, and accepts no file descriptors from clients.
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
from rt_robot_os.link.protocol import MEMORY
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.link.protocol import SLOT
from rt_robot_os.linux.memory_file import MemoryFile
from rt_robot_os.linux.memory_file import send_with_fd
from rt_robot_os.linux.memory_file import slot_stride
from rt_robot_os.topics import LargePublisher
from rt_robot_os.topics import Topic

# One for the core to read, and one for the client to write meanwhile.
UPLOAD_SLOTS: Final = 2
# Of all clients together: about 4 % of a CPU.
BYTES_PER_S: Final = 200_000_000
_BURST_NS: Final = 40 * NS_PER_MS
# The minimum cost of a sample.
_SAMPLE_BYTES_MINIMUM: Final = 1 << 16
# For padding behind a message, and for a middleware that estimates its length too long.
_SPARE_BYTES: Final = 64


def _slot_bytes(topic: Topic) -> int:
    return topic.layout.max_size + _SPARE_BYTES


def upload_bytes(topic: Topic) -> int:
    """Return how much memory the upload buffer of a topic needs."""
    return UPLOAD_SLOTS * slot_stride(_slot_bytes(topic))


class UploadBuffer:
    """
    The slots for the samples of one client on one topic.

    Packets of the client are received in the task for commands; the rest runs in the link's
    low-priority task.

    :param publisher: used for nothing else while :attr:`busy`.
    :param number: of the memory among those of the client.
    :param connection: to the client.
    :ivar memory_bytes: size of the memory file.
    :raises LinkError: the memory file cannot be created.
    """

    def __init__(self, publisher: LargePublisher, channel: int, number: int,
                 connection: socket.socket) -> None:
        topic = publisher.topic
        self.memory_bytes = upload_bytes(topic)
        size = _slot_bytes(topic)
        try:
            self._memory = MemoryFile.create(f'rt_robot_os {topic.name}', UPLOAD_SLOTS, size)
        except OSError as error:
            raise LinkError(f'topic {topic.name!r}: no memory file of {UPLOAD_SLOTS} times {size} '
                            f'bytes: {error.strerror or error}') from error
        self._publisher = publisher
        self._number = number
        self._channel = channel
        self._size = size
        self._connection = connection
        self._announced = False
        self._ours = bytearray(UPLOAD_SLOTS)
        self._owed: list[int] = []

    @property
    def busy(self) -> bool:
        """Return whether the core holds a slot with a sample."""
        return any(self._ours)

    def accept(self, number: int, slot: int, length: int) -> str:
        """
        Accept a slot that the client has filled.

        :return: why the slot is not valid; empty if it is.
        """
        if not self._announced or number != self._number or slot >= UPLOAD_SLOTS:
            return f'it fills slot {slot} of memory {number}, which it never got'
        if self._ours[slot]:
            return f'it fills slot {slot} of {number}, which the core holds'
        if length > self._size:
            return f'it has {length} bytes in a slot of {self._size}'
        self._ours[slot] = 1
        return ''

    def publish(self, slot: int, length: int, stamp_ns: int) -> None:
        """
        Publish the sample in a slot; preemptible.

        :raises TopicError: it does not fit the topic; nothing is published.
        """
        self._publisher.publish_shared(self._memory.slots[slot][:length], stamp_ns)

    def give_back(self, slot: int) -> None:
        """
        Return a slot to the client, now or as soon as its socket accepts the packet.

        :raises OSError: the connection is closed.
        """
        self._owed.append(slot)
        self.flush()

    def flush(self) -> None:
        """
        Send the memory and the slots to be returned, until the client's socket is full.

        :raises OSError: the connection is closed.
        """
        try:
            if not self._announced:
                # Before sending: the answer may come before the next line.
                self._announced = True
                self._announce()
            while self._owed:
                self._send_back(self._owed[0])
                self._owed.pop(0)
        except BlockingIOError:
            pass  # tried again with the next heartbeat

    def _announce(self) -> None:
        try:
            send_with_fd(self._connection, header(PacketKind.UPLOAD, self._channel) + MEMORY.pack(
                self._number, UPLOAD_SLOTS, self._size), self._memory.fd)
        except BlockingIOError:
            self._announced = False
            raise

    def _send_back(self, slot: int) -> None:
        self._ours[slot] = 0
        try:
            self._connection.send(header(PacketKind.GIVE_BACK, self._channel)
                                  + GIVE_BACK.pack(self._number, slot))
        except BlockingIOError:
            self._ours[slot] = 1
            raise

    def close(self, left: bool) -> None:
        """
        Release the memory.

        :param left: the client has closed the connection and reads nothing more.
        """
        if left:
            self._memory.discard()
        self._memory.close()


class Uploads:
    """
    The upload buffers of one client, and its samples that wait to be published.

    :param entries: corrects the stamps of clients.
    :ivar buffers: by channel.
    :ivar waiting: samples to be published: buffer, slot, length, stamp.
    :ivar published: number of samples that were published.
    :ivar turn: the number of its last turn.
    """

    def __init__(self, entries: EntryTimes) -> None:
        self._entries = entries
        self.buffers: dict[int, UploadBuffer] = {}
        self.published = self.turn = 0
        self.waiting: deque[tuple[UploadBuffer, int, int, int]] = deque()

    def add(self, buffer: UploadBuffer, channel: int) -> None:
        """Offer a buffer to the client, now or as soon as its socket accepts the packet."""
        self.buffers[channel] = buffer
        with suppress(OSError):  # the connection is closed: noticed with the next packet
            buffer.flush()

    def is_busy(self, channel: int) -> bool:
        """Return whether a large sample of a channel waits to be published."""
        buffer = self.buffers.get(channel)
        return buffer is not None and buffer.busy

    def accept(self, head: Header, body: memoryview, now_ns: int) -> str:
        """
        Accept a sample; bounded by the number of slots.

        :return: why the packet is not valid; empty if it is.
        """
        buffer = self.buffers.get(head.channel)
        if buffer is None or len(body) != SLOT.size:
            return f'it fills a slot of channel {head.channel} in {len(body)} bytes'
        number, slot, length = SLOT.unpack(body)
        problem = buffer.accept(number, slot, length)
        if not problem:
            stamp_ns = self._entries.stamp_of(head.stamp_ns, now_ns)
            self.waiting.append((buffer, slot, length, stamp_ns))
        return problem

    def publish(self) -> tuple[int, str]:
        """
        Publish the first waiting sample, and return its slot; preemptible.

        :return: its bytes, and why it was refused; empty if it was published.
        """
        buffer, slot, length, stamp_ns = self.waiting.popleft()
        refusal = ''
        try:
            buffer.publish(slot, length, stamp_ns)
            self.published += 1
        except TopicError as error:
            refusal = str(error)
        with suppress(OSError):  # the connection is closed
            buffer.give_back(slot)
        return length, refusal

    def flush(self) -> None:
        """
        Send what did not fit the client's socket before.

        :raises OSError: the connection is closed.
        """
        for buffer in self.buffers.values():
            buffer.flush()

    def close(self, left: bool) -> None:
        """
        Release all memory, and drop the samples that wait in it.

        :param left: the client has closed the connection and reads nothing more.
        """
        buffers, self.buffers = self.buffers, {}
        self.waiting.clear()
        for buffer in buffers.values():
            buffer.close(left)


class Uploader(Protocol):
    """A client that may have samples to be published."""

    @property
    def uploads(self) -> Uploads:
        """Return the samples that wait."""

    def publish_upload(self) -> int:
        """Publish the first of the samples; return its length in bytes."""


class UploadScheduler:
    """
    Publish one sample at a time, of all clients in turn (round robin), at a bounded rate.

    A sample that exceeds the rate waits in its slot, and its client for the slot.
    """

    def __init__(self) -> None:
        self._next_ns = 0
        self._turns = 0

    def publish_next(self, clients: Sequence[Uploader], now_ns: int) -> bool:
        """
        Publish one sample, if one waits and the rate allows it.

        :return: whether another may follow immediately.
        """
        waiting = [client for client in clients if client.uploads.waiting]
        if not waiting or now_ns < self._next_ns:
            return False
        client = min(waiting, key=lambda client: client.uploads.turn)
        self._turns += 1
        client.uploads.turn = self._turns
        cost = max(client.publish_upload(), _SAMPLE_BYTES_MINIMUM)
        self._next_ns = (max(self._next_ns, now_ns - _BURST_NS)
                         + cost * NS_PER_S // BYTES_PER_S)
        return now_ns >= self._next_ns and any(client.uploads.waiting for client in waiting)
