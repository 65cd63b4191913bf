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

In TinyOS 1.x a header of 10 bytes precedes the application's payload and the body of a beacon;
that of the first motes, mica and mica2, has 7 bytes. All are little-endian. TinyOS 2.x is
big-endian; the last sender is in the header of the frame.
"""

from __future__ import annotations

from struct import Struct
from typing import Final
from typing import NamedTuple

from rt_robot_os.features.wsn.packets.message import Header
from rt_robot_os.features.wsn.packets.message import Message

#: Parent, cost and hops of a node without a route.
NO_PARENT: Final = 0xFFFF
NO_ROUTE_COST: Final = 0xFFFE
NO_ROUTE_HOPS: Final = 0xFF
#: Parent of the root of TinyOS 1.x: its serial line.
UART_ADDRESS: Final = 0x007E


def signed(number: int) -> int:
    """Return a 16-bit counter as the signed number in the header of TinyOS 1.x."""
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
    The header of every multi-hop payload of TinyOS 1.x, of any AM type.

    :ivar source: address of the last sender.
    :ivar origin: address of the origin.
    :ivar seqno: counter of the last sender, signed.
    :ivar origin_seqno: counter of the origin, signed.
    :ivar hopcount: from the origin to the sink, as the origin expected.
    :ivar data: the following bytes.
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
    The header of mica, mica2 and mica2dot, without a counter of the origin.

    :ivar source: address of the last sender.
    :ivar origin: address of the origin.
    :ivar seqno: counter of the last sender, signed.
    :ivar hopcount: from the origin to the sink, as the origin expected.
    :ivar data: the following bytes.
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
    The body of a beacon of TinyOS 1.x, after a :class:`MultihopMsg`.

    :ivar parent: of the sender; ``UART_ADDRESS`` at the root, ``NO_PARENT`` without a route.
    :ivar cost: from the sender to the root.
    :ivar hopcount: from the sender to the root.
    :ivar timestamp: unused, unless the motes synchronise their clocks.
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

    :ivar origin: address of the sender.
    :ivar seqno: counted with the data packets that the node sends.
    :ivar origin_seqno: unused, 0.
    :ivar parent: of the sender; itself at the root, ``NO_PARENT`` without a route.
    :ivar cost: from the sender to the root.
    :ivar hopcount: from the sender to the root.
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

    :ivar origin: address of the origin.
    :ivar seqno: counter of the last sender.
    :ivar origin_seqno: counter of the origin.
    :ivar hopcount: from the origin to the root, as the origin expected.
    :ivar collect_id: identifier of the application.
    :ivar data: payload of the application.
    """

    __slots__ = ()
    AM_TYPE = 0x74
    LAYOUT = Struct('>4HB')
