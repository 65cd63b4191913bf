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
The four-bit link estimator of CTP: expected transmissions of a packet over a link.

The estimate starts with the share of received beacons, and continues with the share of
acknowledged data: beacons show only one direction. Both go into one average. The table is small; a
node that is not in it is not a neighbour, however near. All numbers have the width of the motes,
because the decisions depend on it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from rt_robot_os.features.wsn.packets.ctp import Neighbour
from rt_robot_os.features.wsn.routing.tinyos_random import TinyOsRandom

TABLE_SIZE: Final = 10
#: Cost of an unknown link, in tenths of a transmission.
UNKNOWN_ETX: Final = 0xFFFF
#: A perfect link.
BEST_ETX: Final = 10
#: A worse link may be evicted for a new one.
EVICT_ETX: Final = 65
#: After more consecutive lost beacons the estimate of a link restarts.
MOST_LOST: Final = 10
#: Number of beacons, or of data transmissions, for one estimate.
BEACON_WINDOW: Final = 3
DATA_WINDOW: Final = 5
#: Quality of a link without lost beacons.
WHOLE_QUALITY: Final = 250
_LEAST_QUALITY: Final = 10


class _Link:
    """
    A neighbour.

    A data transmission counts in the link's window even before the link is mature, and a restart
    of the estimate does not clear that window: the motes clear it only for a new parent.
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
            self._update_beacon_estimate()

    def _update_beacon_estimate(self) -> None:
        share = WHOLE_QUALITY * self.received // (self.received + self.lost)
        if not self.mature:
            self.quality = share
            self.etx = _etx_of_quality(share)
            self.mature = True
        self.quality = (9 * self.quality + share) // 10
        self.received = 0
        self.lost = 0
        self.average(_etx_of_quality(self.quality))

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
            # The window stays open, and each further failure raises the cost immediately.
            etx = 10 * self.sent
        self.average(etx)
        return True


def _etx_of_quality(quality: int) -> int:
    if quality < _LEAST_QUALITY:
        return UNKNOWN_ETX
    return 2500 // quality


class LinkEstimator:
    """
    The neighbour table of one node.

    :param random: selects the neighbour to evict.
    :param evicted: called with the address of an evicted neighbour.
    """

    __slots__ = ('_evicted', '_last_advertised', '_links', '_random', '_table')

    def __init__(self, random: TinyOsRandom, evicted: Callable[[int], None]) -> None:
        self._evicted = evicted
        self.clear(random)

    def clear(self, random: TinyOsRandom) -> None:
        """Clear the table, and continue with these random numbers."""
        self._random = random
        # Entries are never freed, only replaced.
        self._table: list[_Link] = []
        self._links: dict[int, _Link] = {}
        self._last_advertised = 0

    def etx(self, address: int) -> int:
        """Return the cost of a link in tenths; ``UNKNOWN_ETX`` if unknown."""
        link = self._links.get(address)
        if link is None or not link.mature:
            return UNKNOWN_ETX
        return link.etx

    def receive_beacon(self, address: int, sequence: int, better: Callable[[], bool]) -> None:
        """
        Process the sequence number of a beacon.

        :param sequence: of the beacon, 8 bits.
        :param better: the compare bit, called when the table is full: whether the route over this
            neighbour is better than another's, and the beacon had the white bit.
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
                worst = self._random_immature()
            if worst is not None:
                # As on the motes, this beacon is not counted.
                self._replace(worst, address)

    def insert(self, address: int) -> bool:
        """Insert a neighbour, even in place of a good one; return whether it is in the table."""
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
        """Protect a neighbour from eviction."""
        link = self._links.get(address)
        if link is not None:
            link.pinned = True

    def unpin(self, address: int) -> None:
        """Allow the eviction of a neighbour."""
        link = self._links.get(address)
        if link is not None:
            link.pinned = False

    def sent(self, address: int, acknowledged: bool) -> bool:
        """
        Process the result of a data transmission to a neighbour.

        :return: whether the link's cost may have changed.
        """
        link = self._links.get(address)
        return link is not None and link.transmission(acknowledged)

    def clear_data_window(self, address: int) -> None:
        """Start a new window of data packets: the neighbour has become the parent."""
        link = self._links.get(address)
        if link is not None:
            link.sent = 0
            link.acknowledged = 0

    def footer(self, room: int) -> tuple[Neighbour, ...]:
        """
        Return the neighbours for the next beacon, in turn.

        :param room: largest number of neighbours.
        """
        advertised: list[Neighbour] = []
        last = 0
        table = self._table
        for step in range(1, TABLE_SIZE + 1):
            if len(advertised) >= room:
                break
            place = (self._last_advertised + step) % TABLE_SIZE
            if place < len(table) and table[place].mature:
                advertised.append(Neighbour(table[place].address, table[place].quality))
                last = place
        self._last_advertised = last
        return tuple(advertised)

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

    def _random_immature(self) -> _Link | None:
        young = [link for link in self._table if not link.mature and not link.pinned]
        return young[(self._random.number() & 0xFFFF) % len(young)] if young else None
