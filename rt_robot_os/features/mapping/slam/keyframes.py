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

"""Keyframes: the scans of a map, and the edges between them."""

from __future__ import annotations

from collections.abc import Generator
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.features.mapping.slam.alignment import Aligned
from rt_robot_os.features.mapping.slam.alignment import SurfaceLines
from rt_robot_os.features.mapping.slam.correlation import finished
from rt_robot_os.features.mapping.slam.correlation import fittings
from rt_robot_os.features.mapping.slam.correlation import SearchWindow
from rt_robot_os.features.mapping.slam.likelihood import LikelihoodField
from rt_robot_os.features.mapping.slam.pose_graph import PoseEdge
from rt_robot_os.features.mapping.slam.scan import Surface
from rt_robot_os.features.mapping.slam.transforms import between
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.features.mapping.slam.transforms import placed
from rt_robot_os.features.mapping.slam.transforms import rotation
from rt_robot_os.features.mapping.slam.transforms import wrapped

#: Largest difference between the alignment and the best match of the grid.
_NEAR_M: Final = 0.3
_NEAR_RAD: Final = 0.15
#: Points further from all others are new.
_UNKNOWN_M: Final = 0.3


@dataclass
class Keyframe:
    """
    A scan of the map.

    :ivar pose: shape (3,): of the laser, on the map.
    :ivar odometry: shape (3,).
    :ivar travelled_m: the distance driven until here, a radian counted as half a metre.
    :ivar doubts: shape (points,): how many scans in a row saw through each; None: none did.
    """

    stamp_ns: int
    pose: Floats
    odometry: Floats
    surface: Surface
    travelled_m: float
    doubts: npt.NDArray[np.uint8] | None = field(default=None, repr=False, compare=False)


@dataclass(frozen=True)
class Match:
    """
    The match of a scan with some keyframes.

    :ivar score: of the best match on the grid; 1 is perfect, 0 without a search.
    """

    aligned: Aligned
    score: float


class LocalMap:
    """
    Some keyframes as one point set.

    :ivar is_empty: none of them has a line.
    """

    def __init__(self, keyframes: Sequence[Keyframe]) -> None:
        points = [placed(each.pose, each.surface.points[each.surface.lined])
                  for each in keyframes]
        normals = [each.surface.normals[each.surface.lined] @ rotation(each.pose[2]).T
                   for each in keyframes]
        self._points, self._normals = np.concatenate(points), np.concatenate(normals)
        self.is_empty = len(self._points) == 0
        self._field: LikelihoodField | None = None
        self._lines: SurfaceLines | None = None

    @property
    def lines(self) -> SurfaceLines:
        """Return the points with their normals."""
        if self._lines is None:
            self._lines = SurfaceLines(self._points, self._normals)
        return self._lines

    @property
    def field(self) -> LikelihoodField:
        """Return the points as a grid."""
        if self._field is None:
            self._field = LikelihoodField(self._points)
        return self._field

    def unknown(self, surface: Surface, pose: Floats) -> int:
        """Return how many points of a scan at a pose are far from all lines."""
        return self.lines.far_from(placed(pose, surface.points), _UNKNOWN_M)

    def search(self, surface: Surface, window: SearchWindow, prior_information: Floats | None
               ) -> Match:
        """Search a scan in a window, then align it exactly."""
        return finished(self.searching(surface, window, prior_information))

    def searching(self, surface: Surface, window: SearchWindow, prior_information: Floats | None,
                  tries: int = 1, enough: float = 0.0) -> Generator[None, None, Match]:
        """
        Do as :meth:`search`, in pieces of some milliseconds.

        :param tries: number of the best matches to align, until one has
        :param enough: this share. The grid ignores the sides of walls, alignment does not.
        """
        field = self.field
        yield
        fits = yield from fittings(field, surface.points, window, tries)
        prior = None if prior_information is None else window.centre
        best: Match | None = None
        for pose, score in fits:
            yield
            aligned = self.lines.align(surface.points, pose, prior, prior_information,
                                       normals=surface.normals)
            off = aligned.pose - pose
            if np.hypot(off[0], off[1]) > _NEAR_M or abs(wrapped(off[2])) > _NEAR_RAD:
                aligned = Aligned(pose, aligned.information, aligned.share)
            if best is None or aligned.share > best.aligned.share:
                best = Match(aligned, score)
            if aligned.share >= enough:
                break
        assert best is not None
        return best


def edge_of(first: int, second: int, base: Floats, aligned: Aligned, noise_m: float,
            common: Floats, is_loop: bool = False) -> PoseEdge:
    """
    Return the edge of a match.

    :param base: the pose of the first keyframe.
    :param noise_m: of a point.
    :param common: shape (3,): standard deviations that more points do not lessen.
    """
    turn = np.eye(3)
    turn[:2, :2] = rotation(base[2]).T
    # Along a corridor a scan has little information, not none.
    information = turn @ (aligned.information / noise_m ** 2) @ turn.T + np.diag((1.0, 1.0, 1.0))
    covariance = np.linalg.inv(information) + np.diag(common ** 2)
    return PoseEdge(first, second, between(base, aligned.pose), np.linalg.inv(covariance), is_loop)
