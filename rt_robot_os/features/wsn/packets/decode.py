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
Decoder of packets of any generation, routing protocol and application.

:class:`PacketDecoder` decodes packets of serial frames, or frames from the air. It never raises:
problems are a string in the packet, and are counted.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from typing import Final

from rt_robot_os.features.wsn.packets.contents import ACK
from rt_robot_os.features.wsn.packets.contents import DATA
from rt_robot_os.features.wsn.packets.contents import Draft
from rt_robot_os.features.wsn.packets.contents import mica_multihop
from rt_robot_os.features.wsn.packets.contents import MICA_READERS
from rt_robot_os.features.wsn.packets.contents import multihop
from rt_robot_os.features.wsn.packets.contents import read_payload
from rt_robot_os.features.wsn.packets.contents import Reader
from rt_robot_os.features.wsn.packets.contents import T2_COLLECTIONS
from rt_robot_os.features.wsn.packets.contents import T2_READERS
from rt_robot_os.features.wsn.packets.contents import TELOS_READERS
from rt_robot_os.features.wsn.packets.contents import UNKNOWN
from rt_robot_os.features.wsn.packets.framing import Frame
from rt_robot_os.features.wsn.packets.framing import PROTOCOLS
from rt_robot_os.features.wsn.packets.framing import TINYOS_1
from rt_robot_os.features.wsn.packets.framing import TINYOS_2
from rt_robot_os.features.wsn.packets.ieee802154 import AckFrame
from rt_robot_os.features.wsn.packets.ieee802154 import check_sequence_fits
from rt_robot_os.features.wsn.packets.ieee802154 import read_frame
from rt_robot_os.features.wsn.packets.ieee802154 import T1Frame
from rt_robot_os.features.wsn.packets.multihop_lqi import MicaMultihopMsg
from rt_robot_os.features.wsn.packets.multihop_lqi import MultihopMsg
from rt_robot_os.features.wsn.packets.payload import check_payloads
from rt_robot_os.features.wsn.packets.payload import Payload
from rt_robot_os.features.wsn.packets.serial_am import DISPATCH_802_15_4
from rt_robot_os.features.wsn.packets.serial_am import DISPATCH_AM
from rt_robot_os.features.wsn.packets.serial_am import HEADER as AM_HEADER
from rt_robot_os.features.wsn.packets.tos_msg import is_mica
from rt_robot_os.features.wsn.packets.tos_msg import is_telos
from rt_robot_os.features.wsn.packets.tos_msg import MICA
from rt_robot_os.features.wsn.packets.tos_msg import MICA_HEADER
from rt_robot_os.features.wsn.packets.tos_msg import platform_of
from rt_robot_os.features.wsn.packets.tos_msg import TELOS
from rt_robot_os.features.wsn.packets.tos_msg import TELOS_HEADER

AUTO: Final = 'auto'
STACKS: Final = (AUTO, TINYOS_1.name, TINYOS_2.name)
_TELOS_SIZE: Final = TELOS_HEADER.size
_MICA_SIZE: Final = MICA_HEADER.size
_AM_SIZE: Final = AM_HEADER.size
_RAW: Final = bytes((DISPATCH_802_15_4,))


@dataclass(frozen=True, slots=True)
class Packet:
    """
    A decoded packet; -1 means that it does not have a field.

    :ivar stack: ``tinyos1`` or ``tinyos2``; empty when it is neither.
    :ivar platform: ``telos`` or ``mica`` of TinyOS 1.x, else empty.
    :ivar source: address of the last sender.
    :ivar payload: of the active message.
    :ivar origin: address of the origin.
    :ivar origin_seqno: identifies the packet together with ``origin``: equal ones are duplicates.
    :ivar count: sequence number that the origin increments with each packet, modulo
        ``2 ** count_bits``: gaps are losses, a decrease is a reboot.
    :ivar count_bits: 0 when the packet has no such number.
    :ivar hops: from the origin to the sink, as the origin expected; in CTP, so far.
    :ivar parent: of the origin; in a beacon, of the sender. 0xFFFF is none.
    :ivar cost: of the route from there, in the unit of its routing.
    :ivar kind: ``data``, ``beacon``, ``debug``, ``command``, ``ack`` or
        ``unknown``.
    :ivar name: of the message, such as ``surge``, or of the custom payload.
    :ivar fields: all numbers as they were sent, by name.
    :ivar readings: by quantity, in the units of :mod:`rt_robot_os.messages.quantities`.
    :ivar problem: empty for a valid packet.
    """

    stack: str
    platform: str
    am_type: int
    group: int
    destination: int
    source: int
    payload: bytes
    origin: int
    origin_seqno: int
    count: int
    count_bits: int
    hops: int
    parent: int
    cost: int
    kind: str
    name: str
    fields: Mapping[str, Any]
    readings: Mapping[str, float]
    problem: str


class PacketDecoder:
    """
    Decodes packets; safe in the real-time loop: about 10 us each in pure Python.

    :ivar packets: number of packets.
    :ivar problems: number of packets with a problem.
    :ivar unreadable: number of packets with an unreadable header.
    :ivar foreign_groups: number of packets of other groups.
    :ivar unknown_types: AM type -> number of packets of an undeclared type.
    """

    def __init__(self, stack: str = AUTO, payloads: Iterable[Payload] = (), platform: str = AUTO,
                 group: int | None = None) -> None:
        """
        Store the kind of packets.

        :param stack: ``tinyos1``, ``tinyos2``, or ``auto``: the best match for each packet.
        :param payloads: custom payloads; they take precedence over built-in ones.
        :param platform: of TinyOS 1.x: ``telos``, ``mica`` or ``auto``.
        :param group: of the network; packets of others are decoded, counted and have a problem.
            None accepts all.
        :raises ValueError: the stack or the platform is unknown.
        :raises ConfigError: payloads are ambiguous.
        """
        if stack not in STACKS or platform not in (AUTO, TELOS, MICA):
            raise ValueError(f'stack {stack!r} must be one of {", ".join(STACKS)}, platform '
                             f'{platform!r} one of {AUTO}, {TELOS}, {MICA}')
        self.packets = 0
        self.problems = 0
        self.unreadable = 0
        self.foreign_groups = 0
        self.unknown_types: Counter[int] = Counter()
        self._stack = stack
        self._platform = platform
        self._seen_platform = TELOS
        self._group = group
        self._custom: dict[int, list[Payload]] = {}
        for each in check_payloads(payloads):
            self._custom.setdefault(each.am_type, []).append(each)

    def decode(self, packet: bytes, stack: str = '') -> Packet:
        """
        Decode a packet from the serial line; never raises.

        :param packet: without framing: a TOS_Msg, or an active message with its dispatch byte.
        :param stack: of this packet, from its frame; empty: that of the decoder.
        """
        stack = stack or self._stack
        if stack == AUTO:
            stack = self._guess(packet)
        if stack == TINYOS_2.name:
            return self._decode_t2(packet)
        if stack == TINYOS_1.name:
            return self._decode_t1(packet, self._platform_of(packet))
        return self._unreadable('', f'{len(packet)} bytes are not a packet of TinyOS: no length '
                                    'in them fits')

    def decode_frame(self, frame: Frame) -> Packet:
        """
        Decode a frame of the serial line; never raises.

        :param frame: of a frame reader; its P determines the generation.
        """
        known = PROTOCOLS.get(frame.protocol)
        if known is None:
            return self._unreadable(
                '', f'its protocol byte {frame.protocol:#04x} is not one of TinyOS')
        if frame.protocol != known.ack:
            return self.decode(frame.packet, known.name)
        self.packets += 1
        return _acknowledgement(known.name, {'token': frame.token}, '')

    def decode_air(self, data: bytes, checked: bool = True) -> Packet:
        """
        Decode a frame from the air; never raises.

        :param data: from the length byte to the frame check sequence.
        :param checked: whether to verify that; some radios replace it.
        """
        try:
            found = read_frame(data)
        except ValueError as error:
            return self._unreadable('', str(error))
        problem = ''
        if checked and not check_sequence_fits(data):
            problem = 'its frame check sequence is wrong'
        if isinstance(found, AckFrame):
            self.packets += 1
            self.problems += bool(problem)
            return _acknowledgement('', {'dsn': found.dsn}, problem)
        if isinstance(found, T1Frame):
            return self._read(TINYOS_1.name, TELOS, found.am_type, found.group,
                              found.destination, -1, found.payload, problem)
        return self._read(TINYOS_2.name, '', found.am_type, found.pan & 0xFF, found.destination,
                          found.source, found.payload, problem)

    def counters(self) -> dict[str, int]:
        """Return the counters by name, with the sum of unknown types."""
        return {'packets': self.packets, 'problems': self.problems,
                'unreadable': self.unreadable, 'foreign_groups': self.foreign_groups,
                'unknown_types': sum(self.unknown_types.values())}

    def _guess(self, packet: bytes) -> str:
        if is_telos(packet) and self._platform != MICA:
            return TINYOS_1.name
        if len(packet) >= _AM_SIZE and packet[0] == DISPATCH_AM and (
                len(packet) == packet[5] + _AM_SIZE):
            return TINYOS_2.name
        if packet[:1] == _RAW and len(packet) > 1 and len(packet) == packet[1] + 2:
            return TINYOS_2.name
        if is_mica(packet) and self._platform != TELOS:
            return TINYOS_1.name
        return ''

    def _platform_of(self, packet: bytes) -> str:
        """Return the platform of a packet; if its length fits none, that of the last packet."""
        if self._platform != AUTO:
            return self._platform
        self._seen_platform = platform_of(packet) or self._seen_platform
        return self._seen_platform

    def _decode_t1(self, packet: bytes, platform: str) -> Packet:
        if platform == TELOS:
            if len(packet) < _TELOS_SIZE:
                return self._unreadable(TINYOS_1.name, _too_short(packet, _TELOS_SIZE))
            length, _, _, _, destination, am_type, group = TELOS_HEADER.unpack_from(packet)
            payload = packet[_TELOS_SIZE:]
        else:
            if len(packet) < _MICA_SIZE:
                return self._unreadable(TINYOS_1.name, _too_short(packet, _MICA_SIZE))
            destination, am_type, group, length = MICA_HEADER.unpack_from(packet)
            payload = packet[_MICA_SIZE:]
        problem = '' if length == len(payload) else _wrong_length(length, payload)
        return self._read(TINYOS_1.name, platform, am_type, group, destination, -1,
                          payload[:length], problem)

    def _decode_t2(self, packet: bytes) -> Packet:
        if packet[:1] == _RAW:
            return self.decode_air(packet[1:], checked=False)
        if len(packet) < _AM_SIZE:
            return self._unreadable(TINYOS_2.name, _too_short(packet, _AM_SIZE))
        dispatch, destination, source, length, group, am_type = AM_HEADER.unpack_from(packet)
        if dispatch != DISPATCH_AM:
            return self._unreadable(TINYOS_2.name, f'its dispatch byte is {dispatch:#04x}: '
                                    'neither an active message nor a frame of 802.15.4')
        payload = packet[_AM_SIZE:]
        problem = '' if length == len(payload) else _wrong_length(length, payload)
        return self._read(TINYOS_2.name, '', am_type, group, destination, source,
                          payload[:length], problem)

    def _read(self, stack: str, platform: str, am_type: int, group: int, destination: int,
              source: int, payload: bytes, problem: str) -> Packet:
        self.packets += 1
        draft = Draft(source)
        try:
            if stack == TINYOS_2.name:
                self._read_t2(am_type, payload, draft)
            else:
                self._read_t1(am_type, payload, platform, draft)
        except ValueError as error:
            draft.problem = draft.problem or str(error)
        if self._group is not None and group != self._group:
            self.foreign_groups += 1
            problem = problem or f'group {group:#04x} instead of {self._group:#04x}'
        problem = problem or draft.problem
        if problem:
            draft.readings = {}  # unreliable
            self.problems += 1
        return Packet(
            stack, platform, am_type, group, destination, draft.source, payload, draft.origin,
            draft.origin_seqno, draft.count, draft.count_bits, draft.hops, draft.parent,
            draft.cost, draft.kind, draft.name, draft.fields, draft.readings, problem)

    def _read_t1(self, am_type: int, payload: bytes, platform: str, draft: Draft) -> None:
        header = mica_multihop if platform == MICA else multihop
        readers = MICA_READERS if platform == MICA else TELOS_READERS
        own = self._custom.get(am_type)
        if own:
            size = (MicaMultihopMsg if platform == MICA else MultihopMsg).LAYOUT.size
            declared = _fitting(own, len(payload), size, am_type in readers)
            if declared is not None:
                draft.kind, draft.name = DATA, declared.name
                data = header(payload, draft) if declared.routed else payload
                read_payload(declared, data, False, draft)
                return
        self._read_known(readers.get(am_type), am_type, payload, draft)

    def _read_t2(self, am_type: int, payload: bytes, draft: Draft) -> None:
        collection = T2_COLLECTIONS.get(am_type)
        if collection is None:
            self._read_application(am_type, payload, draft)
            return
        am_type, payload = collection(payload, draft)
        if am_type in self._custom or am_type in T2_READERS:
            self._read_application(am_type, payload, draft)

    def _read_application(self, am_type: int, payload: bytes, draft: Draft) -> None:
        own = self._custom.get(am_type)
        if own:
            declared = _fitting(own, len(payload), 0, am_type in T2_READERS)
            if declared is not None:
                read_payload(declared, payload, True, draft)
                return
        self._read_known(T2_READERS.get(am_type), am_type, payload, draft)

    def _read_known(self, reader: Reader | None, am_type: int, payload: bytes, draft: Draft
                    ) -> None:
        if reader is None:
            self.unknown_types[am_type] += 1
        else:
            reader(payload, draft)

    def _unreadable(self, stack: str, problem: str) -> Packet:
        self.packets += 1
        self.problems += 1
        self.unreadable += 1
        return Packet(stack, '', -1, -1, -1, -1, b'', -1, -1, -1, 0, -1, -1, -1, UNKNOWN, '', {},
                      {}, problem)


def _acknowledgement(stack: str, fields: dict[str, int], problem: str) -> Packet:
    return Packet(stack, '', -1, -1, -1, -1, b'', -1, -1, -1, 0, -1, -1, -1, ACK, ACK, fields, {},
                  problem)


def _fitting(own: list[Payload], size: int, header: int, built_in: bool) -> Payload | None:
    """Return the payload of that size; else the first one, if none is built in."""
    for each in own:
        if size == each.size + (header if each.routed else 0):
            return each
    return None if built_in else own[0]


def _too_short(packet: bytes, size: int) -> str:
    return f'too short: {len(packet)} bytes, the header has {size}'


def _wrong_length(length: int, payload: bytes) -> str:
    return f'its length byte is {length}, but the payload has {len(payload)} bytes'
