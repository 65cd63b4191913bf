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

"""Totals of received packets: by type, and by origin with losses and duplicates."""

from __future__ import annotations

from collections import Counter
from collections import OrderedDict
from collections.abc import Iterator
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.wsn.packets.contents import DATA
from rt_robot_os.features.wsn.packets.decode import Packet
from rt_robot_os.features.wsn.packets.decode import PacketDecoder
from rt_robot_os.features.wsn.packets.framing import FrameReader
from rt_robot_os.features.wsn.sensor_network.sequence_account import DUPLICATE
from rt_robot_os.features.wsn.sensor_network.sequence_account import SequenceAccount

_MOST_ORIGINS: Final = 0x10000
_REMEMBERED: Final = 64
# Fields that change from hop to hop; they are ignored when packets are compared.
_OF_THE_HOP: Final = frozenset({'seqno', 'thl', 'etx', 'options'})
# Assumed interval of packets in a recording without times: that of a busy line.
_BYTE_NS: Final = NS_PER_S // 5760
_FRAME_BYTES: Final = 24
_SKIPS_NUMBERS: Final = 'oscilloscope'
_SKIPPING_BITS: Final = 16


class Origin:
    """
    The data packets of one node.

    :ivar packets: all, including copies.
    :ivar copies: duplicates of earlier packets.
    :ivar account: of its sequence numbers; None without any.
    :ivar is_exact: whether each missing number is a lost packet. With Oscilloscope of TinyOS
        2.x it is not: a node skips numbers when it adopts a higher one.
    """

    __slots__ = ('packets', 'copies', 'account', 'is_exact', '_recent')

    def __init__(self) -> None:
        self.packets = 0
        self.copies = 0
        self.account: SequenceAccount | None = None
        self.is_exact = True
        self._recent: OrderedDict[tuple[int, int], None] = OrderedDict()

    def take(self, packet: Packet, now_ns: int) -> bool:
        """Add a packet; return whether it is a duplicate."""
        self.packets += 1
        if packet.count_bits:
            if self.account is None:
                self.account = SequenceAccount(packet.count_bits, now_ns)
            again = self.account.add(packet.count, _says(packet), now_ns) == DUPLICATE
        else:
            again = self._again(packet)
            number = packet.fields.get('count')
            if packet.name == _SKIPS_NUMBERS and isinstance(number, int) and not again:
                self.is_exact = False
                if self.account is None:
                    self.account = SequenceAccount(_SKIPPING_BITS, now_ns)
                self.account.add(number, _says(packet), now_ns)
        self.copies += again
        return again

    def _again(self, packet: Packet) -> bool:
        key = packet.origin_seqno, _says(packet)
        if packet.origin_seqno < 0:
            return False
        again = key in self._recent
        self._recent[key] = None
        self._recent.move_to_end(key)
        if len(self._recent) > _REMEMBERED:
            self._recent.popitem(last=False)
        return again


class Tally:
    """
    The totals of the received packets.

    :ivar types: kind, AM type and name -> number of packets.
    :ivar origins: node -> its data packets.
    """

    def __init__(self) -> None:
        self.types: Counter[tuple[str, int, str]] = Counter()
        self.origins: dict[int, Origin] = {}
        self._bytes = 0

    def take(self, packet: Packet, time_s: float | None) -> bool:
        """Add a packet; return whether it is a duplicate of an earlier one."""
        self.types[packet.kind, packet.am_type, packet.name] += 1
        self._bytes += _FRAME_BYTES + len(packet.payload)
        if packet.kind != DATA or packet.origin < 0:
            return False
        origin = self.origins.get(packet.origin)
        if origin is None:
            if len(self.origins) >= _MOST_ORIGINS:
                return False
            origin = self.origins[packet.origin] = Origin()
        now_ns = self._bytes * _BYTE_NS if time_s is None else round(time_s * NS_PER_S)
        return origin.take(packet, now_ns)

    def lines(self, decoder: PacketDecoder, reader: FrameReader) -> Iterator[str]:
        """Yield the totals as lines."""
        yield (f'{decoder.packets} packets, {decoder.problems} with a problem; '
               f'{reader.rejected_frames} frames with a wrong CRC, {reader.rejected_bytes} '
               'bytes rejected')
        if decoder.foreign_groups:
            yield f'  {decoder.foreign_groups} of other groups'
        for (kind, am_type, name), count in sorted(self.types.items()):
            number = '    ' if am_type < 0 else f'0x{am_type:02x}'
            yield f'  {number} {name or kind:<24} {count:>8}'
        if self.origins:
            yield '  origin  packets   copies     lost  delivery'
        for node, origin in sorted(self.origins.items()):
            account = origin.account
            least, most = ('', '') if origin.is_exact else ('>=', '<=')
            lost = '-' if account is None else f'{most}{account.lost}'
            delivery = '-' if account is None else f'{least}{account.delivery:.2%}'
            yield f'  {node:>6} {origin.packets:>8} {origin.copies:>8} {lost:>8} {delivery:>9}'
        if not all(origin.is_exact for origin in self.origins.values()):
            yield ('  <= and >= are bounds: a node of Oscilloscope also skips numbers, without a '
                   'loss')


def _says(packet: Packet) -> int:
    """Return a hash of the content of a packet that is equal at all of its hops."""
    return hash((packet.name, packet.origin_seqno, *(
        str(value) for key, value in packet.fields.items() if key not in _OF_THE_HOP)))
