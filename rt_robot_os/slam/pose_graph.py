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
Poses and what is known between them, put into agreement: Gauss-Newton on a sparse graph.

G. Grisetti and others, A tutorial on graph-based SLAM, 2010. The edges of loops are robust: one
that no others agree with loses its weight (Cauchy) instead of bending the map.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from typing import Final

import numpy as np

from rt_robot_os.slam.transforms import between
from rt_robot_os.slam.transforms import Floats
from rt_robot_os.slam.transforms import wrapped

_SMALL: Final = 1e-4
#: Squared error, in variances, at which the edge of a loop counts half.
_SOFT_CHI2: Final = 9.0


@dataclass(frozen=True)
class Edge:
    """
    What is known between two poses.

    :ivar first: index of a pose; ``second`` is in its frame at ``relative``.
    :ivar relative: shape (3,).
    :ivar information: shape (3, 3): the inverse of the covariance, in the frame of the first.
    :ivar is_loop: it may be wrong.
    """

    first: int
    second: int
    relative: Floats
    information: Floats
    is_loop: bool = False


@dataclass(frozen=True)
class Agreement:
    """
    The poses at which all edges agree best.

    :ivar poses: shape (n, 3); the first is where it was.
    :ivar weights: shape (edges,): how much each edge counts; 1 for all but those of loops.
    """

    poses: Floats
    weights: Floats


def agree(poses: Floats, edges: Sequence[Edge], steps: int = 10) -> Agreement:
    """
    Move poses so that edges agree.

    :param poses: shape (n, 3); each is joined to the first over edges.
    :param steps: the most.
    """
    first = np.array([each.first for each in edges])
    second = np.array([each.second for each in edges])
    relative = np.array([each.relative for each in edges]).reshape(-1, 3)
    information = np.array([each.information for each in edges]).reshape(-1, 3, 3)
    is_loop = np.array([each.is_loop for each in edges], dtype=np.bool_)
    poses, weights = poses.copy(), np.ones(len(edges))
    for _ in range(steps if len(edges) and len(poses) > 1 else 0):
        errors = between(poses[first], poses[second]) - relative
        errors[:, 2] = wrapped(errors[:, 2])
        chi2 = np.einsum('ni,nij,nj->n', errors, information, errors)
        weights = np.where(is_loop, 1.0 / (1.0 + chi2 / _SOFT_CHI2), 1.0)
        step = _solve(poses, first, second, errors, information * weights[:, None, None])
        poses[1:] += step
        poses[:, 2] = wrapped(poses[:, 2])
        if np.abs(step).max() < _SMALL:
            break
    return Agreement(poses, weights)


def _solve(poses: Floats, first: Any, second: Any, errors: Floats, information: Floats) -> Floats:
    """Return the step of all poses but the first; shape (n - 1, 3)."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.linalg import spsolve
    of_first, of_second = _jacobians(poses, first, second)
    left = np.swapaxes(of_first, 1, 2) @ information
    right = np.swapaxes(of_second, 1, 2) @ information
    blocks = [(first, first, left @ of_first), (first, second, left @ of_second),
              (second, first, right @ of_first), (second, second, right @ of_second)]
    three = np.arange(3)
    rows = [np.broadcast_to((a[:, None] * 3 + three)[:, :, None], m.shape) for a, _, m in blocks]
    columns = [np.broadcast_to((b[:, None] * 3 + three)[:, None, :], m.shape)
               for _, b, m in blocks]
    size = 3 * len(poses)
    matrix = coo_matrix(
        (np.concatenate([m.ravel() for _, _, m in blocks]),
         (np.concatenate([each.ravel() for each in rows]),
          np.concatenate([each.ravel() for each in columns]))), (size, size)).tocsc()
    gradient = np.zeros((len(poses), 3))
    np.add.at(gradient, first, np.einsum('nij,nj->ni', left, errors))
    np.add.at(gradient, second, np.einsum('nij,nj->ni', right, errors))
    step: Floats = spsolve(matrix[3:, 3:], -gradient.ravel()[3:]).reshape(-1, 3)
    return step


def _jacobians(poses: Floats, first: Any, second: Any) -> tuple[Floats, Floats]:
    cosine, sine = np.cos(poses[first, 2]), np.sin(poses[first, 2])
    local = between(poses[first], poses[second])
    of_first, of_second = np.zeros((len(first), 3, 3)), np.zeros((len(first), 3, 3))
    of_second[:, 0, 0], of_second[:, 0, 1] = cosine, sine
    of_second[:, 1, 0], of_second[:, 1, 1] = -sine, cosine
    of_second[:, 2, 2] = 1.0
    of_first[:, :2, :2] = -of_second[:, :2, :2]
    of_first[:, 0, 2], of_first[:, 1, 2] = local[:, 1], -local[:, 0]
    of_first[:, 2, 2] = -1.0
    return of_first, of_second
