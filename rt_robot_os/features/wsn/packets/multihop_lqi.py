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
Messages of MultiHopLQI, TinyOS' routing by link quality, of TinyOS 1.x and 2.x.

In TinyOS 1.x a header of 10 bytes stands before the application's payload and before the body of
a beacon; the first motes, mica and mica2, have one of 7 bytes. All are little-endian. TinyOS 2.x
counts big-endian; who sent a frame last stands in the frame's own header there.
"""

from __future__ import annotations

from struct import Struct
from typing import Final
from typing import NamedTuple

from rt_robot_os.features.wsn.packets.message import Header
from rt_robot_os.features.wsn.packets.message import Message

#: What a node without a route names as its parent, its cost and its hops.
NO_PARENT: Final = 0xFFFF
NO_ROUTE_COST: Final = 0xFFFE
NO_ROUTE_HOPS: Final = 0xFF
#: What the root of TinyOS 1.x names as its parent: its serial line.
UART_ADDRESS: Final = 0x007E


def signed(number: int) -> int:
    """Return a counter of 16 bits as the header of TinyOS 1.x has it."""
    return ((number + 0x8000) & 0xFFFF) - 0x8000


class _MultihopMsgFields(NamedTuple):
    source: int
    origin: int
    seqno: int
    origin_seqno: int
    hopcount: int
    data: bytes = b''


class MultihopMsg(Header, _MultihopMsgFields):
    """
    What stands before every multi-hop payload of TinyOS 1.x, whatever its AM type.

    :ivar source: who sent it last.
    :ivar origin: who made it.
    :ivar seqno: counted by who sent it last, signed.
    :ivar origin_seqno: counted by who made it, signed.
    :ivar hopcount: from the origin to the sink, as the origin thought.
    :ivar data: what follows.
    """

    __slots__ = ()
    LAYOUT = Struct('<HHhhH')


class _MicaMultihopMsgFields(NamedTuple):
    source: int
    origin: int
    seqno: int
    hopcount: int
    data: bytes = b''


class MicaMultihopMsg(Header, _MicaMultihopMsgFields):
    """
    The same of mica, mica2 and mica2dot: the origin does not count.

    :ivar source: who sent it last.
    :ivar origin: who made it.
    :ivar seqno: counted by who sent it last, signed.
    :ivar hopcount: from the origin to the sink, as the origin thought.
    :ivar data: what follows.
    """

    __slots__ = ()
    LAYOUT = Struct('<HHhB')


class _BeaconMsgFields(NamedTuple):
    parent: int
    cost: int
    hopcount: int
    timestamp: int = 0


class BeaconMsg(Message, _BeaconMsgFields):
    """
    The body of a beacon of TinyOS 1.x; stands behind a :class:`MultihopMsg`.

    :ivar parent: of who sent it; ``UART_ADDRESS`` at the root, ``NO_PARENT`` without a route.
    :ivar cost: from who sent it to the root.
    :ivar hopcount: from who sent it to the root.
    :ivar timestamp: without meaning, unless the motes synchronise their clocks.
    """

    __slots__ = ()
    AM_TYPE = 250
    LAYOUT = Struct('<HHHI')


class _LqiBeaconFields(NamedTuple):
    origin: int
    seqno: int
    origin_seqno: int
    parent: int
    cost: int
    hopcount: int


class LqiBeacon(Message, _LqiBeaconFields):
    """
    A beacon of TinyOS 2.x.

    :ivar origin: who sent it.
    :ivar seqno: counted with the data packets that the node sends.
    :ivar origin_seqno: motes leave it 0.
    :ivar parent: of who sent it; itself at the root, ``NO_PARENT`` without a route.
    :ivar cost: from who sent it to the root.
    :ivar hopcount: from who sent it to the root.
    """

    __slots__ = ()
    AM_TYPE = 0x73
    LAYOUT = Struct('>6H')


class _LqiDataFields(NamedTuple):
    origin: int
    seqno: int
    origin_seqno: int
    hopcount: int
    collect_id: int
    data: bytes = b''


class LqiData(Header, _LqiDataFields):
    """
    A data packet of TinyOS 2.x.

    :ivar origin: who made it.
    :ivar seqno: counted by who sent it last.
    :ivar origin_seqno: counted by who made it.
    :ivar hopcount: from the origin to the root, as the origin thought.
    :ivar collect_id: which application it is of.
    :ivar data: what the application sent.
    """

    __slots__ = ()
    AM_TYPE = 0x74
    LAYOUT = Struct('>4HB')
