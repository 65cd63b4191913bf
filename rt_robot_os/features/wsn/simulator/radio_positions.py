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
The positions of radios in arrays, indexed by the cells of a grid.

The cost of a search depends only on the number of radios nearby.
"""

from __future__ import annotations

import math
from typing import Any
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.features.wsn.simulator.air import Position
from rt_robot_os.features.wsn.simulator.air import Radio

#: Column and row of a cell of the grid.
Cell = tuple[int, int]
Numbers = npt.NDArray[Any]

# Cells are smaller than the range, so that few radios beyond it are searched.
_CELLS_A_RANGE: Final = 3
_FIRST_ROWS: Final = 64


def cell_of(position: Position, size_m: float) -> Cell:
    """Return the cell of a position."""
    return int(position[0] // size_m), int(position[1] // size_m)


class RadioPositions:
    """
    The radios of an area: row by row in arrays, and by cell.

    :ivar examined: pairs that :meth:`near` has compared so far; the work of all searches.
    """

    def __init__(self, range_m: float) -> None:
        """
        Create an index without radios.

        :param range_m: side of the blocks; a radio searches its own block and the eight around it.
        """
        self.examined = 0
        self._range_m = range_m
        self._cell_m = range_m / _CELLS_A_RANGE
        self._radios: list[Radio | None] = []
        self._row_of: dict[Radio, int] = {}
        self._free: list[int] = []
        self._cells: dict[Cell, list[int]] = {}
        self._arrays: dict[Cell, Numbers] = {}
        self._positions: Numbers = np.zeros((_FIRST_ROWS, 3))
        self._powers: Numbers = np.zeros(_FIRST_ROWS)
        # Number of the radio, sequence number of its placement, column and row of its block.
        self._marks: Numbers = np.zeros((_FIRST_ROWS, 4), np.int64)
        self._put = 0

    def add(self, radio: Radio, position: Position) -> None:
        """Add a radio; to move one, remove it first."""
        row = self._free.pop() if self._free else len(self._radios)
        if row == len(self._radios):
            self._radios.append(None)
            if row == len(self._powers):
                self._positions = np.concatenate([self._positions, self._positions])
                self._powers = np.concatenate([self._powers, self._powers])
                self._marks = np.concatenate([self._marks, self._marks])
        self._put += 1
        self._radios[row] = radio
        self._row_of[radio] = row
        self._positions[row] = position
        self._powers[row] = radio.power_dbm
        self._marks[row] = (radio.number, self._put, *cell_of(position, self._range_m))
        cell = cell_of(position, self._cell_m)
        self._cells.setdefault(cell, []).append(row)
        self._arrays.pop(cell, None)

    def remove(self, radio: Radio) -> None:
        """Remove a radio."""
        row = self._row_of.pop(radio)
        x, y, z = self._positions[row].tolist()
        cell = cell_of((x, y, z), self._cell_m)
        self._cells[cell].remove(row)
        self._arrays.pop(cell, None)
        self._radios[row] = None
        self._free.append(row)

    def radio(self, row: int) -> Radio:
        """Return the radio of a row."""
        radio = self._radios[row]
        assert radio is not None
        return radio

    def position(self, row: int) -> Position:
        """Return the position of the radio of a row."""
        x, y, z = self._positions[row].tolist()
        return x, y, z

    def power_dbm(self, row: int) -> float:
        """Return the transmit power of the radio of a row."""
        return float(self._powers[row])

    def row(self, radio: Radio) -> int:
        """Return the row of a radio."""
        return self._row_of[radio]

    def near(self, row: int, reach_m: float) -> tuple[Numbers, Numbers]:
        """
        Find the radios in the block of a radio and around it that are not too far away.

        Their order does not depend on the search: first the radios that were added before this
        one, by block and then in order of addition; then the others in order of addition. Random
        numbers are drawn in this order.

        :param reach_m: radios farther away may be left out.
        :return: their rows, and their distances in m.
        """
        rows = self._candidates(self.position(row), reach_m)
        self.examined += len(rows)
        apart = self._positions[rows] - self._positions[row]
        away_m = np.sqrt(np.einsum('ij,ij->i', apart, apart))
        marks = self._marks[rows]
        block = self._marks[row, 2:]
        kept = np.flatnonzero((away_m <= reach_m) & (rows != row) & (
            np.abs(marks[:, 2:] - block) <= 1).all(axis=1))
        return rows[kept], away_m[kept]

    def numbers(self, rows: Numbers) -> Numbers:
        """Return the numbers of the radios of rows."""
        numbers: Numbers = self._marks[rows, 0]
        return numbers

    def powers_dbm(self, rows: Numbers) -> Numbers:
        """Return the transmit powers of the radios of rows."""
        powers_dbm: Numbers = self._powers[rows]
        return powers_dbm

    def is_later(self, rows: Numbers, row: int) -> Numbers:
        """Return for each radio whether it was added after the one of a row."""
        later: Numbers = self._marks[rows, 1] > self._marks[row, 1]
        return later

    def order(self, rows: Numbers, row: int) -> Numbers:
        """Return the order of :meth:`near` for rows, as indices of them."""
        marks = self._marks[rows]
        later = self.is_later(rows, row)
        return np.lexsort((marks[:, 1], np.where(later, 0, marks[:, 3]),
                           np.where(later, 0, marks[:, 2]), later))

    def _candidates(self, position: Position, reach_m: float) -> Numbers:
        reach_m = min(reach_m, 2 * self._range_m) * (1 + 1e-9)
        low = cell_of((position[0] - reach_m, position[1] - reach_m, 0.0), self._cell_m)
        high = cell_of((position[0] + reach_m, position[1] + reach_m, 0.0), self._cell_m)
        found = [self._rows_in((column, line)) for column in range(low[0], high[0] + 1)
                 for line in range(low[1], high[1] + 1) if self._cells.get((column, line))]
        return np.concatenate(found)

    def _rows_in(self, cell: Cell) -> Numbers:
        rows = self._arrays.get(cell)
        if rows is None:
            rows = self._arrays[cell] = np.array(self._cells[cell], np.intp)
        return rows


def reach_m(budget_db: float, exponent: float) -> float:
    """Return the distance in m at which a signal has this loss, beyond that of the first metre."""
    return math.inf if budget_db > 300 * exponent else float(10 ** (budget_db / (10 * exponent)))
