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
The air of a place: what arrives follows from where the radios are.

Radios are found by cells of a grid, so that the cost of adding or moving one does not depend on
how many there are elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from random import Random
from typing import Final

from rt_robot_os.wsn.radio.mac import MacProfile
from rt_robot_os.wsn.radio.path_loss import Fading
from rt_robot_os.wsn.radio.path_loss import PathLoss
from rt_robot_os.wsn.simulator.air import Position
from rt_robot_os.wsn.simulator.air import Radio
from rt_robot_os.wsn.simulator.air import Transmission
from rt_robot_os.wsn.simulator.gain_medium import GainMedium
from rt_robot_os.wsn.simulator.medium import Medium

# A signal so far below the noise is nothing.
_NEGLIGIBLE_DB: Final = 5.0
_STRONGEST_DBM: Final = 0.0
_NUMBERS: Final = 4096
_MULTIPLIERS: Final = (0x9E3779B1, 0x85EBCA6B, 0xC2B2AE35)
_MASK: Final = 0xFFFFFFFF

Cell = tuple[int, int]


class PathLossMedium(GainMedium):
    """
    Radios that hear each other by path loss, over noise.

    What a pair has of its own (shadowing) depends on the two addresses and the seed alone: it
    stays when nodes are added, removed or moved.
    """

    def __init__(self, path_loss: PathLoss, noise: Sequence[int], mac: MacProfile) -> None:
        """
        Start with nobody there.

        :param noise: in dBm, a value each ms; see ``rt_robot_os.wsn.radio.noise``.
        """
        super().__init__(noise, mac)
        self._path_loss = path_loss
        self._audible_dbm = min(self._noise) - _NEGLIGIBLE_DB
        self._range_m = path_loss.range_m(_STRONGEST_DBM - self._audible_dbm)
        self._cells: dict[Cell, dict[Radio, Position]] = {}
        self._places: dict[Radio, Position] = {}
        self._air: dict[Cell, list[Transmission]] = {}
        self._nears: dict[Cell, tuple[list[Transmission], ...]] = {}
        self._shadowing: list[tuple[float, float]] = []
        self._mixed_seed = 0
        self.seed(1)

    def seed(self, seed: int) -> None:
        """Begin the series of random numbers; before the first radio."""
        super().seed(seed)
        random = Random(f'{seed} shadowing')
        self._mixed_seed = random.getrandbits(32)
        self._shadowing = [self._path_loss.shadowing(random) for _ in range(_NUMBERS)]
        loss = self._path_loss
        self._fading = Fading(
            loss.fading_db, loss.fading_s, Random(f'{seed} fading')) if loss.fading_db else None

    def attach(self, radio: Radio, position: Position) -> None:
        """Let a radio hear and be heard from its place."""
        Medium.attach(self, radio, position)
        radio.noise_place = self.random.randrange(self._length)
        self._put(radio, position)

    def detach(self, radio: Radio) -> None:
        """Take a radio away."""
        Medium.detach(self, radio)
        self._take_away(radio)
        if self._fading is not None:
            self._fading.forget(radio.address)

    def moved(self, radio: Radio, position: Position) -> None:
        """Take note that a radio is somewhere else, or sends with another power."""
        self._take_away(radio)
        self._put(radio, position)

    def _take_away(self, radio: Radio) -> None:
        for other in radio.links:
            other.links.pop(radio, None)
            other.hearers = None
        radio.links = {}
        radio.hearers = None
        del self._cells[self._cell(self._places.pop(radio), self._range_m)][radio]

    def _put(self, radio: Radio, position: Position) -> None:
        """Link a radio with those that it may hear or be heard by."""
        self._places[radio] = position
        column, row = cell = self._cell(position, self._range_m)
        radio.near = self._near(self._cell(position, 2 * self._range_m))
        for x in (column - 1, column, column + 1):
            for y in (row - 1, row, row + 1):
                for other, place in self._cells.get((x, y), {}).items():
                    self._link(radio, position, other, place)
        self._cells.setdefault(cell, {})[radio] = position
        radio.hearers = None

    def _link(self, radio: Radio, position: Position, other: Radio,
              place: Position) -> None:
        """Link two radios, if one of them reaches the other."""
        there_db, back_db = self._shadowing_of(radio.address, other.address)
        loss_db = self._path_loss.loss_db(position, place)
        there = radio.power_dbm - loss_db + there_db
        back = other.power_dbm - loss_db + back_db
        if there > self._audible_dbm or back > self._audible_dbm:
            radio.links[other] = there
            other.links[radio] = back
            other.hearers = None

    def _shadowing_of(self, first: int, second: int) -> tuple[float, float]:
        """Return what a pair has of its own, there and back, in dB."""
        low, high = (first, second) if first < second else (second, first)
        mixed = (low * _MULTIPLIERS[0] ^ high * _MULTIPLIERS[1] ^ self._mixed_seed) & _MASK
        mixed = (mixed ^ mixed >> 15) * _MULTIPLIERS[2] & _MASK
        there, back = self._shadowing[(mixed >> 12) % _NUMBERS]
        return (there, back) if first < second else (back, there)

    @staticmethod
    def _cell(position: Position, size_m: float) -> Cell:
        return int(position[0] // size_m), int(position[1] // size_m)

    def _near(self, cell: Cell) -> tuple[list[Transmission], ...]:
        """Return the lists of what is on the air in and around a cell, its own first."""
        near = self._nears.get(cell)
        if near is None:
            column, row = cell
            around = [(column + x, row + y) for x, y in _AROUND]
            near = self._nears[cell] = tuple(self._air.setdefault(each, []) for each in around)
        return near


_AROUND: Final = ((0, 0), (-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))
