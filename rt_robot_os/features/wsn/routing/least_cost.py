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
The routing of a sensor network whose sink is on a robot, and moves.

Only the sink makes beacons, each with the number of its round. A node that hears one adds the
cost of the link, takes the cheapest way of the round and sends the beacon on with its own cost,
after a random delay. An older round never wins, however cheap it was: the sink has moved since.

What the paper leaves open is how nodes live between two rounds. Here a node keeps the neighbours
that the round showed it. When the parent acknowledges no longer, the next best takes its place
among those that cannot have this node on their way; when nobody is left, packets wait for the next
round. A neighbour that names this node as its parent, or that sends it data while it is
this node's parent, is not sent to: a packet would come back.
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
#: A beacon is sent on after a delay between these, so that neighbours do not all answer at once.
RELAY_DELAY_NS: Final = (5_000_000, 50_000_000)
#: A link that is weaker counts as one of LQI 50: it is at the end of what the radio hears, and
#: the LQI of a single frame says little there.
WEAKEST_DBM: Final = -92
#: The parent is left after so many packets in a row without an acknowledgement.
FAILURES: Final = 4
#: A node corrects what it told in a round when it has become a quarter cheaper, so often.
CORRECTIONS: Final = 2
QUEUE: Final = 24
LIFETIME_NS: Final = 10_000_000_000
#: Without a newer round for so many periods, the sink has booted anew and counts from 0.
RESTART_PERIODS: Final = 3
_REMEMBERED_BY_NODES: Final = 128
_REMEMBERED_BY_SINK: Final = 4096
#: A packet that comes again so often is dropped.
_MOST_VISITS: Final = 5
_SINK_START_NS: Final = 500_000_000
_U16: Final = 0xFFFF


class LeastCost(Router):
    """
    Routing by least cost to a sink that moves.

    :param node: that it runs on.
    :param root: it is the sink.
    :param beacon_period_ns: between two rounds, unless ``timing`` and ``speed`` are given.
    :param timing: let the period follow the sink's speed.
    :param speed: the sink's in m/s.
    :param data_am_type: of the application's packets.
    """

    def __init__(self, node: Node, root: bool = False,
                 beacon_period_ns: int = BEACON_PERIOD_NS, *, timing: BeaconTiming | None = None,
                 speed: Callable[[], float] | None = None,
                 data_am_type: int = DataMsg.AM_TYPE) -> None:
        if beacon_period_ns < 1:
            raise ValueError(f'beacon_period_ns {beacon_period_ns}: 1 or more')
        self.root = root
        self.counters = Counter()
        self._node = node
        self._period_ns = beacon_period_ns
        self._timing = timing
        self._speed = speed
        self._data_am_type = data_am_type
        self._costs = link_costs(u16_wrap=False)
        self._beacon_timer = node.timer(self._beacon_due)
        self._beacons = node.sender(self._beacon_is_through)
        self._queue = DataQueue(node, self._next_hop, self._tried, QUEUE, LIFETIME_NS,
                                self.counters)
        self._forget()

    def _forget(self) -> None:
        self._candidates = Candidates()
        self._sink: int | None = self._node.address if self.root else None
        self._round = 0
        self._round_ns = 0
        self._told: int | None = None
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
        """Begin, with nothing known; the sink begins its first round soon."""
        self._forget()
        if self.root:
            self._beacon_timer.start(self._node.random.randrange(_SINK_START_NS))

    def stop(self) -> None:
        """End: no timer runs, and nothing waits."""
        self._beacon_timer.stop()
        self._forget()

    # Beacons.

    def _beacon_due(self) -> None:
        """Begin a round, or send on the beacon of one."""
        if not self.root:
            self._relay_planned = False
            self._choose()
        elif not self._begins_round():
            return
        self._send_beacon()

    def _begins_round(self) -> bool:
        """Begin a round if it is time, and wait for the next one."""
        timing, speed = self._timing, self._speed
        now_ns = self._node.now_ns()
        pause_ns = self._period_ns
        if timing is not None and speed is not None:
            # Looked at often, as the sink may drive off at any time.
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
            self._told = self.cost
            if self._candidates.advertised is None or self.cost < self._candidates.advertised:
                self._candidates.advertised = self.cost
            self.counters['beacons'] += 1
            self._node.note('beacon_sent', parent, self.hops, self.cost)

    def _beacon_is_through(self, acknowledged: bool) -> None:
        if self._beacon_waits:
            self._beacon_waits = False
            self._send_beacon()

    def _heard_beacon(self, header: MultihopMsg, frame: Received) -> None:
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
        self._candidates.heard(Candidate(
            header.source, number, beacon.cost, beacon.hopcount, link, frame.rssi_dbm,
            returns=beacon.parent == self._node.address))
        if self._told is not None:
            self._correct()
        elif not self._relay_planned:
            self._plan_relay()

    def _is_of_the_last_round(self, sink: int, number: int) -> bool:
        """Tell whether a beacon counts; one of a newer round begins that."""
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
        self._candidates.begin(number)
        self._told = None
        self._corrections = 0
        self.counters['rounds'] += 1
        self._plan_relay()
        return True

    def _correct(self) -> None:
        """Take a way that is cheaper than the one told of in this round, and tell of it."""
        best = self._candidates.best()
        if best is None or best.round_number != self._round or best.total >= self.cost:
            return
        self._choose()
        told = self._told
        if told is not None and self.cost < told - (told >> 2) and (
                self._corrections < CORRECTIONS):
            self._corrections += 1
            self._told = None
            self._plan_relay()

    # The way to the sink.

    def _choose(self) -> None:
        """Take the best neighbour for the parent."""
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
            self._queue.go_on()

    def _next_hop(self) -> int | None:
        if self.parent is None:
            # Nobody acknowledged, and there was a pause since: perhaps it was noise.
            self._candidates.forgive()
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
            self._leave(to, 'silent_parents')

    def _leave(self, parent: int, why: str) -> None:
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
        """Take a beacon or a data packet."""
        try:
            message = MultihopMsg.unpack(frame.payload)
            if frame.am_type == BeaconMsg.AM_TYPE:
                self._heard_beacon(message, frame)
            elif frame.am_type == self._data_am_type:
                if frame.destination == self._node.address:
                    self._heard_data(message)
        except ValueError:
            self.counters['malformed'] += 1

    def _heard_data(self, message: MultihopMsg) -> None:
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
                message.source == parent or visits and self._candidates.is_dear(parent)):
            self._loop(parent)
        if self._push(message):
            self._duplicates.add(last_hop, now_ns)
            self.counters['forwarded'] += 1

    def _loop(self, neighbour: int) -> None:
        """Leave a parent over which packets come back: each takes the other for nearer."""
        candidate = self._candidates.get(neighbour)
        if candidate is not None:
            candidate.returns = True
        self.counters['loops'] += 1
        self._choose()

    def _visits(self, message: MultihopMsg, now_ns: int) -> int:
        """Return how often a packet was here before, and count this time."""
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
        """Hand a packet to the serial line, once."""
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
