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
What a node of MultiHopLQI knows of its way to the root, and how it decides.

There is no table of neighbours: a node knows its parent, the parent's cost and the link to it, and
measures what others advertise against that.
"""

from __future__ import annotations

from collections import deque
from enum import Enum
from typing import Final

from rt_robot_os.features.wsn.packets.multihop_lqi import NO_PARENT
from rt_robot_os.features.wsn.packets.multihop_lqi import NO_ROUTE_HOPS
from rt_robot_os.features.wsn.routing.link_cost import link_costs

#: Of the parent and of the link, each, without a route.
UNKNOWN_COST: Final = 0x7FFF
#: A route is lost when the parent was silent for more beacon periods than this.
SILENT_PERIODS: Final = 8
#: So many packets are remembered, by who sent them and by who made them.
REMEMBERED: Final = 4
_U8: Final = 0xFF
_U16: Final = 0xFFFF


class Decision(Enum):
    """What a node does about a beacon."""

    RENEW = 'the parent told its cost anew'
    LOSE = 'the parent goes over this node: a loop'
    CHANGE = 'the sender becomes the parent'
    KEEP = 'the sender is not a quarter cheaper, or goes over this node'


class LqiRoute:
    """
    The way to the root.

    :ivar parent: ``NO_PARENT`` without a route.
    :ivar parent_cost: as the parent told it.
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
        """Return what the node advertises; 65534 without a route."""
        return (self.parent_cost + self.link) & _U16

    def lose(self) -> None:
        """Have no route."""
        self.parent = NO_PARENT
        self.parent_cost = UNKNOWN_COST
        self.link = UNKNOWN_COST
        self.hops = NO_ROUTE_HOPS

    def heard(self, source: int, parent: int, cost: int, hops: int, lqi: int) -> Decision:
        """
        Take a beacon.

        :param source: who sent it.
        :param parent: the sender's.
        :param cost: the sender's.
        :param hops: the sender's.
        :param lqi: with which the beacon came; the link is used in the other direction.
        """
        if source == self.parent:
            self._silent = 0
            if parent == self._address:
                self.lose()
                return Decision.LOSE
            self._take(source, cost, hops, lqi)
            return Decision.RENEW
        own = self.parent_cost + self.link
        if cost + self._costs[lqi] < own - (own >> 2) and parent != self._address:
            self._silent = 0
            self._take(source, cost, hops, lqi)
            return Decision.CHANGE
        return Decision.KEEP

    def _take(self, source: int, cost: int, hops: int, lqi: int) -> None:
        self.parent = source
        self.parent_cost = cost
        self.link = self._costs[lqi]
        self.hops = (hops + 1) & _U8

    def period_passed(self) -> bool:
        """
        Count a beacon period of the node's own.

        :return: whether the parent was silent for too long, so that there is no route now.
        """
        self._silent = (self._silent + 1) & _U8
        if self._silent <= SILENT_PERIODS:
            return False
        had_one = self.parent != NO_PARENT
        self.lose()
        return had_one


class RecentPackets:
    """The last packets that a node took to forward, by two numbers each."""

    __slots__ = ('_pairs',)

    def __init__(self) -> None:
        self._pairs: deque[tuple[int, int]] = deque(maxlen=REMEMBERED)

    def known(self, node: int, number: int) -> bool:
        """Tell whether the packet is remembered; remember it when it is not."""
        pair = (node, number)
        if pair in self._pairs:
            return True
        self._pairs.append(pair)
        return False
