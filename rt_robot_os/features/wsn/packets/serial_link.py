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
The serial link to a mote, with acknowledgements in both directions.

A mote accepts one frame at a time, and acknowledges it with its token when it had room: no
acknowledgement means back-pressure, or a lost frame. So a frame is retransmitted with the same
token a few times.
"""

from __future__ import annotations

from collections import deque
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.features.wsn.packets.framing import Frame
from rt_robot_os.features.wsn.packets.framing import frame
from rt_robot_os.features.wsn.packets.framing import FrameReader
from rt_robot_os.features.wsn.packets.framing import PROTOCOLS
from rt_robot_os.features.wsn.packets.framing import Protocols

TRIES: Final = 3
WAIT_NS: Final = 250 * NS_PER_MS
#: As in the serial forwarders in C of both generations.
FIRST_TOKEN: Final = 0x26
#: Capacity of the queue, as large as that of a base station for its radio.
CAPACITY: Final = 12
_MOST_ANSWERS: Final = 64


class Outcome(NamedTuple):
    """
    The result of sending a packet.

    :ivar ticket: returned by :meth:`Link.send`.
    :ivar acknowledged: the mote has acknowledged it; else its fate is unknown.
    :ivar tries: number of transmissions.
    """

    ticket: int
    packet: bytes
    acknowledged: bool
    tries: int


class Link:
    """
    The host's end of a serial line; without I/O, times are arguments.

    ``feed`` processes received bytes, ``send`` queues a packet; ``poll`` returns the bytes to
    write now, and is due again at ``next_ns``. Safe in the real-time loop.

    :ivar reader: of the frames, with its counters.
    :ivar acknowledged: number of packets that the mote has acknowledged.
    :ivar given_up: number of packets without an acknowledgement in all tries.
    :ivar resends: number of retransmitted frames.
    :ivar refused: number of packets that did not fit into the queue.
    :ivar stray_acks: number of unexpected acknowledgements, as of a frame written twice.
    :ivar answered: number of packets of the mote that were acknowledged.
    :ivar answers_dropped: number of packets of the mote that were not, because too many arrived
        between two polls.
    """

    def __init__(self, protocols: Protocols, tries: int = TRIES, wait_ns: int = WAIT_NS,
                 capacity: int = CAPACITY, first_token: int = FIRST_TOKEN) -> None:
        """
        Start with an empty queue.

        :param protocols: ``TINYOS_1`` or ``TINYOS_2`` for writing; both are read.
        :param tries: largest number of transmissions of a packet.
        :param wait_ns: timeout of an acknowledgement.
        :param capacity: of the queue, the packet being sent included.
        :param first_token: of the first frame; incremented with each.
        """
        self.reader = FrameReader()
        self.acknowledged = 0
        self.given_up = 0
        self.resends = 0
        self.refused = 0
        self.stray_acks = 0
        self.answered = 0
        self.answers_dropped = 0
        self._protocols = protocols
        self._tries = tries
        self._wait_ns = wait_ns
        self._capacity = capacity
        self._token = first_token & 0xFF
        self._tickets = 0
        self._waiting: deque[tuple[int, bytes]] = deque()
        self._answers: list[bytes] = []
        self._outcomes: deque[Outcome] = deque(maxlen=4 * capacity)
        # Of the first in the queue: its frame, number of transmissions, and timeout.
        self._written = b''
        self._tried = 0
        self._until_ns = 0

    @property
    def waiting(self) -> int:
        """Return the number of queued packets, the one being sent included."""
        return len(self._waiting)

    @property
    def has_answers(self) -> bool:
        """Return whether ``poll`` has acknowledgements to write."""
        return bool(self._answers)

    @property
    def next_ns(self) -> int | None:
        """Return when ``poll`` is due: 0 immediately, None never."""
        if self._answers or self._waiting and not self._tried:
            return 0
        return self._until_ns if self._waiting else None

    def feed(self, data: bytes) -> list[Frame]:
        """
        Process the next bytes from the mote; never raises.

        :return: frames with packets, and those of an unknown P; acknowledgements are handled here.
        """
        return [each for each in self.reader.feed(data) if self.take(each)]

    def take(self, read: Frame) -> bool:
        """
        Process a frame of a reader.

        :return: whether it has a packet, or an unknown P; else it was an acknowledgement.
        """
        known = PROTOCOLS.get(read.protocol)
        if known is None or read.protocol == known.plain:
            return True
        if read.protocol == known.ack:
            self._take_ack(known, read.token)
            return False
        self._answer(known, read.token)
        return True

    def speak(self, protocols: Protocols) -> None:
        """Write in the protocol of another generation of TinyOS from the next frame on."""
        self._protocols = protocols

    def send(self, packet: bytes) -> int:
        """
        Queue a packet.

        :return: its ticket, 1 and up; 0 when the queue is full, which is counted.
        :raises ValueError: it is too long for a frame.
        """
        frame(self._protocols.acked, b'\0' + packet)
        if len(self._waiting) >= self._capacity:
            self.refused += 1
            return 0
        self._tickets += 1
        self._waiting.append((self._tickets, packet))
        return self._tickets

    def poll(self, now_ns: int) -> bytes:
        """
        Return the bytes to write now; they must be written completely.

        :param now_ns: of a monotonic clock.
        """
        found, self._answers = b''.join(self._answers), []
        if not self._waiting or self._tried and now_ns < self._until_ns:
            return found
        if self._tried >= self._tries:
            self.given_up += 1
            self._end(False)
            if not self._waiting:
                return found
        if not self._tried:
            self._written = frame(
                self._protocols.acked, bytes((self._token,)) + self._waiting[0][1])
        else:
            self.resends += 1
        self._tried += 1
        self._until_ns = now_ns + self._wait_ns
        return found + self._written

    def take_outcomes(self) -> list[Outcome]:
        """Return the results since the last call, in order; the oldest are dropped first."""
        found = list(self._outcomes)
        self._outcomes.clear()
        return found

    def reset(self) -> None:
        """Restart, as after opening the port: queued packets are dropped, counters stay."""
        self.reader.reset()
        self._answers.clear()
        while self._waiting:
            self.given_up += 1
            self._end(False)

    def _take_ack(self, protocols: Protocols, token: int) -> None:
        # A mote acknowledges in the protocol of the frame, and only the current frame.
        if self._tried and protocols is self._protocols and token == self._token:
            self.acknowledged += 1
            self._end(True)
        else:
            self.stray_acks += 1

    def _end(self, acknowledged: bool) -> None:
        ticket, packet = self._waiting.popleft()
        self._outcomes.append(Outcome(ticket, packet, acknowledged, self._tried))
        if self._tried:
            self._token = self._token + 1 & 0xFF
        self._tried = 0

    def _answer(self, protocols: Protocols, token: int) -> None:
        if len(self._answers) >= _MOST_ANSWERS:
            self.answers_dropped += 1
            return
        self.answered += 1
        self._answers.append(frame(protocols.ack, bytes((token,))))
