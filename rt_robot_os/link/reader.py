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

"""The reading side of a client of the link: packets, and large samples in memory files."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from collections.abc import Iterator
import select
import socket
import threading
import time
from typing import Any
from typing import Protocol

from rt_robot_os.base.errors import LinkError
from rt_robot_os.link.client_memories import ClientMemories
from rt_robot_os.link.client_memories import give_back
from rt_robot_os.link.client_uploads import ClientUploadBuffers
from rt_robot_os.link.fetch_clock import FetchClock
from rt_robot_os.link.liveness import LivenessReader
from rt_robot_os.link.protocol import CONTINUED
from rt_robot_os.link.protocol import decode_json
from rt_robot_os.link.protocol import HEADER
from rt_robot_os.link.protocol import Header
from rt_robot_os.link.protocol import HEADER_BYTES
from rt_robot_os.link.protocol import PACKET_BYTES_MAXIMUM
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.link.protocol import parse_header
from rt_robot_os.link.protocol import VERSION
from rt_robot_os.link.records import Record
from rt_robot_os.link.records import records
from rt_robot_os.linux.memory_file import FD_BYTES
from rt_robot_os.linux.memory_file import received_fds


DataHandler = Callable[[Header, memoryview], None]
# Called with a sample of one topic: stamp in ns, samples missed, CDR.
SampleHandler = Callable[[int, int, memoryview], None]
ReportHandler = Callable[[dict[str, Any]], None]

_PACKETS_AT_ONCE = 512
# Reports that are stored until on_report is set; the newest are kept.
_REPORTS_MAXIMUM = 1000
_PARTS_BYTES_MAXIMUM = 64 << 20
_CLOSED = 'the core closed the connection'


class Inbox(Protocol):
    """The receiver of the packets of an answer."""

    def put(self, packet: tuple[Header, bytes], /) -> None:
        """Receive a packet; called by the reading thread."""


def connection_error(error: OSError) -> LinkError:
    """Make the error for a core that has ended: the same after a failed read as after a write."""
    if isinstance(error, BrokenPipeError | ConnectionResetError):
        return LinkError(_CLOSED)
    return LinkError(f'the core is gone: {error.strerror or error}')


class Reader:
    """
    Read packets from the socket of a client and dispatch them.

    One thread reads at a time; other threads return without reading.

    :param connection: not blocking once it is connected; closed by :meth:`close`.
    :ivar on_data: called by the reading thread with each sample: header and CDR, valid during the
        call only. The CDR may be written to. A large sample is in a slot of the core, which is
        returned after the call: a slow handler loses the next samples.
    :ivar sample_handlers: called instead, by channel, without building the header.
    :ivar clock: when packets are read while only samples are awaited.
    :ivar on_report: called by the reading thread with each report of the core; first with those
        that arrived before it was set.
    :ivar replies: receivers of the answers to requests, by the number of the request.
    :ivar last_beat_ns: when the last heartbeat of the core was read, on CLOCK_MONOTONIC.
    :ivar upload_buffers: for the large samples that this client publishes.
    :ivar liveness: the liveness counter of the core, which needs no packets; None until received.
    """

    def __init__(self, connection: socket.socket) -> None:
        self.on_data: DataHandler | None = None
        self.sample_handlers: dict[int, SampleHandler] = {}
        self.on_report: ReportHandler | None = None
        self.last_beat_ns = time.monotonic_ns()
        self.closed = False
        self.liveness: LivenessReader | None = None
        self.replies: dict[int, Inbox] = {}
        self._parts: dict[int, bytearray] = {}
        self._reading = threading.Lock()
        self._buffer = bytearray(PACKET_BYTES_MAXIMUM)
        self._view = memoryview(self._buffer)
        self._memories = ClientMemories()
        self.upload_buffers = ClientUploadBuffers()
        self._returns: deque[bytes] = deque()
        self._reports: deque[dict[str, Any]] = deque(maxlen=_REPORTS_MAXIMUM)
        self._records: Iterator[Record] | None = None
        self._socket = connection
        self._poll = select.poll()
        self._poll.register(connection, select.POLLIN)
        self.clock = FetchClock(connection)

    def close(self) -> None:
        """Close the socket and all memory files; may be called twice."""
        self.closed = True
        self._socket.close()
        self.upload_buffers.close()
        if self._reading.acquire(blocking=False):  # else a thread uses the memory files
            self._memories.close()
            if self.liveness is not None:
                self.liveness.close()
                self.liveness = None
            self._reading.release()

    def pump(self, timeout_s: float) -> int:
        """
        Wait for packets and handle those that have arrived, up to some hundred.

        :return: the number of packets; 0 after a time-out, or when another thread reads.
        :raises LinkError: the connection is closed.
        """
        if not self._reading.acquire(timeout=timeout_s):
            return 0
        try:
            if self.closed:
                raise LinkError('the connection to the core is closed')
            if self._returns:
                self._flush_returns()
            self._hand_on_reports()
            if self._records is not None:
                self._dispatch(self._records)  # left from a packet whose handler raised
            if not self._wait(timeout_s):
                return 0
            count = size = 0
            while count < _PACKETS_AT_ONCE and (length := self._receive(count)):
                count += 1
                size += length
                self._handle(length)
            self.clock.fetched(size)
            return count
        finally:
            self._reading.release()

    def _wait(self, timeout_s: float) -> bool:
        """Wait until there may be packets; an awaited answer is read immediately."""
        if self.clock.interval_ns and timeout_s > 0 and not self.replies:
            return self.clock.wait(timeout_s)
        return bool(self._poll.poll(max(0.0, timeout_s) * 1000))

    def _hand_on_reports(self) -> None:
        while self._reports and self.on_report is not None:
            self.on_report(self._reports.popleft())

    def _receive(self, count: int) -> int:
        """
        Receive a packet; return its length, 0 for none.

        When the connection ends after packets were received, the next call raises.
        """
        try:
            length, ancillary, _, _ = self._socket.recvmsg_into(
                [self._buffer], FD_BYTES, socket.MSG_CMSG_CLOEXEC)
        except BlockingIOError:
            return 0
        except ConnectionResetError:
            # The core ended before it had read everything. Linux reports that once, before the
            # packets that the core has sent.
            return self._receive(count)
        except OSError as error:
            if count:
                return 0
            raise connection_error(error) from error
        if ancillary:
            self._receive_fds(length, received_fds(ancillary))
        if not length and not count:
            raise LinkError(_CLOSED)
        return length

    def _receive_fds(self, length: int, fds: list[int]) -> None:
        if length and self._buffer[0] == PacketKind.LIVENESS and len(fds) == 1:
            if self.liveness is not None:
                self.liveness.close()
            self.liveness = LivenessReader(fds[0])
        elif length and self._buffer[0] == PacketKind.UPLOAD:
            self.upload_buffers.take(self._view[:length], fds)
        else:
            self._memories.take(self._view[:length], fds)

    def _handle(self, length: int) -> None:
        kind = self._buffer[0]
        if kind == PacketKind.DATA and length >= HEADER_BYTES:
            _, _, channel, missed, stamp_ns, seq = HEADER.unpack_from(self._buffer)
            self._dispatch(iter((
                (channel, missed, stamp_ns, seq, self._view[HEADER_BYTES:length]),)))
            return
        if kind == PacketKind.BATCH:
            self._records = records(self._view[:length])
            self._dispatch(self._records)
            return
        if kind == PacketKind.SLOT:
            self._handle_slot(length)
            return
        packet = bytes(self._view[:length])
        head = parse_header(packet)
        if kind == PacketKind.BEAT:
            self.last_beat_ns = time.monotonic_ns()
        elif kind == PacketKind.REPORT:
            self._reports.append(decode_json(packet))
            self._hand_on_reports()
        elif kind == PacketKind.TASK:
            self._deliver(head.seq, head, packet)
        elif kind == PacketKind.REPLY:
            self._deliver(head.seq, head, packet)
        elif kind == PacketKind.GIVE_BACK:
            self.upload_buffers.returned(head.channel, packet)

    def _dispatch(self, samples: Iterator[Record]) -> None:
        sample_handlers = self.sample_handlers
        for channel, missed, stamp_ns, seq, cdr in samples:
            handle = sample_handlers.get(channel)
            if handle is not None:
                handle(stamp_ns, missed, cdr)
            elif self.on_data is not None:
                self.on_data(Header(PacketKind.DATA, VERSION, channel, missed, stamp_ns, seq), cdr)
        self._records = None

    def _handle_slot(self, length: int) -> None:
        """Dispatch a large sample in place, and return its slot even if the handler raises."""
        packet = bytes(self._view[:length])
        head = parse_header(packet)
        sample = self._memories.sample(packet)
        if sample is None:
            return
        try:
            self._dispatch(iter(((head.channel, head.missed, head.stamp_ns, head.seq, sample),)))
        finally:
            self._returns.append(give_back(packet))
            self._flush_returns()

    def _flush_returns(self) -> None:
        """Send the slots to be returned, until the socket is full."""
        try:
            while self._returns:
                self._socket.send(self._returns[0])
                self._returns.popleft()
        except BlockingIOError:
            pass  # tried again later; until then the core has fewer free slots
        except OSError as error:
            raise connection_error(error) from error

    def _deliver(self, number: int, head: Header, packet: bytes) -> None:
        waiting = self.replies.get(number)
        if waiting is None:
            self._parts.pop(number, None)  # the caller has given up
            return
        if head.channel & CONTINUED:
            parts = self._parts.setdefault(number, bytearray())
            parts += packet[HEADER_BYTES:]
            if len(parts) > _PARTS_BYTES_MAXIMUM:
                raise LinkError(f'the core answers with more than {_PARTS_BYTES_MAXIMUM} bytes')
            return
        if number in self._parts:
            packet = packet[:HEADER_BYTES] + self._parts.pop(number) + packet[HEADER_BYTES:]
        waiting.put((head, packet))
