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
A radio medium that computes signal strengths from the positions of the radios.

A grid of cells indexes the radios. The links of a radio are computed when it first sends. They
depend only on positions, powers, numbers and the seed, in a fixed order: neither on the cells nor
on the time of the search. So the cost of a radio does not depend on the size of the network, and
only the links of the most recent senders are stored.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from random import Random
from typing import Final

import numpy as np

from rt_robot_os.features.wsn.radio.mac import MacProfile
from rt_robot_os.features.wsn.radio.path_loss import Fading
from rt_robot_os.features.wsn.radio.path_loss import PathLoss
from rt_robot_os.features.wsn.simulator.air import Position
from rt_robot_os.features.wsn.simulator.air import Radio
from rt_robot_os.features.wsn.simulator.air import Transmission
from rt_robot_os.features.wsn.simulator.gain_medium import GainMedium
from rt_robot_os.features.wsn.simulator.medium import Medium
from rt_robot_os.features.wsn.simulator.radio_positions import Cell
from rt_robot_os.features.wsn.simulator.radio_positions import cell_of
from rt_robot_os.features.wsn.simulator.radio_positions import Numbers
from rt_robot_os.features.wsn.simulator.radio_positions import RadioPositions
from rt_robot_os.features.wsn.simulator.radio_positions import reach_m

# Signals this far below the usual noise are ignored.
_NEGLIGIBLE_DB: Final = 3.0
_STRONGEST_DBM: Final = 0.0
# Margin for rounding errors.
_MARGIN_DB: Final = 0.001
_NUMBERS: Final = 4096
_MULTIPLIERS: Final = (0x1E3779B1, 0x05EBCA6B, 0x42B2AE35)
_MASK: Final = 0x7FFFFFFF

#: Maximum number of stored links, about 65 bytes each; the least recent senders are evicted.
MOST_LINKS: Final = 8_000_000
# Links of a radio that has sent within this time are never evicted.
_RECENT_NS: Final = 1_000_000_000


class PathLossMedium(GainMedium):
    """
    A medium with path loss and noise.

    The shadowing of a pair depends only on the two numbers and the seed: it does not change when
    nodes are added, removed or moved.

    :ivar places: the positions of the radios.
    """

    def __init__(self, path_loss: PathLoss, noise: Sequence[int], mac: MacProfile,
                 most_links: int = MOST_LINKS) -> None:
        """
        Create a medium without radios.

        :param noise: in dBm, one value for each ms; see ``rt_robot_os.features.wsn.radio.noise``.
        :param most_links: maximum number of stored links; others are recomputed when needed.
        """
        super().__init__(noise, mac)
        self._path_loss = path_loss
        self._audible_dbm = min(self._lowest_dbm, self._median_dbm - _NEGLIGIBLE_DB)
        self._range_m = path_loss.range_m(_STRONGEST_DBM - self._audible_dbm)
        self.places = RadioPositions(self._range_m)
        self._most_links = most_links
        self._links = 0
        # Radios whose links are stored, with the time they last sent; the latest is last.
        self._linked: OrderedDict[Radio, int] = OrderedDict()
        self._strongest_dbm = _STRONGEST_DBM
        self._air: dict[Cell, list[Transmission]] = {}
        self._nears: dict[Cell, tuple[list[Transmission], ...]] = {}
        self._shadowing: Numbers = np.zeros((_NUMBERS, 2))
        self._mixed_seed = 0
        self.seed(1)

    def seed(self, seed: int) -> None:
        """Set the seed of the random numbers; call it before the first radio is added."""
        super().seed(seed)
        random = Random(f'{seed} shadowing')
        self._mixed_seed = random.getrandbits(31)
        self._shadowing = np.array(
            [self._path_loss.shadowing(random) for _ in range(_NUMBERS)])
        self._most_shadowing_db = float(self._shadowing.max())
        loss = self._path_loss
        self._fading = Fading(
            loss.fading_db, loss.fading_s, Random(f'{seed} fading')) if loss.fading_db else None

    def attach(self, radio: Radio, position: Position) -> None:
        """Add a radio at its position."""
        Medium.attach(self, radio, position)
        radio.noise_place = self.random.randrange(self._length)
        self._put(radio, position)

    def detach(self, radio: Radio) -> None:
        """Remove a radio."""
        Medium.detach(self, radio)
        self._take_away(radio)
        if self._fading is not None:
            self._fading.forget(radio.number)

    def moved(self, radio: Radio, position: Position) -> None:
        """Note a new position or transmit power of a radio."""
        self._take_away(radio)
        self._put(radio, position)

    def begin(self, frame: Transmission) -> None:
        """Start a frame; it overlaps with those already on the air."""
        radio = frame.sender
        if radio not in self._linked:
            self.links_of(radio)
        self._linked[radio] = frame.begin_ns
        self._linked.move_to_end(radio)
        if self._links > self._most_links:
            self._forget_links(frame.begin_ns - _RECENT_NS)
        super().begin(frame)

    def links_of(self, radio: Radio) -> dict[Radio, float]:
        """Return the signal strength of a radio at all radios in range, in dBm."""
        if radio not in self._linked:
            others, there_dbm, _ = self._reached(radio)
            self._store_links(radio, dict(zip(others, there_dbm)))
        return radio.links

    def _store_links(self, radio: Radio, links: dict[Radio, float]) -> None:
        radio.links = links
        radio.hearers = None
        self._links += len(links)
        self._linked[radio] = 0
        self._linked.move_to_end(radio, last=False)

    def _drop(self, radio: Radio) -> None:
        if self._linked.pop(radio, None) is not None:
            self._links -= len(radio.links)
            radio.links = {}
            radio.hearers = None

    def _forget_links(self, before_ns: int) -> None:
        """Evict the links of the radios that have not sent for the longest time."""
        while self._links > self._most_links:
            radio, sent_ns = next(iter(self._linked.items()))
            if sent_ns >= before_ns:
                return
            self._drop(radio)

    def _take_away(self, radio: Radio) -> None:
        if self._linked:
            for other in self.links_of(radio):
                if other.links.pop(radio, None) is not None:
                    self._links -= 1
                    other.hearers = None
            self._drop(radio)
        self.places.remove(radio)

    def _put(self, radio: Radio, position: Position) -> None:
        """Place a radio, and add its links to the stored ones."""
        radio.near = self._near(cell_of(position, 2 * self._range_m))
        self._strongest_dbm = max(self._strongest_dbm, radio.power_dbm)
        self.places.add(radio, position)
        radio.hearers = None
        if not self._linked:
            return
        others, there_dbm, back_dbm = self._reached(radio)
        for other, power_dbm in zip(others, back_dbm):
            if other in self._linked:
                other.links[radio] = power_dbm
                other.hearers = None
                self._links += 1
        self._store_links(radio, dict(zip(others, there_dbm)))

    def _reached(self, radio: Radio) -> tuple[list[Radio], list[float], list[float]]:
        """Return the radios in range of one, and the signals in both directions, in dBm."""
        places, audible_dbm, loss = self.places, self._audible_dbm, self._path_loss
        row = places.row(radio)
        rows, away_m = places.near(row, reach_m(
            self._strongest_dbm + self._most_shadowing_db + _MARGIN_DB - audible_dbm
            - loss.one_metre_db, loss.exponent))
        loss_db = loss.without_walls_db(away_m)
        there_db, back_db = self._shadowing_of(radio.number, places.numbers(rows))
        there_dbm = radio.power_dbm - loss_db + there_db
        back_dbm = places.powers_dbm(rows) - loss_db + back_db
        reached = np.flatnonzero(np.maximum(there_dbm, back_dbm) > audible_dbm)
        reached = reached[places.order(rows[reached], row)]
        rows, there_dbm, back_dbm = rows[reached], there_dbm[reached], back_dbm[reached]
        if loss.walls is not None:
            behind_db = self._behind_walls_db(row, rows)
            there_dbm, back_dbm = there_dbm - behind_db, back_dbm - behind_db
            left = np.flatnonzero(np.maximum(there_dbm, back_dbm) > audible_dbm)
            rows, there_dbm, back_dbm = rows[left], there_dbm[left], back_dbm[left]
        others = [places.radio(each) for each in rows.tolist()]
        return others, there_dbm.tolist(), back_dbm.tolist()

    def _behind_walls_db(self, row: int, others: Numbers) -> Numbers:
        """Return the loss in walls, counted from the radio that was placed later."""
        places, walls = self.places, self._path_loss.walls
        assert walls is not None
        here, behind_db = places.position(row), []
        for other, later in zip(others.tolist(), places.is_later(others, row).tolist()):
            there = places.position(other)
            begin, end = (there, here) if later else (here, there)
            behind_db.append(walls(begin[0], begin[1], end[0], end[1]))
        return np.array(behind_db)

    def _shadowing_of(self, number: int, others: Numbers) -> tuple[Numbers, Numbers]:
        """Return the shadowing between a node and others in both directions, in dB."""
        low, high = np.minimum(others, number), np.maximum(others, number)
        mixed = low * _MULTIPLIERS[0] & _MASK ^ high * _MULTIPLIERS[1] & _MASK ^ self._mixed_seed
        mixed = (mixed ^ mixed >> 15) * _MULTIPLIERS[2] & _MASK
        pairs = self._shadowing[mixed >> 12 & _NUMBERS - 1]
        upwards = others > number
        return (np.where(upwards, pairs[:, 0], pairs[:, 1]),
                np.where(upwards, pairs[:, 1], pairs[:, 0]))

    def _near(self, cell: Cell) -> tuple[list[Transmission], ...]:
        """Return the lists of frames on the air in and around a cell, its own first."""
        near = self._nears.get(cell)
        if near is None:
            column, row = cell
            around = [(column + x, row + y) for x, y in _AROUND]
            near = self._nears[cell] = tuple(self._air.setdefault(each, []) for each in around)
        return near


_AROUND: Final = ((0, 0), (-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))
