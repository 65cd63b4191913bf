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
Paths by their arc length: position, heading and curvature.

A path is made from poses outside of the control step, as samples at equal distances. A look-up
costs the same for any length.
"""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Any
from typing import Final
from typing import TypeAlias

import numpy as np

from rt_robot_os.motion.differential import Pose

Array: TypeAlias = 'np.ndarray[Any, np.dtype[np.float64]]'
Point: TypeAlias = tuple[float, float]

# Poses nearer to each other than this are the same one.
SAME_M: Final = 1e-3
# Longer paths are errors.
LENGTH_MAXIMUM_M: Final = 10_000.0
# Maps may be in coordinates of a country; nothing on earth is farther from its origin.
COORDINATE_MAXIMUM_M: Final = 1e8
_SPACING_M: Final = 0.02
_SAMPLES_MINIMUM: Final = 8
_SAMPLES_MAXIMUM: Final = 4000
# Samples of the search for the nearest point in one step.
_SEARCH_SAMPLES: Final = 200


class PathError(ValueError):
    """A path that cannot be driven; the text says why."""


class Path:
    """
    A path sampled by its arc length; look-ups are safe in the real-time loop.

    :param x: of the samples in m, at equal distances along the path; so are the next two.
    :param heading: in rad, not wrapped.
    :param curvature: in 1/m, positive to the left.
    :ivar length_m: from the first sample to the last.
    :ivar spacing_m: from sample to sample, along the path.
    """

    def __init__(self, x: Array, y: Array, heading: Array, curvature: Array, length_m: float
                 ) -> None:
        self.x: list[float] = x.tolist()
        self.y: list[float] = y.tolist()
        self.heading: list[float] = heading.tolist()
        self.curvature: list[float] = curvature.tolist()
        self.length_m = length_m
        self.last = len(self.x) - 1
        self.spacing_m = length_m / self.last
        self._per_m = 1.0 / self.spacing_m

    def at(self, along_m: float) -> tuple[float, float, float, float]:
        """Return x, y, heading and curvature at a length, clipped to the path."""
        place = along_m * self._per_m
        i = int(place)
        if place <= 0.0:
            i, part = 0, 0.0
        elif i >= self.last:
            i, part = self.last - 1, 1.0
        else:
            part = place - i
        rest = 1.0 - part
        x, y, heading, curvature = self.x, self.y, self.heading, self.curvature
        return (x[i] * rest + x[i + 1] * part, y[i] * rest + y[i + 1] * part,
                heading[i] * rest + heading[i + 1] * part,
                curvature[i] * rest + curvature[i + 1] * part)

    def nearest(self, x_m: float, y_m: float, near_m: float) -> float:
        """
        Return the length at the local minimum of the distance to a place.

        It searches along the path while the distance decreases: where a path crosses itself the
        search stays on its branch.

        :param near_m: where to start, usually the last result.
        """
        xs, ys, last = self.x, self.y, self.last
        i = min(last, max(0, round(near_m * self._per_m)))
        best = (xs[i] - x_m) ** 2 + (ys[i] - y_m) ** 2
        for step in (1, -1):
            for _ in range(_SEARCH_SAMPLES):
                j = i + step
                if not 0 <= j <= last:
                    break
                distance = (xs[j] - x_m) ** 2 + (ys[j] - y_m) ** 2
                if distance >= best:
                    break
                i, best = j, distance
        heading = self.heading[i]
        beyond = (x_m - xs[i]) * math.cos(heading) + (y_m - ys[i]) * math.sin(heading)
        half = self.spacing_m / 2
        beyond = half if beyond > half else -half if beyond < -half else beyond
        return min(self.length_m, max(0.0, i * self.spacing_m + beyond))

    def joined(self, x_m: float, y_m: float, within_m: float) -> float:
        """Return the length at the point nearest to a place, among the first metres."""
        count = min(self.last, int(within_m * self._per_m)) + 1
        distances = np.hypot(np.asarray(self.x[:count]) - x_m, np.asarray(self.y[:count]) - y_m)
        return self.nearest(x_m, y_m, int(np.argmin(distances)) * self.spacing_m)


def is_pose(pose: Pose) -> bool:
    """Return whether the numbers can be a pose on a map; a NaN cannot."""
    x, y, heading = pose
    return (abs(x) <= COORDINATE_MAXIMUM_M and abs(y) <= COORDINATE_MAXIMUM_M
            and math.isfinite(heading))


def checked(poses: Sequence[Pose]) -> list[Pose]:
    """
    Return the poses of a path without repeated ones.

    The heading of the last one stays. Not for the hot path.

    :raises PathError: it is empty, or has an invalid or too large number.
    """
    if not poses:
        raise PathError('path is empty')
    kept: list[Pose] = []
    length = 0.0
    for i, pose in enumerate(poses):
        if not is_pose(pose):
            raise PathError(f'pose {i} of {len(poses)} is no place: '
                            f'{", ".join(f"{each:g}" for each in pose)}')
        if kept:
            distance = math.hypot(pose[0] - kept[-1][0], pose[1] - kept[-1][1])
            if distance < SAME_M:
                if i == len(poses) - 1:
                    kept[-1] = (*kept[-1][:2], pose[2])
                continue
            length += distance
        if length > LENGTH_MAXIMUM_M:
            raise PathError(f'pose {i} of {len(poses)} is {length:g} m away along the path, at '
                            f'most {LENGTH_MAXIMUM_M:g}')
        kept.append(pose)
    return kept


def straight(start: Point, end: Point) -> Path:
    """
    Make a straight line.

    :raises PathError: the points are the same.
    """
    dx, dy = end[0] - start[0], end[1] - start[1]
    length = math.hypot(dx, dy)
    if length < SAME_M:
        raise PathError(f'a line of {length:g} m has no direction')
    count = sample_count(length)
    part = np.linspace(0.0, 1.0, count)
    return Path(start[0] + part * dx, start[1] + part * dy,
                np.full(count, math.atan2(dy, dx)), np.zeros(count), length)


def sample_count(length_m: float) -> int:
    """Return how many samples a path of a length has."""
    return 1 + min(_SAMPLES_MAXIMUM, max(_SAMPLES_MINIMUM, math.ceil(length_m / _SPACING_M)))
