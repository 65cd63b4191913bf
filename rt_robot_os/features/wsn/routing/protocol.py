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
Interfaces of a routing protocol and of the node that it runs on.

A protocol is driven by calls only, so that the same code runs in the simulator, in tests and with
a recorded log. Times are integers in ns on the node's own clock, which drifts. Addresses have 16
bits, as on the air.
"""

from __future__ import annotations

from abc import ABC
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from random import Random
from typing import Final
from typing import Protocol

BROADCAST: Final = 0xFFFF
#: TinyOS counts time in 1/1024 s, and calls it ms.
BINARY_MS_NS: Final = 1_000_000_000 / 1024


@dataclass(frozen=True)
class Received:
    """
    A frame that the radio received, with a correct checksum.

    :ivar destination: the node's address, or the broadcast address.
    :ivar source: the last sender; -1 if the frame does not have it, as in TinyOS 1.x.
    :ivar am_type: type of the payload.
    :ivar payload: of the active message.
    :ivar lqi: link quality indication of the CC2420: about 50 to 110.
    :ivar rssi_dbm: signal strength.
    """

    destination: int
    source: int
    am_type: int
    payload: bytes
    lqi: int
    rssi_dbm: int


class Timer(Protocol):
    """A timer of a node; it stops with the node's power."""

    def start(self, delay_ns: int) -> None:
        """Start as a one-shot timer; replaces an earlier start."""

    def every(self, period_ns: int) -> None:
        """Start as a periodic timer, on a grid of times from now on."""

    def stop(self) -> None:
        """Stop the timer; may be repeated."""


class Sender(Protocol):
    """
    Buffer for one frame at the radio of a node; the radio serves its senders in turn.

    :ivar busy: a frame is being sent; ``done`` has not been called yet.
    """

    busy: bool

    def send(self, destination: int, am_type: int, payload: bytes, acknowledge: bool) -> bool:
        """
        Send a frame.

        :param acknowledge: whether to request an acknowledgement.
        :return: False when the sender is busy; then nothing happens.
        """

    def rewrite(self, destination: int, payload: bytes) -> None:
        """
        Change the frame that is being sent, if it has not left the mote's memory yet.

        In TOSSIM a frame on the air changes too, and counts as acknowledged if that was requested.
        """


class Node(Protocol):
    """
    The node, as a protocol uses it.

    :ivar address: the node's.
    :ivar random: for delays; seeded.
    """

    address: int
    random: Random

    def now_ns(self) -> int:
        """Return the time since the node started."""

    def timer(self, call: Callable[[], None]) -> Timer:
        """Create a timer with its callback."""

    def sender(self, done: Callable[[bool], None]) -> Sender:
        """
        Create a sender.

        :param done: called when the frame has been sent, with whether it was acknowledged; always
            False without a request.
        """

    def deliver(self, am_type: int, payload: bytes, origin: int, application: bytes) -> None:
        """
        Deliver a data packet to the sink's serial line; only at the root.

        :param payload: of the active message, headers of the protocol included.
        :param origin: address of the origin.
        :param application: payload of the application at the origin.
        """

    def note(self, event: str, *numbers: int) -> None:
        """Record an event for logs and plots, such as ``parent 3``; cheap."""


class Router(ABC):
    """
    A protocol on one node.

    :ivar root: it is the sink.
    :ivar parent: the next node on the route to the sink; None without a route, and at the root.
    :ivar cost: of the whole route, in the unit of the protocol; 0 at the root.
    :ivar hops: to the sink.
    :ivar counters: by name, such as ``queue_full``, ``resends``, ``given_up``, ``loops``,
        ``duplicates``.
    """

    root: bool
    parent: int | None
    cost: int
    hops: int
    counters: dict[str, int]

    @abstractmethod
    def start(self) -> None:
        """Start without a route: the node has booted."""

    @abstractmethod
    def stop(self) -> None:
        """Stop timers and clear queues: the node has no power."""

    @abstractmethod
    def receive(self, frame: Received) -> None:
        """Process a frame for this node or a broadcast; never raises."""

    @abstractmethod
    def originate(self, application: bytes) -> bool:
        """
        Send a packet of the application to the sink.

        :return: False when there is no room, and the packet is lost.
        """

    def snoops(self, am_type: int, payload: bytes) -> bool:
        """Return whether ``snoop`` uses such a frame for another node."""
        return True

    def snoop(self, frame: Received) -> None:
        """Process a frame for another node."""
