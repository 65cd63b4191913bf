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
Pose graph optimisation: Gauss-Newton on sparse constraints between poses.

G. Grisetti and others, A tutorial on graph-based SLAM, 2010. The edges of loops are robust: an
inconsistent one loses its weight (Cauchy) instead of bending the map. So are absolute poses, of
which a wrong one has still less weight (Geman and McClure), as they are independent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from operator import is_
from typing import Any
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.features.mapping.slam.transforms import between
from rt_robot_os.features.mapping.slam.transforms import composed
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.features.mapping.slam.transforms import moved_by
from rt_robot_os.features.mapping.slam.transforms import wrapped

_SMALL: Final = 1e-4
#: Squared error, in variances, at which the edge of a loop has half the weight.
_SOFT_CHI2: Final = 9.0
#: Squared error up to which an absolute pose is consistent, when the whole map is aligned.
_CONSISTENT_CHI2: Final = 16.0
#: Absolute poses that can move a whole map, and those of them that are tried.
_FIXES_MOVE: Final = 3
_TRIED_MOST: Final = 50
#: Information that holds the first pose if there are absolute ones: nearly none.
_HELD: Final = np.diag((1e-2, 1e-2, 1e-2))


@dataclass(frozen=True)
class PoseEdge:
    """
    A constraint between two poses.

    :ivar first: index of a pose; ``second`` is at ``relative`` in its frame.
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
class AbsolutePose:
    """
    An absolute constraint of a pose: an edge from the origin.

    :ivar keyframe: index of the pose.
    :ivar pose: shape (3,): on the map.
    :ivar information: shape (3, 3): the inverse of the covariance, along the axes of the map.
    """

    keyframe: int
    pose: Floats
    information: Floats


@dataclass(frozen=True)
class OptimisedPoses:
    """
    The result of an optimisation.

    :ivar poses: shape (n, 3); without absolute poses the first is unchanged.
    :ivar weights: shape (edges,): robust weight of each edge; 1 for all but those of loops.
    :ivar fix_weights: shape (fixes,).
    :ivar step: largest movement of a pose in the last step, in m or rad.
    """

    poses: Floats
    weights: Floats
    fix_weights: Floats
    step: float = 0.0


class PoseEdges:
    """
    Edges as arrays.

    :ivar first: shape (edges,), as ``second`` and ``is_loop``.
    :ivar relative: shape (edges, 3).
    :ivar information: shape (edges, 3, 3), as its inverse, ``covariances``.
    """

    first: npt.NDArray[np.int64]
    second: npt.NDArray[np.int64]
    is_loop: npt.NDArray[np.bool_]
    relative: Floats
    information: Floats
    covariances: Floats

    def __init__(self, edges: Sequence[PoseEdge] = ()) -> None:
        self._clear()
        self.update(edges)

    def _clear(self) -> None:
        self._edges: list[PoseEdge] = []
        self.first, self.second = np.zeros(0, np.int64), np.zeros(0, np.int64)
        self.is_loop, self.relative = np.zeros(0, np.bool_), np.zeros((0, 3))
        self.information = self.covariances = np.zeros((0, 3, 3))

    def __len__(self) -> int:
        return len(self._edges)

    def update(self, edges: Sequence[PoseEdge]) -> None:
        """Replace the edges; if they start with the present ones, only the rest is read."""
        if len(edges) < len(self) or not all(map(is_, self._edges, edges)):
            self._clear()
        new = edges[len(self):]
        if not new:
            return
        information = np.array([each.information for each in new])
        self._edges.extend(new)
        self.first = np.append(self.first, [each.first for each in new])
        self.second = np.append(self.second, [each.second for each in new])
        self.is_loop = np.append(self.is_loop, [each.is_loop for each in new])
        self.relative = np.concatenate((self.relative, [each.relative for each in new]))
        self.information = np.concatenate((self.information, information))
        self.covariances = np.concatenate((self.covariances, np.linalg.inv(information)))

    def errors(self, poses: Floats) -> tuple[Floats, Floats]:
        """Return the errors of poses on the edges, and the weight of each edge."""
        errors = between(poses[self.first], poses[self.second]) - self.relative
        errors[:, 2] = wrapped(errors[:, 2])
        chi2 = np.einsum('ni,nij,nj->n', errors, self.information, errors)
        return errors, np.where(self.is_loop, 1.0 / (1.0 + chi2 / _SOFT_CHI2), 1.0)


def optimise(poses: Floats, edges: Sequence[PoseEdge] | PoseEdges, steps: int = 10,
             fixes: Sequence[AbsolutePose] = (),
             small: float = _SMALL) -> OptimisedPoses:
    """
    Optimise poses for a set of edges.

    :param poses: shape (n, 3); each is connected to the first over edges.
    :param steps: maximum number.
    :param fixes: absolute poses. If most of them contradict the map, and are consistent with each
        other, the map is moved as a whole first.
    :param small: a step that moves no pose by more, in m or rad, is the last.
    """
    known = edges if isinstance(edges, PoseEdges) else PoseEdges(edges)
    poses, weights = _aligned_with_most(poses, fixes), np.ones(len(edges))
    absolute = _AbsolutePoses(fixes)
    moved = 0.0
    for _ in range(steps if len(poses) > 1 and len(edges) or fixes else 0):
        errors, weights = known.errors(poses)
        step = _solve(poses, (known.first, known.second), errors,
                      known.information * weights[:, None, None], absolute)
        poses += step
        poses[:, 2] = wrapped(poses[:, 2])
        moved = float(np.abs(step).max())
        if moved < small:
            break
    return OptimisedPoses(poses, weights, absolute.weights, moved)


class _AbsolutePoses:
    """Absolute poses as arrays."""

    def __init__(self, fixes: Sequence[AbsolutePose]) -> None:
        self.at = np.array([each.keyframe for each in fixes], dtype=np.int64)
        self.poses = np.array([each.pose for each in fixes]).reshape(-1, 3)
        self.information = np.array([each.information for each in fixes]).reshape(-1, 3, 3)
        self.weights = np.ones(len(self.at))

    def errors(self, poses: Floats) -> tuple[Floats, Floats]:
        """Return the errors of poses, and their squares in variances."""
        errors = poses[self.at] - self.poses
        errors[:, 2] = wrapped(errors[:, 2])
        return errors, np.einsum('ni,nij,nj->n', errors, self.information, errors)


def _aligned_with_most(poses: Floats, fixes: Sequence[AbsolutePose]) -> Floats:
    """Move the whole map to the position of most absolute poses, if that is elsewhere."""
    if len(fixes) < _FIXES_MOVE:
        return poses.copy()
    absolute = _AbsolutePoses(fixes)
    most = int((absolute.errors(poses)[1] < _CONSISTENT_CHI2).sum())
    if 2 * most >= len(fixes):
        return poses.copy()
    best = poses
    for fix in fixes[::-(-len(fixes) // _TRIED_MOST)]:
        movement = moved_by(poses[fix.keyframe], fix.pose)
        there = composed(np.broadcast_to(movement, poses.shape), poses)
        agreeing = int((absolute.errors(there)[1] < _CONSISTENT_CHI2).sum())
        if agreeing > most and 2 * agreeing > len(fixes):
            best, most = there, agreeing
    return best.copy()


def _solve(poses: Floats, ends: tuple[Any, Any], errors: Floats, information: Floats,
           absolute: _AbsolutePoses) -> Floats:
    """Return the step of all poses; shape (n, 3)."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.linalg import splu
    first, second = ends
    of_first, of_second = _jacobians(poses, first, second)
    left = np.swapaxes(of_first, 1, 2) @ information
    right = np.swapaxes(of_second, 1, 2) @ information
    gradient = np.zeros((len(poses), 3))
    np.add.at(gradient, first, np.einsum('nij,nj->ni', left, errors))
    np.add.at(gradient, second, np.einsum('nij,nj->ni', right, errors))
    blocks = [(first, first, left @ of_first), (first, second, left @ of_second),
              (second, first, right @ of_first), (second, second, right @ of_second)]
    if len(absolute.at):
        off, chi2 = absolute.errors(poses)
        absolute.weights = 1.0 / (1.0 + chi2 / _SOFT_CHI2) ** 2
        held = absolute.information * absolute.weights[:, None, None]
        np.add.at(gradient, absolute.at, np.einsum('nij,nj->ni', held, off))
        blocks += [(absolute.at, absolute.at, held), (np.zeros(1, np.int64),) * 2 + (_HELD[None],)]
    three = np.arange(3)
    rows = [np.broadcast_to((a[:, None] * 3 + three)[:, :, None], m.shape) for a, _, m in blocks]
    columns = [np.broadcast_to((b[:, None] * 3 + three)[:, None, :], m.shape)
               for _, b, m in blocks]
    size = 3 * len(poses)
    matrix = coo_matrix(
        (np.concatenate([m.ravel() for _, _, m in blocks]),
         (np.concatenate([each.ravel() for each in rows]),
          np.concatenate([each.ravel() for each in columns]))), (size, size)).tocsc()
    free = 0 if len(absolute.at) else 3  # without absolute poses the first is fixed
    step = np.zeros(size)
    step[free:] = splu(matrix[free:, free:], permc_spec='MMD_AT_PLUS_A', diag_pivot_thresh=0.0,
                       options={'SymmetricMode': True}).solve(-gradient.ravel()[free:])
    return step.reshape(-1, 3)


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
