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
The outlines of obstacles in a grid map, as straight segments.

Slanted walls are stairs of cells; their outlines here are straight again. Walls along the rows and
columns keep their edges to the last digit.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.grid_map import Mask

Segments = npt.NDArray[np.float64]
Corner = tuple[int, int]
Point = tuple[float, float]

# A run of this many cells is an edge of its own, unless there are several steps like it.
_LONG_RUN: Final = 10
# Largest distance of a point from the straight line that replaces it, in cells.
_TOLERANCE: Final = 0.75


def outline(grid: GridMap, least: int = 50) -> Segments:
    """
    Find the outlines of everything that is occupied.

    :param least: the smallest value that counts as occupied.
    :return: of shape (count, 4): x and y of both ends in m, in the frame of the map;
        occupied cells are on the right of each.
    """
    found: list[tuple[float, float, float, float]] = []
    resolution = grid.resolution_m
    for loop in _loops(grid.occupied_mask(least)):
        points = [grid.point(x * resolution, y * resolution) for x, y in _straightened(loop)]
        found += [(*a, *b) for a, b in zip(points, points[1:] + points[:1])]
    return np.array(found, dtype=np.float64).reshape(-1, 4)


def _loops(occupied: Mask) -> list[list[Corner]]:
    """Follow the edges between occupied and other cells; return the corners of each loop."""
    steps = _steps(occupied)
    loops = []
    for start, ways in steps.items():
        while ways:
            loops.append(_loop(start, steps))
    return loops


def _loop(start: Corner, steps: dict[Corner, list[Corner]]) -> list[Corner]:
    """Follow edges from a corner until the loop closes; they are removed from the steps."""
    at, heading = start, (0, 0)
    corners: list[Corner] = []
    while not corners or at != start:
        ways = steps[at]
        # Where two cells touch at a corner the loop stays with the cell on its right.
        way = ways[0] if len(ways) == 1 else max(
            ways, key=lambda w: heading[1] * w[0] - heading[0] * w[1])
        ways.remove(way)
        if way != heading:
            corners.append(at)
        heading = way
        at = (at[0] + way[0], at[1] + way[1])
    if len(corners) > 1 and _heading(corners[-1], start) == _heading(start, corners[1]):
        del corners[0]  # it started in the middle of an edge
    return corners


def _steps(occupied: Mask) -> dict[Corner, list[Corner]]:
    """Return the steps along edges that lead away from each corner; walls are on their right."""
    padded = np.pad(occupied, 1).astype(np.int8)
    steps: dict[Corner, list[Corner]] = {}
    # Between a cell and the one above: eastwards when the lower one is occupied.
    change = padded[1:, 1:-1] - padded[:-1, 1:-1]
    for row, column in np.argwhere(change).tolist():
        if change[row, column] < 0:
            steps.setdefault((column, row), []).append((1, 0))
        else:
            steps.setdefault((column + 1, row), []).append((-1, 0))
    # Between a cell and the one to the right: northwards when that one is occupied.
    change = padded[1:-1, 1:] - padded[1:-1, :-1]
    for row, column in np.argwhere(change).tolist():
        if change[row, column] > 0:
            steps.setdefault((column, row), []).append((0, 1))
        else:
            steps.setdefault((column, row + 1), []).append((0, -1))
    return steps


def _heading(a: Corner, b: Corner) -> Corner:
    return (b[0] > a[0]) - (b[0] < a[0]), (b[1] > a[1]) - (b[1] < a[1])


def _straightened(corners: list[Corner]) -> list[Point]:
    """Replace the stairs of a loop by straight lines between its true corners."""
    count = len(corners)
    run = [abs(b[0] - a[0]) + abs(b[1] - a[1])
           for a, b in zip(corners, corners[1:] + corners[:1])]
    turns = [_turn(corners[i - 1], corners[i], corners[(i + 1) % count]) for i in range(count)]

    jogs = [run[i] == 1 and turns[i] != turns[(i + 1) % count] for i in range(count)]

    def step(i: int) -> bool:
        """Return whether the edge that begins at a corner is one step of a stair."""
        if not jogs[i]:
            return False
        if run[i - 1] < _LONG_RUN and run[(i + 1) % count] < _LONG_RUN:
            return True
        # A wall that hardly slants has long steps; one jog alone is where a wall is thicker.
        return any(jogs[j] and turns[j] == turns[i] for j in (i - 2, (i + 2) % count))

    steps = [step(i) for i in range(count)]
    # The ends of a step are not corners; all others are.
    true = [i for i in range(count) if not (steps[i] or steps[i - 1])]
    if len(true) == count:
        return [(float(x), float(y)) for x, y in corners]
    if not true:
        middles = [_middle(corners[i], corners[(i + 1) % count]) for i in range(count)]
        half = len(middles) // 2
        rest = middles[half:] + middles[:1]
        return _simplified(middles[:half + 1])[:-1] + _simplified(rest)[:-1]
    points: list[Point] = []
    for a, b in zip(true, true[1:] + [true[0] + count]):
        first = (float(corners[a][0]), float(corners[a][1]))
        last = (float(corners[b % count][0]), float(corners[b % count][1]))
        middles = [_middle(corners[i % count], corners[(i + 1) % count]) for i in range(a, b)]
        points += _simplified([first, *(middles if b - a > 1 else []), last])[:-1]
    return points


def _turn(a: Corner, b: Corner, c: Corner) -> bool:
    return (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]) > 0


def _middle(a: Corner, b: Corner) -> Point:
    return (a[0] + b[0]) / 2, (a[1] + b[1]) / 2


def _simplified(points: list[Point]) -> list[Point]:
    """Remove points near the straight line between others (Douglas and Peucker)."""
    kept = {0, len(points) - 1}
    waiting = [(0, len(points) - 1)]
    while waiting:
        first, last = waiting.pop()
        (ax, ay), (bx, by) = points[first], points[last]
        length = math.hypot(bx - ax, by - ay)
        worst, at = 0.0, first
        for i in range(first + 1, last):
            x, y = points[i]
            if length:
                off = abs((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / length
            else:
                off = math.hypot(x - ax, y - ay)
            if off > worst:
                worst, at = off, i
        if worst > _TOLERANCE:
            kept.add(at)
            waiting += [(first, at), (at, last)]
    return [points[i] for i in sorted(kept)]
