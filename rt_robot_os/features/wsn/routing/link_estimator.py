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
How many transmissions a packet needs over a link: the four-bit link estimator of CTP.

A link begins with what share of its neighbour's beacons comes in, and goes on with what share of
the data sent is acknowledged: the former knows one direction only. Both go into one average. The
table is small; who has no room in it is no neighbour, however near. All numbers have the width
that the motes give them, because the motes' decisions depend on it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from rt_robot_os.features.wsn.packets.ctp import Neighbour
from rt_robot_os.features.wsn.routing.tinyos_random import TinyOsRandom

TABLE_SIZE: Final = 10
#: What is said of a link that is not known, in tenths of a transmission.
UNKNOWN_ETX: Final = 0xFFFF
#: A perfect link.
BEST_ETX: Final = 10
#: A link worse than this makes room for a new one.
EVICT_ETX: Final = 65
#: After more beacons lost in a row than this, a link is judged anew.
MOST_LOST: Final = 10
#: So many beacons, or so many transmissions of data, make one estimate.
BEACON_WINDOW: Final = 3
DATA_WINDOW: Final = 5
#: Beacons come in to this measure when none is lost.
WHOLE_QUALITY: Final = 250
_LEAST_QUALITY: Final = 10


class _Link:
    """
    What is known of one neighbour.

    A transmission of data is counted in the link's window even before the link is mature, and a
    link that is judged anew keeps that window: the motes clear it only for a new parent.
    """

    __slots__ = ('acknowledged', 'address', 'etx', 'lost', 'mature', 'pinned', 'quality',
                 'received', 'sent', 'sequence')

    def __init__(self, address: int) -> None:
        self.sent = 0
        self.acknowledged = 0
        self.renew(address)

    def renew(self, address: int) -> None:
        self.address = address
        self.sequence = 0
        self.received = 0
        self.lost = 0
        self.mature = False
        self.pinned = False
        self.quality = 0
        self.etx = 0

    def beacon(self, sequence: int) -> None:
        gap = (sequence - self.sequence) & 0xFF
        self.sequence = sequence
        if gap > MOST_LOST:
            self.renew(self.address)
            self.sequence = sequence
            self.received = 1
            return
        self.received += 1
        if gap:
            self.lost += gap - 1
        if self.received + self.lost >= BEACON_WINDOW or gap >= BEACON_WINDOW:
            self._judge_beacons()

    def _judge_beacons(self) -> None:
        share = WHOLE_QUALITY * self.received // (self.received + self.lost)
        if not self.mature:
            self.quality = share
            self.etx = _of_quality(share)
            self.mature = True
        self.quality = (9 * self.quality + share) // 10
        self.received = 0
        self.lost = 0
        self.average(_of_quality(self.quality))

    def average(self, etx: int) -> None:
        self.etx = (9 * self.etx + etx) // 10 & 0xFFFF

    def transmission(self, acknowledged: bool) -> bool:
        self.sent = self.sent + 1 & 0xFF
        if acknowledged:
            self.acknowledged += 1
        if self.sent < DATA_WINDOW:
            return False
        if self.acknowledged:
            etx = 10 * self.sent // self.acknowledged
            self.sent = 0
            self.acknowledged = 0
        else:
            # The window stays open, and each further failure makes the link worse at once.
            etx = 10 * self.sent
        self.average(etx)
        return True


def _of_quality(quality: int) -> int:
    if quality < _LEAST_QUALITY:
        return UNKNOWN_ETX
    return 2500 // quality


class LinkEstimator:
    """
    The neighbours' table of one node.

    :param random: to choose whom to evict.
    :param evicted: called with the address of a neighbour that has lost its place.
    """

    __slots__ = ('_evicted', '_last_told', '_links', '_random', '_table')

    def __init__(self, random: TinyOsRandom, evicted: Callable[[int], None]) -> None:
        self._evicted = evicted
        self.clear(random)

    def clear(self, random: TinyOsRandom) -> None:
        """Know nobody, and go on with these random numbers."""
        self._random = random
        # No place becomes free again: it goes from one neighbour to the next.
        self._table: list[_Link] = []
        self._links: dict[int, _Link] = {}
        self._last_told = 0

    def etx(self, address: int) -> int:
        """Return what the link to a neighbour costs in tenths; ``UNKNOWN_ETX`` if not known."""
        link = self._links.get(address)
        if link is None or not link.mature:
            return UNKNOWN_ETX
        return link.etx

    def heard(self, address: int, sequence: int, better: Callable[[], bool]) -> None:
        """
        Take that a beacon came in.

        :param sequence: of the beacon, 8 bits.
        :param better: asked when there is no room: whether the way through this neighbour is
            better than another's, and the beacon came in so well that the link must be good.
        """
        link = self._links.get(address)
        if link is not None:
            link.beacon(sequence)
        elif len(self._table) < TABLE_SIZE:
            link = self._append(address)
            link.sequence = sequence
            link.beacon(sequence)
        else:
            worst = self._worst(EVICT_ETX)
            if worst is None and better():
                worst = self._any_young()
            if worst is not None:
                # As on the motes, the beacon that opened the place is not counted.
                self._replace(worst, address)

    def insert(self, address: int) -> bool:
        """Make room for a neighbour, even if a good one must go; return whether it is in."""
        if address in self._links:
            return True
        if len(self._table) < TABLE_SIZE:
            self._append(address)
            return True
        worst = self._worst(BEST_ETX)
        if worst is None:
            return False
        self._replace(worst, address)
        return True

    def pin(self, address: int) -> None:
        """Keep a neighbour in the table, whatever comes."""
        link = self._links.get(address)
        if link is not None:
            link.pinned = True

    def unpin(self, address: int) -> None:
        """Let a neighbour go when there is need."""
        link = self._links.get(address)
        if link is not None:
            link.pinned = False

    def sent(self, address: int, acknowledged: bool) -> bool:
        """
        Take that a data packet was transmitted to a neighbour.

        :return: the link's cost may have changed.
        """
        link = self._links.get(address)
        return link is not None and link.transmission(acknowledged)

    def forget_data(self, address: int) -> None:
        """Begin a new window of data packets: the neighbour has become the parent."""
        link = self._links.get(address)
        if link is not None:
            link.sent = 0
            link.acknowledged = 0

    def footer(self, room: int) -> tuple[Neighbour, ...]:
        """
        Return what to tell of the neighbours in the next beacon: others each time, in turn.

        :param room: for so many.
        """
        told: list[Neighbour] = []
        last = 0
        table = self._table
        for step in range(1, TABLE_SIZE + 1):
            if len(told) >= room:
                break
            place = (self._last_told + step) % TABLE_SIZE
            if place < len(table) and table[place].mature:
                told.append(Neighbour(table[place].address, table[place].quality))
                last = place
        self._last_told = last
        return tuple(told)

    def _append(self, address: int) -> _Link:
        link = _Link(address)
        self._table.append(link)
        self._links[address] = link
        return link

    def _replace(self, link: _Link, address: int) -> None:
        gone = link.address
        self._evicted(gone)
        del self._links[gone]
        link.renew(address)
        self._links[address] = link

    def _worst(self, least_etx: int) -> _Link | None:
        worst = None
        etx = 0
        for link in self._table:
            if link.mature and not link.pinned and link.etx >= etx:
                worst = link
                etx = link.etx
        return worst if etx >= least_etx else None

    def _any_young(self) -> _Link | None:
        young = [link for link in self._table if not link.mature and not link.pinned]
        return young[(self._random.number() & 0xFFFF) % len(young)] if young else None
