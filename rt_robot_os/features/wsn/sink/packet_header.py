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
:mod:`rt_robot_os.features.wsn.packets`.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Collection
from collections.abc import Iterable
from collections.abc import Mapping
from struct import calcsize
from types import MappingProxyType
from typing import Final
from typing import Literal
from typing import NamedTuple

from rt_robot_os.features.wsn.packets.contents import MICA_READERS
from rt_robot_os.features.wsn.packets.contents import T2_COLLECTIONS
from rt_robot_os.features.wsn.packets.contents import T2_READERS
from rt_robot_os.features.wsn.packets.contents import TELOS_READERS
from rt_robot_os.features.wsn.packets.framing import TINYOS_1
from rt_robot_os.features.wsn.packets.framing import TINYOS_2
from rt_robot_os.features.wsn.packets.payload import Payload
from rt_robot_os.features.wsn.packets.serial_am import DISPATCH_AM
from rt_robot_os.features.wsn.packets.serial_am import SIZE
from rt_robot_os.features.wsn.packets.tos_msg import MICA
from rt_robot_os.features.wsn.packets.tos_msg import MICA_HEADER
from rt_robot_os.features.wsn.packets.tos_msg import TELOS_HEADER

#: What is wrong with a packet that cannot be used.
TRUNCATED: Final = 'truncated header'
LYING: Final = 'length byte that lies'
NOT_AM: Final = 'no active message'

SURGE: Final = 17
_LQI_BEACON_1: Final = 250
_CTP_BEACON, _CTP_DATA, _CTP_DEBUG = 0x70, 0x71, 0x72
_LQI_BEACON, _LQI_DATA, _LQI_DEBUG = 0x73, 0x74, 0x75
_OSCILLOSCOPE: Final = 0x93
#: Types that are known without being declared, by generation.
KNOWN: Final = {TINYOS_1.name: frozenset({*TELOS_READERS, *MICA_READERS}),
                TINYOS_2.name: frozenset({*T2_READERS, *T2_COLLECTIONS})}


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
    :ivar relay: which node delivered it, according to its header; -1 when it does not say.
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
    relay: int = -1
    problem: str = ''


Looker = Callable[[bytes], Look]
_Look = Callable[[bytes, int], Look]
_Found = tuple[int, _Look]
Looks = Mapping[int, _Found]
_Place = tuple[slice, Literal['little', 'big']]

_TELOS, _MICA, _SERIAL_AM = TELOS_HEADER.size, MICA_HEADER.size, SIZE
_UNSIGNED: Final = ('B', 'H', 'I', 'L')


def looker(stack: str, platform: str, payloads: Iterable[Payload] = ()) -> Looker:
    """
    Return what looks at the packets of a network.

    :param stack: ``tinyos1`` or ``tinyos2``.
    :param platform: of TinyOS 1.x, ``telos`` or ``mica``.
    :param payloads: of a user's own.
    """
    own = tuple(payloads)
    if stack == TINYOS_2.name:
        looks = {**_own_looks(own, _SERIAL_AM, True), **_LOOKS_2}
        return lambda packet: look_2(packet, looks)
    routed = frozenset((SURGE, *(each.am_type for each in own if each.routed)))
    plain = [each for each in own if each.am_type not in routed]
    if platform == MICA:
        looks = _own_looks(plain, _MICA, False)
        return lambda packet: look_mica(packet, routed, looks)
    looks = _own_looks(plain, _TELOS, False)
    return lambda packet: look_telos(packet, routed, looks)


def look_telos(packet: bytes, routed: Collection[int] = frozenset((SURGE,)),
               looks: Looks = MappingProxyType({})) -> Look:
    """
    Look at a TOS_Msg of TinyOS 1.x on motes with a CC2420.

    :param routed: types whose packets have the header of MultiHopLQI in front.
    :param looks: at packets of other types.
    """
    size = len(packet)
    if size < _TELOS:
        return Look(-1, -1, problem=TRUNCATED)
    am_type, group, length = packet[8], packet[9], packet[0]
    if length != size - _TELOS:
        return Look(am_type, group, problem=LYING)
    if am_type == _LQI_BEACON_1:
        if length < 16:
            return Look(am_type, group, problem=TRUNCATED)
        source = packet[10] | packet[11] << 8
        return Look(am_type, group, packet[12] | packet[13] << 8,
                    free_of_charge=-1 if packet[22] or packet[23] else source)
    if am_type not in routed:
        return _look_at(packet, am_type, group, -1, length, looks)
    if length < 10:
        return Look(am_type, group, problem=TRUNCATED)
    relay, origin = packet[10] | packet[11] << 8, packet[12] | packet[13] << 8
    content = hash(packet[12:14] + packet[16:]) or 1
    if am_type != SURGE or length < 20:
        return Look(am_type, group, origin, -1, packet[16] | packet[17] << 8, 16, content,
                    relay=relay)
    kind = packet[30] | packet[31] << 8 if length >= 24 and not (packet[20] or packet[21]) else -1
    return Look(am_type, group, origin, kind,
                packet[26] | packet[27] << 8 | packet[28] << 16 | packet[29] << 24, 32, content,
                relay=relay)


def look_mica(packet: bytes, routed: Collection[int] = frozenset((SURGE,)),
              looks: Looks = MappingProxyType({})) -> Look:
    """
    Look at a TOS_Msg of TinyOS 1.x on mica, mica2 and mica2dot.

    :param routed: types whose packets have a header of the routing in front.
    :param looks: at packets of other types.
    """
    size = len(packet)
    if size < _MICA:
        return Look(-1, -1, problem=TRUNCATED)
    am_type, group, length = packet[2], packet[3], packet[4]
    if length != size - _MICA:
        return Look(am_type, group, problem=LYING)
    if am_type not in routed:
        return _look_at(packet, am_type, group, -1, length, looks)
    if length < 7:
        return Look(am_type, group, problem=TRUNCATED)
    # The number is that of who sent it last: of copies only its own can be told.
    return Look(am_type, group, packet[7] | packet[8] << 8, content=hash(packet[5:]) or 1,
                relay=packet[5] | packet[6] << 8)


def look_2(packet: bytes, looks: Looks | None = None) -> Look:
    """
    Look at an active message of TinyOS 2.x, its dispatch byte in front.

    :param looks: at packets by type; by default at those of TinyOS.
    """
    size = len(packet)
    if size < _SERIAL_AM:
        return Look(-1, -1, problem=TRUNCATED)
    am_type, group, length = packet[7], packet[6], packet[5]
    if packet[0] != DISPATCH_AM:
        return Look(-1, -1, problem=NOT_AM)
    if length != size - _SERIAL_AM:
        return Look(am_type, group, problem=LYING)
    return _look_at(packet, am_type, group, packet[3] << 8 | packet[4], length,
                    _LOOKS_2 if looks is None else looks)


def _look_at(packet: bytes, am_type: int, group: int, source: int, length: int, looks: Looks
             ) -> Look:
    found = looks.get(am_type)
    if found is None:
        return Look(am_type, group, source)
    shortest, find = found
    if length < shortest:
        return Look(am_type, group, problem=TRUNCATED)
    return find(packet, group)


def _own_looks(payloads: Iterable[Payload], header: int, big: bool) -> dict[int, _Found]:
    """Return looks at payloads that say who made them, and number them."""
    found: dict[int, _Found] = {}
    for each in payloads:
        places = _places(each, header, big)
        if {'origin', 'seqno'} <= places.keys():
            found.setdefault(each.am_type, (each.size, _own_look(
                each.am_type, header, places['origin'], places['seqno'])))
    return found


def _own_look(am_type: int, header: int, origin: _Place, seqno: _Place) -> _Look:
    (from_, order), (number, _) = origin, seqno
    bits = 8 * (number.stop - number.start)

    def look(packet: bytes, group: int) -> Look:
        return Look(am_type, group, int.from_bytes(packet[from_], order) & 0xFFFF, -1,
                    int.from_bytes(packet[number], order), bits, hash(packet[header:]) or 1)

    return look


def _places(payload: Payload, header: int, big: bool) -> dict[str, _Place]:
    """Return where the whole numbers of a payload stand in the packet, by field."""
    order: Literal['little', 'big'] = 'big' if (
        payload.byte_order == 'big' if payload.byte_order else big) else 'little'
    found: dict[str, _Place] = {}
    at = header
    for each in payload.fields:
        size = calcsize('<' + each.code)
        if each.code in _UNSIGNED:
            found[each.name] = slice(at, at + size), order
        at += size
    return found


def _lqi_data(packet: bytes, group: int) -> Look:
    return Look(_LQI_DATA, group, packet[8] << 8 | packet[9], -1,
                packet[12] << 8 | packet[13], 16, hash(packet[8:10] + packet[12:]) or 1,
                relay=packet[3] << 8 | packet[4])


def _ctp_data(packet: bytes, group: int) -> Look:
    return Look(_CTP_DATA, group, packet[12] << 8 | packet[13], -1, packet[14], 8,
                hash(packet[12:]) or 1, relay=packet[3] << 8 | packet[4])


def _lqi_beacon(packet: bytes, group: int) -> Look:
    origin = packet[8] << 8 | packet[9]
    return Look(_LQI_BEACON, group, origin,
                free_of_charge=-1 if packet[16] or packet[17] else origin)


def _ctp_beacon(packet: bytes, group: int) -> Look:
    source = packet[3] << 8 | packet[4]
    return Look(_CTP_BEACON, group, source,
                free_of_charge=-1 if packet[13] or packet[14] else source)


def _debug(packet: bytes, group: int) -> Look:
    # Its number counts the messages of the sink itself: when it goes back, the sink began anew.
    return Look(packet[7], group, packet[3] << 8 | packet[4], -1,
                packet[15] << 8 | packet[16], 16)


def _oscilloscope(packet: bytes, group: int) -> Look:
    # Its count jumps when a node hears a larger one: gaps are no losses.
    return Look(_OSCILLOSCOPE, group, packet[12] << 8 | packet[13], -1,
                packet[14] << 8 | packet[15], 0, hash(packet[8:]) or 1)


# Type -> bytes of data at least, and what looks at them.
_LOOKS_2: Final[Looks] = {
    _CTP_BEACON: (7, _ctp_beacon), _CTP_DATA: (8, _ctp_data), _CTP_DEBUG: (9, _debug),
    _LQI_BEACON: (12, _lqi_beacon), _LQI_DATA: (9, _lqi_data), _LQI_DEBUG: (9, _debug),
    _OSCILLOSCOPE: (8, _oscilloscope)}
