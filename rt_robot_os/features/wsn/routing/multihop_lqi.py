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
MultiHopLQI, TinyOS' routing by link quality, in both of its versions.

The implementation reproduces the motes, with their defects: without a route data are broadcast,
the link is measured against the direction of the data, a parent with received beacons is kept
although it receives no data, and the cost overflows below LQI 50.
"""

from __future__ import annotations

from abc import abstractmethod
from collections import Counter
from collections.abc import Callable
from typing import Final

from rt_robot_os.features.wsn.packets.multihop_lqi import BeaconMsg
from rt_robot_os.features.wsn.packets.multihop_lqi import LqiBeacon
from rt_robot_os.features.wsn.packets.multihop_lqi import LqiData
from rt_robot_os.features.wsn.packets.multihop_lqi import MultihopMsg
from rt_robot_os.features.wsn.packets.multihop_lqi import NO_PARENT
from rt_robot_os.features.wsn.packets.multihop_lqi import signed
from rt_robot_os.features.wsn.packets.multihop_lqi import UART_ADDRESS
from rt_robot_os.features.wsn.routing.lqi_route import Decision
from rt_robot_os.features.wsn.routing.lqi_route import LqiRoute
from rt_robot_os.features.wsn.routing.lqi_route import RecentPackets
from rt_robot_os.features.wsn.routing.protocol import BINARY_MS_NS
from rt_robot_os.features.wsn.routing.protocol import BROADCAST
from rt_robot_os.features.wsn.routing.protocol import Node
from rt_robot_os.features.wsn.routing.protocol import Received
from rt_robot_os.features.wsn.routing.protocol import Router
from rt_robot_os.features.wsn.routing.retransmission import Packet
from rt_robot_os.features.wsn.routing.retransmission import Retransmitter
from rt_robot_os.features.wsn.routing.tinyos_random import TinyOsRandom

#: 32 s, as in TinyOS; networks with a moving sink use 4 s.
BEACON_PERIOD_NS: Final = 32_000_000_000
#: The motes restart the timer each time, for a tick of 1/1024 s more than the period.
_TICK_NS: Final = round(BINARY_MS_NS)
#: Largest number of retransmissions of a packet.
RETRANSMISSIONS: Final = 5
QUEUE: Final = 2
_U16: Final = 0xFFFF


class _MultiHopLqi(Router):
    """
    The common part of both versions.

    :param node: that it runs on.
    :param root: it is the sink.
    :param beacon_period_ns: between two beacons of a node.
    :param u16_wrap: whether the cost overflows as on motes; see :func:`.link_cost.link_cost`.
    """

    def __init__(self, node: Node, root: bool = False,
                 beacon_period_ns: int = BEACON_PERIOD_NS, *,
                 u16_wrap: bool = True) -> None:
        if beacon_period_ns < 1:
            raise ValueError(f'beacon_period_ns {beacon_period_ns}: must be 1 or more')
        self.root = root
        self.counters = Counter()
        self._node = node
        self._period_ns = beacon_period_ns
        self._u16_wrap = u16_wrap
        self._timer = node.timer(self._timer_fired)

    def _reset(self) -> None:
        self._seqno = 0
        self._route = LqiRoute(self._node.address, self._u16_wrap)
        self._recent_by_sender = RecentPackets()
        self._recent_by_origin = RecentPackets()
        self._update_attributes()

    def _update_attributes(self) -> None:
        """Update the attributes that all protocols have."""
        route = self._route
        none = route.parent == NO_PARENT
        self.parent = None if none or self.root else route.parent
        self.cost = 0 if self.root else route.cost
        self.hops = 0 if self.root else route.hops

    def start(self) -> None:
        """Start without a route; the first beacon is sent within a period."""
        self._reset()
        self._timer.start(self._first_beacon_ns())

    def _first_beacon_ns(self) -> int:
        return self._node.random.randrange(self._period_ns)

    def stop(self) -> None:
        """Stop all timers, and clear the queues."""
        self._timer.stop()
        self._reset()

    def _timer_fired(self) -> None:
        self._timer.start(self._period_ns + _TICK_NS)
        if not self.root and self._route.period_passed():
            self.counters['silent_parents'] += 1
            self._lost()
        self._send_beacon()

    @abstractmethod
    def _send_beacon(self) -> None:
        """Advertise the route."""

    @property
    def _at_sink(self) -> bool:
        return self.root and self._route.parent != NO_PARENT

    def _retransmitter(self, finished: Callable[[], None]) -> Retransmitter:
        return Retransmitter(self._node, lambda: self._route.parent, finished, RETRANSMISSIONS,
                             self.counters)

    def _packet(self, am_type: int, payload: bytes) -> Packet:
        if self._route.parent == NO_PARENT:
            self.counters['unrouted'] += 1
        return Packet(self._route.parent, am_type, payload)

    def _next_seqno(self) -> int:
        seqno = self._seqno
        self._seqno = (seqno + 1) & _U16
        return seqno

    def _receive_beacon(self, source: int, parent: int, cost: int, hops: int, lqi: int) -> None:
        self.counters['beacons_heard'] += 1
        self._node.note('beacon_heard', source, 0, cost)
        if self._at_sink:
            return
        decision = self._route.update(source, parent, cost, hops, lqi)
        if decision is Decision.KEEP:
            return
        if decision is Decision.LOSE:
            self.counters['loops'] += 1
            self._lost()
            return
        self._update_attributes()
        if decision is Decision.CHANGE:
            self.counters['parent_changes'] += 1
            self._node.note('parent', source, self._route.hops, self._route.cost)

    def _lost(self) -> None:
        self._update_attributes()
        self._node.note('no_parent')

    def _may_forward(self, sender: int, seqno: int, origin: int, origin_seqno: int) -> bool:
        """Return whether a packet is not a duplicate; one that returned shows a loop."""
        if self._recent_by_sender.check_and_add(sender, seqno):
            self.counters['duplicates'] += 1
            return False
        if self._recent_by_origin.check_and_add(origin, origin_seqno):
            self.counters['loops'] += 1
            self._route.lose()
            self._node.note('loop', origin, origin_seqno)
            self._lost()
            return False
        return True


class MultiHopLqi2(_MultiHopLqi):
    """
    MultiHopLQI of TinyOS 2.x.

    Own packets, forwarded ones and beacons have separate senders at the radio.

    :param collect_id: application identifier in each packet.
    """

    def __init__(self, node: Node, root: bool = False,
                 beacon_period_ns: int = BEACON_PERIOD_NS, *,
                 u16_wrap: bool = True, collect_id: int = 0x93) -> None:
        super().__init__(node, root, beacon_period_ns=beacon_period_ns, u16_wrap=u16_wrap)
        self._collect_id = collect_id
        self._beacons = node.sender(self._beacon_sent)
        self._own = self._retransmitter(lambda: None)
        self._forwarding = self._retransmitter(self._forward_next)
        self._reset()

    def _reset(self) -> None:
        super()._reset()
        self._origin_seqno = 0
        self._beacon_waits = False
        self._random = TinyOsRandom(self._node.address)
        self._waiting: list[Packet | None] = [None] * QUEUE
        self._own.clear()
        self._forwarding.clear()
        if self.root:
            self._route.parent = self._node.address
            self._route.parent_cost = self._route.link = self._route.hops = 0

    def start(self) -> None:
        """Start without a route."""
        super().start()
        if self.root:
            self._node.note('parent', self._node.address, 0, 0)

    def _first_beacon_ns(self) -> int:
        ticks = max(1, round(self._period_ns / BINARY_MS_NS))
        return round(self._random.below(ticks) * BINARY_MS_NS)

    def _send_beacon(self) -> None:
        if self._beacons.busy:
            self._beacon_waits = True
            return
        route = self._route
        beacon = LqiBeacon(self._node.address, self._next_seqno(), 0, route.parent, route.cost,
                           route.hops)
        if self._beacons.send(BROADCAST, LqiBeacon.AM_TYPE, beacon.pack(), False):
            self.counters['beacons'] += 1
            self._node.note('beacon_sent', route.parent, 0, route.cost)

    def _beacon_sent(self, acknowledged: bool) -> None:
        if self._beacon_waits:
            self._beacon_waits = False
            self._send_beacon()

    def originate(self, application: bytes) -> bool:
        """Send a packet of the application; not at a root, and one at a time."""
        if self.root or self._own.busy:
            self.counters['no_room'] += 1
            return False
        origin_seqno = self._origin_seqno
        self._origin_seqno = (origin_seqno + 1) & _U16
        hops = self._route.hops
        data = LqiData(self._node.address, self._next_seqno(), origin_seqno, hops,
                       self._collect_id, application)
        self.counters['originated'] += 1
        return self._own.send(self._packet(LqiData.AM_TYPE, data.pack()))

    def receive(self, frame: Received) -> None:
        """Process a beacon or a data packet."""
        try:
            if frame.am_type == LqiBeacon.AM_TYPE:
                beacon = LqiBeacon.unpack(frame.payload)
                self._receive_beacon(frame.source, *beacon[3:], frame.lqi)
            elif frame.am_type == LqiData.AM_TYPE:
                self._receive_data(frame, LqiData.unpack(frame.payload))
        except ValueError:
            self.counters['malformed'] += 1

    def _receive_data(self, frame: Received, data: LqiData) -> None:
        self._node.note('data_heard', data.origin_seqno, data.origin, frame.destination)
        if self.root:
            # The root delivers all copies: the host has to remove duplicates.
            self.counters['delivered'] += 1
            self._node.deliver(frame.am_type, frame.payload, data.origin, data.data)
        elif frame.destination == self._node.address:
            self._forward(frame.source, data)

    def _forward(self, sender: int, data: LqiData) -> None:
        if None not in self._waiting:
            self.counters['queue_full'] += 1
            return
        if not self._may_forward(sender, data.seqno, data.origin, data.origin_seqno):
            return
        data = LqiData(data.origin, self._next_seqno(), *data[2:])
        packet = self._packet(LqiData.AM_TYPE, data.pack())
        self._waiting[self._waiting.index(None)] = packet
        self.counters['forwarded'] += 1
        if not self._forwarding.busy:
            self._forwarding.send(packet)

    def _forward_next(self) -> None:
        through = self._forwarding.packet
        waiting = self._waiting
        for place, packet in enumerate(waiting):
            if packet is through:
                waiting[place] = None
        first = self._random.below(QUEUE)
        for step in range(QUEUE):
            packet = waiting[(first + step) % QUEUE]
            if packet is not None:
                self._forwarding.send(packet)
                break


class MultiHopLqi1(_MultiHopLqi):
    """
    MultiHopLQI of TinyOS 1.x, of SurgeTelos.

    The stack has one message buffer for the radio and the serial line: packets and beacons that
    are sent meanwhile are lost. Data that are broadcast without a route are ignored by all nodes.
    A root that treats a copy as a loop loses its route to the serial line.

    :param data_am_type: of the application's packets.
    :param serial_baud: of the root's serial line, which blocks the stack; 0: no delay.
    """

    def __init__(self, node: Node, root: bool = False,
                 beacon_period_ns: int = BEACON_PERIOD_NS, *,
                 u16_wrap: bool = True, data_am_type: int = 17,
                 serial_baud: int = 57_600) -> None:
        super().__init__(node, root, beacon_period_ns=beacon_period_ns, u16_wrap=u16_wrap)
        self._data_am_type = data_am_type
        self._byte_ns = 10 * 1_000_000_000 // serial_baud if serial_baud else 0
        self._serial_busy = False
        self._serial = node.timer(self._serial_done)
        self._radio = self._retransmitter(lambda: None)
        self._reset()

    def _reset(self) -> None:
        super()._reset()
        self._radio.clear()
        self._serial_busy = False
        self._serial.stop()
        if self.root:
            self._route.parent = UART_ADDRESS
            self._route.parent_cost = self._route.link = self._route.hops = 0

    @property
    def _busy(self) -> bool:
        return self._radio.busy or self._serial_busy

    def _header(self, origin: int, seqno: int, origin_seqno: int, hops: int,
                data: bytes) -> bytes:
        return MultihopMsg(self._node.address, origin, signed(seqno), signed(origin_seqno),
                           hops, data).pack()

    def _send_beacon(self) -> None:
        route = self._route
        seqno = self._next_seqno()
        if self._busy:
            self.counters['stack_busy'] += 1
            return
        body = BeaconMsg(route.parent, route.cost, route.hops).pack()
        payload = self._header(self._node.address, seqno, seqno, route.hops, body)
        self.counters['beacons'] += 1
        self._node.note('beacon_sent', route.parent, 0, route.cost)
        self._radio.send(Packet(BROADCAST, BeaconMsg.AM_TYPE, payload))

    def originate(self, application: bytes) -> bool:
        """Send a packet of the application; False when the stack is busy."""
        origin_seqno = self._seqno
        seqno = origin_seqno if self._at_sink else self._next_seqno()
        self.counters['originated'] += 1
        payload = self._header(self._node.address, seqno, origin_seqno, self._route.hops,
                               application)
        return self._pass_on(payload, self._node.address, application)

    def receive(self, frame: Received) -> None:
        """Process a beacon or a data packet."""
        try:
            message = MultihopMsg.unpack(frame.payload)
            if frame.am_type == BeaconMsg.AM_TYPE:
                beacon = BeaconMsg.unpack(message.data)
                self._receive_beacon(message.source, *beacon[:3], frame.lqi)
            elif frame.am_type == self._data_am_type:
                if frame.destination == self._node.address:
                    self._forward(message)
        except ValueError:
            self.counters['malformed'] += 1

    def _forward(self, message: MultihopMsg) -> None:
        origin = message.origin
        if origin != self._node.address and not self._may_forward(
                message.source, message.seqno, origin, message.origin_seqno):
            return
        seqno = message.seqno if self._at_sink else self._next_seqno()
        payload = self._header(origin, seqno, message.origin_seqno, message.hopcount,
                               message.data)
        if self._pass_on(payload, origin, message.data):
            self.counters['forwarded'] += 1

    def _pass_on(self, payload: bytes, origin: int, application: bytes) -> bool:
        if self._busy:
            self.counters['stack_busy'] += 1
            return False
        if not self._at_sink:
            return self._radio.send(self._packet(self._data_am_type, payload))
        self.counters['delivered'] += 1
        if self._byte_ns:
            self._serial_busy = True
            self._serial.start(self._byte_ns * (len(payload) + _SERIAL_OVERHEAD_BYTES))
        self._node.deliver(self._data_am_type, payload, origin, application)
        return True

    def _serial_done(self) -> None:
        self._serial_busy = False


#: Two flags, the protocol byte, the header of 10 bytes and a checksum of two.
_SERIAL_OVERHEAD_BYTES: Final = 15
