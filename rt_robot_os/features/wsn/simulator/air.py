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

"""A frame on the air, and radios as the air sees them."""

from __future__ import annotations

from abc import ABC
from abc import abstractmethod
from typing import Final
from typing import NamedTuple

#: In place of an AM type: the frame is an acknowledgement.
ACK: Final = -1
#: x, y and height in m.
Position = tuple[float, float, float]


class Link(NamedTuple):
    """
    One way between two nodes.

    :ivar reception_rate: share of the frames that arrive, 0 to 1; acknowledgements too.
    :ivar rssi_dbm: as the receiver sees it.
    :ivar lqi: as the receiver sees it.
    """

    reception_rate: float
    rssi_dbm: int
    lqi: int


class Radio(ABC):
    """
    A radio as the air sees it.

    :ivar address: of the mote.
    :ivar number: unique also where networks share the area, and have the same addresses.
    :ivar pan: the network that it belongs to; frames of others are noise to it.
    :ivar power_dbm: that it sends with.
    :ivar is_on: it has power.
    :ivar on_since_ns: since when.
    :ivar sent_frames: that were on the air, acknowledgements not among them.
    :ivar sent_acks: acknowledgements.
    :ivar received_frames: for this node or for all.
    :ivar air_ns: how long it has sent.
    :ivar links: signal strength at others, in dBm. It belongs to the medium, as do the attributes
        below; read it by ``GainMedium.links_of``, which computes it where it is not stored.
    :ivar fixed_links: in place of ``links`` where nothing but links is known.
    :ivar hearers: who may receive its frames; None: to be found out.
    :ivar near: lists of what is on the air in its part of the area; its own list is first.
    :ivar noise_place: where in the series of noise it is.
    :ivar is_out_of_step: its receive FIFO holds what was cut off, so that it has to be given all
        that it receives.
    """

    __slots__ = (
        'address', 'number', 'pan', 'power_dbm', 'is_on', 'on_since_ns', 'sent_frames',
        'sent_acks', 'received_frames', 'air_ns', 'links', 'fixed_links', 'hearers', 'near',
        'noise_place', 'is_out_of_step')

    def __init__(self, address: int, power_dbm: float) -> None:
        """Make a radio that is off, and linked with none."""
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
        """Take a frame for this node or for all."""

    @abstractmethod
    def overhear(self, frame: Transmission, lqi: int, rssi_dbm: int) -> None:
        """Take a frame for another node."""

    @abstractmethod
    def store(self, frame: Transmission, lqi: int, rssi_dbm: int) -> None:
        """Take a frame into a receive FIFO that is out of step."""

    @abstractmethod
    def miss(self, frame: Transmission) -> None:
        """Miss a frame for this node."""

    @abstractmethod
    def acked(self) -> None:
        """Take an acknowledgement with the number of the frame that was sent."""


class Transmission:
    """
    A frame on the air, or that was.

    :ivar sender: whose it is.
    :ivar destination: an address; that of all is 0xFFFF.
    :ivar am_type: of the active message, ``ACK`` for an acknowledgement.
    :ivar payload: of the active message.
    :ivar acknowledge: the receivers are to acknowledge it.
    :ivar dsn: sequence number of the frame.
    :ivar begin_ns: the first bit is on the air; before that the radio turns to sending.
    :ivar end_ns: the last bit was on the air.
    :ivar overlaps: what else was on the air near by at any time between.
    :ivar unfinished: how many of itself and ``overlaps`` are still on the air.
    :ivar starts: by receiver, why it did not start to receive this; 0 where it did.
    :ivar cell: the list of what is on the air in the sender's part of the area.
    """

    __slots__ = ('sender', 'destination', 'am_type', 'payload', 'acknowledge', 'dsn', 'begin_ns',
                 'end_ns', 'overlaps', 'unfinished', 'starts', 'cell')

    def __init__(self, sender: Radio, destination: int, am_type: int, payload: bytes,
                 acknowledge: bool, dsn: int, begin_ns: int, end_ns: int) -> None:
        """Take what the frame is; see the class."""
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
