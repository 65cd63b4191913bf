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
"""Prune the map: limit the keyframes at one place, and remove points that are gone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field
from dataclasses import replace
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.features.mapping.slam.keyframes import Keyframe
from rt_robot_os.features.mapping.slam.scan import Surface
from rt_robot_os.features.mapping.slam.sectors import ends_by_sector
from rt_robot_os.features.mapping.slam.sectors import sector_of
from rt_robot_os.features.mapping.slam.sectors import seen_through
from rt_robot_os.features.mapping.slam.transforms import between
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.features.mapping.slam.transforms import placed
from rt_robot_os.features.mapping.slam.transforms import wrapped
from rt_robot_os.features.mapping.slam.tuning import MapperTuning

_RAD_AS_M: Final = 0.5
#: A point is removed when this many scans in a row saw through it
_SEEN_THROUGH: Final = 5
#: from about the direction from which it was seen: glass is passed from other sides.
_SAME_SIDE_RAD: Final = float(np.radians(30.0))
#: It is confirmed by a beam that ends this near.
_THERE_M: Final = 0.15
#: Movement after which the next scan is compared.
_MOVED_M: Final = 0.2
_MOVED_RAD: Final = 0.2
#: Scans after which one of a standing robot is compared.
_STANDING: Final = 20
#: A keyframe with fewer points left is removed.
_POINTS_LEAST: Final = 20


def redundant_keyframes(keyframes: Sequence[Keyframe], index: int, tuning: MapperTuning
                        ) -> list[int]:
    """
    Return the keyframes to remove in favour of a new one, the last in the list first.

    :param index: of the new one.
    """
    poses = np.array([each.pose for each in keyframes])
    apart = np.hypot(*(poses[:, :2] - poses[index, :2]).T)
    gone: list[int] = []
    here = np.flatnonzero(apart < tuning.place_m)
    if len(here) > tuning.place_most:
        gone.append(_most_similar(poses, here, index))
    if len(keyframes) - len(gone) > tuning.keyframes_most:
        rest = np.setdiff1d(np.arange(len(keyframes)), gone)
        gone.append(_most_similar(poses, rest, index))
    return sorted(gone, reverse=True)


def _most_similar(poses: Floats, those: npt.NDArray[np.int64], index: int) -> int:
    """Return the older one of the two most similar keyframes."""
    from scipy.spatial import cKDTree
    yaw = poses[those, 2]
    arm = 2.0 * _RAD_AS_M
    views = np.column_stack((poses[those, :2], arm * np.cos(yaw), arm * np.sin(yaw)))
    distances, nearest = cKDTree(views).query(views, 2)
    for first in np.argsort(distances[:, 1], kind='stable').tolist():
        older = int(min(those[first], those[nearest[first, 1]]))
        if older != index and older > 0:
            return older
    return int(those[those != index][0])


@dataclass(frozen=True)
class RemovedGeometry:
    """
    What was removed from the map.

    :ivar points: number of removed points.
    :ivar keyframes: indices of those with too few points left.
    """

    points: int = 0
    keyframes: list[int] = field(default_factory=list)


class DynamicPointFilter:
    """Remove points that scans see through repeatedly, as of people and moved furniture."""

    def __init__(self) -> None:
        self._last_pose: Floats = np.full(3, np.inf)
        self._scans = 0

    def remove_seen_through(self, keyframes: list[Keyframe], members: Sequence[int], pose: Floats,
                            surface: Surface) -> RemovedGeometry:
        """
        Compare keyframes with a matched scan; remove points that are gone.

        :param keyframes: all; one that loses points is replaced.
        :param members: indices of the near ones.
        :param pose: shape (3,): of the scan.
        """
        self._scans += 1
        moved = float(np.hypot(*(pose[:2] - self._last_pose[:2])))
        turned = abs(float(wrapped(pose[2] - self._last_pose[2]))) if moved < np.inf else np.inf
        if moved < _MOVED_M and turned < _MOVED_RAD and self._scans < _STANDING:
            return RemovedGeometry()
        self._last_pose, self._scans = pose, 0
        nearest, beyond = ends_by_sector(surface)
        points, few = 0, []
        for index in members:
            keyframe = keyframes[index]
            doubts = _seen_through_counts(keyframe, pose, nearest, beyond)
            gone = doubts >= _SEEN_THROUGH
            if not gone.any():
                keyframe.doubts = doubts
                continue
            points += int(gone.sum())
            keyframes[index] = replace(keyframe, doubts=doubts[~gone],
                                       surface=_without(keyframe.surface, gone))
            if (~gone).sum() < _POINTS_LEAST:
                few.append(index)
        return RemovedGeometry(points, few)


def _seen_through_counts(keyframe: Keyframe, pose: Floats, nearest: Floats, beyond: Floats
                         ) -> npt.NDArray[np.uint8]:
    """Return how many scans in a row have seen through each point."""
    points = placed(between(pose, keyframe.pose), keyframe.surface.points)
    own = keyframe.surface.points
    ranges = np.hypot(points[:, 0], points[:, 1])
    sector = sector_of(points)
    off = np.abs(nearest[sector] - ranges)
    for shift in (-1, 1):
        off = np.minimum(off, np.abs(np.roll(nearest, shift)[sector] - ranges))
    turn = float(keyframe.pose[2] - pose[2])
    side = np.arctan2(points[:, 1], points[:, 0]) - np.arctan2(own[:, 1], own[:, 0]) - turn
    through = (beyond[sector] > seen_through(ranges)) & (
        np.abs(wrapped(side)) < _SAME_SIDE_RAD)
    doubts = np.zeros(len(points), np.uint8) if keyframe.doubts is None else keyframe.doubts
    doubts = np.where(off < _THERE_M, 0, doubts)
    return (doubts + through).astype(np.uint8)


def _without(surface: Surface, gone: npt.NDArray[np.bool_]) -> Surface:
    kept = ~gone
    return replace(surface, points=surface.points[kept], normals=surface.normals[kept],
                   lined=surface.lined[kept])
