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
Search of a scan on a whole map: every free place, every heading.

Branch and bound as in W. Hess and others, Real-time loop closure in 2D lidar SLAM, ICRA 2016: the
best value of a square bounds the scores of all places in it, so that most are never evaluated.
"""

from __future__ import annotations

from collections.abc import Iterator
import math
from typing import Any
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.features.mapping.slam.known_map import KnownMap
from rt_robot_os.features.mapping.slam.known_map import STEP_M
from rt_robot_os.features.mapping.slam.transforms import Floats

#: Edge of the cells of the search.
_CELL_M: Final = 0.1
#: Standard deviation of the distance of the end of a beam from its surface.
_SIGMA_M: Final = 0.12
_BEAMS: Final = 60
_HEADINGS: Final = 180
#: Squares at the top are 2 ** levels cells wide; all of them are evaluated.
_LEVELS: Final = 2
_WIDE: Final = 1 << _LEVELS
#: Values that are looked up, and those that are added up, in one piece of work: some 10 ms.
_PIECE: Final = 500_000
_SUMS: Final = 30_000_000
#: Squares that are added up together, as they fit into a cache; a call costs as much as this many.
_AT_ONCE: Final = 65_536
_CALL: Final = 4_000
#: Squares that are expanded at most: the best ones.
_SQUARES_MOST: Final = 400_000
#: Rows that are filled in one piece.
_STRIP: Final = 256
_TOP_CHUNK: Final = 400
#: Smallest score of a place relative to a perfect one, and largest difference to the best;
#: stricter if a map has more such places than can be stored.
_LEAST: Final = 0.35
_BELOW_BEST: Final = 0.25
#: One place of each square and angle of this size is stored, and this many in all.
_APART_M: Final = 0.3
_APART_HEADINGS: Final = 4
_PLACES_MOST: Final = 1200
_LEAVES_MOST: Final = 100_000

Numbers = npt.NDArray[Any]


class Pyramid:
    """
    Upper bounds of the scores of beams in squares of a map, for several sizes.

    :param reach_m: length of the longest beam.
    :ivar cell_m: edge of the smallest squares.
    :ivar free: where a robot may be, for squares of 1, 2 and 4 cells.
    :ivar values: the best value in squares of 1 and 2 cells, at each cell.
    :ivar top: the same of the largest squares, by the remainders of row and column, so that what
        beams of neighbouring squares look up lies in a row.
    """

    def __init__(self, known: KnownMap, reach_m: float) -> None:
        self._known = known
        factor = max(1, round(_CELL_M / known.cell_m))
        self._factor, self.cell_m = factor, known.cell_m * factor
        free = _least_of(~known.free, factor) == 0
        rows, columns = free.shape
        free = np.pad(free, ((0, -rows % _WIDE), (0, -columns % _WIDE)))
        self.free = [free]
        self.pad = (math.ceil(reach_m / self.cell_m) // _WIDE + 1) * _WIDE
        beyond = 2 * self.pad + _WIDE
        self.columns = free.shape[1] + beyond
        self.top = np.zeros((_WIDE, _WIDE, (free.shape[0] + beyond) // _WIDE,
                             self.columns // _WIDE), np.uint16)
        self.values = [np.zeros((free.shape[0] + beyond, self.columns), np.uint8)]

    def build(self) -> Iterator[None]:
        """Fill it; each step takes some milliseconds."""
        sigma = max(_SIGMA_M, 0.8 * self.cell_m)
        table = np.rint(255.0 * np.exp(-0.5 * (np.arange(256) * STEP_M / sigma) ** 2))
        table[255] = 0.0
        worth, high = table.astype(np.uint8), _STRIP * self._factor
        for low in range(0, len(self._known.distances), high):
            part = worth[_least_of(self._known.distances[low:low + high], self._factor)]
            row = self.pad + low // self._factor
            self.values[0][row:row + len(part), self.pad:self.pad + part.shape[1]] = part
            yield
        for level in range(_LEVELS):
            shift, below = 1 << level, self.values[-1]
            above = np.zeros_like(below)
            for low in range(0, len(below), _STRIP):
                part = below[low:low + _STRIP + shift]
                best = part.copy()
                np.maximum(best[:, :-shift], part[:, shift:], out=best[:, :-shift])
                both, after = best[:_STRIP].copy(), best[shift:shift + _STRIP]
                np.maximum(both[:len(after)], after, out=both[:len(after)])
                above[low:low + _STRIP] = both
                yield
            self.values.append(above)
            self.free.append(_least_of(~self.free[-1], 2) == 0)
        highest = self.values.pop()
        for row in range(_WIDE):
            for column in range(_WIDE):
                self.top[row, column] = highest[row::_WIDE, column::_WIDE]
                yield


class PlaceSearch:
    """
    The search for one scan.

    :param pyramid: of the map, built.
    :param points: shape (n, 2): its ends, in the laser's frame, in m, n > 0.
    :ivar places: shape (m, 3): where it may have been taken, in the grid's own frame, the best
        first; when the search is done.
    :ivar done: the part of the work that is done, 0 to 1.
    """

    def __init__(self, pyramid: Pyramid, points: Floats) -> None:
        self.places: Floats = np.zeros((0, 3))
        self.done = 0.0
        self._pyramid, self._cell = pyramid, pyramid.cell_m
        some = points[np.linspace(0, len(points) - 1, _BEAMS).astype(np.int64)
                      if len(points) > _BEAMS else slice(None)]
        self._beams, self._best = len(some), 0.0
        turns = np.arange(_HEADINGS) * (2.0 * np.pi / _HEADINGS)
        cosine, sine = np.cos(turns)[:, None], np.sin(turns)[:, None]
        x, y = some.T / self._cell
        across = np.floor(cosine * x - sine * y + 0.5).astype(np.int64)
        up = np.floor(sine * x + cosine * y + 0.5).astype(np.int64)
        self._shifts = np.stack((up, across), -1)
        self._offsets = up * pyramid.columns + across
        self._least = _LEAST * 255.0  # the smallest score

    def work(self) -> Iterator[None]:
        """Search; each step takes some 10 ms."""
        parts: list[Numbers] = []
        fits: list[Any] = []
        yield from self._look_at_squares(parts, fits)
        nodes, bound = np.concatenate(parts), np.concatenate(fits)
        # Sixteen bits are sorted in a tenth of the time.
        order = np.argsort((65535.0 - 256.0 * bound).astype(np.uint16), kind='stable')
        nodes, bound = nodes[order], bound[order]
        parts, fits = [], []
        chunk = max(_TOP_CHUNK, len(nodes) // 200)
        for low in range(0, len(nodes), chunk):
            self.done = 0.5 + 0.5 * low / len(nodes)
            if bound[low] < self._threshold - 1.0:
                break
            part = nodes[low:low + chunk]
            for _ in self._descend(part[bound[low:low + chunk] >= self._threshold], parts, fits):
                yield
        self.places = self._kept(parts, fits)
        self.done = 1.0

    @property
    def _threshold(self) -> float:
        return max(self._least, (self._best - _BELOW_BEST) * 255.0)

    def _look_at_squares(self, parts: list[Numbers], fits: list[Any]) -> Iterator[None]:
        """
        Evaluate all squares of the highest level, and collect those that may hold a place.

        Beam by beam for all squares together, which is many times faster than one by one.
        """
        free = self._pyramid.free[_LEVELS]
        rows, columns = free.shape
        strip, added, floor, count = max(1, _AT_ONCE // columns), 0, self._least, 0
        for heading in range(_HEADINGS):
            self.done = 0.5 * heading / _HEADINGS
            for low in range(0, rows, strip):
                here = free[low:low + strip]
                if here.any():
                    sums = self._summed(heading, low, *here.shape)
                    up, across = np.nonzero((sums >= floor * self._beams) & here)
                    parts.append(np.stack((np.full(len(up), heading), (low + up) * _WIDE,
                                           across * _WIDE), -1).astype(np.int32))
                    fits.append((sums[up, across] / self._beams).astype(np.float32))
                    added += self._beams * max(here.size, _CALL)
                    count += len(up)
                if count > 2 * _SQUARES_MOST:
                    floor, count = _best_only(parts, fits, _SQUARES_MOST)
                if added > _SUMS:
                    added = 0
                    yield

    def _summed(self, heading: int, low: int, rows: int, columns: int) -> Any:
        """Return the sums of the bounds of all beams in each square of some rows."""
        sums, top = np.zeros((rows, columns), np.uint16), self._pyramid.top
        up, across = (self._shifts[heading] + self._pyramid.pad).T
        for row, column, first, left in zip((up % _WIDE).tolist(), (across % _WIDE).tolist(),
                                            (up // _WIDE + low).tolist(),
                                            (across // _WIDE).tolist()):
            sums += top[row, column, first:first + rows, left:left + columns]
        return sums

    def _values(self, nodes: Numbers, level: int) -> Any:
        """Return the mean value under the beams, 0 to 255; for squares an upper bound."""
        pyramid = self._pyramid
        at = (nodes[:, 1] + pyramid.pad) * pyramid.columns + nodes[:, 2] + pyramid.pad
        found = pyramid.values[level].reshape(-1).take(at[:, None] + self._offsets[nodes[:, 0]])
        return found.sum(1, dtype=np.int64) / self._beams

    def _descend(self, nodes: Numbers, leaves: list[Numbers], fits: list[Any]) -> Iterator[None]:
        """Expand squares down to the matching places in them."""
        for level in range(_LEVELS - 1, -1, -1):
            step = 1 << level
            four = np.array(((0, 0, 0), (0, 0, step), (0, step, 0), (0, step, step)))
            children = (nodes[:, None] + four).reshape(-1, 3)
            children = children[self._pyramid.free[level][children[:, 1] >> level,
                                                          children[:, 2] >> level]]
            kept, values = [], []
            for part in np.array_split(
                    children, max(1, math.ceil(len(children) * self._beams / _PIECE))):
                value = self._values(part, level)
                if level == 0 and len(value):
                    self._best = max(self._best, float(value.max()) / 255.0)
                good = value >= self._threshold
                kept.append(part[good])
                values.append(value[good])
                yield
            nodes = np.concatenate(kept)
            if not len(nodes):
                return
        leaves.append(nodes)
        fits.append(np.concatenate(values))
        if sum(map(len, leaves)) > _LEAVES_MOST:
            self._least, _ = _best_only(leaves, fits, _LEAVES_MOST // 2)

    def _kept(self, leaves: list[Numbers], fits: list[Any]) -> Floats:
        if not leaves:
            return np.zeros((0, 3))
        nodes, values = np.concatenate(leaves), np.concatenate(fits)
        good = values >= self._threshold
        nodes, values = nodes[good], values[good]
        order = np.argsort(-values, kind='stable')
        nodes = nodes[order]
        apart = max(1, round(_APART_M / self._cell))
        rooms = nodes.astype(np.int64) // (_APART_HEADINGS, apart, apart)
        key = (rooms[:, 0] * 1_000_000 + rooms[:, 1]) * 1_000_000 + rooms[:, 2]
        _, first = np.unique(key, return_index=True)
        nodes = nodes[np.sort(first)][:_PLACES_MOST]
        return np.stack(((nodes[:, 2] + 0.5) * self._cell, (nodes[:, 1] + 0.5) * self._cell,
                         nodes[:, 0] * (2.0 * np.pi / _HEADINGS)), -1)


def _best_only(parts: list[Numbers], fits: list[Any], count: int) -> tuple[float, int]:
    """Keep the best ones; return their smallest value, and their number."""
    nodes, values = np.concatenate(parts), np.concatenate(fits)
    good = np.argpartition(values, len(values) - count)[len(values) - count:]
    parts[:], fits[:] = [nodes[good]], [values[good]]
    return float(fits[0].min()), count


def _least_of(values: Any, factor: int) -> Any:
    """Return the least of factor x factor cells; the last ones may have fewer."""
    rows, columns = values.shape
    beyond = 1 if values.dtype == np.bool_ else 255
    padded = np.pad(values, ((0, -rows % factor), (0, -columns % factor)),
                    constant_values=beyond)
    across = padded[:, ::factor].copy()
    for at in range(1, factor):
        np.minimum(across, padded[:, at::factor], out=across)
    found = across[::factor].copy()
    for at in range(1, factor):
        np.minimum(found, across[at::factor], out=found)
    return found
