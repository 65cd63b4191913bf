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

"""Turn a path of cells into a drivable one: fewer corners first, then rounder ones."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.motion.terrain import Terrain

Points = npt.NDArray[np.float64]

# Largest cost of a straight line relative to the cells.
_DEARER: Final = 1.01
_ROUNDS: Final = 40
_WEIGHT: Final = 0.4


def shortened(terrain: Terrain, points: Sequence[tuple[float, float]]
              ) -> Iterator[list[tuple[float, float]]]:
    """
    Pull the string: leave out points that a straight line passes as cheaply.

    :param points: in cells that are free, each in a neighbour of the one before.
    :return: yields empty lists, after a bounded piece of work each, and at last the points.
    """
    prices = [0.0]
    resolution = terrain.grid.resolution_m
    for a, b in zip(points, points[1:]):
        # From centre to centre; rounding could make a line touch the corner of a third cell.
        costs = terrain.cost[terrain.cell(*a)] + terrain.cost[terrain.cell(*b)]
        prices.append(prices[-1] + 0.5 * float(costs) * math.dist(a, b) / resolution)
        if len(prices) % 64 == 0:
            yield []
    kept, at, last = [points[0]], 0, len(points) - 1
    while at < last:
        # The first line that does not pass bounds the search for the last one that does.
        good, step = at + 1, 2
        while at + step <= last and _passes(terrain, points, prices, at, at + step):
            good, step = at + step, step * 2
            yield []
        bad = min(at + step, last + 1)
        while bad - good > 1:
            middle = (good + bad) // 2
            if _passes(terrain, points, prices, at, middle):
                good = middle
            else:
                bad = middle
            yield []
        kept.append(points[good])
        at = good
    yield kept


def price(terrain: Terrain, start: tuple[float, float], end: tuple[float, float]) -> float:
    """Return the cost of a straight line, in lengths of a cell; infinite if it is forbidden."""
    length_m = math.hypot(end[0] - start[0], end[1] - start[1])
    return float(terrain.cost[terrain.line(start, end)].mean()) * (
        length_m / terrain.grid.resolution_m)


def _passes(terrain: Terrain, points: Sequence[tuple[float, float]], prices: Sequence[float],
            a: int, b: int) -> bool:
    return price(terrain, points[a], points[b]) <= _DEARER * (prices[b] - prices[a]) + 1e-6


def rounded(terrain: Terrain, points: Sequence[tuple[float, float]], spacing_m: float
            ) -> Iterator[Points]:
    """
    Round the corners as far as the ground allows, ends excepted.

    :param spacing_m: of the points of the result, at most.
    :return: yields empty arrays, after a bounded piece of work each, and at last the points, of
        shape (n, 2).
    """
    way = resampled(points, spacing_m)
    nothing = way[:0]
    if len(way) < 3:
        yield way
        return
    for _ in range(_ROUNDS):
        middle = (way[:-2] + way[2:]) / 2
        candidate = way.copy()
        candidate[1:-1] += _WEIGHT * (middle - way[1:-1])
        # Where a piece cuts a corner its ends stay; that may make the pieces beside it cut one.
        stays = np.zeros(len(way), bool)
        while True:
            yield nothing
            tried = np.where(stays[:, None], way, candidate)
            bad = ~_free(terrain, tried) & ~(stays[:-1] & stays[1:])
            if not bad.any():
                break
            stays[:-1] |= bad
            stays[1:] |= bad
        way = tried
    yield way


def _free(terrain: Terrain, way: Points) -> npt.NDArray[np.bool_]:
    """Return which pieces between two points cross nothing that is forbidden."""
    longest_m = float(np.hypot(*np.diff(way, axis=0).T).max())
    part = np.linspace(0.0, 1.0, 2 + int(longest_m / (0.2 * terrain.grid.resolution_m)))[:, None]
    x, y = (way[:-1, axis] + part * (way[1:, axis] - way[:-1, axis]) for axis in (0, 1))
    return np.asarray(np.isfinite(terrain.cost[terrain.cells(x, y)]).all(axis=0))


def resampled(points: Sequence[tuple[float, float]], spacing_m: float) -> Points:
    """Return the points of a path with additional ones, none further apart than a distance."""
    found: list[Points] = []
    for a, b in zip(points, points[1:]):
        count = max(1, math.ceil(math.dist(a, b) / spacing_m))
        part = np.arange(count)[:, None] / count
        found.append(np.array(a) + part * (np.array(b) - np.array(a)))
    return np.concatenate((*found, np.array([points[-1]], float)))
