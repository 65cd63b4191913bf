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
from typing import Any
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.wsn.radio.mac import MacProfile
from rt_robot_os.wsn.radio.path_loss import Fading
from rt_robot_os.wsn.radio.path_loss import PathLoss
from rt_robot_os.wsn.simulator.air import Position
from rt_robot_os.wsn.simulator.air import Radio
from rt_robot_os.wsn.simulator.air import Transmission
from rt_robot_os.wsn.simulator.gain_medium import GainMedium
from rt_robot_os.wsn.simulator.medium import Medium

# A signal so far below the usual noise is nothing.
_NEGLIGIBLE_DB: Final = 3.0
_STRONGEST_DBM: Final = 0.0
_NUMBERS: Final = 4096
_MULTIPLIERS: Final = (0x1E3779B1, 0x05EBCA6B, 0x42B2AE35)
_MASK: Final = 0x7FFFFFFF

Cell = tuple[int, int]
Numbers = npt.NDArray[Any]


class _Place:
    """
    The radios in a cell of the grid, also as arrays, which are made when they are asked for.

    :ivar radios: that are there.
    :ivar positions: of these.
    """

    __slots__ = ('radios', 'positions', '_arrays')

    def __init__(self) -> None:
        self.radios: list[Radio] = []
        self.positions: list[Position] = []
        self._arrays: tuple[Numbers, Numbers, Numbers] | None = None

    def add(self, radio: Radio, position: Position) -> None:
        """Put a radio there."""
        self.radios.append(radio)
        self.positions.append(position)
        self._arrays = None

    def remove(self, radio: Radio) -> None:
        """Take a radio away."""
        index = self.radios.index(radio)
        del self.radios[index], self.positions[index]
        self._arrays = None

    def seen_from(self, position: Position) -> tuple[Numbers, Numbers, Numbers]:
        """Return the distances in m, addresses and powers in dBm of those that are there."""
        if self._arrays is None:
            self._arrays = (np.array(self.positions),
                            np.array([radio.address for radio in self.radios]),
                            np.array([radio.power_dbm for radio in self.radios]))
        positions, addresses, powers_dbm = self._arrays
        apart = positions - position
        return np.sqrt(np.einsum('ij,ij->i', apart, apart)), addresses, powers_dbm


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
        self._audible_dbm = min(self._lowest_dbm, self._median_dbm - _NEGLIGIBLE_DB)
        self._range_m = path_loss.range_m(_STRONGEST_DBM - self._audible_dbm)
        self._cells: dict[Cell, _Place] = {}
        self._places: dict[Radio, _Place] = {}
        self._air: dict[Cell, list[Transmission]] = {}
        self._nears: dict[Cell, tuple[list[Transmission], ...]] = {}
        self._shadowing: Numbers = np.zeros((_NUMBERS, 2))
        self._mixed_seed = 0
        self.seed(1)

    def seed(self, seed: int) -> None:
        """Begin the series of random numbers; before the first radio."""
        super().seed(seed)
        random = Random(f'{seed} shadowing')
        self._mixed_seed = random.getrandbits(31)
        self._shadowing = np.array(
            [self._path_loss.shadowing(random) for _ in range(_NUMBERS)])
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
        self._places.pop(radio).remove(radio)

    def _put(self, radio: Radio, position: Position) -> None:
        """Link a radio with those that it may hear or be heard by."""
        column, row = cell = self._cell(position, self._range_m)
        radio.near = self._near(self._cell(position, 2 * self._range_m))
        for x in (column - 1, column, column + 1):
            for y in (row - 1, row, row + 1):
                place = self._cells.get((x, y))
                if place is not None and place.radios:
                    self._link(radio, position, place)
        place = self._cells.setdefault(cell, _Place())
        place.add(radio, position)
        self._places[radio] = place
        radio.hearers = None

    def _link(self, radio: Radio, position: Position, place: _Place) -> None:
        """Link a radio with those of a place that it reaches, or that reach it."""
        away_m, addresses, powers_dbm = place.seen_from(position)
        loss_db = self._path_loss.without_walls_db(away_m)
        there_db, back_db = self._shadowing_of(radio.address, addresses)
        there_dbm = radio.power_dbm - loss_db + there_db
        back_dbm = powers_dbm - loss_db + back_db
        walls = self._path_loss.walls
        links, radios, audible_dbm = radio.links, place.radios, self._audible_dbm
        reached = np.flatnonzero(np.maximum(there_dbm, back_dbm) > audible_dbm)
        for index, there, back in zip(
                reached.tolist(), there_dbm[reached].tolist(), back_dbm[reached].tolist()):
            other = radios[index]
            if walls is not None:
                end = place.positions[index]
                behind_db = walls(position[0], position[1], end[0], end[1])
                there, back = there - behind_db, back - behind_db
                if max(there, back) <= audible_dbm:
                    continue
            links[other] = there
            other.links[radio] = back
            other.hearers = None

    def _shadowing_of(self, address: int, others: Numbers) -> tuple[Numbers, Numbers]:
        """Return what a node and others have of their own, there and back, in dB."""
        low, high = np.minimum(others, address), np.maximum(others, address)
        mixed = low * _MULTIPLIERS[0] & _MASK ^ high * _MULTIPLIERS[1] & _MASK ^ self._mixed_seed
        mixed = (mixed ^ mixed >> 15) * _MULTIPLIERS[2] & _MASK
        pairs = self._shadowing[mixed >> 12 & _NUMBERS - 1]
        upwards = others > address
        return (np.where(upwards, pairs[:, 0], pairs[:, 1]),
                np.where(upwards, pairs[:, 1], pairs[:, 0]))

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
