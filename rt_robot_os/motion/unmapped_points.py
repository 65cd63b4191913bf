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
"""Points of scanners that a map does not have, and their clusters."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
import numpy.typing as npt

from rt_robot_os.motion.differential import Pose

Array = npt.NDArray[np.float64]


class HasWalls(Protocol):
    """A map that can find places near its walls."""

    def beside_wall(self, x: Array, y: Array, within_m: float) -> npt.NDArray[np.bool_]:
        """Return which places are this near to occupied cells, or off the map."""
        ...


def unmapped_points(chart: HasWalls, pose: Pose, x: Array, y: Array, tolerance_m: float
                    ) -> tuple[Array, Array]:
    """
    Return the points that the map does not have, in its frame; safe in the real-time loop.

    :param pose: of the robot on the map.
    :param x: of points in ``base_link``, in m.
    :param y: as x.
    :param tolerance_m: points this near to occupied cells are part of them.
    :return: x and y in m, in the order of the points.
    """
    x0, y0, yaw = pose
    cosine, sine = math.cos(yaw), math.sin(yaw)
    there_x = x0 + cosine * x - sine * y
    there_y = y0 + sine * x + cosine * y
    strange = ~chart.beside_wall(there_x, there_y, tolerance_m)
    return there_x[strange], there_y[strange]


def clusters(x: Array, y: Array, gap_m: float) -> list[tuple[Array, Array]]:
    """
    Split the points of one scan at gaps; safe in the real-time loop.

    :param x: in m, in the order in which the scanner turns.
    :param y: as x.
    :param gap_m: neighbours that are farther apart belong to different objects.
    :return: the points of each object, also of one at the beginning and end of a full turn.
    """
    if not x.size:
        return []
    # The distance of each point to the one before; of the first to the last.
    apart = np.flatnonzero(
        np.hypot(np.diff(x, prepend=x[-1]), np.diff(y, prepend=y[-1])) > gap_m)
    if not apart.size:
        return [(x, y)]
    first = int(apart[0])
    cuts = apart[1:] - first
    return list(zip(np.split(np.roll(x, -first), cuts), np.split(np.roll(y, -first), cuts)))
