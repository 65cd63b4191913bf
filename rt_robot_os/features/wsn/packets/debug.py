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
Debug messages of the routing of motes, on the serial line: telemetry of a network.

CTP and MultiHopLQI of TinyOS 2.x send numbered events; TinyOS 1.x: :mod:`.neighbour_tables`.
"""

from __future__ import annotations

from struct import Struct
from typing import Final
from typing import NamedTuple

from rt_robot_os.features.wsn.packets.message import Message

#: Names of events by their number.
EVENTS: Final = {
    0x10: 'message_pool_empty', 0x11: 'send_queue_full', 0x12: 'no_route_to_send',
    0x13: 'radio_off', 0x14: 'radio_busy', 0x15: 'send_done_bad', 0x16: 'queue_entries_empty',
    0x17: 'too_long_to_send', 0x18: 'loop', 0x19: 'send_busy',
    0x20: 'sent', 0x21: 'received', 0x22: 'forwarded', 0x23: 'delivered', 0x24: 'send_failed',
    0x25: 'not_acknowledged', 0x26: 'given_up', 0x27: 'given_up_forwarding',
    0x28: 'duplicate_remembered', 0x29: 'duplicate_in_queue', 0x2A: 'duplicate_when_sent',
    0x30: 'no_route', 0x31: 'new_parent', 0x32: 'route', 0x33: 'beacon_sent',
    0x34: 'beacon_received',
    0x50: 'send_queue_empty', 0x51: 'message_pool_error', 0x52: 'queue_entries_error',
    0x53: 'message_pool_error', 0x54: 'queue_entries_error', 0xDE: 'started',
}
_ROUTING: Final = range(0x30, 0x40)


class _CollectionDebugFields(NamedTuple):
    event: int
    first: int
    second: int
    third: int
    seqno: int


class CollectionDebug(Message, _CollectionDebugFields):
    """
    An event of the collection protocol of a root or a node, of TinyOS 2.x, big-endian.

    :ivar event: 0x10 to 0x19 errors, 0x20 to 0x2A forwarding, 0x30 to 0x34 routing.
    :ivar first: of three numbers of 16 bits: forwarding has message, origin, other node.
    :ivar seqno: counts the events of the node.
    """

    __slots__ = ()
    AM_TYPE = 0x72
    LAYOUT = Struct('>B3HH')

    @property
    def name(self) -> str:
        """Return the name of the event."""
        return EVENTS.get(self.event) or f'event_{self.event:#04x}'

    @property
    def fields(self) -> dict[str, int]:
        """Return the numbers by name; routing and forwarding have different layouts."""
        found = {'event': self.event, 'seqno': self.seqno}
        if self.event in _ROUTING:
            # parent u16, hopcount u8, metric u16, an unused byte
            found['parent'] = self.first
            found['hopcount'] = self.second >> 8
            found['metric'] = (self.second & 0xFF) << 8 | self.third >> 8
        else:
            found['message'], found['origin'], found['other'] = (
                self.first, self.second, self.third)
        return found


class LqiDebug(CollectionDebug):
    """The same with the AM type of MultiHopLQI."""

    __slots__ = ()
    AM_TYPE = 0x75
