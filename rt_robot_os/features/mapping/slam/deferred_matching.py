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
Match scans again that matched nothing when they came, once their surroundings are mapped.

A robot that turns towards unmapped ground without odometry sees nothing that is on the map. Its
scan gets the pose of odometry; the scans after it show where it was.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Final

import numpy as np

from rt_robot_os.features.mapping.slam.keyframes import Keyframe
from rt_robot_os.features.mapping.slam.keyframes import LocalMap
from rt_robot_os.features.mapping.slam.matching import Matcher
from rt_robot_os.features.mapping.slam.scan import Surface
from rt_robot_os.features.mapping.slam.trajectory import ScanTrajectory
from rt_robot_os.features.mapping.slam.transforms import between

#: Scans that are stored: the last ones.
_MOST: Final = 200
#: Keyframes of the local map at most, and their distance.
_AROUND: Final = 12
_AROUND_M: Final = 5.0


class DeferredMatching:
    """Unmatched scans that are not part of the map."""

    def __init__(self) -> None:
        self._scans: deque[tuple[int, Surface]] = deque(maxlen=_MOST)

    def add(self, number: int, surface: Surface) -> None:
        """Store a scan, by its number in the trajectory from the first scan ever."""
        if len(surface):
            self._scans.append((number, surface))

    def match_again(self, keyframes: Sequence[Keyframe], track: ScanTrajectory, matcher: Matcher
                    ) -> int:
        """
        Move scans to where they match now; those without a unique match stay.

        :return: how many were matched.
        """
        known = [each.pose for each in keyframes]
        poses, seen_at = np.array(known), track.poses(known)
        count = 0
        for number, surface in self._scans:
            place = number - track.forgotten
            if place < 0:
                continue
            apart = np.hypot(*(poses[:, :2] - seen_at[place, :2]).T)
            nearest = np.argsort(apart, kind='stable')[:_AROUND]
            around = [keyframes[each] for each in nearest[apart[nearest] < _AROUND_M].tolist()]
            local = LocalMap(around) if around else None
            match = None if local is None or local.is_empty else matcher.turned(
                local, surface, seen_at[place])
            if match is not None:
                count += 1
                track.put(place, int(nearest[0]), between(around[0].pose, match.aligned.pose))
        self._scans.clear()
        return count
