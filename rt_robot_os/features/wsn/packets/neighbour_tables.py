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
Neighbour tables of motes of TinyOS 1.x, after the header of their routing.

``DebugPacket`` is sent to the sink. ``RoutePacket`` is the beacon of mica and mica2, in which
their routing (MINT) reports link qualities to the neighbours.
"""

from __future__ import annotations

from struct import Struct
from typing import Final
from typing import NamedTuple

from rt_robot_os.features.wsn.packets.message import Header

#: The number of neighbours has 16 bits on motes with the radio CC2420, 8 on mica.
_COUNTS: Final = {False: Struct('<H'), True: Struct('<B')}
_ESTIMATE: Final = Struct('<HBB')
_RECEIVED: Final = Struct('<HB')
DEBUG_PACKET_TYPE: Final = 3


class Estimate(NamedTuple):
    """
    A neighbour in a table of estimates.

    :ivar quality: of the link from the node to it, of 255.
    """

    node: int
    hopcount: int
    quality: int


class DebugPacket(NamedTuple):
    """
    The neighbour table of a node.

    :ivar estimates: the neighbours.
    """

    estimates: tuple[Estimate, ...]

    def pack(self, is_mica: bool = False) -> bytes:
        """Return the bytes."""
        return _COUNTS[is_mica].pack(len(self.estimates)) + b''.join(
            [_ESTIMATE.pack(*each) for each in self.estimates])

    @classmethod
    def unpack(cls, data: bytes, is_mica: bool = False) -> DebugPacket:
        """
        Parse the bytes; those of mica have unused entries.

        :raises ValueError: there are too few for the number of neighbours.
        """
        layout = _COUNTS[is_mica]
        if len(data) < layout.size:
            raise ValueError(f'too short: {len(data)} bytes, DebugPacket has {layout.size}')
        count, = layout.unpack_from(data)
        size = layout.size + count * _ESTIMATE.size
        if len(data) < size:
            raise ValueError(f'too short: {len(data)} bytes, DebugPacket with {count} neighbours '
                             f'has {size}')
        return cls(tuple([Estimate(*each)
                          for each in _ESTIMATE.iter_unpack(data[layout.size:size])]))


class ReceivedNeighbour(NamedTuple):
    """
    A neighbour and the quality of the link from it to the sender, of 255.

    :ivar address: of the neighbour.
    """

    address: int
    quality: int


class _RoutePacketFields(NamedTuple):
    parent: int
    cost: int
    entries: int
    data: bytes = b''


class RoutePacket(Header, _RoutePacketFields):
    """
    The beacon of mica and mica2.

    :ivar parent: of the sender.
    :ivar cost: from the sender to the root, in the unit of MINT.
    :ivar entries: number of neighbours.
    :ivar data: the neighbours, see :meth:`neighbours`.
    """

    __slots__ = ()
    AM_TYPE = 250
    LAYOUT = Struct('<HHB')

    def neighbours(self) -> tuple[ReceivedNeighbour, ...]:
        """
        Return the neighbours.

        :raises ValueError: there are fewer than ``entries``.
        """
        size = self.entries * _RECEIVED.size
        if len(self.data) < size:
            raise ValueError(f'too short: {len(self.data)} bytes for {self.entries} neighbours')
        return tuple(
            [ReceivedNeighbour(*each) for each in _RECEIVED.iter_unpack(self.data[:size])])
