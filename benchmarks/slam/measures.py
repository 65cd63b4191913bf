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

"""How far a map and a way are from the true ones."""

from __future__ import annotations

import math

import numpy as np

from rt_robot_os.features.mapping.slam.transforms import between
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.features.mapping.slam.transforms import placed
from rt_robot_os.motion.grid_map import FREE
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.grid_map import Mask
from rt_robot_os.motion.grid_map import OCCUPIED

#: A cell is right when the true map has the same so near to it.
NEAR_M = 0.1


def way_errors(truth: Floats, found: Floats) -> tuple[float, float]:
    """
    Return the root of the mean of squared errors of a way that begins as the true one does.

    :param truth: shape (n, 3), as found; each begins where it will.
    :return: in m and degrees.
    """
    off = between(_from_first(truth), _from_first(found))
    return (float(np.sqrt((off[:, :2] ** 2).sum(axis=1).mean())),
            math.degrees(float(np.sqrt((off[:, 2] ** 2).mean()))))


def fitted_error(truth: Floats, found: Floats) -> float:
    """
    Return the same in m with the whole way laid on the true one as well as it fits.

    So a small error of the first pose does not count at each of the others.
    """
    middles = truth[:, :2].mean(axis=0), found[:, :2].mean(axis=0)
    a, b = truth[:, :2] - middles[0], found[:, :2] - middles[1]
    turn = math.atan2(float((b[:, 0] * a[:, 1] - b[:, 1] * a[:, 0]).sum()), float((a * b).sum()))
    laid = placed(np.array((0.0, 0.0, turn)), b)
    return float(np.sqrt(((a - laid) ** 2).sum(axis=1).mean()))


def closing_error(truth: Floats, found: Floats) -> float:
    """Return by how much the last pose is off, seen from the first, in m."""
    off = between(between(truth[0], truth[-1]), between(found[0], found[-1]))
    return float(np.hypot(off[0], off[1]))


def agreement(made: GridMap, start: Floats, true: GridMap) -> float:
    """
    Return the share of the free and the occupied cells that are right within ``NEAR_M``.

    :param start: shape (3,): where the made map's origin is in the true one.
    """
    rows, columns = np.nonzero(made.cells >= 0)
    x = made.origin[0] + made.resolution_m * (columns + 0.5)
    y = made.origin[1] + made.resolution_m * (rows + 0.5)
    there = placed(start, np.stack((x, y), -1))
    values = made.cells[rows, columns]
    row, column, inside = true.indices(there[:, 0], there[:, 1])
    right = np.zeros(len(values), dtype=np.bool_)
    for value, mask in ((OCCUPIED, true.occupied_mask()), (FREE, ~true.occupied_mask())):
        known = values == value
        right[known] = (_near(mask, true.resolution_m)[row, column] & inside)[known]
    counted = (values == OCCUPIED) | (values == FREE)
    return float(right[counted].mean())


def _near(mask: Mask, cell_m: float) -> Mask:
    """Return which cells have one of a mask within ``NEAR_M``."""
    reach = math.floor(NEAR_M / cell_m + 1e-9)
    found = mask.copy()
    for dy in range(-reach, reach + 1):
        for dx in range(-reach, reach + 1):
            if math.hypot(dx, dy) * cell_m <= NEAR_M + 1e-9:
                found |= np.roll(mask, (dy, dx), axis=(0, 1))
    return found


def _from_first(poses: Floats) -> Floats:
    return between(np.broadcast_to(poses[0], poses.shape), poses)
