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

"""Poses of the plane as arrays ``(x, y, yaw)`` in m and rad, many at once."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def wrapped(angles: Floats) -> Floats:
    """Return angles in [-pi, pi)."""
    turns: Floats = (angles + np.pi) % (2.0 * np.pi) - np.pi
    return turns


def composed(first: Floats, second: Floats) -> Floats:
    """
    Compose poses: return the second, given in the frames of the first, in the outer frame.

    :param first: shape (..., 3), as the second.
    """
    cosine, sine = np.cos(first[..., 2]), np.sin(first[..., 2])
    return np.stack((first[..., 0] + cosine * second[..., 0] - sine * second[..., 1],
                     first[..., 1] + sine * second[..., 0] + cosine * second[..., 1],
                     wrapped(first[..., 2] + second[..., 2])), -1)


def between(first: Floats, second: Floats) -> Floats:
    """
    Return the second poses in the frames of the first: the inverse of ``composed``.

    :param first: shape (..., 3), as the second.
    """
    cosine, sine = np.cos(first[..., 2]), np.sin(first[..., 2])
    x, y = second[..., 0] - first[..., 0], second[..., 1] - first[..., 1]
    return np.stack((cosine * x + sine * y, cosine * y - sine * x,
                     wrapped(second[..., 2] - first[..., 2])), -1)


def moved_by(before: Floats, after: Floats) -> Floats:
    """
    Return the movement of a whole map that brings one pose on it to another; shape (3,).

    ``composed(moved_by(before, after), before)`` is ``after``.

    :param before: shape (3,), as after.
    """
    turn = float(wrapped(after[2] - before[2]))
    x, y = after[:2] - rotation(turn) @ before[:2]
    return np.array((x, y, turn))


def rotation(yaw: float) -> Floats:
    """Return the matrix that turns column vectors; shape (2, 2)."""
    cosine, sine = np.cos(yaw), np.sin(yaw)
    return np.array(((cosine, -sine), (sine, cosine)))


def placed(pose: Floats, points: Floats) -> Floats:
    """
    Return points of a robot's frame in the frame of its pose.

    :param pose: shape (3,).
    :param points: shape (n, 2), in m; so is what is returned.
    """
    turned: Floats = points @ rotation(pose[2]).T + pose[:2]
    return turned
