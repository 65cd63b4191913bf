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
The forwarding engine of the Collection Tree Protocol: sends data packets to the parent.

One queue, one packet at a time, up to 30 transmissions of each. A packet from a node that is not
farther from the sink than this one shows a loop: the route is advertised again, and the packet is
delayed. The delays between transmissions avoid collisions with the own packet at the next hop;
they also limit a node to about 40 forwarded packets a second. With a higher load the queues fill,
the 30 transmissions of each packet fill the air, and the tree collapses.
"""

from __future__ import annotations

from collections import deque
from typing import Final

from rt_robot_os.features.wsn.packets.ctp import CONGESTED
from rt_robot_os.features.wsn.packets.ctp import CtpData
from rt_robot_os.features.wsn.packets.ctp import NO_PARENT
from rt_robot_os.features.wsn.packets.ctp import PULL
from rt_robot_os.features.wsn.routing.ctp_routing import RoutingEngine
from rt_robot_os.features.wsn.routing.ctp_rules import CtpRules
from rt_robot_os.features.wsn.routing.protocol import BINARY_MS_NS
from rt_robot_os.features.wsn.routing.protocol import Node
from rt_robot_os.features.wsn.routing.tinyos_random import TinyOsRandom

#: Delay of a node without a route before it tries again, in 1/1024 s.
NO_ROUTE_MS: Final = 10_000

_OPTIONS: Final = ~(PULL | CONGESTED) & 0xFF


class _Queued:
    """A packet in the queue, or on the air."""

    __slots__ = ('data', 'own', 'tries')

    def __init__(self, data: CtpData, tries: int, own: bool) -> None:
        self.data = data
        self.tries = tries
        self.own = own


def _instance(data: CtpData) -> tuple[int, int, int, int]:
    """Return the identity of a packet; in a loop it differs in each round, by the hops."""
    return data.origin, data.origin_sequence, data.hops, data.collect_id


class ForwardingEngine:
    """
    The forwarding queue of one node.

    :param collect_id: of the node's own packets.
    :param counters: that it updates.
    """

    __slots__ = ('_cache', '_collect_id', '_counters', '_destination', '_forwarded', '_node',
                 '_own_waits', '_queue', '_random', '_routing', '_rules', '_sender', '_sending',
                 '_sequence', '_timer', '_waiting', '_waits_for_parent')

    def __init__(self, node: Node, routing: RoutingEngine, rules: CtpRules, collect_id: int,
                 counters: dict[str, int]) -> None:
        self._node = node
        self._routing = routing
        self._rules = rules
        self._collect_id = collect_id
        self._counters = counters
        self._queue: deque[_Queued] = deque()
        self._cache: list[tuple[int, int, int, int]] = []
        self._timer = node.timer(self._timer_fired)
        self._sender = node.sender(self._send_done)
        self.clear(TinyOsRandom(node.address))

    def clear(self, random: TinyOsRandom) -> None:
        """Remove all packets, and restart the sequence numbers and the random numbers."""
        self._random = random
        self._timer.stop()
        self._queue.clear()
        self._cache.clear()
        self._forwarded = 0
        self._own_waits = False
        self._sequence = 0
        # Not the same as a busy radio: the delay after a failure belongs to it, and a delay that
        # expires during a transmission clears it too early, as on the motes.
        self._sending = False
        self._destination = NO_PARENT
        self._waiting = False
        self._waits_for_parent = False

    def is_congested(self) -> bool:
        """Return whether more than half of the queue is in use."""
        return (self._rules.congestion and
                len(self._queue) > (self._rules.forward_queue + 1) // 2)

    def originate(self, application: bytes) -> bool:
        """Send a packet of this node; False while the previous one is queued."""
        if self._own_waits:
            self._counters['own_busy'] += 1
            return False
        data = CtpData(0, 0, 0, self._node.address, self._sequence, self._collect_id, application)
        self._sequence = self._sequence + 1 & 0xFF
        self._own_waits = True
        self._queue.append(_Queued(data, self._rules.transmissions, True))
        if not self._sending:
            self.send()
        return True

    def receive(self, data: CtpData) -> None:
        """Forward a packet of another node, or deliver it at the sink."""
        instance = _instance(data)
        if instance in self._cache or instance in [_instance(one.data) for one in self._queue]:
            self._counters['duplicates'] += 1
        elif self._routing.root:
            if self._rules.root_drops_duplicates:
                self._insert_in_cache(instance)
            self._deliver(data)
        elif self._forwarded >= self._rules.forward_queue:
            self._counters['queue_full'] += 1
        else:
            self._forward(data)

    def snoop(self, source: int, data: CtpData) -> None:
        """Process a packet for another node."""
        if data.options & PULL:
            self._routing.trigger_immediate_update()
        if self._rules.congestion:
            congested = bool(data.options & CONGESTED)
            self._routing.neighbour_congested(source, congested)
            if self._waits_for_parent and source == self._routing.parent and not congested:
                self._waits_for_parent = False
                self._timer.stop()
                self._timer_fired()

    def send(self) -> None:
        """Transmit the first packet of the queue, if there is one and a route."""
        if self._sending:
            return
        while self._queue:
            first = self._queue[0]
            if not first.own and _instance(first.data) in self._cache:
                self._counters['duplicates'] += 1
                self._dequeue()
            elif self._routing.root:
                self._deliver(first.data)
                self._dequeue()
                self._start_timer(self._rules.packet_ms)
                return
            else:
                self._transmit(first)
                return

    def _transmit(self, first: _Queued) -> None:
        parent = self._routing.parent
        if parent == NO_PARENT:
            self._counters['no_route'] += 1
            self._start_timer_ms(NO_ROUTE_MS)
            return
        if self._rules.congestion and self._routing.parent_congested():
            self._counters['parent_congested'] += 1
            self._waits_for_parent = True
            self._start_timer(4 * self._rules.packet_ms)
            return
        options = first.data.options & _OPTIONS
        if self.is_congested():
            options |= CONGESTED
        first.data = first.data._replace(options=options, etx=self._routing.etx())
        self._destination = parent
        payload = first.data.pack()
        if self._sender.busy:
            # A delay expired during the transmission. TinyOS prepares the same message again
            # before its queue refuses it (AMQueueEntryP, AMQueueImplP); the result counts for
            # the new parent.
            self._sender.rewrite(parent, payload)
        elif self._sender.send(parent, CtpData.AM_TYPE, payload, True):
            self._sending = True
            if first.tries < self._rules.transmissions:
                self._counters['resends'] += 1

    def _send_done(self, acknowledged: bool) -> None:
        if not self._queue:
            return
        routing = self._routing
        routing.links.sent(self._destination, acknowledged)
        first = self._queue[0]
        if acknowledged:
            if not first.own:
                self._insert_in_cache(_instance(first.data))
            self._dequeue()
            self._sending = False
            self._start_timer(self._rules.packet_ms)
            return
        first.tries -= 1
        if first.tries == 0:
            self._counters['given_up'] += 1
            self._node.note('given_up', first.data.origin, first.data.origin_sequence)
            self._dequeue()
            self._sending = False
        self._start_timer(self._rules.packet_ms)
        routing.update()

    def _forward(self, data: CtpData) -> None:
        self._queue.append(_Queued(data, self._rules.transmissions, False))
        self._forwarded += 1
        routing = self._routing
        if routing.parent != NO_PARENT and data.etx <= routing.etx():
            self._counters['loops'] += 1
            self._node.note('loop', data.origin, data.origin_sequence)
            routing.trigger_immediate_update()
            self._start_timer(4 * self._rules.packet_ms)
        if not self._waiting:
            self.send()

    def _dequeue(self) -> None:
        gone = self._queue.popleft()
        if gone.own:
            self._own_waits = False
        else:
            self._forwarded -= 1

    def _deliver(self, data: CtpData) -> None:
        self._counters['delivered'] += 1
        self._node.deliver(CtpData.AM_TYPE, data.pack(), data.origin, data.application)

    def _insert_in_cache(self, instance: tuple[int, int, int, int]) -> None:
        """Append it; an existing entry moves to the end only when the cache is full."""
        cache = self._cache
        if len(cache) >= self._rules.sent_cache:
            del cache[cache.index(instance) if instance in cache else 0]
        cache.append(instance)

    def _start_timer(self, least_ms: int) -> None:
        self._start_timer_ms(least_ms + (self._random.number() & 0xFFFF) % least_ms)

    def _start_timer_ms(self, delay_ms: int) -> None:
        self._waiting = True
        self._timer.start(int(delay_ms * BINARY_MS_NS))

    def _timer_fired(self) -> None:
        self._waiting = False
        self._waits_for_parent = False
        self._sending = False
        self.send()
