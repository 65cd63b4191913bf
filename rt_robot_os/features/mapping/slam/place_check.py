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
The likelihood of a scan at many poses of a known map, beam by beam.

A beam ends at the surface of the map, or before it at a person, or it went through a wall: that is
the strongest evidence against a pose.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from rt_robot_os.features.mapping.slam.known_map import FAR_M
from rt_robot_os.features.mapping.slam.known_map import KnownMap
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.features.mapping.slam.transforms import wrapped

#: Beams that are evaluated; more for a fine evaluation.
_BEAMS: Final = 72
_BEAMS_CLOSELY: Final = 360
_STEPS: Final = 8
_SOFT_M: Final = 0.1
#: Largest movement of a refined pose.
_NEAR_M: Final = 0.35
_NEAR_RAD: Final = 0.12
#: Uncertainty of a surface within its cells, and in addition the standard deviation of the end of
#: a beam on it, which grows with the cells.
_SURFACE_CELLS: Final = 0.5
_SIGMA_M: Final = 0.02
_SIGMA_CELLS: Final = 0.4
#: A beam that ends this far behind its surface did not end on it, though another one may be there.
_BEHIND_M: Final = 0.1
#: A beam this near to its surface ended on it.
_ON_M: Final = 0.13
#: A beam that is longer than all neighbours allow by this went through.
_THROUGH_M: Final = 0.25
#: Angle to each side within which a beam along a wall may hit another one.
_GRAZING_RAD: Final = 0.02
#: Likelihoods of beams that do not end on a surface, relative to a perfect end.
_SHORT: Final = 0.04
_PASSED: Final = 0.004
#: In unknown cells.
_UNKNOWN: Final = 0.15


@dataclass(frozen=True)
class PlaceFit:
    """
    The match of a scan at several poses; each of shape (places,).

    :ivar likelihood: mean logarithm of a beam's likelihood; 0 is perfect, -5.5 the worst.
    :ivar explained: share of the beams that end on a surface.
    :ivar through: share of the beams that went through one.
    """

    likelihood: Floats
    explained: Floats
    through: Floats


def some_of(points: Floats, closely: bool = False) -> Floats:
    """
    Return the points of a scan that are evaluated, spread evenly.

    :param closely: use more points, for small features: a corner, the edge of a shelf.
    """
    most = _BEAMS_CLOSELY if closely else _BEAMS
    if len(points) <= most:
        return points
    return points[np.linspace(0, len(points) - 1, most).astype(np.int64)]


def refined(known: KnownMap, places: Floats, points: Floats) -> Floats:
    """
    Return poses refined to the best match nearby.

    :param places: shape (m, 3), in the grid's own frame.
    :param points: shape (n, 2), in the laser's.
    """
    found, h = places.copy(), known.cell_m
    for _ in range(_STEPS):
        cosine, sine = np.cos(found[:, 2, None]), np.sin(found[:, 2, None])
        ax, ay = (cosine * points[:, 0] - sine * points[:, 1],
                  sine * points[:, 0] + cosine * points[:, 1])
        away, slope_x, slope_y = _sloped(known, found[:, 0, None] + ax, found[:, 1, None] + ay)
        weights = np.where(away < FAR_M - h, 1.0 / (1.0 + (away / _SOFT_M) ** 2), 0.0)
        jacobian = np.stack((slope_x, slope_y, slope_y * ax - slope_x * ay), -1)
        weighted = jacobian * weights[..., None]
        matrix = np.einsum('mni,mnj->mij', weighted, jacobian) + np.eye(3) * 1e-3
        step = np.linalg.solve(matrix, -np.einsum('mni,mn->mi', weighted, away)[..., None])[..., 0]
        found += np.clip(step, (-0.1, -0.1, -0.04), (0.1, 0.1, 0.04))
    off = found - places
    off[:, 2] = wrapped(off[:, 2])
    astray = (np.hypot(off[:, 0], off[:, 1]) > _NEAR_M) | (np.abs(off[:, 2]) > _NEAR_RAD)
    found[astray] = places[astray]
    found[:, 2] = wrapped(found[:, 2])
    return found


def _sloped(known: KnownMap, x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
    """Return distances between the middles of cells, and their slopes."""
    h = known.cell_m
    u, v = x / h - 0.5, y / h - 0.5
    left, low = np.floor(u), np.floor(v)
    s, t = u - left, v - low
    x0, y0 = (left + 0.5) * h, (low + 0.5) * h
    a, b = known.away(x0, y0), known.away(x0 + h, y0)
    c, d = known.away(x0, y0 + h), known.away(x0 + h, y0 + h)
    across0, across1 = a + s * (b - a), c + s * (d - c)
    away: Floats = across0 + t * (across1 - across0)
    return away, ((b - a) * (1 - t) + (d - c) * t) / h, (across1 - across0) / h


def checked(known: KnownMap, places: Floats, points: Floats) -> PlaceFit:
    """
    Evaluate each beam at each pose.

    :param places: shape (m, 3), in the grid's own frame; points of shape (n, 2), n > 0.
    """
    ranges, angles = np.hypot(points[:, 0], points[:, 1]), np.arctan2(points[:, 1], points[:, 0])
    headings = places[:, 2, None] + angles
    x, y = (np.broadcast_to(each[:, None], headings.shape) for each in places[:, :2].T)
    most = float(ranges.max()) + 1.0
    reach = known.cast(x, y, headings, most)
    aside = [known.cast(x, y, headings + turn, most) for turn in (-_GRAZING_RAD, _GRAZING_RAD)]
    furthest = np.maximum(reach, np.maximum(*aside))
    nearest = np.minimum(reach, np.minimum(*aside))
    end_x, end_y = x + ranges * np.cos(headings), y + ranges * np.sin(headings)
    away = known.away(end_x, end_y)
    through = ranges > furthest + _THROUGH_M
    error = np.minimum(np.abs(ranges - reach), away)
    explained = ~through & (error < max(_ON_M, 1.2 * known.cell_m))
    # Deviations within the cell, and between the neighbours of a beam, are no errors.
    spare = _SURFACE_CELLS * known.cell_m
    behind, before = (np.maximum(each - spare, 0.0)
                      for each in (ranges - furthest, nearest - ranges))
    off = np.minimum(behind + before, np.maximum(away - spare, 0.0))
    sigma = max(_SIGMA_M, _SIGMA_CELLS * known.cell_m)
    floor = np.where(behind > max(_BEHIND_M, 2.0 * known.cell_m), _PASSED,
                     np.where(before > 0.0, _SHORT, _UNKNOWN))
    fit = np.where(through, 0.0, np.exp(-0.5 * (off / sigma) ** 2))
    likelihood = np.log(floor + (1.0 - floor) * fit)
    return PlaceFit(likelihood.mean(1), explained.mean(1), through.mean(1))
