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
A cheap look at the header of a packet: who made it, which one it is, and what it carries.

That is all the sink needs to sort packets by importance and to leave out copies; it takes some
microseconds and makes no objects but one. What a packet says is decoded by whoever wants it, see
:mod:`rt_robot_os.wsn.packets`.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Collection
from typing import Final
from typing import NamedTuple

from rt_robot_os.wsn.packets.framing import TINYOS_2
from rt_robot_os.wsn.packets.tos_msg import MICA


#: What is wrong with a packet that cannot be used.
TRUNCATED: Final = 'truncated header'
LYING: Final = 'length byte that lies'

SURGE: Final = 17
_LQI_BEACON_1: Final = 250
_CTP_BEACON, _CTP_DATA, _CTP_DEBUG = 0x70, 0x71, 0x72
_LQI_BEACON, _LQI_DATA, _LQI_DEBUG = 0x73, 0x74, 0x75
_OSCILLOSCOPE: Final = 0x93
#: Types that are known without being declared.
KNOWN_1: Final = frozenset({3, SURGE, 18, _LQI_BEACON_1})
KNOWN_2: Final = frozenset({SURGE, 18, _CTP_BEACON, _CTP_DATA, _CTP_DEBUG, _LQI_BEACON, _LQI_DATA,
                            _LQI_DEBUG, _OSCILLOSCOPE})


class Look(NamedTuple):
    """
    What a look at the header finds.

    :ivar am_type: -1 when the packet is not even a header.
    :ivar origin: who made it; -1 when it does not say.
    :ivar kind: of its reading; -1 when it does not say.
    :ivar sequence: number that its origin gave it; -1 when it has none.
    :ivar bits: of that number, after which it begins again; 0 when gaps in it mean nothing.
    :ivar content: of all that stays the same from hop to hop, a number; 0 for what is no data,
        such as a beacon, and has no copies.
    :ivar free_of_charge: who claims to be at no cost from the sink, in a beacon; -1 nobody.
    :ivar problem: why it cannot be used; empty when it can.
    """

    am_type: int
    group: int
    origin: int = -1
    kind: int = -1
    sequence: int = -1
    bits: int = 0
    content: int = 0
    free_of_charge: int = -1
    problem: str = ''


Looker = Callable[[bytes], Look]


def looker(stack: str, platform: str, multihop_types: Collection[int]) -> Looker:
    """
    Return what looks at the packets of a network.

    :param stack: ``tinyos1`` or ``tinyos2``.
    :param platform: of TinyOS 1.x, ``telos`` or ``mica``.
    :param multihop_types: types whose packets have a header of MultiHopLQI, of TinyOS 1.x.
    """
    if stack == TINYOS_2.name:
        return look_2
    types = frozenset((SURGE, *multihop_types))
    if platform == MICA:
        return lambda packet: look_mica(packet, types)
    return lambda packet: look_telos(packet, types)


def look_telos(packet: bytes, multihop_types: Collection[int]) -> Look:
    """Look at a TOS_Msg of TinyOS 1.x on motes with a CC2420."""
    size = len(packet)
    if size < 10:
        return Look(-1, -1, problem=TRUNCATED)
    am_type, group, length = packet[8], packet[9], packet[0]
    if length != size - 10:
        return Look(am_type, group, problem=LYING)
    if am_type == _LQI_BEACON_1:
        if length < 16:
            return Look(am_type, group, problem=TRUNCATED)
        source = packet[10] | packet[11] << 8
        return Look(am_type, group, packet[12] | packet[13] << 8,
                    free_of_charge=-1 if packet[22] or packet[23] else source)
    if am_type not in multihop_types:
        return Look(am_type, group)
    if length < 10:
        return Look(am_type, group, problem=TRUNCATED)
    origin = packet[12] | packet[13] << 8
    content = hash(packet[12:14] + packet[16:]) or 1
    if am_type != SURGE or length < 20:
        return Look(am_type, group, origin, -1, packet[16] | packet[17] << 8, 16, content)
    kind = packet[30] | packet[31] << 8 if length >= 24 and not (packet[20] or packet[21]) else -1
    return Look(am_type, group, origin, kind,
                packet[26] | packet[27] << 8 | packet[28] << 16 | packet[29] << 24, 32, content)


def look_mica(packet: bytes, multihop_types: Collection[int]) -> Look:
    """Look at a TOS_Msg of TinyOS 1.x on mica, mica2 and mica2dot."""
    size = len(packet)
    if size < 5:
        return Look(-1, -1, problem=TRUNCATED)
    am_type, group, length = packet[2], packet[3], packet[4]
    if length != size - 5:
        return Look(am_type, group, problem=LYING)
    if am_type not in multihop_types:
        return Look(am_type, group)
    if length < 7:
        return Look(am_type, group, problem=TRUNCATED)
    # The number is that of who sent it last: of copies only its own can be told.
    return Look(am_type, group, packet[7] | packet[8] << 8, content=hash(packet[5:]) or 1)


def look_2(packet: bytes) -> Look:
    """Look at an active message of TinyOS 2.x, its dispatch byte in front."""
    size = len(packet)
    if size < 8:
        return Look(-1, -1, problem=TRUNCATED)
    am_type, group, length = packet[7], packet[6], packet[5]
    if length != size - 8:
        return Look(am_type, group, problem=LYING)
    look = _LOOKS_2.get(am_type)
    if look is None:
        return Look(am_type, group, packet[3] << 8 | packet[4])
    shortest, find = look
    return find(packet) if length >= shortest else Look(am_type, group, problem=TRUNCATED)


def _lqi_data(packet: bytes) -> Look:
    return Look(_LQI_DATA, packet[6], packet[8] << 8 | packet[9], -1,
                packet[12] << 8 | packet[13], 16, hash(packet[8:10] + packet[12:]) or 1)


def _ctp_data(packet: bytes) -> Look:
    return Look(_CTP_DATA, packet[6], packet[12] << 8 | packet[13], -1, packet[14], 8,
                hash(packet[12:]) or 1)


def _lqi_beacon(packet: bytes) -> Look:
    origin = packet[8] << 8 | packet[9]
    return Look(_LQI_BEACON, packet[6], origin,
                free_of_charge=-1 if packet[16] or packet[17] else origin)


def _ctp_beacon(packet: bytes) -> Look:
    source = packet[3] << 8 | packet[4]
    return Look(_CTP_BEACON, packet[6], source,
                free_of_charge=-1 if packet[13] or packet[14] else source)


def _debug(packet: bytes) -> Look:
    # Its number counts the messages of the sink itself: when it goes back, the sink began anew.
    return Look(packet[7], packet[6], packet[3] << 8 | packet[4], -1,
                packet[15] << 8 | packet[16], 16)


def _oscilloscope(packet: bytes) -> Look:
    # Its count jumps when a node hears a larger one: gaps are no losses.
    return Look(_OSCILLOSCOPE, packet[6], packet[12] << 8 | packet[13], -1,
                packet[14] << 8 | packet[15], 0, hash(packet[8:]) or 1)


# Type -> bytes of data at least, and what looks at them.
_LOOKS_2: Final[dict[int, tuple[int, Callable[[bytes], Look]]]] = {
    _CTP_BEACON: (7, _ctp_beacon), _CTP_DATA: (8, _ctp_data), _CTP_DEBUG: (9, _debug),
    _LQI_BEACON: (12, _lqi_beacon), _LQI_DATA: (9, _lqi_data), _LQI_DEBUG: (9, _debug),
    _OSCILLOSCOPE: (8, _oscilloscope)}
