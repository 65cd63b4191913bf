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
The other side of the link: what the ROS node, a recorder, a monitor or a test uses.

Not for the real-time loop: calls here may wait.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from collections.abc import Iterator
import itertools
import os
from pathlib import Path
import queue
import select
import socket
import struct
import threading
import time
from typing import Any

from rt_robot_os.errors import LinkError
from rt_robot_os.link.batch import records
from rt_robot_os.link.facts import collect
from rt_robot_os.link.facts import CoreStatistics as CoreStatistics
from rt_robot_os.link.facts import TopicInfo as TopicInfo
from rt_robot_os.link.memories import ClientMemories
from rt_robot_os.link.memories import give_back
from rt_robot_os.link.protocol import decode_json
from rt_robot_os.link.protocol import encode_json
from rt_robot_os.link.protocol import HEADER
from rt_robot_os.link.protocol import Header
from rt_robot_os.link.protocol import header
from rt_robot_os.link.protocol import HEADER_BYTES
from rt_robot_os.link.protocol import Kind
from rt_robot_os.link.protocol import PACKET_BYTES_MAXIMUM
from rt_robot_os.link.protocol import parse_header
from rt_robot_os.linux.memory_file import FD_BYTES
from rt_robot_os.linux.memory_file import received_fds

RECEIVE_BUFFER_BYTES = 1 << 20
US_PER_S = 1_000_000

DataHandler = Callable[[Header, memoryview], None]
ReportHandler = Callable[[dict[str, Any]], None]

_CLOSED = 'the core closed the connection'


def _parted(error: OSError) -> LinkError:
    """Say the same of a core that has ended, whether it was noticed in reading or in sending."""
    if isinstance(error, BrokenPipeError | ConnectionResetError):
        return LinkError(_CLOSED)
    return LinkError(f'the core is gone: {error.strerror or error}')


class LinkClient:
    """
    A connection to a core.

    One thread reads, by :meth:`pump` or :meth:`serve`; requests may come from any thread, and read
    by themselves when nobody else does.

    :param path: of the core's socket.
    :param name: what the core calls this client in its statistics.
    :ivar on_data: called by the reading thread with each sample: header and CDR, valid during the
        call only. The CDR may be written to. A large one lies where the core put it, and that
        place is given back afterwards: who is slow with it loses the next ones.
    :ivar on_report: called by the reading thread with each report of the core.
    :ivar core: what the core said when it was greeted: pid, version and so on.
    :ivar topics: the topics of the core by name.
    :raises LinkError: nobody listens there, or it is no core of this version.
    """

    def __init__(self, path: Path, name: str = 'client', timeout_s: float = 5.0) -> None:
        self.on_data: DataHandler | None = None
        self.on_report: ReportHandler | None = None
        self.last_beat_ns = time.monotonic_ns()
        self.closed = False
        self._timeout_s = timeout_s
        self._numbers = itertools.count(1)
        self._replies: dict[int, queue.SimpleQueue[tuple[Header, bytes]]] = {}
        self._reader = threading.Lock()
        self._buffer = bytearray(PACKET_BYTES_MAXIMUM)
        self._view = memoryview(self._buffer)
        self._memories = ClientMemories()
        self._owed: deque[bytes] = deque()
        self._records: Iterator[memoryview] | None = None
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
            # With settimeout() it would not wait for a place among those that are to be accepted.
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, struct.pack(
                'll', *divmod(max(1, round(timeout_s * US_PER_S)), US_PER_S)))
            self._socket.connect(str(path))
            self._socket.setblocking(False)
            self._poll = select.poll()
            self._poll.register(self._socket, select.POLLIN)
            self.core = self.request('hello', name=name, pid=os.getpid())
        except OSError as error:
            self._socket.close()
            if isinstance(error, LinkError):
                raise
            raise LinkError(f'no core answers at {path}: {error.strerror or error}; '
                            'is the robot running?') from error
        self.topics = {t['name']: TopicInfo(**t) for t in self.core.pop('topics')}

    def close(self) -> None:
        """Leave; may be called twice."""
        self.closed = True
        self._socket.close()
        if self._reader.acquire(blocking=False):  # else somebody reads: they go with the client
            self._memories.close()
            self._reader.release()

    def __enter__(self) -> LinkClient:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()

    # ---- reading -----------------------------------------------------------------------------

    def pump(self, timeout_s: float) -> int:
        """
        Wait for packets and handle all that are there.

        :return: how many there were; 0 when the time was over, or another thread reads.
        :raises LinkError: the core is gone.
        """
        if not self._reader.acquire(timeout=timeout_s):
            return 0
        try:
            if self.closed:
                raise LinkError('the connection to the core is closed')
            if self._owed:
                self._settle()
            if self._records is not None:
                self._hand_on(self._records)  # a handler raised: the others come after it
            if not self._poll.poll(max(0.0, timeout_s) * 1000):
                return 0
            count = 0
            while length := self._receive(count):
                count += 1
                self._handle(length)
            return count
        finally:
            self._reader.release()

    def _receive(self, count: int) -> int:
        """Receive a packet; none is 0. What came before the end counts: the next call tells it."""
        try:
            length, ancillary, _, _ = self._socket.recvmsg_into(
                [self._buffer], FD_BYTES, socket.MSG_CMSG_CLOEXEC)
        except BlockingIOError:
            return 0
        except OSError as error:
            if count:
                return 0
            raise _parted(error) from error
        if ancillary:
            self._memories.take(self._view[:length], received_fds(ancillary))
        if not length and not count:
            raise LinkError(_CLOSED)
        return length

    def _handle(self, length: int) -> None:
        kind = self._buffer[0]
        if kind == Kind.DATA and length >= HEADER_BYTES:
            if self.on_data is not None:
                self.on_data(Header(*HEADER.unpack_from(self._buffer)),
                             self._view[HEADER_BYTES:length])
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
            if self.on_report is not None:
                self.on_report(decode_json(packet))
        elif kind == Kind.TASK:
            self._deliver(head.seq, head, packet)
        elif kind == Kind.REPLY:
            self._deliver(head.seq, head, packet)

    def _hand_on(self, samples: Iterator[memoryview]) -> None:
        for sample in samples:
            if self.on_data is not None:
                self.on_data(Header(*HEADER.unpack_from(sample)), sample[HEADER_BYTES:])
        self._records = None

    def _handle_slot(self, length: int) -> None:
        """Hand on a large sample in place, and give its slot back, whatever the handler does."""
        packet = bytes(self._view[:length])
        head = parse_header(packet)
        sample = self._memories.sample(packet)
        if sample is None:
            return
        try:
            if self.on_data is not None:
                self.on_data(head._replace(kind=Kind.DATA), sample)
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
            raise _parted(error) from error

    def _deliver(self, number: int, head: Header, packet: bytes) -> None:
        waiting = self._replies.get(number)
        if waiting is not None:
            waiting.put((head, packet))

    # ---- asking ------------------------------------------------------------------------------

    def _ask(self, do: str, **arguments: Any) -> list[tuple[Header, bytes]]:
        """Send a request and collect the packets of its answer, the last one marked final."""
        number = next(self._numbers)
        replies: queue.SimpleQueue[tuple[Header, bytes]] = queue.SimpleQueue()
        self._replies[number] = replies
        deadline = time.monotonic() + self._timeout_s
        collected: list[tuple[Header, bytes]] = []
        try:
            self._send(encode_json(Kind.REQUEST, {'id': number, 'do': do, **arguments}),
                       self._timeout_s)
            while True:
                try:
                    head, packet = replies.get_nowait()
                except queue.Empty:
                    if time.monotonic() > deadline:
                        raise LinkError(f'the core did not answer {do!r} within '
                                        f'{self._timeout_s:g} s') from None
                    self.pump(0.02)
                    continue
                collected.append((head, packet))
                deadline = time.monotonic() + self._timeout_s
                if head.channel == 0:  # no more to come
                    return collected
        finally:
            del self._replies[number]

    def request(self, do: str, **arguments: Any) -> dict[str, Any]:
        """
        Ask the core to do something.

        :return: its answer.
        :raises LinkError: the core is gone, silent, or refuses; the message says why.
        """
        answer = decode_json(self._ask(do, **arguments)[-1][1])
        if 'error' in answer:
            raise LinkError(str(answer['error']))
        return answer

    def request_all(self, do: str, **arguments: Any) -> list[dict[str, Any]]:
        """
        Ask for something that takes several packets, such as ``black_box``.

        :return: what each of them holds, without the last, which holds nothing.
        :raises LinkError: as for :meth:`request`.
        """
        answers = [decode_json(packet) for _, packet in self._ask(do, **arguments)]
        if 'error' in answers[-1]:
            raise LinkError(str(answers[-1]['error']))
        return answers[:-1]

    def statistics(self) -> CoreStatistics:
        """
        Get all statistics of the core.

        :raises LinkError: as for :meth:`request`.
        """
        return collect(self._ask('statistics'))

    def mirror(self, topic: str, policy: str = 'drain', max_rate_hz: float = 0.0,
               initial: bool = False, oldest: bool = False, patient: bool = False) -> int:
        """
        Ask for the samples of a topic.

        :param policy: ``drain`` or ``latest``.
        :param max_rate_hz: 0 for no limit.
        :param initial: begin with the last sample that is there already.
        :param oldest: begin with the oldest that is kept.
        :param patient: what does not fit the socket now is tried again, not lost at once.
        :return: their channel.
        :raises LinkError: as for :meth:`request`.
        """
        return int(self.request('mirror', topic=topic, policy=policy, max_rate_hz=max_rate_hz,
                                initial=initial, oldest=oldest, patient=patient)['channel'])

    def tap(self) -> tuple[str, ...]:
        """
        Have the bytes of devices and the times of jobs noted in topics, see ``core/tap.py``.

        :return: those topics; :attr:`topics` has them now.
        :raises LinkError: as for :meth:`request`.
        """
        answer = self.request('tap')
        self.topics = {t['name']: TopicInfo(**t) for t in answer['topics']}
        return tuple(answer['taps'])

    def advertise(self, topic: str) -> int:
        """
        Announce that this client publishes a topic.

        :return: the channel for :meth:`publish`.
        :raises LinkError: as for :meth:`request`.
        """
        return int(self.request('advertise', topic=topic)['channel'])

    def publish(self, channel: int, cdr: bytes, stamp_ns: int = 0) -> None:
        """
        Publish a sample in the core.

        :param cdr: with its four bytes of encapsulation.
        :param stamp_ns: on CLOCK_MONOTONIC; 0, or a moment to come, for that of its arrival in
            the core.
        :raises LinkError: the core is gone, or does not keep up.
        """
        self._send(header(Kind.DATA, channel, stamp_ns=stamp_ns) + cdr)

    def beat(self) -> None:
        """
        Tell the core that this client is alive.

        :raises LinkError: the core is gone, or does not keep up.
        """
        self._send(header(Kind.BEAT, stamp_ns=time.monotonic_ns()))

    def _send(self, packet: bytes, patience_s: float = 0.0) -> None:
        deadline = time.monotonic() + patience_s
        while True:
            try:
                self._socket.send(packet)
                return
            except BlockingIOError:
                room = select.poll()
                room.register(self._socket, select.POLLOUT)
                if not room.poll(max(0.0, deadline - time.monotonic()) * 1000):
                    raise LinkError('the core does not read what it is sent') from None
            except OSError as error:
                raise _parted(error) from error
