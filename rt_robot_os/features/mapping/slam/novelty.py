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
"""Whether a scan has content that is new to the map."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from rt_robot_os.features.mapping.slam.keyframes import Keyframe
from rt_robot_os.features.mapping.slam.keyframes import Match
from rt_robot_os.features.mapping.slam.transforms import between
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.features.mapping.slam.tuning import MapperTuning

#: Share of new points, and scans in a row with it, that make a novelty: people who walk by do not.
_NEW_SHARE: Final = 0.04
_NEW_SCANS: Final = 8
#: Keyframes without new content that are added at a known place: a single loop may be wrong.
_AGAIN: Final = 6


class Novelty:
    """
    The new content of recent scans.

    :param keyframes: of the map, a live list.
    """

    def __init__(self, keyframes: Sequence[Keyframe], tuning: MapperTuning) -> None:
        self._keyframes, self._tuning = keyframes, tuning
        self._news = 0  # scans in a row with new points
        self._again = 0  # keyframes added since the robot is at a known place

    def mark_known(self) -> None:
        """Record that the robot is certainly at a known place."""
        self._again = _AGAIN

    def record_match(self, unknown: int, points: int) -> None:
        """
        Record a matched scan.

        :param unknown: number of its ``points`` that are far from the map.
        """
        self._news = self._news + 1 if unknown > _NEW_SHARE * points else 0

    def is_novel(self, match: Match | None, pose: Floats, near: list[int], travelled_m: float
                 ) -> bool:
        """
        Return whether a scan should become a keyframe.

        :param match: None without one.
        :param pose: shape (3,): of the scan.
        :param near: the keyframes with which it was matched; for an unmatched one that to which it
            would be connected.
        :param travelled_m: the distance driven until now.
        """
        t = self._tuning
        recent = [index for index in near if not self._is_old(index, travelled_m)]
        is_back = len(recent) < len(near)
        if not is_back:
            self._again = 0
        elif self._again < _AGAIN:
            near = recent or [len(self._keyframes) - 1]
        apart = between(np.broadcast_to(pose, (len(near), 3)),
                        np.array([self._keyframes[index].pose for index in near]))
        far, turned = np.hypot(apart[:, 0], apart[:, 1]), np.abs(apart[:, 2])
        if ((far <= t.keyframe_m) & (turned <= t.keyframe_rad)).any():
            return False
        if match is None or is_back and self._again < _AGAIN:
            return True
        return (match.aligned.share < t.keep_share or self._news >= _NEW_SCANS
                or bool(far.min() > t.cover_m))

    def record_keyframe(self, members: Sequence[int], travelled_m: float) -> None:
        """
        Record a new keyframe.

        :param members: keyframes of the local map.
        """
        self._again += any(self._is_old(each, travelled_m) for each in members)
        self._news = 0

    def _is_old(self, index: int, travelled_m: float) -> bool:
        """Return whether a keyframe is of another visit to this place."""
        return travelled_m - self._keyframes[index].travelled_m > self._tuning.loop_apart_m
