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

"""How far each cell of a grid is from the nearest occupied one, in preemptible pieces."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np
import numpy.typing as npt

Mask = npt.NDArray[np.bool_]
Distances = npt.NDArray[np.float32]

# Up to this distance the sums fit into 16 bits.
_SHORT = 180
# Cells in one native call, some 10 us.
_AT_ONCE = 1 << 15
# Shifts in a piece of work.
_SHIFTS = 4


def halo_of(most: float) -> int:
    """Return how many cells beyond its edges a part of a grid needs, for distances up to this."""
    return int(most)


def distances_within(occupied: Mask, most: float) -> Generator[None, None, Distances]:
    """
    Return how far cells are from the nearest occupied one, in cells, middle to middle.

    It yields after each bounded piece of work.

    :param occupied: of shape (rows, columns): the requested cells, with a margin of
        :func:`halo_of` cells.
    :param most: longer distances are clipped to this.
    :return: of the requested cells.
    """
    reach = halo_of(most)
    rows, columns = occupied.shape[0] - 2 * reach, occupied.shape[1] - 2 * reach
    if not occupied.any():
        return np.full((rows, columns), most, np.float32)
    number = np.uint16 if reach <= _SHORT else np.uint32
    far = (reach + 1) ** 2
    squares = np.where(occupied, number(0), number(far))
    # Along the columns, then along the rows.
    best = yield from _nearest(squares, reach, rows)
    best = yield from _nearest(best.T, reach, columns)
    found: Distances = np.sqrt(best.T, dtype=np.float32)
    np.minimum(found, np.float32(most), out=found)
    return found


def _nearest(squares: npt.NDArray[np.unsignedinteger], reach: int, rows: int
             ) -> Generator[None, None, npt.NDArray[np.unsignedinteger]]:
    """Return the least sum of a square and that of the row distance, for the middle rows."""
    found = np.empty((rows, squares.shape[1]), squares.dtype)
    high = max(1, _AT_ONCE // squares.shape[1])
    for begin in range(0, rows, high):
        best = found[begin:begin + high]
        middle, size = reach + begin, len(best)
        best[:] = squares[middle:middle + size]
        other = np.empty_like(best)
        for shift in range(1, reach + 1):
            np.minimum(squares[middle - shift:middle - shift + size],
                       squares[middle + shift:middle + shift + size], out=other)
            other += squares.dtype.type(shift * shift)
            np.minimum(best, other, out=best)
            if shift % _SHIFTS == 0:
                yield
    return found
