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
The neighbours that a node may send its data to, as the beacons of the last round showed them.

A neighbour's cost is what it advertised: the sum of the links from it to the sink. Whoever has
advertised less than this node ever did in the round cannot have this node on its way, whatever
either changes to; so that packets go round in no circle. Others are not used, but for the
neighbours of the sink: without them nobody would be left to the nodes that the sink drives off.
"""

from __future__ import annotations

from typing import Final

#: Of neighbours; the dearest is forgotten for a cheaper one.
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
    :ivar rssi_dbm: of the beacon; the stronger of two that cost the same is taken.
    :ivar failed: it did not acknowledge.
    :ivar returns: it sends over this node.
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
        """Return the cost of the way to the sink over it."""
        return self.cost + self.link


class Candidates:
    """
    The neighbours of which the current round and the one before told.

    :ivar advertised: the least cost that this node has told others in the round; None before.
    """

    __slots__ = ('advertised', '_by_address', '_round')

    def __init__(self) -> None:
        self.advertised: int | None = None
        self._by_address: dict[int, Candidate] = {}
        self._round = 0

    def begin(self, round_number: int) -> None:
        """Begin a round; who was silent in the one that ends is forgotten."""
        self._by_address = {address: one for address, one in self._by_address.items()
                            if one.round_number == self._round}
        self._round = round_number
        self.advertised = None
        for one in self._by_address.values():
            one.failed = False

    def heard(self, candidate: Candidate) -> None:
        """Take what a beacon of the round told of its sender."""
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
        """Return whom to send to; None when nobody is left."""
        usable = [one for one in self._by_address.values()
                  if not (one.failed or one.returns
                          or self._is_dear(one) and one.hops > _NEXT_TO_SINK)]
        return min(usable, key=self._rank, default=None)

    def is_dear(self, address: int) -> bool:
        """Tell whether a neighbour may have this node on its way."""
        one = self._by_address.get(address)
        return one is not None and self._is_dear(one)

    def _is_dear(self, one: Candidate) -> bool:
        return self.advertised is not None and one.cost >= self.advertised

    def get(self, address: int) -> Candidate | None:
        """Return a neighbour."""
        return self._by_address.get(address)

    def forgive(self) -> None:
        """Let those be tried again that did not acknowledge."""
        for one in self._by_address.values():
            one.failed = False

    def _rank(self, one: Candidate) -> tuple[bool, bool, int, int]:
        old = one.round_number != self._round
        return old, self._is_dear(one), one.total, -one.rssi_dbm
