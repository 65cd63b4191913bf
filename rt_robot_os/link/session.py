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

"""The core's side of the connection to one client."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict
from dataclasses import dataclass
import socket
from typing import Any

from rt_robot_os.base.errors import LinkError
from rt_robot_os.base.errors import TopicError
from rt_robot_os.link.batch import Batch
from rt_robot_os.link.entry_times import EntryTimes
from rt_robot_os.link.large import CLIENT_MEMORY_MAXIMUM
from rt_robot_os.link.large import LargeMirror
from rt_robot_os.link.mirror import Mirror
from rt_robot_os.link.mirror import MirrorStatistics
from rt_robot_os.link.protocol import GIVE_BACK
from rt_robot_os.link.protocol import header
from rt_robot_os.link.protocol import HEADER_BYTES
from rt_robot_os.link.protocol import in_parts
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.link.protocol import parse_header
from rt_robot_os.link.protocol import PART_BYTES
from rt_robot_os.link.protocol import REQUEST_BYTES_MAXIMUM
from rt_robot_os.link.uploads import upload_bytes
from rt_robot_os.link.uploads import UploadBuffer
from rt_robot_os.link.uploads import Uploads
from rt_robot_os.linux.memory_file import send_with_fd
from rt_robot_os.topics import Bus
from rt_robot_os.topics import LargePublisher
from rt_robot_os.topics import Publisher

REQUESTS_WAITING_MAXIMUM = 64
OUTBOX_MAXIMUM = 2048
OUTBOX_BYTES_MAXIMUM = 4 << 20
STREAMS_MAXIMUM = 8
PACKETS_PER_FLUSH = 256
# A packet costs one unit, and one more for each of these bytes.
UNIT_BYTES = 4096


@dataclass(frozen=True)
class ClientStatistics:
    """
    The statistics of a client.

    :ivar received: samples that it published.
    :ivar last_refusal: why the last sample was refused that did not fit its topic.
    :ivar large: published samples that were too long for a packet.
    :ivar large_waiting: large samples that are not published yet.
    :ivar refused: samples that did not fit their topic.
    :ivar outbox_dropped: replies and reports that were dropped, because it read too slowly.
    :ivar quiet_ns: since its last packet.
    """

    name: str
    pid: int
    received: int
    large: int
    large_waiting: int
    refused: int
    outbox_dropped: int
    quiet_ns: int
    mirrors: tuple[MirrorStatistics, ...]
    last_refusal: str = ''

    def as_json(self) -> dict[str, Any]:
        """Return plain values."""
        return asdict(self)


class ClientSession:
    """
    The connection of a client.

    :meth:`receive` runs in the task for commands, everything else in the link's low-priority task.

    :param entries: corrects the stamps of clients.
    :param buffer: for received packets, shared by all sessions. A new buffer for each packet would
        cost six times as much as the packet, because malloc maps so large a buffer each time.
    :ivar gone: why the client is to be removed; empty while it is connected.
    :ivar greeted: whether it has sent hello.
    :ivar quota: units that it may still send in this interval, see :meth:`receive`.
    :ivar paused: whether the quota is used up; the client is not read until the next interval.
    :ivar over_quota_until_ns: until when it counts as a client that uses up its quota.
    """

    def __init__(self, connection: socket.socket, bus: Bus, pid: int, now_ns: int,
                 buffer: bytearray, entries: EntryTimes) -> None:
        self._entries = entries
        self.since_ns = now_ns
        self.greeted = self.paused = False
        self.quota = self.over_quota_until_ns = 0
        self.connection = connection
        self.name = f'pid{pid}'
        self.pid = pid
        self.gone = ''
        self.heard_ns = now_ns
        self.received = self.refused = self.outbox_dropped = 0
        self.last_refusal = ''
        self.report_place = 0
        self.requests: deque[bytes] = deque()
        self.mirrors: dict[str, Mirror] = {}
        self.batch = Batch(connection)
        self._large: dict[int, LargeMirror] = {}
        self._memories = 0
        self.uploads = Uploads(entries)
        self._bus = bus
        self._publishers: dict[int, Publisher] = {}
        self._outbox: deque[bytes] = deque()
        self._outbox_bytes = 0
        self._streams: deque[Iterator[bytes]] = deque()
        self._buffer = buffer
        self._view = memoryview(buffer)

    def receive(self, now_ns: int) -> None:
        """
        Read the packets that have arrived: publish samples, store requests for later.

        Ends when no packet is left or :attr:`quota` is used up.
        """
        while self.quota > 0 and not self.gone:
            try:
                # With MSG_TRUNC the result is the length of the packet as it was sent.
                length = self.connection.recv_into(self._buffer, 0, socket.MSG_TRUNC)
            except BlockingIOError:
                return
            except ConnectionResetError:
                self.quota -= 1  # reported once, before the last packets of a client that ended
                continue
            except OSError as error:
                self.gone = error.strerror or 'connection lost'
                return
            if not length:
                self.gone = 'closed by the client'
                return
            self.quota -= 1 + length // UNIT_BYTES
            self.heard_ns = now_ns
            try:
                self._accept(length, now_ns)
            except OSError as error:
                self.gone = f'refused: {error}'

    def _accept(self, length: int, now_ns: int) -> None:
        if length > len(self._buffer):
            self.gone = f'refused: a packet of {length} bytes; the limit is {len(self._buffer)}'
            return
        packet = self._view[:length]
        head = parse_header(packet)
        if head.kind == PacketKind.DATA:
            stamp_ns = self._entries.stamp_of(head.stamp_ns, now_ns)
            self._publish(head.channel, stamp_ns, packet[HEADER_BYTES:])
        elif head.kind == PacketKind.REQUEST:
            if length > REQUEST_BYTES_MAXIMUM:
                self.gone = (f'refused: a request of {length} bytes; the limit is '
                             f'{REQUEST_BYTES_MAXIMUM}')
            elif len(self.requests) >= REQUESTS_WAITING_MAXIMUM:
                self.gone = f'refused: more than {REQUESTS_WAITING_MAXIMUM} requests at once'
            else:
                self.requests.append(bytes(packet))
        elif head.kind == PacketKind.SLOT:
            problem = self.uploads.accept(head, packet[HEADER_BYTES:], now_ns)
            self.gone = self.gone or (f'refused: {problem}' if problem else '')
        elif head.kind == PacketKind.GIVE_BACK:
            self._receive_slot(packet[HEADER_BYTES:])
        elif head.kind != PacketKind.BEAT:
            self.gone = f'refused: a packet of kind {head.kind} is not for the core'

    def _receive_slot(self, body: memoryview) -> None:
        if len(body) != GIVE_BACK.size:
            self.gone = f'refused: it returns a slot in {len(body)} bytes'
            return
        number, slot = GIVE_BACK.unpack(body)
        mirror = self._large.get(number)
        if mirror is not None:
            if not mirror.loans.returned(slot):
                self.gone = f'refused: it returns slot {slot} of {number}, which it does not hold'
        elif not 0 < number <= self._memories:
            self.gone = f'refused: it returns a slot of memory {number}, which it never got'
        # Otherwise the mirror was removed while the packet was on its way.

    def add_large(self, topic: str, make: Callable[[int], LargeMirror], size: int) -> None:
        """
        Add a mirror whose samples go through a memory file.

        :param make: makes the mirror from the number of its memory.
        :param size: bytes of its memory.
        :raises LinkError: the client would have more memory than allowed.
        """
        self._check_memory(f'topic {topic!r}: mirroring it', size)
        mirror = make(self._memories + 1)
        self._memories += 1
        self._large[self._memories] = self.mirrors[topic] = mirror

    def _check_memory(self, what: str, size: int) -> None:
        users: list[LargeMirror | UploadBuffer] = [
            *self._large.values(), *self.uploads.buffers.values()]
        used = sum(user.memory_bytes for user in users)
        if used + size > CLIENT_MEMORY_MAXIMUM:
            raise LinkError(f'{what} needs {size} bytes of memory, and {used} of '
                            f'{CLIENT_MEMORY_MAXIMUM} are used by this client; use fewer large '
                            'topics, or connect twice')

    def remove_mirror(self, topic: str) -> None:
        """Stop sending a topic; unknown topics are ignored."""
        mirror = self.mirrors.pop(topic, None)
        if mirror is not None:
            self._large = {n: large for n, large in self._large.items() if large is not mirror}
            mirror.close()

    def _publish(self, channel: int, stamp_ns: int, cdr: memoryview) -> None:
        publisher = self._publishers.get(channel)
        if publisher is None:
            self.gone = f'refused: a sample for channel {channel}, which it never advertised'
            return
        if self.uploads.buffers and self.uploads.is_busy(channel):
            self.gone = f'refused: a sample for channel {channel} would overtake a large one'
            return
        try:
            publisher.publish_cdr(cdr, stamp_ns)
            self.received += 1
        except TopicError as error:
            self.refused += 1
            self.last_refusal = str(error)

    def advertise(self, topic: str) -> tuple[int, bool]:
        """
        Allow the client to publish on a topic.

        :return: the channel to use, and whether there is an upload buffer for large samples.
        :raises TopicError: there is no such topic.
        :raises LinkError: there is not enough memory.
        """
        channel = self.channel(topic)
        if channel not in self._publishers:
            publisher = self._bus.publisher(topic)
            if isinstance(publisher, LargePublisher):
                self._add_upload_buffer(publisher, channel)
            self._publishers[channel] = publisher
        return channel, channel in self.uploads.buffers

    def reads(self, topic: str) -> bool:
        """Return whether the client receives the samples of a topic."""
        return not self.gone and topic in self.mirrors

    def publishes(self, channel: int) -> bool:
        """Return whether the client may publish on a channel."""
        return channel in self._publishers

    def publish_upload(self) -> int:
        """Publish the first of the waiting large samples; return its bytes."""
        length, refusal = self.uploads.publish()
        self.received += not refusal
        self.refused += bool(refusal)
        self.last_refusal = refusal or self.last_refusal
        return length

    def _add_upload_buffer(self, publisher: LargePublisher, channel: int) -> None:
        self._check_memory(f'topic {publisher.topic.name!r}: publishing there',
                           upload_bytes(publisher.topic))
        self._memories += 1
        buffer = UploadBuffer(publisher, channel, self._memories, self.connection)
        self.uploads.add(buffer, channel)

    def channel(self, topic: str) -> int:
        """
        Return the number of a topic.

        :raises TopicError: there is no such topic.
        """
        return self._bus.topics.index(self._bus.topic(topic))

    def post(self, packet: bytes) -> None:
        """
        Queue a packet; a client that reads too slowly loses it.

        A long packet is sent in parts, none of which is lost.
        """
        if len(packet) > PART_BYTES:
            self.post_all(iter((packet,)))
            return
        if (len(self._outbox) >= OUTBOX_MAXIMUM
                or self._outbox_bytes + len(packet) > OUTBOX_BYTES_MAXIMUM):
            self.outbox_dropped += 1
            return
        self._outbox.append(packet)
        self._outbox_bytes += len(packet)
        self.flush()

    def post_all(self, packets: Iterator[bytes]) -> None:
        """
        Send many packets, each made when the client can receive it: none is lost.

        :raises LinkError: too many answers are still being sent.
        """
        if len(self._streams) >= STREAMS_MAXIMUM:
            raise LinkError(f'the answers to {STREAMS_MAXIMUM} earlier requests are still being '
                            'sent; wait for them')
        self._streams.append(part for packet in packets for part in in_parts(packet))
        self.flush()

    def flush(self) -> None:
        """Send queued packets, until the client's socket is full; at most some hundred."""
        try:
            for _ in range(PACKETS_PER_FLUSH):
                if not self._outbox and not self._refill():
                    return
                self.connection.send(self._outbox[0])
                self._outbox_bytes -= len(self._outbox.popleft())
        except BlockingIOError:
            return
        except OSError as error:
            self.gone = self.gone or error.strerror or 'connection lost'

    def _refill(self) -> bool:
        """Queue the next packet of a long answer; return False if there is none."""
        while self._streams:
            packet = next(self._streams[0], None)
            if packet is not None:
                self._outbox.append(packet)
                self._outbox_bytes += len(packet)
                return True
            self._streams.popleft()
        return False

    def greet(self, name: str, liveness_fd: int) -> None:
        """Store the name of a client that sent hello, and send it the liveness page."""
        self.name = name or f'pid{self.pid}'
        self.greeted = True
        if liveness_fd >= 0:
            with suppress(OSError):  # without the page the client relies on heartbeats
                send_with_fd(self.connection, header(PacketKind.LIVENESS), liveness_fd)

    def send_samples(self, now_ns: int) -> bool:
        """
        Send the samples of all mirrored topics.

        :return: whether there were any.
        """
        some = False
        try:
            for mirror in self.mirrors.values():
                some |= mirror.send_due(now_ns)
            self.batch.send()
            self.uploads.flush()
        except OSError as error:
            self.gone = self.gone or error.strerror or 'connection lost'
        return some

    def close(self) -> None:
        """Release everything of this client."""
        left = bool(self.gone) and not self.gone.startswith('refused')
        self._large = {}
        self._streams.clear()
        for mirror in self.mirrors.values():
            mirror.close(left)
        self.mirrors.clear()
        self.uploads.close(left)
        self.connection.close()

    def statistics(self, now_ns: int) -> ClientStatistics:
        """Return the statistics."""
        uploads = self.uploads
        return ClientStatistics(
            self.name, self.pid, self.received, uploads.published, len(uploads.waiting),
            self.refused, self.outbox_dropped, now_ns - self.heard_ns,
            tuple(m.statistics() for m in self.mirrors.values()), self.last_refusal[:300])
