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
The overlap of a scan and a place, so that a short overlap is judged by its visible part.

A point of the scan that no keyframe of the place observed is no evidence: it lies behind what they
saw, outside their view, or where the laser has no echo. Observed points must be there; and the
points of the place must not lie where the scan sees through.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rt_robot_os.features.mapping.slam.keyframes import Keyframe
from rt_robot_os.features.mapping.slam.scan import Surface
from rt_robot_os.features.mapping.slam.sectors import ends_by_sector
from rt_robot_os.features.mapping.slam.sectors import furthest_by_sector
from rt_robot_os.features.mapping.slam.sectors import sector_of
from rt_robot_os.features.mapping.slam.sectors import seen_through
from rt_robot_os.features.mapping.slam.transforms import between
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.features.mapping.slam.transforms import placed


@dataclass(frozen=True)
class Overlap:
    """
    The part that is visible in both.

    :ivar visible: part of the scan's points that the place observed, 0 to 1.
    :ivar contradicted: part of the place's points in view of the scan that it sees through.
    """

    visible: float
    contradicted: float


def overlap_of(keyframes: Sequence[Keyframe], surface: Surface, pose: Floats) -> Overlap:
    """
    Return the overlap of a scan at a pose with some keyframes.

    :param keyframes: of the place, as they are on the map.
    :param pose: shape (3,): of the scan, on the map.
    """
    is_visible = np.zeros(len(surface), np.bool_)
    nearest, beyond = ends_by_sector(surface)
    in_view = through = 0
    for each in keyframes:
        if not len(each.surface):
            continue
        there = placed(between(each.pose, pose), surface.points)
        ranges = np.hypot(there[:, 0], there[:, 1])
        furthest = furthest_by_sector(each.surface)[sector_of(there)]
        is_visible |= (furthest > 0.0) & (ranges < seen_through(furthest))
        seen = placed(between(pose, each.pose), each.surface.points)
        sector, far = sector_of(seen), np.hypot(seen[:, 0], seen[:, 1])
        has_passed = beyond[sector] > seen_through(far)
        # Nothing behind the end of a beam is in view.
        in_view += int((has_passed | (seen_through(nearest[sector]) > far)
                        & np.isfinite(nearest[sector])).sum())
        through += int(has_passed.sum())
    return Overlap(float(is_visible.mean()) if len(surface) else 0.0,
                   through / in_view if in_view else 0.0)
