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
Reads the header of a packet: its origin, its sequence number and its type.

The sink needs no more to sort packets by importance and to drop duplicates; it takes a few
microseconds and makes one object. The readers of a packet decode its contents, see
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

#: Problems of packets that cannot be used.
TRUNCATED: Final = 'truncated header'
WRONG_LENGTH: Final = 'wrong length byte'
NOT_AM: Final = 'not an active message'

SURGE: Final = 17
_LQI_BEACON_1: Final = 250
_CTP_BEACON, _CTP_DATA, _CTP_DEBUG = 0x70, 0x71, 0x72
_LQI_BEACON, _LQI_DATA, _LQI_DEBUG = 0x73, 0x74, 0x75
_OSCILLOSCOPE: Final = 0x93
#: Types that are known without a declaration, by generation.
KNOWN: Final = {TINYOS_1.name: frozenset({*TELOS_READERS, *MICA_READERS}),
                TINYOS_2.name: frozenset({*T2_READERS, *T2_COLLECTIONS})}


class PacketHeader(NamedTuple):
    """
    The header of a packet.

    :ivar am_type: AM type; -1 when the packet is shorter than a header.
    :ivar origin: node that made it; -1 when it does not say.
    :ivar kind: of its reading; -1 when it does not say.
    :ivar sequence: sequence number from its origin; -1 when it has none.
    :ivar bits: of that number, before it wraps; 0 when gaps in it mean nothing.
    :ivar content: hash of everything that is the same at each hop; 0 for packets without data,
        such as a beacon, which have no duplicates.
    :ivar relay: node that delivered it, according to its header; -1 when it does not say.
    :ivar zero_cost: sender of a beacon that advertises a cost of 0 to the sink; -1 for none.
    :ivar problem: why it cannot be used; empty when it can.
    """

    am_type: int
    group: int
    origin: int = -1
    kind: int = -1
    sequence: int = -1
    bits: int = 0
    content: int = 0
    zero_cost: int = -1
    relay: int = -1
    problem: str = ''


HeaderReader = Callable[[bytes], PacketHeader]
_ReadHeader = Callable[[bytes, int], PacketHeader]
_Found = tuple[int, _ReadHeader]
Readers = Mapping[int, _Found]
_FieldPosition = tuple[slice, Literal['little', 'big']]

_TELOS, _MICA, _SERIAL_AM = TELOS_HEADER.size, MICA_HEADER.size, SIZE
_UNSIGNED: Final = ('B', 'H', 'I', 'L')


def header_reader(stack: str, platform: str, payloads: Iterable[Payload] = ()) -> HeaderReader:
    """
    Return the function that reads the headers of a network's packets.

    :param stack: ``tinyos1`` or ``tinyos2``.
    :param platform: of TinyOS 1.x, ``telos`` or ``mica``.
    :param payloads: user-defined payloads.
    """
    own = tuple(payloads)
    if stack == TINYOS_2.name:
        readers = {**_own_readers(own, _SERIAL_AM, True), **_READERS_2}
        return lambda packet: read_tinyos2_header(packet, readers)
    routed = frozenset((SURGE, *(each.am_type for each in own if each.routed)))
    plain = [each for each in own if each.am_type not in routed]
    if platform == MICA:
        readers = _own_readers(plain, _MICA, False)
        return lambda packet: read_mica_header(packet, routed, readers)
    readers = _own_readers(plain, _TELOS, False)
    return lambda packet: read_telos_header(packet, routed, readers)


def read_telos_header(packet: bytes, routed: Collection[int] = frozenset((SURGE,)),
                      readers: Readers = MappingProxyType({})) -> PacketHeader:
    """
    Read the header of a TOS_Msg of TinyOS 1.x on motes with a CC2420.

    :param routed: types whose packets start with the header of MultiHopLQI.
    :param readers: for packets of other types.
    """
    size = len(packet)
    if size < _TELOS:
        return PacketHeader(-1, -1, problem=TRUNCATED)
    am_type, group, length = packet[8], packet[9], packet[0]
    if length != size - _TELOS:
        return PacketHeader(am_type, group, problem=WRONG_LENGTH)
    if am_type == _LQI_BEACON_1:
        if length < 16:
            return PacketHeader(am_type, group, problem=TRUNCATED)
        source = packet[10] | packet[11] << 8
        return PacketHeader(am_type, group, packet[12] | packet[13] << 8,
                            zero_cost=-1 if packet[22] or packet[23] else source)
    if am_type not in routed:
        return _read_data(packet, am_type, group, -1, length, readers)
    if length < 10:
        return PacketHeader(am_type, group, problem=TRUNCATED)
    relay, origin = packet[10] | packet[11] << 8, packet[12] | packet[13] << 8
    content = hash(packet[12:14] + packet[16:]) or 1
    if am_type != SURGE or length < 20:
        return PacketHeader(am_type, group, origin, -1, packet[16] | packet[17] << 8, 16, content,
                            relay=relay)
    kind = packet[30] | packet[31] << 8 if length >= 24 and not (packet[20] or packet[21]) else -1
    return PacketHeader(am_type, group, origin, kind,
                        packet[26] | packet[27] << 8 | packet[28] << 16 | packet[29] << 24, 32,
                        content, relay=relay)


def read_mica_header(packet: bytes, routed: Collection[int] = frozenset((SURGE,)),
                     readers: Readers = MappingProxyType({})) -> PacketHeader:
    """
    Read the header of a TOS_Msg of TinyOS 1.x on mica, mica2 and mica2dot.

    :param routed: types whose packets start with a routing header.
    :param readers: for packets of other types.
    """
    size = len(packet)
    if size < _MICA:
        return PacketHeader(-1, -1, problem=TRUNCATED)
    am_type, group, length = packet[2], packet[3], packet[4]
    if length != size - _MICA:
        return PacketHeader(am_type, group, problem=WRONG_LENGTH)
    if am_type not in routed:
        return _read_data(packet, am_type, group, -1, length, readers)
    if length < 7:
        return PacketHeader(am_type, group, problem=TRUNCATED)
    # The sequence number is that of the last sender: only its own duplicates are recognized.
    return PacketHeader(am_type, group, packet[7] | packet[8] << 8, content=hash(packet[5:]) or 1,
                        relay=packet[5] | packet[6] << 8)


def read_tinyos2_header(packet: bytes, readers: Readers | None = None) -> PacketHeader:
    """
    Read the header of an active message of TinyOS 2.x, which starts with its dispatch byte.

    :param readers: for packets, by type; by default those of TinyOS.
    """
    size = len(packet)
    if size < _SERIAL_AM:
        return PacketHeader(-1, -1, problem=TRUNCATED)
    am_type, group, length = packet[7], packet[6], packet[5]
    if packet[0] != DISPATCH_AM:
        return PacketHeader(-1, -1, problem=NOT_AM)
    if length != size - _SERIAL_AM:
        return PacketHeader(am_type, group, problem=WRONG_LENGTH)
    return _read_data(packet, am_type, group, packet[3] << 8 | packet[4], length,
                      _READERS_2 if readers is None else readers)


def _read_data(packet: bytes, am_type: int, group: int, source: int, length: int, readers: Readers
               ) -> PacketHeader:
    found = readers.get(am_type)
    if found is None:
        return PacketHeader(am_type, group, source)
    shortest, find = found
    if length < shortest:
        return PacketHeader(am_type, group, problem=TRUNCATED)
    return find(packet, group)


def _own_readers(payloads: Iterable[Payload], header: int, big: bool) -> dict[int, _Found]:
    """Return readers of the payloads that contain their origin and a sequence number."""
    found: dict[int, _Found] = {}
    for each in payloads:
        places = _places(each, header, big)
        if {'origin', 'seqno'} <= places.keys():
            found.setdefault(each.am_type, (each.size, _own_reader(
                each.am_type, header, places['origin'], places['seqno'])))
    return found


def _own_reader(am_type: int, header: int, origin: _FieldPosition, seqno: _FieldPosition
                ) -> _ReadHeader:
    (from_, order), (number, _) = origin, seqno
    bits = 8 * (number.stop - number.start)

    def read(packet: bytes, group: int) -> PacketHeader:
        return PacketHeader(
            am_type, group, int.from_bytes(packet[from_], order) & 0xFFFF, -1,
            int.from_bytes(packet[number], order), bits, hash(packet[header:]) or 1)

    return read


def _places(payload: Payload, header: int, big: bool) -> dict[str, _FieldPosition]:
    """Return the positions of the integer fields of a payload in the packet, by name."""
    order: Literal['little', 'big'] = 'big' if (
        payload.byte_order == 'big' if payload.byte_order else big) else 'little'
    found: dict[str, _FieldPosition] = {}
    at = header
    for each in payload.fields:
        size = calcsize('<' + each.code)
        if each.code in _UNSIGNED:
            found[each.name] = slice(at, at + size), order
        at += size
    return found


def _lqi_data(packet: bytes, group: int) -> PacketHeader:
    return PacketHeader(_LQI_DATA, group, packet[8] << 8 | packet[9], -1,
                        packet[12] << 8 | packet[13], 16, hash(packet[8:10] + packet[12:]) or 1,
                        relay=packet[3] << 8 | packet[4])


def _ctp_data(packet: bytes, group: int) -> PacketHeader:
    return PacketHeader(_CTP_DATA, group, packet[12] << 8 | packet[13], -1, packet[14], 8,
                        hash(packet[12:]) or 1, relay=packet[3] << 8 | packet[4])


def _lqi_beacon(packet: bytes, group: int) -> PacketHeader:
    origin = packet[8] << 8 | packet[9]
    return PacketHeader(_LQI_BEACON, group, origin,
                        zero_cost=-1 if packet[16] or packet[17] else origin)


def _ctp_beacon(packet: bytes, group: int) -> PacketHeader:
    source = packet[3] << 8 | packet[4]
    return PacketHeader(_CTP_BEACON, group, source,
                        zero_cost=-1 if packet[13] or packet[14] else source)


def _debug(packet: bytes, group: int) -> PacketHeader:
    # Its number counts the messages of the sink itself: when it goes back, the sink has rebooted.
    return PacketHeader(packet[7], group, packet[3] << 8 | packet[4], -1,
                        packet[15] << 8 | packet[16], 16)


def _oscilloscope(packet: bytes, group: int) -> PacketHeader:
    # Its count jumps when a node receives a larger one: gaps are not losses.
    return PacketHeader(_OSCILLOSCOPE, group, packet[12] << 8 | packet[13], -1,
                        packet[14] << 8 | packet[15], 0, hash(packet[8:]) or 1)


# Type -> least number of bytes of data, and their reader.
_READERS_2: Final[Readers] = {
    _CTP_BEACON: (7, _ctp_beacon), _CTP_DATA: (8, _ctp_data), _CTP_DEBUG: (9, _debug),
    _LQI_BEACON: (12, _lqi_beacon), _LQI_DATA: (9, _lqi_data), _LQI_DEBUG: (9, _debug),
    _OSCILLOSCOPE: (8, _oscilloscope)}
