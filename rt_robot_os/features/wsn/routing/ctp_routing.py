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
The routing engine of the Collection Tree Protocol: selects the parent.

A node adds the cost of the link to the cost that each neighbour advertises. It changes its parent
only for a much better one, so that the tree is stable. All sums have 16 bits, as on the motes. An
unknown link costs 65535, and sums with it overflow: a node that restarts the estimate of its
parent's link believes to be nearer to the sink than its parent, until it has received three more
beacons. Real trees have loops from that, and so have these.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from rt_robot_os.features.wsn.packets.ctp import BEACON_SIZE
from rt_robot_os.features.wsn.packets.ctp import BeaconHead
from rt_robot_os.features.wsn.packets.ctp import CONGESTED
from rt_robot_os.features.wsn.packets.ctp import CtpBeacon
from rt_robot_os.features.wsn.packets.ctp import NEIGHBOUR_SIZE
from rt_robot_os.features.wsn.packets.ctp import NO_PARENT
from rt_robot_os.features.wsn.packets.ctp import PULL
from rt_robot_os.features.wsn.routing.ctp_rules import CtpRules
from rt_robot_os.features.wsn.routing.link_estimator import LinkEstimator
from rt_robot_os.features.wsn.routing.protocol import BINARY_MS_NS
from rt_robot_os.features.wsn.routing.protocol import BROADCAST
from rt_robot_os.features.wsn.routing.protocol import Node
from rt_robot_os.features.wsn.routing.tinyos_random import TinyOsRandom
from rt_robot_os.features.wsn.routing.trickle import Trickle

#: Cost in tenths from which a link is not used.
WORST_LINK_ETX: Final = 50
#: Least improvement for a change of the parent.
SWITCH_ETX: Final = 15
#: An improvement by more than this is advertised immediately.
IMMEDIATE_UPDATE_ETX: Final = 20
#: Period of the route update, in 1/1024 s.
UPDATE_MS: Final = 8192

_TABLE_SIZE: Final = 10
_NO_ETX: Final = 0xFFFF


class _TableEntry:
    """A neighbour in the routing table."""

    __slots__ = ('address', 'congested', 'etx', 'parent')

    def __init__(self, address: int, parent: int, etx: int) -> None:
        self.address = address
        self.parent = parent
        self.etx = etx
        self.congested = False


class RoutingEngine:
    """
    Selects the parent, sends beacons and processes those of neighbours.

    :param root: the node is the sink.
    :param route_found: called when there is a route, and was none.
    :param updated: called when the parent or the cost may have changed.
    :param is_congested: returns whether the node's own queue is congested.
    :ivar parent: the next node; the node itself at a root; ``NO_PARENT``.
    :ivar links: the link estimator.
    :ivar changes: number of changes of the parent.
    :ivar beacons: number of sent beacons.
    """

    __slots__ = ('_beacon_sender', '_congested', '_etx', '_is_congested', '_lost', '_node',
                 '_route_found', '_rules', '_sequence', '_table', '_timer', '_trickle', '_updated',
                 'beacons', 'changes', 'links', 'parent', 'root')

    def __init__(self, node: Node, root: bool, rules: CtpRules, route_found: Callable[[], None],
                 updated: Callable[[], None], is_congested: Callable[[], bool]) -> None:
        self.root = root
        self.links = LinkEstimator(TinyOsRandom(node.address), self._evicted)
        self.changes = 0
        self.beacons = 0
        self._node = node
        self._rules = rules
        self._route_found = route_found
        self._updated = updated
        self._is_congested = is_congested
        self._reset()
        self._trickle = Trickle(node, self._beacon_due, maximum_ms=rules.longest_interval_ms)
        self._timer = node.timer(self.update)
        self._beacon_sender = node.sender(self._beacon_sent)

    def _reset(self) -> None:
        self.parent = self._node.address if self.root else NO_PARENT
        self._etx = 0
        self._congested = False
        self._table: dict[int, _TableEntry] = {}
        self._lost = False
        self._sequence = 0

    def start(self, random: TinyOsRandom) -> None:
        """Start without a route: send beacons, and select a parent."""
        self._reset()
        self.links.clear(random)
        self._trickle.start(random)
        self._timer.every(int(UPDATE_MS * BINARY_MS_NS))

    def stop(self) -> None:
        """Stop the timers."""
        self._trickle.stop()
        self._timer.stop()

    def etx(self) -> int:
        """Return the cost to the sink in tenths, as advertised; also without a route."""
        if self.root or self.parent == NO_PARENT:
            return self._etx
        return self._etx + self.links.etx(self.parent) & 0xFFFF

    def trigger_immediate_update(self) -> None:
        """Advertise the route soon: reset the Trickle timer."""
        self._trickle.reset()

    def receive_beacon(self, source: int, beacon: BeaconHead, lqi: int) -> None:
        """Process a beacon."""
        sequence, options, parent, etx = beacon
        self.links.receive_beacon(source, sequence, lambda: self._compare_bit(beacon, lqi))
        if parent != NO_PARENT:
            if etx == 0:
                self.links.insert(source)
                self.links.pin(source)
            self._update_table(source, parent, etx)
            self.neighbour_congested(source, bool(options & CONGESTED))
        if options & PULL:
            self._trickle.reset()
        if self._lost:
            self.update()

    def neighbour_congested(self, address: int, congested: bool) -> None:
        """Update whether a neighbour is congested."""
        if not self._rules.congestion:
            return
        neighbour = self._table.get(address)
        if neighbour is None:
            return
        neighbour.congested = congested
        if (self._congested and not congested) or (self.parent == address and congested):
            self.update()

    def parent_congested(self) -> bool:
        """Return whether the parent is congested."""
        neighbour = self._table.get(self.parent)
        return neighbour is not None and neighbour.congested

    def update(self) -> None:
        """Select the parent again."""
        if self.root:
            return
        best, least, current = self._compare()
        if best is not None and (current == _NO_ETX or least + SWITCH_ETX < current or
                                 self._congested and least < self._etx + 10):
            self._switch(best, least, current)
        found = not self._lost and current == _NO_ETX and best is not None
        self._lost = False
        self._updated()
        if found:
            self._route_found()

    def _compare(self) -> tuple[_TableEntry | None, int, int]:
        """Return the best neighbour but the parent, its cost, and the cost over the parent."""
        me = self._node.address
        current = least = _NO_ETX
        best = None
        etx_of = self.links.etx
        for neighbour in self._table.values():
            # Without a route, or with a route over this node, it is not a candidate.
            if neighbour.parent == NO_PARENT or neighbour.parent == me:
                continue
            link = etx_of(neighbour.address)
            etx = link + neighbour.etx & 0xFFFF
            if neighbour.address == self.parent:
                current = etx
                self._etx = neighbour.etx
                self._congested = neighbour.congested
            elif link < WORST_LINK_ETX and not neighbour.congested and etx < least:
                least = etx
                best = neighbour
        return best, least, current

    def _switch(self, best: _TableEntry, least: int, current: int) -> None:
        self.changes += 1
        self.links.unpin(self.parent)
        self.links.pin(best.address)
        self.links.clear_data_window(best.address)
        self.parent = best.address
        self._etx = best.etx
        self._congested = best.congested
        self._node.note('parent', best.address, least)
        if current - least > IMMEDIATE_UPDATE_ETX:
            self._trickle.reset()

    def _update_table(self, source: int, parent: int, etx: int) -> None:
        neighbour = self._table.get(source)
        if neighbour is not None:
            neighbour.parent = parent
            neighbour.etx = etx
        elif len(self._table) < _TABLE_SIZE and self.links.etx(source) < WORST_LINK_ETX:
            self._table[source] = _TableEntry(source, parent, etx)

    def _compare_bit(self, beacon: BeaconHead, lqi: int) -> bool:
        """Return whether a new neighbour should replace another in the estimator's table."""
        white = self._rules.white_lqi
        if white is None or lqi <= white or beacon.parent == NO_PARENT:
            return False
        if beacon.etx == 0:
            return True
        return any([beacon.etx < neighbour.etx for neighbour in self._table.values()
                    if neighbour.address != self.parent])

    def _evicted(self, address: int) -> None:
        self._table.pop(address, None)
        if address == self.parent:
            self.parent = NO_PARENT
            self._etx = 0
            self._congested = False
            self._lost = True
            self._node.note('no_route')

    def _beacon_due(self) -> None:
        self.update()
        if self._beacon_sender.busy:
            return
        options = CONGESTED if self._is_congested() else 0
        if self.parent == NO_PARENT:
            options |= PULL
        room = (self._rules.payload_size - BEACON_SIZE) // NEIGHBOUR_SIZE
        beacon = CtpBeacon(self._sequence, options, self.parent, self.etx(),
                           self.links.footer(min(room, 15)))
        self._sequence = self._sequence + 1 & 0xFF
        self.beacons += 1
        self._beacon_sender.send(BROADCAST, CtpBeacon.AM_TYPE, beacon.pack(), False)

    def _beacon_sent(self, acknowledged: bool) -> None:
        del acknowledged
