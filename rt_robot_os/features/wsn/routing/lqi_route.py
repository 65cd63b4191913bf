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
The route of a MultiHopLQI node to the root, and its decisions.

There is no neighbour table: a node stores its parent, the parent's cost and the cost of the link,
and compares advertised costs with them.
"""

from __future__ import annotations

from collections import deque
from enum import Enum
from typing import Final

from rt_robot_os.features.wsn.packets.multihop_lqi import NO_PARENT
from rt_robot_os.features.wsn.packets.multihop_lqi import NO_ROUTE_HOPS
from rt_robot_os.features.wsn.routing.link_cost import link_costs

#: Cost of the parent and of the link, each, without a route.
UNKNOWN_COST: Final = 0x7FFF
#: Beacon periods without a beacon of the parent after which the route is lost.
SILENT_PERIODS: Final = 8
#: Size of the two duplicate caches, by sender and by origin.
REMEMBERED: Final = 4
_U8: Final = 0xFF
_U16: Final = 0xFFFF


class Decision(Enum):
    """Decision of a node on a beacon."""

    RENEW = 'the parent advertised its cost'
    LOSE = 'the parent routes over this node: a loop'
    CHANGE = 'the sender becomes the parent'
    KEEP = 'the sender is not a quarter cheaper, or routes over this node'


class LqiRoute:
    """
    The route to the root.

    :ivar parent: ``NO_PARENT`` without a route.
    :ivar parent_cost: as the parent advertised it.
    :ivar link: cost of the hop to the parent.
    :ivar hops: to the root, 8 bits.

    :param address: of the node.
    :param u16_wrap: see :func:`.link_cost.link_cost`.
    """

    __slots__ = ('parent', 'parent_cost', 'link', 'hops', '_silent', '_address', '_costs')

    def __init__(self, address: int, u16_wrap: bool = True) -> None:
        self._address = address
        self._costs = link_costs(u16_wrap)
        self._silent = 0
        self.lose()

    @property
    def cost(self) -> int:
        """Return the advertised cost; 65534 without a route."""
        return (self.parent_cost + self.link) & _U16

    def lose(self) -> None:
        """Remove the route."""
        self.parent = NO_PARENT
        self.parent_cost = UNKNOWN_COST
        self.link = UNKNOWN_COST
        self.hops = NO_ROUTE_HOPS

    def update(self, source: int, parent: int, cost: int, hops: int, lqi: int) -> Decision:
        """
        Process a beacon.

        :param source: its sender.
        :param parent: the sender's.
        :param cost: the sender's.
        :param hops: the sender's.
        :param lqi: of the beacon; data use the link in the other direction.
        """
        if source == self.parent:
            self._silent = 0
            if parent == self._address:
                self.lose()
                return Decision.LOSE
            self._set_parent(source, cost, hops, lqi)
            return Decision.RENEW
        own = self.parent_cost + self.link
        if cost + self._costs[lqi] < own - (own >> 2) and parent != self._address:
            self._silent = 0
            self._set_parent(source, cost, hops, lqi)
            return Decision.CHANGE
        return Decision.KEEP

    def _set_parent(self, source: int, cost: int, hops: int, lqi: int) -> None:
        self.parent = source
        self.parent_cost = cost
        self.link = self._costs[lqi]
        self.hops = (hops + 1) & _U8

    def period_passed(self) -> bool:
        """
        Count a beacon period of the node's own.

        :return: whether the route is lost, because the parent was silent for too long.
        """
        self._silent = (self._silent + 1) & _U8
        if self._silent <= SILENT_PERIODS:
            return False
        had_one = self.parent != NO_PARENT
        self.lose()
        return had_one


class RecentPackets:
    """Duplicate cache of the last packets that a node forwarded, by two numbers each."""

    __slots__ = ('_pairs',)

    def __init__(self) -> None:
        self._pairs: deque[tuple[int, int]] = deque(maxlen=REMEMBERED)

    def check_and_add(self, node: int, number: int) -> bool:
        """Return whether the packet is in the cache; add it if it is not."""
        pair = (node, number)
        if pair in self._pairs:
            return True
        self._pairs.append(pair)
        return False
