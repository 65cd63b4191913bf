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
Tables of neighbours, as motes of TinyOS 1.x send them behind the header of their routing.

``DebugPacket`` goes to the sink. ``RoutePacket`` is the beacon of mica and mica2, whose routing
(MINT) tells its neighbours how well it hears them.
"""

from __future__ import annotations

from struct import Struct
from typing import Final
from typing import NamedTuple

from rt_robot_os.features.wsn.packets.message import Header

#: Of the radio CC2420's motes the number of neighbours has 16 bits, of mica's 8.
_COUNTS: Final = {False: Struct('<H'), True: Struct('<B')}
_ESTIMATE: Final = Struct('<HBB')
_HEARD: Final = Struct('<HB')
DEBUG_PACKET_TYPE: Final = 3


class Estimate(NamedTuple):
    """
    A neighbour in a table of estimates.

    :ivar quality: how well the node is heard by it, of 255.
    """

    node: int
    hopcount: int
    quality: int


class DebugPacket(NamedTuple):
    """
    The table of neighbours of a node.

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
        Read the bytes; mica's have room for more neighbours than there are.

        :raises ValueError: there are too few for what the packet says it has.
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


class HeardNeighbour(NamedTuple):
    """
    A neighbour and how well the sender hears it, of 255.

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

    :ivar parent: of who sent it.
    :ivar cost: from there to the root, as that routing counts it.
    :ivar entries: how many neighbours follow.
    :ivar data: the neighbours, see :meth:`neighbours`.
    """

    __slots__ = ()
    AM_TYPE = 250
    LAYOUT = Struct('<HHB')

    def neighbours(self) -> tuple[HeardNeighbour, ...]:
        """
        Return the neighbours.

        :raises ValueError: there are fewer than the packet says.
        """
        size = self.entries * _HEARD.size
        if len(self.data) < size:
            raise ValueError(f'too short: {len(self.data)} bytes for {self.entries} neighbours')
        return tuple([HeardNeighbour(*each) for each in _HEARD.iter_unpack(self.data[:size])])
