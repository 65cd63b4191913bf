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


"""The Collection Tree Protocol (TEP 123) of TinyOS 2 on one node."""

from __future__ import annotations

from typing import Final

from rt_robot_os.features.wsn.packets.ctp import beacon_head
from rt_robot_os.features.wsn.packets.ctp import CtpBeacon
from rt_robot_os.features.wsn.packets.ctp import CtpData
from rt_robot_os.features.wsn.packets.ctp import NO_PARENT
from rt_robot_os.features.wsn.packets.ctp import PULL
from rt_robot_os.features.wsn.routing.ctp_forwarding import ForwardingEngine
from rt_robot_os.features.wsn.routing.ctp_routing import RoutingEngine
from rt_robot_os.features.wsn.routing.ctp_rules import CtpRules
from rt_robot_os.features.wsn.routing.link_estimator import BEST_ETX
from rt_robot_os.features.wsn.routing.protocol import BROADCAST
from rt_robot_os.features.wsn.routing.protocol import Node
from rt_robot_os.features.wsn.routing.protocol import Received
from rt_robot_os.features.wsn.routing.protocol import Router
from rt_robot_os.features.wsn.routing.tinyos_random import TinyOsRandom

#: Collection of TinyOS' MultihopOscilloscope.
OSCILLOSCOPE: Final = 0x93
_NO_COST: Final = 0xFFFF
_NO_HOPS: Final = 0xFF
_COUNTERS: Final = ('queue_full', 'own_busy', 'resends', 'given_up', 'loops', 'duplicates',
                    'no_route', 'parent_congested', 'delivered', 'bad_frames')


class Ctp(Router):
    """
    Routing by expected transmissions, over a tree that beacons with Trickle timing maintain.

    CTP has no hop count: ``hops`` is the number of perfect links with the same cost.

    :param node: that it runs on.
    :param root: the node is the sink.
    :param rules: of the implementation.
    :param collect_id: application of the node's packets.
    """

    def __init__(self, node: Node, root: bool = False, rules: CtpRules = CtpRules(),
                 collect_id: int = OSCILLOSCOPE) -> None:
        self.root = root
        self.counters = dict.fromkeys(_COUNTERS, 0)
        self._congestion = rules.congestion
        self._address = node.address
        self._routing = RoutingEngine(node, root, rules, self._route_found, self._updated,
                                      self._is_congested)
        self._forwarding = ForwardingEngine(node, self._routing, rules, collect_id, self.counters)
        self._updated()

    @property
    def beacons(self) -> int:
        """Return the number of sent beacons."""
        return self._routing.beacons

    @property
    def parent_changes(self) -> int:
        """Return the number of changes of the parent."""
        return self._routing.changes

    def start(self) -> None:
        """Start without a route."""
        # One generator for the whole node, as in TinyOS; its seed is the node's address.
        random = TinyOsRandom(self._address)
        self._forwarding.clear(random)
        self._routing.start(random)
        self._updated()

    def stop(self) -> None:
        """Stop; queued packets are lost."""
        self._routing.stop()
        self._forwarding.clear(TinyOsRandom(self._address))

    def receive(self, frame: Received) -> None:
        """Process a frame for this node or a broadcast; frames that are not of CTP are counted."""
        am_type = frame.am_type
        try:
            if am_type == CtpBeacon.AM_TYPE:
                head = beacon_head(frame.payload)
                if frame.destination != BROADCAST or not self._is_neighbour(frame.source):
                    raise ValueError('not a broadcast of a neighbour')
                self._routing.receive_beacon(frame.source, head, frame.lqi)
            elif am_type == CtpData.AM_TYPE:
                data = CtpData.unpack(frame.payload)
                self._forwarding.receive(data._replace(hops=data.hops + 1 & 0xFF))
        except ValueError:
            self.counters['bad_frames'] += 1

    def snoops(self, am_type: int, payload: bytes) -> bool:
        """Return whether such a frame for another node has the pull or the congestion bit."""
        return am_type == CtpData.AM_TYPE and bool(payload) and bool(
            self._congestion or payload[0] & PULL)

    def snoop(self, frame: Received) -> None:
        """Process a frame for another node: it may have the pull or the congestion bit."""
        if not self.snoops(frame.am_type, frame.payload):
            return
        try:
            self._forwarding.snoop(frame.source, CtpData.unpack(frame.payload))
        except ValueError:
            self.counters['bad_frames'] += 1

    def originate(self, application: bytes) -> bool:
        """Send a packet of the application; False while the previous one is queued."""
        return self._forwarding.originate(application)

    def _is_neighbour(self, source: int) -> bool:
        return 0 <= source < BROADCAST and source != self._address

    def _route_found(self) -> None:
        self._forwarding.send()

    def _is_congested(self) -> bool:
        return self._forwarding.is_congested()

    def _updated(self) -> None:
        if self.root:
            self.parent, self.cost, self.hops = None, 0, 0
            return
        parent = self._routing.parent
        if parent == NO_PARENT:
            self.parent, self.cost, self.hops = None, _NO_COST, _NO_HOPS
            return
        self.parent = parent
        self.cost = self._routing.etx()
        self.hops = max(1, (self.cost + BEST_ETX // 2) // BEST_ETX)
