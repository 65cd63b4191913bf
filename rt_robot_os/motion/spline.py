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

"""Cubic splines through points, as paths; and the legs of a path that has corners."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Final

import numpy as np

from rt_robot_os.motion.angles import wrapped
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.reference_path import Array
from rt_robot_os.motion.reference_path import Path
from rt_robot_os.motion.reference_path import PathError
from rt_robot_os.motion.reference_path import Point
from rt_robot_os.motion.reference_path import SAME_M
from rt_robot_os.motion.reference_path import sample_count
from rt_robot_os.motion.reference_path import straight

# A spline through points that lie close together follows their noise instead of the path.
_KNOTS_APART_M: Final = 0.1
_KNOTS_MAXIMUM: Final = 1000


def legs(poses: Sequence[Pose], corner_rad: float, shape: str = 'spline') -> list[Path]:
    """
    Make the paths between the places at which a robot must stop and turn.

    Not for the hot path; some milliseconds for a thousand poses.

    :param poses: checked ones. Their headings are ignored: planners often omit them, and the
        positions are what was found free.
    :return: empty when the poses lie closer together than a spline has knots.
    :param corner_rad: a sharper bend at a pose is a corner.
    :param shape: ``spline`` or ``line``, which has no curves but corners.
    """
    points = _knots([(x, y) for x, y, _ in poses])
    limit = corner_rad if shape == 'spline' else 1e-3
    found: list[Path] = []
    begin = 0
    headings = [math.atan2(b[1] - a[1], b[0] - a[0]) for a, b in zip(points, points[1:])]
    for i in range(1, len(points)):
        if i == len(points) - 1 or abs(wrapped(headings[i] - headings[i - 1])) > limit:
            leg = points[begin:i + 1]
            found.append(_through(leg) if shape == 'spline' else straight(leg[0], leg[-1]))
            begin = i
    return found


def spline(points: Sequence[Point], start_rad: float | None = None,
           end_rad: float | None = None) -> Path:
    """
    Make a cubic spline through points: its curvature has no steps.

    Two points with both headings make the cubic of Hermite between two poses.

    :param points: at least two; those that lie close together are merged.
    :param start_rad: its heading at the beginning; None leaves that to the points.
    :param end_rad: the same of its end.
    :raises PathError: all points are the same.
    """
    return _through(_knots(points), start_rad, end_rad)


def _through(knots: Sequence[Point], start_rad: float | None = None,
             end_rad: float | None = None) -> Path:
    if len(knots) < 2:
        raise PathError('a path of one point has no direction')
    if len(knots) == 2 and start_rad is None and end_rad is None:
        return straight(knots[0], knots[1])
    xy = np.array(knots)
    steps = np.hypot(*np.diff(xy, axis=0).T)
    ends = [None if a is None else np.array((math.cos(a), math.sin(a)))
            for a in (start_rad, end_rad)]
    bend = _second_derivatives(xy, steps, ends[0], ends[1])
    return _sampled(xy, steps, bend)


def _knots(points: Sequence[Point]) -> list[Point]:
    """
    Merge points that lie closer together than knots may; the first and the last stay.

    Points that are far enough from each other stay as they are.
    """
    total = sum(math.dist(a, b) for a, b in zip(points, points[1:]))
    apart = max(_KNOTS_APART_M, total / _KNOTS_MAXIMUM)
    start, end = points[0], points[-1]
    groups: list[list[Point]] = []
    for point in points[1:-1]:
        if groups and math.dist(point, groups[-1][0]) < apart:
            groups[-1].append(point)
        elif groups or math.dist(point, start) >= apart / 2:
            groups.append([point])
    kept = [start, *((sum(x for x, _ in group) / len(group), sum(y for _, y in group) / len(group))
                     for group in groups)]
    while len(kept) > 1 and math.dist(kept[-1], end) < apart / 2:
        kept.pop()
    return kept if math.dist(kept[-1], end) < SAME_M else [*kept, end]


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
    fine = np.linspace(0.0, knots[-1], 2 * sample_count(float(knots[-1])))
    speed = np.hypot(*_spline_at(xy, steps, bend, knots, fine)[1].T)
    # The length of each piece by the mean of its ends' speeds.
    along = np.concatenate(([0.0], np.cumsum(
        (speed[1:] + speed[:-1]) / 2 * (fine[1] - fine[0]))))
    length = float(along[-1])
    where = np.interp(np.linspace(0.0, length, sample_count(length)), along, fine)
    position, first, second = _spline_at(xy, steps, bend, knots, where)
    norm = np.maximum(np.hypot(first[:, 0], first[:, 1]), 1e-6)
    curvature = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / norm ** 3
    heading = np.unwrap(np.arctan2(first[:, 1], first[:, 0]))
    return Path(position[:, 0], position[:, 1], heading, curvature, length)


def _spline_at(xy: Array, steps: Array, bend: Array, knots: Array, where: Array
               ) -> tuple[Array, Array, Array]:
    """Return position, first and second derivative of a spline at values of its parameter."""
    i = np.clip(np.searchsorted(knots, where, side='right') - 1, 0, len(steps) - 1)
    h = steps[:, None]
    # Of each piece first, then of each value: there are fewer pieces.
    slopes = (np.diff(xy, axis=0) / h - h * (2 * bend[:-1] + bend[1:]) / 6)[i]
    thirds = (np.diff(bend, axis=0) / h)[i]
    seconds = bend[i]
    t = (where - knots[i])[:, None]
    half = t * thirds / 2
    return (xy[i] + t * (slopes + t * (seconds / 2 + half / 3)),
            slopes + t * (seconds + half), seconds + t * thirds)
