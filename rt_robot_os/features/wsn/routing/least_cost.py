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
Routing to a moving sink on a robot, by least cost.

Only the sink originates beacons, each with the number of its round. A node that receives one adds
the cost of the link, selects the cheapest route of the round and forwards the beacon with its own
cost, after a random delay. A newer round always replaces an older one, whatever the cost: the sink
has moved since.

The paper leaves the time between two rounds open. Here a node stores the neighbours of the round.
When the parent stops acknowledging, the best of the neighbours that cannot route over this node
replaces it; if there is none, packets wait for the next round. A neighbour that has this node as
its parent, or that sends it data while it is this node's parent, is not used: packets would
return.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Final

from rt_robot_os.features.wsn.packets.multihop_lqi import MultihopMsg
from rt_robot_os.features.wsn.packets.multihop_lqi import NO_ROUTE_COST
from rt_robot_os.features.wsn.packets.multihop_lqi import NO_ROUTE_HOPS
from rt_robot_os.features.wsn.packets.multihop_lqi import signed
from rt_robot_os.features.wsn.packets.paper import BeaconMsg
from rt_robot_os.features.wsn.packets.paper import DataMsg
from rt_robot_os.features.wsn.routing.beacon_timing import BeaconTiming
from rt_robot_os.features.wsn.routing.candidates import Candidate
from rt_robot_os.features.wsn.routing.candidates import Candidates
from rt_robot_os.features.wsn.routing.data_queue import DataQueue
from rt_robot_os.features.wsn.routing.data_queue import DuplicateCache
from rt_robot_os.features.wsn.routing.link_cost import link_costs
from rt_robot_os.features.wsn.routing.protocol import BROADCAST
from rt_robot_os.features.wsn.routing.protocol import Node
from rt_robot_os.features.wsn.routing.protocol import Received
from rt_robot_os.features.wsn.routing.protocol import Router

#: 4,096 binary ms.
BEACON_PERIOD_NS: Final = 4_000_000_000
#: Bounds of the random delay of forwarding a beacon, which avoids collisions.
RELAY_DELAY_NS: Final = (5_000_000, 50_000_000)
#: A weaker link counts as one of LQI 50: near the sensitivity of the radio the LQI of a single
#: frame is unreliable.
WEAKEST_DBM: Final = -92
#: Consecutive packets without an acknowledgement after which the parent is replaced.
FAILURES: Final = 4
#: Largest number of corrections in a round: beacons with a cost lower by a quarter.
CORRECTIONS: Final = 2
QUEUE: Final = 24
LIFETIME_NS: Final = 10_000_000_000
#: Periods without a newer round after which an older round number means a reboot of the sink.
RESTART_PERIODS: Final = 3
_REMEMBERED_BY_NODES: Final = 128
_REMEMBERED_BY_SINK: Final = 4096
#: A packet that returns this often is dropped.
_MOST_VISITS: Final = 5
_SINK_START_NS: Final = 500_000_000
_U16: Final = 0xFFFF


class LeastCost(Router):
    """
    Routing by least cost to a moving sink.

    :param node: that it runs on.
    :param root: it is the sink.
    :param beacon_period_ns: between two rounds, unless ``timing`` and ``speed`` are given.
    :param timing: adapts the period to the sink's speed.
    :param speed: returns the sink's speed in m/s.
    :param data_am_type: of the application's packets.
    """

    def __init__(self, node: Node, root: bool = False,
                 beacon_period_ns: int = BEACON_PERIOD_NS, *, timing: BeaconTiming | None = None,
                 speed: Callable[[], float] | None = None,
                 data_am_type: int = DataMsg.AM_TYPE) -> None:
        if beacon_period_ns < 1:
            raise ValueError(f'beacon_period_ns {beacon_period_ns}: must be 1 or more')
        self.root = root
        self.counters = Counter()
        self._node = node
        self._period_ns = beacon_period_ns
        self._timing = timing
        self._speed = speed
        self._data_am_type = data_am_type
        self._costs = link_costs(u16_wrap=False)
        self._beacon_timer = node.timer(self._beacon_due)
        self._beacons = node.sender(self._beacon_sent)
        self._queue = DataQueue(node, self._next_hop, self._tried, QUEUE, LIFETIME_NS,
                                self.counters)
        self._reset()

    def _reset(self) -> None:
        self._candidates = Candidates()
        self._sink: int | None = self._node.address if self.root else None
        self._round = 0
        self._round_ns = 0
        self._advertised_cost: int | None = None
        self._corrections = 0
        self._relay_planned = False
        self._beacon_waits = False
        self._failures = 0
        self._seqno = 0
        self._origin_seqno = 0
        most = _REMEMBERED_BY_SINK if self.root else _REMEMBERED_BY_NODES
        self._duplicates = DuplicateCache(most, 2 * LIFETIME_NS)
        self.parent = None
        self.cost = 0 if self.root else NO_ROUTE_COST
        self.hops = 0 if self.root else NO_ROUTE_HOPS
        self._queue.clear()

    def start(self) -> None:
        """Start without a route; the sink starts its first round soon."""
        self._reset()
        if self.root:
            self._beacon_timer.start(self._node.random.randrange(_SINK_START_NS))

    def stop(self) -> None:
        """Stop all timers, and clear the queue."""
        self._beacon_timer.stop()
        self._reset()

    # Beacons.

    def _beacon_due(self) -> None:
        """Start a round, or forward the beacon of one."""
        if not self.root:
            self._relay_planned = False
            self._choose()
        elif not self._start_round_if_due():
            return
        self._send_beacon()

    def _start_round_if_due(self) -> bool:
        """Start a round if it is due, and the timer of the next one."""
        timing, speed = self._timing, self._speed
        now_ns = self._node.now_ns()
        pause_ns = self._period_ns
        if timing is not None and speed is not None:
            # Evaluated often, because the sink may start to move at any time.
            pause_ns = timing.shortest_ns
            left_ns = self._round_ns + timing.period_ns(speed()) - now_ns
            if self._round and left_ns > 0:
                self._beacon_timer.start(min(pause_ns, left_ns))
                return False
        self._round = (self._round + 1) & _U16
        self._round_ns = now_ns
        self._beacon_timer.start(pause_ns)
        return True

    def _plan_relay(self) -> None:
        self._relay_planned = True
        self._beacon_timer.start(self._node.random.randint(*RELAY_DELAY_NS))

    def _send_beacon(self) -> None:
        if self._beacons.busy:
            self._beacon_waits = True
            return
        if self.parent is None and not self.root:
            return
        address = self._node.address
        parent = address if self.parent is None else self.parent
        body = BeaconMsg(parent, self.cost, self.hops).pack()
        sink = address if self._sink is None else self._sink
        header = MultihopMsg(address, sink, signed(self._next_seqno()), signed(self._round),
                             self.hops, body)
        if self._beacons.send(BROADCAST, BeaconMsg.AM_TYPE, header.pack(), False):
            self._advertised_cost = self.cost
            if self._candidates.advertised is None or self.cost < self._candidates.advertised:
                self._candidates.advertised = self.cost
            self.counters['beacons'] += 1
            self._node.note('beacon_sent', parent, self.hops, self.cost)

    def _beacon_sent(self, acknowledged: bool) -> None:
        if self._beacon_waits:
            self._beacon_waits = False
            self._send_beacon()

    def _receive_beacon(self, header: MultihopMsg, frame: Received) -> None:
        self.counters['beacons_heard'] += 1
        if self.root or header.source == self._node.address:
            return
        beacon = BeaconMsg.unpack(header.data)
        number = header.origin_seqno & _U16
        if not self._is_of_the_last_round(header.origin, number):
            self.counters['old_beacons'] += 1
            return
        link = self._costs[frame.lqi & 0xFF]
        if frame.rssi_dbm < WEAKEST_DBM:
            link = max(link, self._costs[50])
        self._candidates.update(Candidate(
            header.source, number, beacon.cost, beacon.hopcount, link, frame.rssi_dbm,
            returns=beacon.parent == self._node.address))
        if self._advertised_cost is not None:
            self._correct()
        elif not self._relay_planned:
            self._plan_relay()

    def _is_of_the_last_round(self, sink: int, number: int) -> bool:
        """Return whether a beacon is of the current round; one of a newer round starts that."""
        now_ns = self._node.now_ns()
        if sink == self._sink and number == self._round:
            return True
        newer = sink == self._sink and (number - self._round) & _U16 <= 0x7FFF
        silent_ns = now_ns - self._round_ns
        longest_ns = self._period_ns if self._timing is None else self._timing.longest_ns
        if not newer and self._sink is not None and silent_ns < RESTART_PERIODS * longest_ns:
            return False
        self._sink = sink
        self._round = number
        self._round_ns = now_ns
        self._candidates.start_round(number)
        self._advertised_cost = None
        self._corrections = 0
        self.counters['rounds'] += 1
        self._plan_relay()
        return True

    def _correct(self) -> None:
        """Use a cheaper route than the one advertised in this round, and advertise it."""
        best = self._candidates.best()
        if best is None or best.round_number != self._round or best.total >= self.cost:
            return
        self._choose()
        advertised = self._advertised_cost
        if advertised is not None and self.cost < advertised - (advertised >> 2) and (
                self._corrections < CORRECTIONS):
            self._corrections += 1
            self._advertised_cost = None
            self._plan_relay()

    # The route to the sink.

    def _choose(self) -> None:
        """Select the best neighbour as the parent."""
        best = self._candidates.best()
        before = self.parent
        if best is None:
            self.parent, self.cost, self.hops = None, NO_ROUTE_COST, NO_ROUTE_HOPS
        else:
            self.parent = best.address
            self.cost = min(best.total, NO_ROUTE_COST - 1)
            self.hops = min(best.hops + 1, NO_ROUTE_HOPS)
        if self.parent != before:
            self._failures = 0
            if best is None:
                self._node.note('no_parent')
            else:
                self.counters['parent_changes'] += 1
                self._node.note('parent', best.address, self.hops, self.cost)
        if best is not None and len(self._queue):
            self._queue.send_next()

    def _next_hop(self) -> int | None:
        if self.parent is None:
            # No neighbour acknowledged, and there was a pause since: perhaps it was noise.
            self._candidates.retry_failed()
            self._choose()
        return self.parent

    def _tried(self, to: int, acknowledged: bool) -> None:
        if acknowledged:
            self._failures = 0
            return
        if to != self.parent:
            return
        self._failures += 1
        if self._failures >= FAILURES:
            self._fail_parent(to, 'silent_parents')

    def _fail_parent(self, parent: int, why: str) -> None:
        candidate = self._candidates.get(parent)
        if candidate is not None:
            candidate.failed = True
        self.counters[why] += 1
        self._choose()

    # Data.

    def originate(self, application: bytes) -> bool:
        """Send a packet of the application; False when the queue is full."""
        self.counters['originated'] += 1
        origin_seqno = self._origin_seqno
        self._origin_seqno = (origin_seqno + 1) & _U16
        message = MultihopMsg(self._node.address, self._node.address, 0, signed(origin_seqno),
                              self.hops, application)
        if self.root:
            self._deliver(message)
            return True
        return self._push(message)

    def receive(self, frame: Received) -> None:
        """Process a beacon or a data packet."""
        try:
            message = MultihopMsg.unpack(frame.payload)
            if frame.am_type == BeaconMsg.AM_TYPE:
                self._receive_beacon(message, frame)
            elif frame.am_type == self._data_am_type:
                if frame.destination == self._node.address:
                    self._receive_data(message)
        except ValueError:
            self.counters['malformed'] += 1

    def _receive_data(self, message: MultihopMsg) -> None:
        if self.root:
            self._deliver(message)
            return
        now_ns = self._node.now_ns()
        last_hop = (message.source, message.seqno, message.origin, message.origin_seqno)
        if self._duplicates.contains(last_hop, now_ns):
            self.counters['duplicates'] += 1
            return
        visits = self._visits(message, now_ns)
        if visits >= _MOST_VISITS:
            self.counters['given_up'] += 1
            return
        parent = self.parent
        if parent is not None and (
                message.source == parent or visits and self._candidates.may_loop(parent)):
            self._loop(parent)
        if self._push(message):
            self._duplicates.add(last_hop, now_ns)
            self.counters['forwarded'] += 1

    def _loop(self, neighbour: int) -> None:
        """Replace a parent over which packets return: each node treats the other as nearer."""
        candidate = self._candidates.get(neighbour)
        if candidate is not None:
            candidate.returns = True
        self.counters['loops'] += 1
        self._choose()

    def _visits(self, message: MultihopMsg, now_ns: int) -> int:
        """Return how often a packet was received before, and count this time."""
        for visit in range(_MOST_VISITS):
            packet = (visit, message.origin, message.origin_seqno)
            if not self._duplicates.contains(packet, now_ns):
                self._duplicates.add(packet, now_ns)
                return visit
        return _MOST_VISITS

    def _push(self, message: MultihopMsg) -> bool:
        sent = MultihopMsg(self._node.address, message.origin, signed(self._next_seqno()),
                           *message[3:])
        return self._queue.push(self._data_am_type, sent.pack())

    def _deliver(self, message: MultihopMsg) -> None:
        """Deliver a packet to the serial line, once."""
        now_ns = self._node.now_ns()
        packet = (message.origin, message.origin_seqno, message.data)
        if self._duplicates.contains(packet, now_ns):
            self.counters['duplicates'] += 1
            return
        self._duplicates.add(packet, now_ns)
        self.counters['delivered'] += 1
        message = message._replace(source=self._node.address)
        self._node.deliver(self._data_am_type, message.pack(), message.origin, message.data)

    def _next_seqno(self) -> int:
        seqno = self._seqno
        self._seqno = (seqno + 1) & _U16
        return seqno
