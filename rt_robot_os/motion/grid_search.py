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
The cheapest path over a grid (A*), searched in small pieces that tasks can preempt.

A* over whole fronts: the cells whose estimate is near the lowest are expanded together, in NumPy,
until the start is reached and nothing cheaper is left. That is exact, as cells that were expanded
too early are expanded again. No native call takes longer than some 0.1 ms.
"""

from __future__ import annotations

from collections.abc import Iterator
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.motion.terrain import Cells
from rt_robot_os.motion.terrain import Costs
from rt_robot_os.motion.terrain import PIECE
from rt_robot_os.motion.terrain import Terrain

# How much above the lowest estimate cells are expanded along with it: wider fronts are fewer, but
# more of their cells are expanded twice.
_FRONT: Final = 2.0
# The estimate must be admissible, also in 32-bit arithmetic.
_SURE: Final = 0.999
_MOST_AT_ONCE: Final = 4096


class GridSearch:
    """
    Search paths over a terrain, one after the other.

    :ivar expanded: cells of the last search, those that were expanded twice counted twice.
    """

    def __init__(self, terrain: Terrain) -> None:
        self._terrain = terrain
        size, width = terrain.cost.size, terrain.width
        # Each search fills the first; of the second it reads only what it has written.
        self._spent: Costs = np.empty(size, np.float32)
        self._next: npt.NDArray[np.int32] = np.empty(size, np.int32)
        diagonal = math.sqrt(2.0)
        self._steps = tuple((offset, np.float32(length)) for offset, length in (
            (1, 1.0), (-1, 1.0), (width, 1.0), (-width, 1.0), (width + 1, diagonal),
            (width - 1, diagonal), (1 - width, diagonal), (-width - 1, diagonal)))
        self.expanded = 0

    def way(self, start: int, goal: int) -> Iterator[list[int]]:
        """
        Search; each time it yields a bounded piece of work is done.

        :param start: a cell that may be driven over; so is the goal.
        :return: yields empty lists, and finally the cells from start to goal, or another empty
            list when there is no path.
        """
        for _ in self._forget():
            yield []
        spent = self._spent
        self.expanded = 0
        spent[goal] = 0.0
        row, column = divmod(start, self._terrain.width)
        cells: Cells = np.array([goal], np.intp)
        costs: Costs = np.zeros(1, np.float32)
        estimates = self._estimates(cells, costs, row, column)
        while cells.size:
            lowest = estimates.min()
            if spent[start] <= lowest:
                yield self._followed(start, goal)
                return
            front = np.flatnonzero(estimates < lowest + _FRONT)[:_MOST_AT_ONCE]
            rest = np.ones(cells.size, bool)
            rest[front] = False
            now, spent_now = cells[front], costs[front]
            fresh = spent_now == spent[now]  # others have been reached at lower cost since
            reached, grown = self._expand(now[fresh])
            cells = np.concatenate((cells[rest], reached))
            costs = np.concatenate((costs[rest], grown))
            estimates = np.concatenate((
                estimates[rest], self._estimates(reached, grown, row, column)))
            yield []
        # All is expanded: all costs are minimal.
        yield self._followed(start, goal) if math.isfinite(spent[start]) else []

    def _expand(self, cells: Cells) -> tuple[Cells, Costs]:
        """
        Reach the neighbours of some cells.

        :return: those that are cheaper now, and their costs. One that is reached by several steps
            is there several times, each time cheaper.
        """
        self.expanded += cells.size
        spent, cost, following = self._spent, self._terrain.cost, self._next
        from_here = spent[cells]
        here = cost[cells]
        found: list[Cells] = []
        costs: list[Costs] = []
        for offset, length in self._steps:
            # The neighbours of one step are distinct, so none is written twice.
            to = cells + offset
            then = from_here + length * np.float32(0.5) * (here + cost[to])
            better = np.flatnonzero(then < spent[to])
            if better.size:
                to = to[better]
                then = then[better]
                spent[to] = then
                following[to] = cells[better]
                found.append(to)
                costs.append(then)
        if not found:
            return cells[:0], from_here[:0]
        return np.concatenate(found), np.concatenate(costs)

    def _estimates(self, cells: Cells, costs: Costs, row: int, column: int) -> Costs:
        rows, columns = np.divmod(cells, self._terrain.width)
        left = np.hypot(rows - row, columns - column)
        found: Costs = (costs + _SURE * left).astype(np.float32)
        return found

    def _followed(self, start: int, goal: int) -> list[int]:
        found, cell = [start], start
        while cell != goal:
            cell = int(self._next[cell])
            found.append(cell)
        return found

    def _forget(self) -> Iterator[None]:
        for begin in range(0, self._spent.size, PIECE):
            self._spent[begin:begin + PIECE] = math.inf
            yield
