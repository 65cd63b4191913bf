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
Packets of the Collection Tree Protocol: beacons with the link estimator's header, and data.

TinyOS 2.x, TEP 123 and 124: big-endian, the payload of an active message.
"""

from __future__ import annotations

from struct import error
from struct import Struct
from typing import Final
from typing import NamedTuple

#: Option of both packets: the sender has no route, and requests beacons.
PULL: Final = 0x80
#: Option of both packets: the sender's queue is congested.
CONGESTED: Final = 0x40
#: As a parent: none.
NO_PARENT: Final = 0xFFFF

_COUNT_MASK: Final = 0x0F
_BEACON: Final = Struct('>BBBHH')
_NEIGHBOUR: Final = Struct('>HB')
#: Bytes of a beacon without neighbours, and of each neighbour.
BEACON_SIZE: Final = _BEACON.size
NEIGHBOUR_SIZE: Final = _NEIGHBOUR.size
_DATA: Final = Struct('>BBHHBB')


class Neighbour(NamedTuple):
    """
    Link quality of a neighbour of the sender of a beacon.

    :ivar quality: received beacons of 250.
    """

    address: int
    quality: int


class BeaconHead(NamedTuple):
    """The routing part of a beacon; the fields are those of ``CtpBeacon``."""

    sequence: int
    options: int
    parent: int
    etx: int


class _BeaconFields(NamedTuple):
    sequence: int
    options: int
    parent: int
    etx: int
    neighbours: tuple[Neighbour, ...] = ()
    flags: int = 0


class CtpBeacon(_BeaconFields):
    """
    The advertised route of a node, in a frame of the link estimator.

    :ivar sequence: of the beacons of this sender, 8 bits; gaps are lost beacons.
    :ivar options: ``PULL``, ``CONGESTED`` and unused bits.
    :ivar parent: the next node on the route; the node itself at a root; ``NO_PARENT``.
    :ivar etx: expected transmissions to the sink, in tenths.
    :ivar neighbours: link qualities of neighbours; up to 15.
    :ivar flags: the header's upper four bits, in place; usually 0.
    """

    __slots__ = ()
    AM_TYPE = 0x70

    def pack(self) -> bytes:
        """
        Return the payload of the active message.

        :raises ValueError: a number does not fit its field, or there are too many neighbours.
        """
        count = len(self.neighbours)
        if count > _COUNT_MASK:
            raise ValueError(f'{count} neighbours, CtpBeacon has at most {_COUNT_MASK}')
        if self.flags & _COUNT_MASK:
            raise ValueError(f'flags {self.flags:#04x} use bits of the number of neighbours')
        try:
            head = _BEACON.pack(self.flags | count, self.sequence, self.options, self.parent,
                                self.etx)
            return head + b''.join([_NEIGHBOUR.pack(*one) for one in self.neighbours])
        except error as problem:
            raise ValueError(f'{self} does not fit its fields: {problem}') from None

    @classmethod
    def unpack(cls, data: bytes) -> CtpBeacon:
        """
        Parse the payload of an active message.

        :raises ValueError: it is too short, or too long for its number of neighbours.
        """
        head = beacon_head(data)
        neighbours = tuple([Neighbour(*one)
                            for one in _NEIGHBOUR.iter_unpack(data[_BEACON.size:])])
        return cls(*head, neighbours, data[0] & ~_COUNT_MASK)


def beacon_head(data: bytes) -> BeaconHead:
    """
    Parse the routing part of a beacon; the whole beacon is checked.

    :raises ValueError: it is too short, or too long for its number of neighbours.
    """
    if len(data) < _BEACON.size:
        raise ValueError(f'too short: {len(data)} bytes, CtpBeacon has {_BEACON.size} or more')
    flags, sequence, options, parent, etx = _BEACON.unpack_from(data)
    size = _BEACON.size + _NEIGHBOUR.size * (flags & _COUNT_MASK)
    if len(data) != size:
        raise ValueError(f'{len(data)} bytes, CtpBeacon with {flags & _COUNT_MASK} neighbours '
                         f'has {size}')
    return BeaconHead(sequence, options, parent, etx)


class _DataFields(NamedTuple):
    options: int
    hops: int
    etx: int
    origin: int
    origin_sequence: int
    collect_id: int
    application: bytes = b''


class CtpData(_DataFields):
    """
    A packet of an application for the sink.

    :ivar options: ``PULL``, ``CONGESTED`` and unused bits.
    :ivar hops: so far (time has lived, THL).
    :ivar etx: of the last sender, to the sink, in tenths.
    :ivar origin: address of the origin.
    :ivar origin_sequence: the origin's number for it, 8 bits.
    :ivar collect_id: identifier of the application.
    :ivar application: the application's bytes.
    """

    __slots__ = ()
    AM_TYPE = 0x71

    def pack(self) -> bytes:
        """
        Return the payload of the active message.

        :raises ValueError: a number does not fit its field.
        """
        try:
            return _DATA.pack(*self[:6]) + self.application
        except error as problem:
            raise ValueError(f'{self} does not fit its fields: {problem}') from None

    @classmethod
    def unpack(cls, data: bytes) -> CtpData:
        """
        Parse the payload of an active message.

        :raises ValueError: it is too short.
        """
        if len(data) < _DATA.size:
            raise ValueError(f'too short: {len(data)} bytes, CtpData has {_DATA.size} or more')
        return cls(*_DATA.unpack_from(data))._replace(application=data[_DATA.size:])
