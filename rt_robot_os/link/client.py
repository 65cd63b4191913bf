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
The client's side of the link, used by the ROS node, the recorder, the monitor and tests.

It receives the topics of a core when it connects, and the statistics on request. Calls may block:
not for the real-time loop.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import itertools
import os
from pathlib import Path
import queue
import select
import socket
import struct
import time
from typing import Any
from typing import Final
from typing import TYPE_CHECKING

from rt_robot_os.base.errors import LinkError
from rt_robot_os.base.safe_text import safe_line
from rt_robot_os.link.client_uploads import ClientUploadBuffer
from rt_robot_os.link.client_uploads import SampleTooLong
from rt_robot_os.link.core_statistics import collect
from rt_robot_os.link.core_statistics import CoreStatistics
from rt_robot_os.link.protocol import decode_json
from rt_robot_os.link.protocol import encode_json
from rt_robot_os.link.protocol import Header
from rt_robot_os.link.protocol import header
from rt_robot_os.link.protocol import HEADER_BYTES
from rt_robot_os.link.protocol import PACKET_BYTES_MAXIMUM
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.link.reader import connection_error
from rt_robot_os.link.reader import Inbox
from rt_robot_os.link.reader import Reader
from rt_robot_os.link.readers import Readers
from rt_robot_os.link.readers import readers_of
from rt_robot_os.link.robots import others_than
from rt_robot_os.linux.paths import socket_path

if TYPE_CHECKING:
    from rt_robot_os.topics import Bus

#: The end of the error for a core that does not answer.
HINT: Final = '; is the robot running?'


@dataclass(frozen=True)
class TopicInfo:
    """The facts about a topic of the core that a client receives."""

    name: str
    channel: int
    type_name: str
    size: int
    max_size: int
    stamp_offset: int | None
    depth: int
    rate_hz: float


def topic_infos(bus: Bus) -> tuple[TopicInfo, ...]:
    """List the topics of a core; the channel of a topic is its index in the list."""
    return tuple(TopicInfo(
        topic.name, channel, topic.layout.type_name, topic.layout.size, topic.layout.max_size,
        topic.layout.stamp_offset, topic.depth, topic.rate_hz)
        for channel, topic in enumerate(bus.topics))


RECEIVE_BUFFER_BYTES = 1 << 20
Answers = dict[int, Inbox]
US_PER_S = 1_000_000
_DATA_BYTES_MAXIMUM = PACKET_BYTES_MAXIMUM - HEADER_BYTES


class LinkSilent(LinkError):
    """The core has not answered in time; it may be alive and busy with higher priorities."""


class Question:
    """
    A request whose answer is received asynchronously.

    :param on_packet: called by the reading thread after each packet of the answer.
    :ivar packets: the packets of the answer so far.
    """

    def __init__(self, do: str, waiting: Answers, number: int,
                 on_packet: Callable[[Question], None] | None = None) -> None:
        self.do = do
        self._on_packet = on_packet
        self.packets: list[tuple[Header, bytes]] = []
        self._waiting = waiting
        self._number = number
        self._new: queue.SimpleQueue[tuple[Header, bytes]] = queue.SimpleQueue()
        waiting[number] = self

    def put(self, packet: tuple[Header, bytes]) -> None:
        """Receive a packet; called by the reading thread."""
        self._new.put(packet)
        if self._on_packet is not None:
            self._on_packet(self)

    def answered(self) -> bool:
        """Collect the packets that have arrived; return whether the answer is complete."""
        while not (self.packets and not self.packets[-1][0].channel):
            try:
                self.packets.append(self._new.get_nowait())
            except queue.Empty:
                return False
        return True

    def drop(self) -> None:
        """Stop waiting for the answer; may be called twice."""
        self._waiting.pop(self._number, None)


class LinkClient(Reader):
    """
    A connection to a core.

    One thread reads, by :meth:`pump`. Requests may be made in any thread; they read themselves if
    no other thread does. :class:`~rt_robot_os.link.reader.Reader` dispatches what is read.

    :param path: of the core's socket.
    :param name: of this client in the statistics of the core.
    :ivar core: the answer of the core to hello: pid, version and so on.
    :ivar topics: the topics of the core by name.
    :raises LinkError: no core listens there, or it has another version.
    """

    def __init__(self, path: Path, name: str = 'client', timeout_s: float = 5.0) -> None:
        super().__init__(socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET))
        self._timeout_s = timeout_s
        self._numbers = itertools.count(1)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
            # With settimeout() it would fail immediately when the core's listen queue is full.
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, struct.pack(
                'll', *divmod(max(1, round(timeout_s * US_PER_S)), US_PER_S)))
            self._socket.connect(str(path))
            self._socket.setblocking(False)
            self.core = self.request('hello', name=safe_line(name), pid=os.getpid())
        except OSError as error:
            self.close()
            if isinstance(error, LinkError):
                raise
            raise LinkError(f'no core answers at {path}: {error.strerror or error}'
                            f'{HINT}') from error
        try:
            self.topics = {t['name']: TopicInfo(**t) for t in self.core.pop('topics')}
        except (AttributeError, KeyError, TypeError) as error:
            self.close()
            raise LinkError(f'the process at {path} is not a core of this release: '
                            f'{type(error).__name__}: {error}') from error

    def __enter__(self) -> LinkClient:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()

    def begin(self, do: str, patience_s: float = 0.0,
              on_packet: Callable[[Question], None] | None = None, **arguments: Any) -> Question:
        """
        Send a request without waiting for its answer.

        :param patience_s: how long to wait while the socket is full.
        :param on_packet: as for :class:`Question`.
        :raises LinkSilent: the socket stays full.
        :raises LinkError: the connection is closed.
        """
        number = next(self._numbers)
        question = Question(do, self.replies, number, on_packet)
        try:
            self._send(encode_json(PacketKind.REQUEST, {'id': number, 'do': do, **arguments}),
                       patience_s)
        except BaseException:
            question.drop()
            raise
        return question

    def _ask(self, do: str, **arguments: Any) -> list[tuple[Header, bytes]]:
        """Send a request and collect the packets of its answer."""
        question = self.begin(do, self._timeout_s, **arguments)
        known = 0
        deadline = time.monotonic() + self._timeout_s
        try:
            while not question.answered():
                if len(question.packets) > known:
                    known = len(question.packets)
                    deadline = time.monotonic() + self._timeout_s
                if time.monotonic() > deadline:
                    raise LinkSilent(f'the core did not answer {do!r} within '
                                     f'{self._timeout_s:g} s')
                self.pump(0.02)
            return question.packets
        finally:
            question.drop()

    def request(self, do: str, **arguments: Any) -> dict[str, Any]:
        """
        Send a request to the core and wait for the answer.

        :return: the answer.
        :raises LinkError: the connection is closed, the core does not answer, or it refuses; the
            message gives its reason.
        """
        answer = decode_json(self._ask(do, **arguments)[-1][1])
        if 'error' in answer:
            raise LinkError(str(answer['error']))
        return answer

    def request_all(self, do: str, **arguments: Any) -> list[dict[str, Any]]:
        """
        Send a request that is answered by several packets, such as ``black_box``.

        :return: the content of each packet, without the last, which is empty.
        :raises LinkError: as for :meth:`request`.
        """
        answers = [decode_json(packet) for _, packet in self._ask(do, **arguments)]
        if 'error' in answers[-1]:
            raise LinkError(str(answers[-1]['error']))
        return answers[:-1]

    def statistics(self) -> CoreStatistics:
        """
        Request all statistics of the core.

        :raises LinkError: as for :meth:`request`.
        """
        return collect(self._ask('statistics'))

    def parameters(self) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """
        Request the parameters that may change while the core runs.

        :return: the facts common to all (``file`` and ``files``), and by the name of each its
            ``value``, ``loaded`` (the value in the configuration), ``unit``, ``description`` and
            ``wanted``.
        :raises LinkError: as for :meth:`request`.
        """
        first, *rest = self.request_all('parameters')
        return first, {str(each['name']): each for each in rest}

    def change(self, name: str, value: Any) -> Any:
        """
        Change a parameter, with effect from the next release or job.

        :param name: dotted, such as ``guard.rate_hz``.
        :return: the value in its declared type.
        :raises LinkError: as for :meth:`request`.
        """
        return self.request('change', name=name, value=value)['value']

    def mirror(self, topic: str, policy: str = 'drain', max_rate_hz: float = 0.0,
               initial: bool = False, oldest: bool = False, patient: bool = False,
               delay_ms: float = 0.0) -> int:
        """
        Request the samples of a topic.

        :param policy: ``drain`` or ``latest``.
        :param max_rate_hz: 0 for no limit.
        :param initial: begin with the last sample that was published before.
        :param oldest: begin with the oldest stored sample.
        :param patient: a sample that does not fit the socket is tried again, not dropped.
        :param delay_ms: how long the core may delay a sample to send it with others; 0: the
            setting ``core.link_gather_ms``.
        :return: the channel of the topic.
        :raises LinkError: as for :meth:`request`.
        """
        return int(self.request('mirror', topic=topic, policy=policy, max_rate_hz=max_rate_hz,
                                initial=initial, oldest=oldest, patient=patient,
                                delay_ms=delay_ms)['channel'])

    def readers(self, topic: str, answers: str = '') -> Readers:
        """
        Request the readers of a topic.

        :param answers: a topic that client readers must also publish, for a caller that awaits
            an answer there; readers in the core count in any case.
        :raises LinkError: as for :meth:`request`; there is no such topic.
        """
        return readers_of(self.request('readers', topic=topic, answers=answers))

    def tap(self) -> tuple[str, ...]:
        """
        Turn on the taps: topics with the bytes of devices and the times of jobs (``core/tap.py``).

        :return: these topics; they are added to :attr:`topics`.
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
        answer = self.request('advertise', topic=topic)
        channel = int(answer['channel'])
        deadline = time.monotonic() + self._timeout_s
        while answer.get('room') and channel not in self.upload_buffers.by_channel:
            if time.monotonic() > deadline:
                raise LinkSilent(f'topic {topic!r}: the core sent no upload buffer within '
                                 f'{self._timeout_s:g} s')
            self.pump(0.02)
        return channel

    def publish(self, channel: int, cdr: bytes, stamp_ns: int = 0) -> None:
        """
        Publish a sample of any length in the core; thread-safe.

        :param cdr: with its four bytes of encapsulation.
        :param stamp_ns: time of the data on CLOCK_MONOTONIC; 0 means now, so that a sample ages
            while it waits for the core. A time in the future counts as the time of arrival.
        :raises SampleTooLong: the sample is too long for the topic; nothing was sent.
        :raises LinkSilent: the core does not keep up; nothing was sent.
        :raises LinkError: the connection is closed.
        """
        stamp_ns = stamp_ns or time.monotonic_ns()
        if channel in self.upload_buffers.by_channel:
            self._publish_large(self.upload_buffers.by_channel[channel], cdr, stamp_ns)
            return
        if len(cdr) > _DATA_BYTES_MAXIMUM:
            raise SampleTooLong(f'a sample of {len(cdr)} bytes for channel {channel}; its topic '
                                f'allows at most {_DATA_BYTES_MAXIMUM}')
        self._send(header(PacketKind.DATA, channel, stamp_ns=stamp_ns) + cdr)

    def _publish_large(self, buffer: ClientUploadBuffer, cdr: bytes, stamp_ns: int) -> None:
        if buffer.publish(cdr, stamp_ns, self._send):
            return
        self.pump(0.0)  # the packet that returns a slot may not have been read yet
        if not buffer.publish(cdr, stamp_ns, self._send):
            raise LinkSilent('the core has not published the large samples before')

    def beat(self) -> None:
        """
        Send a heartbeat to the core.

        :raises LinkError: the connection is closed, or the core does not keep up.
        """
        self._send(header(PacketKind.BEAT, stamp_ns=time.monotonic_ns()))

    def _send(self, packet: bytes, patience_s: float = 0.0) -> None:
        deadline = time.monotonic() + patience_s
        while True:
            try:
                self._socket.send(packet)
                return
            except BlockingIOError:
                writable = select.poll()
                writable.register(self._socket, select.POLLOUT)
                if not writable.poll(max(0.0, deadline - time.monotonic()) * 1000):
                    raise LinkSilent('the core does not read its socket') from None
            except OSError as error:
                raise connection_error(error) from error


def connect(robot: str, name: str) -> LinkClient:
    """
    Connect to the core of a robot, as the programs do.

    :param robot: name of its files.
    :param name: of this client in the statistics of the core.
    :raises LinkError: the core does not answer; the message names the running robots.
    :raises StartError: the runtime folder cannot be used.
    """
    try:
        return LinkClient(socket_path(robot), name)
    except LinkError as error:
        raise LinkError(f'{error}{others_than(robot)}') from error
