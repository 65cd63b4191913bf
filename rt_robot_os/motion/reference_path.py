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
Paths by their arc length: where they lead, how they are turned and bent there.

A path is made from poses outside of the control step, as samples at equal distances. Looking
something up in it costs the same however long it is.
"""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Any
from typing import Final
from typing import TypeAlias

import numpy as np

from rt_robot_os.motion.angles import wrapped
from rt_robot_os.motion.differential import Pose

Array: TypeAlias = 'np.ndarray[Any, np.dtype[np.float64]]'
Point: TypeAlias = tuple[float, float]

# Poses nearer to each other than this are the same one.
SAME_M: Final = 1e-3
# Nobody drives farther in one go; beyond it numbers are mistakes.
LENGTH_MAXIMUM_M: Final = 10_000.0
_SPACING_M: Final = 0.02
_SAMPLES_MINIMUM: Final = 8
_SAMPLES_MAXIMUM: Final = 4000
# A spline through points that lie close together follows their noise instead of the way.
_KNOTS_APART_M: Final = 0.1
_KNOTS_MAXIMUM: Final = 1000
# How far the search for the nearest point goes in one step.
_SEARCH_SAMPLES: Final = 200


class PathError(ValueError):
    """A path that cannot be driven; the text says why."""


class Path:
    """
    A path sampled by its arc length; looking things up is safe in the real-time loop.

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
        """Return x, y, heading and curvature at a length, that of an end beyond it."""
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
        Return the length at the point that is nearest to a place, as seen from a length.

        From there it goes along the path as long as that leads nearer: where a path crosses
        itself the search stays on its branch.

        :param near_m: where to begin, usually what was found before.
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


def checked(poses: Sequence[Pose]) -> list[Pose]:
    """
    Return the poses of a path without those that repeat the one before.

    The heading of the last one stays. Not for the hot path.

    :raises PathError: there is none, or a number that is none or too large.
    """
    if not poses:
        raise PathError('path is empty')
    kept: list[Pose] = []
    length = 0.0
    for i, pose in enumerate(poses):
        if not all(map(math.isfinite, pose)):
            raise PathError(f'pose {i} of {len(poses)} is not a number: '
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
    count = _count(length)
    part = np.linspace(0.0, 1.0, count)
    return Path(start[0] + part * dx, start[1] + part * dy,
                np.full(count, math.atan2(dy, dx)), np.zeros(count), length)


def spline(points: Sequence[Point], start_rad: float | None = None,
           end_rad: float | None = None) -> Path:
    """
    Make a cubic spline through points: its curvature has no steps.

    Two points with both headings make the cubic of Hermite between two poses.

    :param points: at least two; of those that lie close together some are left out.
    :param start_rad: its heading at the beginning; None leaves that to the points.
    :param end_rad: the same of its end.
    :raises PathError: all points are the same.
    """
    xy = np.array(_knots(points))
    steps = np.hypot(*np.diff(xy, axis=0).T)
    if len(xy) < 2:
        raise PathError('a path of one point has no direction')
    if len(xy) == 2 and start_rad is None and end_rad is None:
        return straight(tuple(xy[0]), tuple(xy[1]))
    ends = [None if a is None else np.array((math.cos(a), math.sin(a)))
            for a in (start_rad, end_rad)]
    bend = _second_derivatives(xy, steps, ends[0], ends[1])
    return _sampled(xy, steps, bend)


def _count(length_m: float) -> int:
    return 1 + min(_SAMPLES_MAXIMUM, max(_SAMPLES_MINIMUM, math.ceil(length_m / _SPACING_M)))


def _knots(points: Sequence[Point]) -> list[Point]:
    """Leave out what lies closer than knots may; the first and the last point stay."""
    total = sum(math.hypot(b[0] - a[0], b[1] - a[1]) for a, b in zip(points, points[1:]))
    apart = max(_KNOTS_APART_M, total / _KNOTS_MAXIMUM)
    kept = [points[0]]
    for point in points[1:-1]:
        if math.hypot(point[0] - kept[-1][0], point[1] - kept[-1][1]) >= apart:
            kept.append(point)
    end = points[-1]
    if len(kept) > 1 and math.hypot(end[0] - kept[-1][0], end[1] - kept[-1][1]) < apart / 2:
        kept.pop()
    if math.hypot(end[0] - kept[-1][0], end[1] - kept[-1][1]) >= SAME_M:
        kept.append(end)
    return kept


def _second_derivatives(xy: Array, steps: Array, start: Array | None, end: Array | None
                        ) -> Array:
    """
    Solve for the second derivatives of the spline at its knots, the chord being the parameter.

    An end without heading is bent as its neighbour is, so that circles stay circles.
    Source: the tridiagonal system of cubic splines, solved after Thomas.
    """
    n = len(xy)
    slopes = np.diff(xy, axis=0) / steps[:, None]
    below, main, above = [0.0] * n, [1.0] * n, [0.0] * n
    right = np.zeros((n, 2))
    for i in range(1, n - 1):
        below[i], main[i], above[i] = steps[i - 1], 2 * (steps[i - 1] + steps[i]), steps[i]
    right[1:-1] = 6 * np.diff(slopes, axis=0)
    if start is None:
        above[0] = -1.0
    else:
        main[0], above[0] = 2 * steps[0], steps[0]
        right[0] = 6 * (slopes[0] - start)
    if end is None:
        below[-1] = -1.0
    else:
        below[-1], main[-1] = steps[-1], 2 * steps[-1]
        right[-1] = 6 * (end - slopes[-1])
    if n == 2 and (start is None or end is None):
        # One cubic with one heading: its free end is not bent.
        below[-1] = below[-1] if start is None else 0.0
        above[0] = above[0] if end is None else 0.0
    columns = [right[:, 0].tolist(), right[:, 1].tolist()]
    for i in range(1, n):
        factor = below[i] / main[i - 1]
        main[i] -= factor * above[i - 1]
        for column in columns:
            column[i] -= factor * column[i - 1]
    for column in columns:
        column[-1] /= main[-1]
        for i in range(n - 2, -1, -1):
            column[i] = (column[i] - above[i] * column[i + 1]) / main[i]
    return np.array(columns).T


def _sampled(xy: Array, steps: Array, bend: Array) -> Path:
    """Sample a spline at equal distances along itself."""
    knots = np.concatenate(([0.0], np.cumsum(steps)))
    fine = np.linspace(0.0, knots[-1], 4 * _count(float(knots[-1])))
    speed = np.hypot(*_spline_at(xy, steps, bend, knots, fine)[1].T)
    # The length of each piece by the mean of its ends' speeds.
    along = np.concatenate(([0.0], np.cumsum(
        (speed[1:] + speed[:-1]) / 2 * (fine[1] - fine[0]))))
    length = float(along[-1])
    where = np.interp(np.linspace(0.0, length, _count(length)), along, fine)
    position, first, second = _spline_at(xy, steps, bend, knots, where)
    norm = np.maximum(np.hypot(first[:, 0], first[:, 1]), 1e-6)
    curvature = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / norm ** 3
    heading = np.unwrap(np.arctan2(first[:, 1], first[:, 0]))
    return Path(position[:, 0], position[:, 1], heading, curvature, length)


def _spline_at(xy: Array, steps: Array, bend: Array, knots: Array, where: Array
               ) -> tuple[Array, Array, Array]:
    """Return position, first and second derivative of a spline at values of its parameter."""
    i = np.clip(np.searchsorted(knots, where, side='right') - 1, 0, len(steps) - 1)
    h = steps[i][:, None]
    t = (where - knots[i])[:, None]
    slope = (xy[i + 1] - xy[i]) / h - h * (2 * bend[i] + bend[i + 1]) / 6
    third = (bend[i + 1] - bend[i]) / h
    return (xy[i] + t * (slope + t * (bend[i] / 2 + t * third / 6)),
            slope + t * (bend[i] + t * third / 2), bend[i] + t * third)


def legs(poses: Sequence[Pose], corner_rad: float, shape: str = 'spline') -> list[Path]:
    """
    Make the paths between the places at which a robot has to stop and turn.

    Not for the hot path; some milliseconds for a thousand poses.

    :param poses: checked ones, at least two. Their headings do not count: planners often leave
        them out, and the way is what was found free.
    :param corner_rad: a sharper bend at a pose is a corner.
    :param shape: ``spline`` or ``line``, which has no curves but corners.
    """
    points = [(x, y) for x, y, _ in poses]
    limit = corner_rad if shape == 'spline' else 1e-3
    found: list[Path] = []
    begin = 0
    headings = [math.atan2(b[1] - a[1], b[0] - a[0]) for a, b in zip(points, points[1:])]
    for i in range(1, len(points)):
        if i == len(points) - 1 or abs(wrapped(headings[i] - headings[i - 1])) > limit:
            leg = points[begin:i + 1]
            found.append(spline(leg) if shape == 'spline' else straight(leg[0], leg[-1]))
            begin = i
    return found
