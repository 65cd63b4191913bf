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
The protocols between the port and the packets of a sink: a serial line, or a forwarder.

Both decode a stream and queue packets to send; neither does any input or output.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Final
from typing import Protocol

from rt_robot_os.devices.device import Value
from rt_robot_os.features.wsn.packets.forwarder import ForwarderClient
from rt_robot_os.features.wsn.packets.framing import Frame
from rt_robot_os.features.wsn.packets.framing import FrameReader
from rt_robot_os.features.wsn.packets.framing import Protocols
from rt_robot_os.features.wsn.packets.serial_link import CAPACITY
from rt_robot_os.features.wsn.packets.serial_link import Link
from rt_robot_os.features.wsn.packets.serial_link import Outcome

# Largest number of unread outcomes; there cannot be more packets in transit.
_OUTCOMES: Final = 4 * CAPACITY


class Line(Protocol):
    """The interface of a line; as a decoder it has the counters of decoders."""

    frames: int
    rejected_bytes: int
    rejected_frames: int

    @property
    def problem(self) -> str:
        """Return why the other side cannot be used; empty when it can."""

    @property
    def ready(self) -> bool:
        """Return whether packets may arrive."""

    @property
    def pending_bytes(self) -> int:
        """Return the number of bytes that wait for the rest of their frame."""

    @property
    def waiting(self) -> int:
        """Return the number of packets that wait to be sent or acknowledged."""

    @property
    def due_ns(self) -> int | None:
        """Return when :meth:`output` has data: 0 for at once, None for never."""

    @property
    def answers(self) -> bool:
        """Return whether an answer to received data is to be sent at once."""

    def feed(self, data: bytes) -> Sequence[Frame]:
        """Add received bytes; return the completed frames with packets."""

    def reset(self) -> None:
        """Reset: pending bytes are rejected, waiting packets are given up."""

    def send(self, packet: bytes) -> int:
        """Queue a packet; return its ticket, 0 when the queue is full."""

    def output(self, now_ns: int) -> bytes:
        """Return the bytes to send now."""

    def take_outcomes(self) -> Sequence[Outcome]:
        """Return the outcomes of packets since the last call."""

    def command_counters(self) -> dict[str, Value]:
        """Return the counters of packets sent, by name."""

    def report(self) -> dict[str, Value]:
        """Return the other counters by name."""


class SerialLine(FrameReader):
    """A serial line: frames with packets, and acknowledgements, which it handles."""

    def __init__(self, protocols: Protocols) -> None:
        """
        Create an idle line.

        :param protocols: of the frames sent; frames of both generations are received.
        """
        super().__init__()
        self._link = Link(protocols)

    @property
    def problem(self) -> str:
        """Return nothing: problems of a serial line show in its bytes."""
        return ''

    @property
    def ready(self) -> bool:
        """Return whether packets may arrive: always."""
        return True

    @property
    def waiting(self) -> int:
        """Return the number of packets that wait to be sent or acknowledged."""
        return self._link.waiting

    @property
    def due_ns(self) -> int | None:
        """Return when :meth:`output` has data: 0 for at once, None for never."""
        return self._link.next_ns

    @property
    def answers(self) -> bool:
        """Return whether acknowledgements for the mote are to be sent."""
        return self._link.has_answers

    def feed(self, data: bytes) -> list[Frame]:
        """
        Add received bytes; never raises.

        :return: the completed frames with packets, in order.
        """
        take = self._link.take
        return [each for each in super().feed(data) if take(each)]

    def reset(self) -> None:
        """Reset: pending bytes are rejected, waiting packets are given up."""
        super().reset()
        self._link.reset()

    def send(self, packet: bytes) -> int:
        """Queue a packet; return its ticket, 0 when the queue is full."""
        return self._link.send(packet)

    def output(self, now_ns: int) -> bytes:
        """Return the bytes to send now."""
        return self._link.poll(now_ns)

    def take_outcomes(self) -> list[Outcome]:
        """Return the outcomes of packets since the last call."""
        return self._link.take_outcomes()

    def command_counters(self) -> dict[str, Value]:
        """Return the counters of packets sent, by name."""
        link = self._link
        return {'waiting_commands': link.waiting, 'acknowledged_commands': link.acknowledged,
                'unacknowledged_commands': link.given_up, 'command_resends': link.resends}

    def report(self) -> dict[str, Value]:
        """Return the other counters by name."""
        link = self._link
        return {'acks_sent': link.answered, 'stray_acks': link.stray_acks,
                'acks_dropped': link.answers_dropped}


class ForwarderLine:
    """
    A serial forwarder of TinyOS.

    It does not acknowledge packets; those that wait when the connection breaks are reported as
    given up.

    :ivar frames: packets received.
    :ivar rejected_bytes: bytes that do not belong to its protocol.
    :ivar rejected_frames: always 0; TCP has checksums of its own.
    """

    def __init__(self, protocols: Protocols, platform: str) -> None:
        """
        Create an unconnected line.

        :param protocols: of the generation that is set.
        :param platform: of the motes under TinyOS 1.x.
        """
        self.frames = 0
        self.rejected_bytes = 0
        self.rejected_frames = 0
        self._protocols = protocols
        self._platform = platform
        self._client = ForwarderClient(protocols.name, platform=platform)
        self._rejected = 0
        self._connections = 0
        self._sent = self._given_up = 0
        self._tickets = 0
        self._waiting: deque[tuple[int, bytes]] = deque()
        self._outcomes: deque[Outcome] = deque(maxlen=_OUTCOMES)

    @property
    def problem(self) -> str:
        """Return why the other side cannot be used; empty when it can."""
        return self._client.problem

    @property
    def ready(self) -> bool:
        """Return whether the handshake is complete."""
        return self._client.ready

    @property
    def pending_bytes(self) -> int:
        """Return the number of bytes that wait for the rest of their packet."""
        return self._client.pending_bytes

    @property
    def waiting(self) -> int:
        """Return the number of packets that wait for the connection."""
        return len(self._waiting)

    @property
    def due_ns(self) -> int | None:
        """Return when :meth:`output` has data: 0 for at once, None for never."""
        return 0 if self.answers or self._waiting and self._client.ready else None

    @property
    def answers(self) -> bool:
        """Return whether a handshake is to be sent."""
        return self._client.has_output

    def feed(self, data: bytes) -> list[Frame]:
        """
        Add received bytes; never raises.

        :return: a frame for each completed packet; all end with the last byte.
        """
        client, plain, end = self._client, self._protocols.plain, len(data)
        found = [Frame(plain, -1, packet, end, len(packet) + 1) for packet in client.feed(data)]
        self.frames += len(found)
        self.rejected_bytes += client.rejected_bytes - self._rejected
        self._rejected = client.rejected_bytes
        return found

    def reset(self) -> None:
        """Restart the handshake: pending bytes are rejected, waiting packets are given up."""
        self.rejected_bytes += self._client.pending_bytes
        self._rejected = 0
        self._client = ForwarderClient(self._protocols.name, platform=self._platform)
        self._connections += 1
        self._given_up += len(self._waiting)
        self._outcomes.extend(Outcome(ticket, packet, False, 0)
                              for ticket, packet in self._waiting)
        self._waiting.clear()

    def send(self, packet: bytes) -> int:
        """Queue a packet; return its ticket, 0 when the queue is full."""
        if len(self._waiting) >= CAPACITY:
            return 0
        self._tickets += 1
        self._waiting.append((self._tickets, packet))
        return self._tickets

    def output(self, now_ns: int) -> bytes:
        """Return the bytes to send now."""
        client = self._client
        while self._waiting and client.ready:
            client.send(self._waiting.popleft()[1])
            self._sent += 1
        return client.take_output()

    def take_outcomes(self) -> list[Outcome]:
        """Return the packets that were given up since the last call."""
        found = list(self._outcomes)
        self._outcomes.clear()
        return found

    def command_counters(self) -> dict[str, Value]:
        """Return the counters of packets sent, by name."""
        return {'waiting_commands': len(self._waiting), 'forwarded_commands': self._sent,
                'unacknowledged_commands': self._given_up}

    def report(self) -> dict[str, Value]:
        """Return the other counters by name."""
        state = 'connected' if self.ready else 'refused' if self.problem else 'greeting'
        return {'forwarder': state, 'forwarder_platform': self._client.peer_platform,
                'forwarder_connections': self._connections}
