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

"""A scan as sectors around its laser, with the visible distance in each."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.features.mapping.slam.scan import Surface
from rt_robot_os.features.mapping.slam.transforms import Floats

#: All around.
SECTORS: Final = 240
#: A beam that ends this much further away has seen through a point.
_BEYOND_M: Final = 0.3
_BEYOND_PART: Final = 0.05


def seen_through(ranges: Floats) -> Floats:
    """Return the length from which on a beam has passed points at these distances, in m."""
    return ranges * (1.0 + _BEYOND_PART) + _BEYOND_M


def ends_by_sector(surface: Surface) -> tuple[Floats, Floats]:
    """Return the nearest end of a beam in each sector, and the visible distance around it."""
    points = surface.points
    sector = sector_of(points)
    ranges = np.hypot(points[:, 0], points[:, 1])
    nearest = np.full(SECTORS, np.inf)
    np.minimum.at(nearest, sector, ranges)
    known = np.where(np.isfinite(nearest), nearest, 0.0)
    beyond = known.copy()
    for shift in (-1, 1):
        beyond = np.minimum(beyond, np.roll(known, shift))
    return nearest, beyond


def sector_of(points: Floats) -> npt.NDArray[np.int64]:
    """Return the sectors of points; shape (n,)."""
    angles = np.arctan2(points[:, 1], points[:, 0])
    sectors: npt.NDArray[np.int64] = np.floor(
        (angles + np.pi) * (SECTORS / (2.0 * np.pi))).astype(np.int64) % SECTORS
    return sectors


def furthest_by_sector(surface: Surface) -> Floats:
    """Return the visible distance in each sector or its neighbours, in m; 0: unknown."""
    furthest = np.zeros(SECTORS)
    np.maximum.at(furthest, sector_of(surface.points), np.hypot(*surface.points.T))
    return np.maximum(furthest, np.maximum(np.roll(furthest, 1), np.roll(furthest, -1)))
