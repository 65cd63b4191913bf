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
Align a scan exactly with earlier scans: points to lines, with robust weights (ICP).

A. Censi, An ICP variant using a point-to-line metric, ICRA 2008. The weight of a point falls with
its distance from its line (Cauchy), so that people who walk by do not distort the result.
"""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Any
from typing import Final
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.features.mapping.slam.transforms import wrapped

_STEPS_MOST: Final = 20
_SMALL: Final = 1e-4
_LEAST: Final = 1e-6 * np.eye(3)
#: Distance to its line at which a point has half the weight.
_SOFT_M: Final = 0.05
#: A point this near to its line lies on it.
_ON_LINE_M: Final = 0.12
_GATE_LEAST_M: Final = 0.15
#: Normals at a right angle count as points at this distance. So a scan is not aligned with the
#: other side of a thin wall, nor round a corner.
_FACING_M: Final = 0.15
_SIDE: Final = _FACING_M / float(np.sqrt(2.0))
#: Smallest dot product of the normals of two points of one surface.
_ALIKE: Final = 0.5
_POINTS_LEAST: Final = 10


@dataclass(frozen=True)
class Aligned:
    """
    A scan that is aligned with a map.

    :ivar pose: shape (3,).
    :ivar information: shape (3, 3), of the points alone, in units of a point's own variance.
    :ivar share: of the scan's points that lie on a line of the map.
    """

    pose: Floats
    information: Floats
    share: float


class _Pairs(NamedTuple):
    """
    Points and the lines that they are aligned with.

    :ivar near: indices of the points.
    :ivar across: x of the normals of their lines; ``up`` is y.
    :ivar offset: distance of those lines from the origin.
    """

    near: npt.NDArray[np.int64]
    across: Floats
    up: Floats
    offset: Floats


class SurfaceLines:
    """
    Points with normals, with which other points are aligned.

    :param points: shape (n, 2), in m, n > 0.
    :param normals: shape (n, 2).
    """

    def __init__(self, points: Floats, normals: Floats) -> None:
        from scipy.spatial import cKDTree  # slow to import, and used here only
        self.points, self.normals = points, normals
        self._offsets: Floats = (points * normals).sum(1)
        self._tree: Any = cKDTree(np.hstack((points, normals * _SIDE)), compact_nodes=False,
                                  balanced_tree=False)  # built often, queried seldom

    def align(self, points: Floats, start: Floats, prior: Floats | None = None,
              prior_information: Floats | None = None, gate_m: float = 0.4,
              normals: Floats | None = None) -> Aligned:
        """
        Align points, starting at a pose.

        :param points: shape (n, 2), in the frame of the pose.
        :param prior: a pose that is expected, with its information, shape (3, 3), in the units
            of :class:`Aligned`.
        :param gate_m: points further from every line are ignored, at first.
        :param normals: shape (n, 2), towards the laser; None or zeros: not known.
        """
        facing = np.zeros_like(points) if normals is None else normals
        has_side = np.hypot(facing[:, 0], facing[:, 1]) > _ALIKE
        views = np.hstack((points, facing * _SIDE))
        pose, found, errors = start.copy(), np.zeros((3, 3)), np.zeros(0)
        for _ in range(_STEPS_MOST):
            there = _moved(pose, views)
            # Lines are looked up in each step: fixed ones end a motion along a corridor early.
            pairs = self._pairs(there, has_side, gate_m)
            if len(pairs.near) < _POINTS_LEAST:
                return Aligned(pose, np.zeros((3, 3)), 0.0)
            gate_m = max(_GATE_LEAST_M, gate_m * 0.8)
            x, y = there[pairs.near, 0], there[pairs.near, 1]
            errors = pairs.across * x + pairs.up * y - pairs.offset
            weights = 1.0 / (1.0 + (errors / _SOFT_M) ** 2)
            jacobian = np.empty((3, len(x)))
            jacobian[0], jacobian[1] = pairs.across, pairs.up
            jacobian[2] = pairs.up * (x - pose[0]) - pairs.across * (y - pose[1])
            weighted = jacobian * weights
            found = weighted @ jacobian.T
            matrix, right = found + _LEAST, weighted @ errors
            if prior is not None and prior_information is not None:
                off = pose - prior
                off[2] = wrapped(off[2])
                matrix, right = matrix + prior_information, right + prior_information @ off
            step = -np.linalg.solve(matrix, right)
            pose = pose + step
            pose[2] = wrapped(pose[2])
            if np.abs(step).max() < _SMALL:
                break
        share = float((np.abs(errors) < _ON_LINE_M).sum() / len(points))
        return Aligned(pose, found, share)

    def far_from(self, points: Floats, far_m: float) -> int:
        """Return how many points have no line within a distance, on either side."""
        distances, _ = self._tree.query(np.hstack((points, np.zeros_like(points))),
                                        distance_upper_bound=np.hypot(far_m, _SIDE))
        return int(np.isinf(distances).sum())

    def _pairs(self, there: Floats, has_side: npt.NDArray[np.bool_], gate_m: float) -> _Pairs:
        """
        Return the points near a line that was seen from the same side.

        :param there: shape (n, 4): points, and normals in the tree's unit.
        """
        distances, nearest = self._tree.query(
            there, distance_upper_bound=np.hypot(gate_m, _FACING_M))
        near = np.flatnonzero(np.isfinite(distances))
        nearest = nearest[near]
        alike = (there[near, 2:] * self.normals[nearest]).sum(1) > _ALIKE * _SIDE
        kept = alike | ~has_side[near]
        nearest = nearest[kept]
        across, up = self.normals[nearest].T
        return _Pairs(near[kept], across, up, self._offsets[nearest])


def _moved(pose: Floats, views: Floats) -> Floats:
    """Return points with normals, shape (n, 4), of a pose's frame in the frame of the pose."""
    x, y, yaw = pose.tolist()
    cosine, sine = math.cos(yaw), math.sin(yaw)
    there: Floats = views @ np.array(((cosine, sine, 0.0, 0.0), (-sine, cosine, 0.0, 0.0),
                                      (0.0, 0.0, cosine, sine), (0.0, 0.0, -sine, cosine)))
    there += (x, y, 0.0, 0.0)
    return there
