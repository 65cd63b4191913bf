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
What a routing protocol and the node that it runs on know of each other.

A protocol is driven by calls alone, so that the same code runs in the simulator, under a test and
against a recorded log. Times are integers in ns on the node's own clock, which drifts. Addresses
are 16 bits, as on the air.
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
    A frame that the radio took from the air, with a good checksum.

    :ivar destination: the node's address, or that of all.
    :ivar source: who sent it last; -1 where the frame does not say so, as in TinyOS 1.x.
    :ivar am_type: the number that says what the payload is.
    :ivar payload: of the active message.
    :ivar lqi: link quality indication, as CC2420 has it: about 50 to 110.
    :ivar rssi_dbm: strength of the signal.
    """

    destination: int
    source: int
    am_type: int
    payload: bytes
    lqi: int
    rssi_dbm: int


class Timer(Protocol):
    """A timer of a node; it ends with the node's power."""

    def start(self, delay_ns: int) -> None:
        """Run down once from now on; what it did before is forgotten."""

    def every(self, period_ns: int) -> None:
        """Run down again and again, on a grid of times that begins now."""

    def stop(self) -> None:
        """Do not run down; may be repeated."""


class Sender(Protocol):
    """
    A place for one frame at the radio of a node; the radio takes turns among its senders.

    :ivar busy: a frame is on its way; ``done`` has not been called yet.
    """

    busy: bool

    def send(self, destination: int, am_type: int, payload: bytes, acknowledge: bool) -> bool:
        """
        Give a frame to the radio.

        :param acknowledge: whether the receivers are to acknowledge it.
        :return: False when the sender is busy; then nothing happens.
        """

    def rewrite(self, destination: int, payload: bytes) -> None:
        """
        Change the frame that is on its way, if it has not left the mote's memory yet.

        In TOSSIM a frame on the air changes too, and counts as acknowledged if that was asked.
        """


class Node(Protocol):
    """
    What a protocol has of the node that it runs on.

    :ivar address: the node's.
    :ivar random: for delays; seeded.
    """

    address: int
    random: Random

    def now_ns(self) -> int:
        """Return the time since the node started."""

    def timer(self, call: Callable[[], None]) -> Timer:
        """Make a timer that calls when it has run down."""

    def sender(self, done: Callable[[bool], None]) -> Sender:
        """
        Make a sender.

        :param done: called when the frame is through, with whether it was acknowledged; a frame
            for which that was not asked never is.
        """

    def deliver(self, am_type: int, payload: bytes, origin: int, application: bytes) -> None:
        """
        Hand a data packet to the sink's serial line; only the root does that.

        :param payload: of the active message, headers of the protocol included.
        :param origin: who made the packet.
        :param application: what the application at the origin gave to be sent.
        """

    def note(self, event: str, *numbers: int) -> None:
        """Tell of something for logs and pictures, such as ``parent 3``; costs little."""


class Router(ABC):
    """
    A protocol on one node.

    :ivar root: it is on the sink.
    :ivar parent: the next node on the way to the sink; None without a route, at the root as well.
    :ivar cost: of the whole way as the protocol counts it; 0 at the root.
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
        """Begin, with nothing known: the node has booted."""

    @abstractmethod
    def stop(self) -> None:
        """End: the node has no power; timers stop, queues are empty."""

    @abstractmethod
    def receive(self, frame: Received) -> None:
        """Take a frame for this node or for all; bytes of whatever kind raise nothing."""

    @abstractmethod
    def originate(self, application: bytes) -> bool:
        """
        Send a packet of the application to the sink.

        :return: False when there is no room; the packet is lost, and the application knows.
        """

    def snoops(self, am_type: int, payload: bytes) -> bool:
        """Return whether such a frame for another node means anything to ``snoop``."""
        return True

    def snoop(self, frame: Received) -> None:
        """Take a frame for another node; the radio hears all."""
