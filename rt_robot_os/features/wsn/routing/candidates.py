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
The neighbours to which a node may send its data, from the beacons of the last round.

The cost of a neighbour is the one it advertised: the sum of the links from it to the sink. A
neighbour that advertised less than this node ever did in the round cannot route over this node,
whatever either changes to, so there are no loops. Other neighbours are not used, except those of
the sink: without them the nodes that the sink drives away from would have none.
"""

from __future__ import annotations

from typing import Final

#: Largest number of neighbours; a cheaper one replaces the most expensive one.
MOST: Final = 16
_NEXT_TO_SINK: Final = 1


class Candidate:
    """
    A neighbour.

    :ivar address: the neighbour's.
    :ivar round_number: of the beacon.
    :ivar cost: from the neighbour to the sink.
    :ivar hops: from the neighbour to the sink.
    :ivar link: cost of the hop to the neighbour.
    :ivar rssi_dbm: of the beacon; of two with the same cost the stronger is used.
    :ivar failed: it did not acknowledge.
    :ivar returns: it routes over this node.
    """

    __slots__ = ('address', 'round_number', 'cost', 'hops', 'link', 'rssi_dbm', 'failed',
                 'returns')

    def __init__(self, address: int, round_number: int, cost: int, hops: int, link: int,
                 rssi_dbm: int, returns: bool) -> None:
        self.address = address
        self.round_number = round_number
        self.cost = cost
        self.hops = hops
        self.link = link
        self.rssi_dbm = rssi_dbm
        self.failed = False
        self.returns = returns

    @property
    def total(self) -> int:
        """Return the cost of the route to the sink over it."""
        return self.cost + self.link


class Candidates:
    """
    The neighbours with a beacon in the current round or the one before.

    :ivar advertised: the least cost that this node has advertised in the round; None before.
    """

    __slots__ = ('advertised', '_by_address', '_round')

    def __init__(self) -> None:
        self.advertised: int | None = None
        self._by_address: dict[int, Candidate] = {}
        self._round = 0

    def start_round(self, round_number: int) -> None:
        """Start a round; neighbours without a beacon in the last one are removed."""
        self._by_address = {address: one for address, one in self._by_address.items()
                            if one.round_number == self._round}
        self._round = round_number
        self.advertised = None
        for one in self._by_address.values():
            one.failed = False

    def update(self, candidate: Candidate) -> None:
        """Add or update the sender of a beacon of the round."""
        known = self._by_address.get(candidate.address)
        if known is None and len(self._by_address) >= MOST:
            last = max(self._by_address.values(), key=self._rank)
            if self._rank(candidate) > self._rank(last):
                return
            del self._by_address[last.address]
        elif known is not None and known.round_number == self._round:
            candidate.failed = known.failed
        self._by_address[candidate.address] = candidate

    def best(self) -> Candidate | None:
        """Return the neighbour to send to; None if none is usable."""
        usable = [one for one in self._by_address.values()
                  if not (one.failed or one.returns
                          or self._may_loop(one) and one.hops > _NEXT_TO_SINK)]
        return min(usable, key=self._rank, default=None)

    def may_loop(self, address: int) -> bool:
        """Return whether a neighbour may route over this node."""
        one = self._by_address.get(address)
        return one is not None and self._may_loop(one)

    def _may_loop(self, one: Candidate) -> bool:
        return self.advertised is not None and one.cost >= self.advertised

    def get(self, address: int) -> Candidate | None:
        """Return a neighbour."""
        return self._by_address.get(address)

    def retry_failed(self) -> None:
        """Allow neighbours that did not acknowledge again."""
        for one in self._by_address.values():
            one.failed = False

    def _rank(self, one: Candidate) -> tuple[bool, bool, int, int]:
        old = one.round_number != self._round
        return old, self._may_loop(one), one.total, -one.rssi_dbm
