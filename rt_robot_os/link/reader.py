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

"""How a client of the link reads: packets, and large samples in memory files."""

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
from rt_robot_os.link.client_rooms import ClientRooms
from rt_robot_os.link.fetch_clock import FetchClock
from rt_robot_os.link.protocol import CONTINUED
from rt_robot_os.link.protocol import decode_json
from rt_robot_os.link.protocol import HEADER
from rt_robot_os.link.protocol import Header
from rt_robot_os.link.protocol import HEADER_BYTES
from rt_robot_os.link.protocol import Kind
from rt_robot_os.link.protocol import PACKET_BYTES_MAXIMUM
from rt_robot_os.link.protocol import parse_header
from rt_robot_os.link.protocol import VERSION
from rt_robot_os.link.records import Record
from rt_robot_os.link.records import records
from rt_robot_os.link.sign_of_life import Life
from rt_robot_os.linux.memory_file import FD_BYTES
from rt_robot_os.linux.memory_file import received_fds


DataHandler = Callable[[Header, memoryview], None]
# Called with a sample of one topic: stamp in ns, samples missed, CDR.
SampleHandler = Callable[[int, int, memoryview], None]
ReportHandler = Callable[[dict[str, Any]], None]

_PACKETS_AT_ONCE = 512
# Reports that wait until on_report is set; the newest are kept.
_REPORTS_MAXIMUM = 1000
_PARTS_BYTES_MAXIMUM = 64 << 20
_CLOSED = 'the core closed the connection'


class Inbox(Protocol):
    """Where the packets of an answer go."""

    def put(self, packet: tuple[Header, bytes], /) -> None:
        """Receive one; called by the reading thread."""


def connection_error(error: OSError) -> LinkError:
    """Make the error for a core that has ended: the same after a failed read as after a send."""
    if isinstance(error, BrokenPipeError | ConnectionResetError):
        return LinkError(_CLOSED)
    return LinkError(f'the core is gone: {error.strerror or error}')


class Reader:
    """
    Read packets from the socket of a client and hand them on.

    One thread reads at a time; others find the reader taken and go on without.

    :param connection: not blocking once it is connected; closed by :meth:`close`.
    :ivar on_data: called by the reading thread with each sample: header and CDR, valid during the
        call only. The CDR may be written to. A large one lies where the core put it, and that
        place is given back afterwards: who is slow with it loses the next ones.
    :ivar carriers: called instead, by channel, without building the header.
    :ivar clock: when packets are read while nothing but samples is awaited.
    :ivar on_report: called by the reading thread with each report of the core; those that came
        before it was set, with the answer to the greeting, come first.
    :ivar replies: where the answers to requests go, by the number of the request.
    :ivar last_beat_ns: when a beat of the core was read last, on CLOCK_MONOTONIC.
    :ivar rooms: for the large samples that this client publishes.
    :ivar life: the core's sign of life, which needs no packets; None until it has come.
    """

    def __init__(self, connection: socket.socket) -> None:
        self.on_data: DataHandler | None = None
        self.carriers: dict[int, SampleHandler] = {}
        self.on_report: ReportHandler | None = None
        self.last_beat_ns = time.monotonic_ns()
        self.closed = False
        self.life: Life | None = None
        self.replies: dict[int, Inbox] = {}
        self._parts: dict[int, bytearray] = {}
        self._taken = threading.Lock()
        self._buffer = bytearray(PACKET_BYTES_MAXIMUM)
        self._view = memoryview(self._buffer)
        self._memories = ClientMemories()
        self.rooms = ClientRooms()
        self._owed: deque[bytes] = deque()
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
        self.rooms.close()
        if self._taken.acquire(blocking=False):  # else a thread reads in them: they end with it
            self._memories.close()
            if self.life is not None:
                self.life.close()
                self.life = None
            self._taken.release()

    def pump(self, timeout_s: float) -> int:
        """
        Wait for packets and handle those that are there, up to some hundred.

        :return: how many there were; 0 when the time was over, or another thread reads.
        :raises LinkError: the core is gone.
        """
        if not self._taken.acquire(timeout=timeout_s):
            return 0
        try:
            if self.closed:
                raise LinkError('the connection to the core is closed')
            if self._owed:
                self._settle()
            self._hand_on_reports()
            if self._records is not None:
                self._hand_on(self._records)  # left from a packet whose handler raised
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
            self._taken.release()

    def _wait(self, timeout_s: float) -> bool:
        """Wait until there may be packets; an answer that is awaited is read at once."""
        if self.clock.interval_ns and timeout_s > 0 and not self.replies:
            return self.clock.wait(timeout_s)
        return bool(self._poll.poll(max(0.0, timeout_s) * 1000))

    def _hand_on_reports(self) -> None:
        while self._reports and self.on_report is not None:
            self.on_report(self._reports.popleft())

    def _receive(self, count: int) -> int:
        """Receive a packet; none is 0. What came before the end counts: the next call tells it."""
        try:
            length, ancillary, _, _ = self._socket.recvmsg_into(
                [self._buffer], FD_BYTES, socket.MSG_CMSG_CLOEXEC)
        except BlockingIOError:
            return 0
        except ConnectionResetError:
            # The core ended before it had read all that it was sent. Linux tells that, once, ahead
            # of what it has said before.
            return self._receive(count)
        except OSError as error:
            if count:
                return 0
            raise connection_error(error) from error
        if ancillary:
            self._take_fds(length, received_fds(ancillary))
        if not length and not count:
            raise LinkError(_CLOSED)
        return length

    def _take_fds(self, length: int, fds: list[int]) -> None:
        if length and self._buffer[0] == Kind.LIFE and len(fds) == 1:
            if self.life is not None:
                self.life.close()
            self.life = Life(fds[0])
        elif length and self._buffer[0] == Kind.ROOM:
            self.rooms.take(self._view[:length], fds)
        else:
            self._memories.take(self._view[:length], fds)

    def _handle(self, length: int) -> None:
        kind = self._buffer[0]
        if kind == Kind.DATA and length >= HEADER_BYTES:
            _, _, channel, missed, stamp_ns, seq = HEADER.unpack_from(self._buffer)
            self._hand_on(iter((
                (channel, missed, stamp_ns, seq, self._view[HEADER_BYTES:length]),)))
            return
        if kind == Kind.BATCH:
            self._records = records(self._view[:length])
            self._hand_on(self._records)
            return
        if kind == Kind.SLOT:
            self._handle_slot(length)
            return
        packet = bytes(self._view[:length])
        head = parse_header(packet)
        if kind == Kind.BEAT:
            self.last_beat_ns = time.monotonic_ns()
        elif kind == Kind.REPORT:
            self._reports.append(decode_json(packet))
            self._hand_on_reports()
        elif kind == Kind.TASK:
            self._deliver(head.seq, head, packet)
        elif kind == Kind.REPLY:
            self._deliver(head.seq, head, packet)
        elif kind == Kind.GIVE_BACK:
            self.rooms.returned(head.channel, packet)

    def _hand_on(self, samples: Iterator[Record]) -> None:
        carriers = self.carriers
        for channel, missed, stamp_ns, seq, cdr in samples:
            carry = carriers.get(channel)
            if carry is not None:
                carry(stamp_ns, missed, cdr)
            elif self.on_data is not None:
                self.on_data(Header(Kind.DATA, VERSION, channel, missed, stamp_ns, seq), cdr)
        self._records = None

    def _handle_slot(self, length: int) -> None:
        """Hand on a large sample in place, and give its slot back, whatever the handler does."""
        packet = bytes(self._view[:length])
        head = parse_header(packet)
        sample = self._memories.sample(packet)
        if sample is None:
            return
        try:
            self._hand_on(iter(((head.channel, head.missed, head.stamp_ns, head.seq, sample),)))
        finally:
            self._owed.append(give_back(packet))
            self._settle()

    def _settle(self) -> None:
        """Give back the slots that are owed, as far as the core takes it."""
        try:
            while self._owed:
                self._socket.send(self._owed[0])
                self._owed.popleft()
        except BlockingIOError:
            pass  # it will be tried again; until then the core has fewer slots to fill
        except OSError as error:
            raise connection_error(error) from error

    def _deliver(self, number: int, head: Header, packet: bytes) -> None:
        waiting = self.replies.get(number)
        if waiting is None:
            self._parts.pop(number, None)  # whoever asked has given up
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
