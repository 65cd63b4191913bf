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

"""A frame on the air, and the interface of radios to the medium."""

from __future__ import annotations

from abc import ABC
from abc import abstractmethod
from typing import Final
from typing import NamedTuple

#: Used as the AM type of an acknowledgement.
ACK: Final = -1
#: x, y and height in m.
Position = tuple[float, float, float]


class Link(NamedTuple):
    """
    One direction of a link between two nodes.

    :ivar reception_rate: share of the frames that arrive, 0 to 1; acknowledgements too.
    :ivar rssi_dbm: as the receiver sees it.
    :ivar lqi: as the receiver sees it.
    """

    reception_rate: float
    rssi_dbm: int
    lqi: int


class Radio(ABC):
    """
    The interface of a radio to the medium.

    :ivar address: of the mote.
    :ivar number: unique even if several networks in the area use the same addresses.
    :ivar pan: its network; frames of other networks are noise to it.
    :ivar power_dbm: transmit power.
    :ivar is_on: whether it has power.
    :ivar on_since_ns: when it was switched on.
    :ivar sent_frames: frames sent, without acknowledgements.
    :ivar sent_acks: acknowledgements sent.
    :ivar received_frames: frames received for this node, and broadcasts.
    :ivar air_ns: total time of its transmissions.
    :ivar links: signal strength at other radios, in dBm. This and the attributes below belong to
        the medium; read it with ``GainMedium.links_of``, which computes it if it is not stored.
    :ivar fixed_links: used instead of ``links`` if only the links are known.
    :ivar hearers: radios that may receive its frames; None: not computed yet.
    :ivar near: lists of the frames on the air in its part of the area; its own list is first.
    :ivar noise_place: its offset in the series of noise.
    :ivar is_out_of_step: its receive FIFO contains part of a frame that was cut off, so the
        medium must deliver all frames that it can receive.
    """

    __slots__ = (
        'address', 'number', 'pan', 'power_dbm', 'is_on', 'on_since_ns', 'sent_frames',
        'sent_acks', 'received_frames', 'air_ns', 'links', 'fixed_links', 'hearers', 'near',
        'noise_place', 'is_out_of_step')

    def __init__(self, address: int, power_dbm: float) -> None:
        """Create a radio that is off and has no links."""
        self.address = address
        self.number = address
        self.pan = 0
        self.power_dbm = power_dbm
        self.is_on = False
        self.on_since_ns = 0
        self.sent_frames = 0
        self.sent_acks = 0
        self.received_frames = 0
        self.air_ns = 0
        self.links: dict[Radio, float] = {}
        self.fixed_links: dict[Radio, Link] = {}
        self.hearers: tuple[Radio, ...] | None = None
        self.near: tuple[list[Transmission], ...] = ()
        self.noise_place = 0
        self.is_out_of_step = False

    @abstractmethod
    def take(self, frame: Transmission, lqi: int, rssi_dbm: int) -> None:
        """Receive a frame for this node, or a broadcast."""

    @abstractmethod
    def overhear(self, frame: Transmission, lqi: int, rssi_dbm: int) -> None:
        """Receive a frame for another node."""

    @abstractmethod
    def store(self, frame: Transmission, lqi: int, rssi_dbm: int) -> None:
        """Add a frame to a receive FIFO that is out of step."""

    @abstractmethod
    def miss(self, frame: Transmission) -> None:
        """Lose a frame for this node."""

    @abstractmethod
    def acked(self) -> None:
        """Receive an acknowledgement with the sequence number of the frame sent."""


class Transmission:
    """
    A frame that is or was on the air.

    :ivar sender: the radio that sends it.
    :ivar destination: an address; 0xFFFF is the broadcast address.
    :ivar am_type: of the active message, ``ACK`` for an acknowledgement.
    :ivar payload: of the active message.
    :ivar acknowledge: an acknowledgement is requested.
    :ivar dsn: sequence number of the frame.
    :ivar begin_ns: time of the first bit; before it the radio switches to transmit mode.
    :ivar end_ns: time of the last bit.
    :ivar overlaps: other frames that were on the air nearby between these times.
    :ivar unfinished: number of frames, of itself and ``overlaps``, still on the air.
    :ivar starts: for each receiver the reason why it did not start to receive; 0: it started.
    :ivar cell: the list of the frames on the air in the sender's part of the area.
    """

    __slots__ = ('sender', 'destination', 'am_type', 'payload', 'acknowledge', 'dsn', 'begin_ns',
                 'end_ns', 'overlaps', 'unfinished', 'starts', 'cell')

    def __init__(self, sender: Radio, destination: int, am_type: int, payload: bytes,
                 acknowledge: bool, dsn: int, begin_ns: int, end_ns: int) -> None:
        """Create a frame; for its parameters see the class."""
        self.sender = sender
        self.destination = destination
        self.am_type = am_type
        self.payload = payload
        self.acknowledge = acknowledge
        self.dsn = dsn
        self.begin_ns = begin_ns
        self.end_ns = end_ns
        self.overlaps: list[Transmission] | None = None
        self.unfinished = 1
        self.starts: dict[Radio, int] | None = None
        self.cell: list[Transmission] = sender.near[0]
