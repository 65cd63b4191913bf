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
"""The edges that connect a new keyframe to the map."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from rt_robot_os.features.mapping.slam.keyframes import edge_of
from rt_robot_os.features.mapping.slam.keyframes import Keyframe
from rt_robot_os.features.mapping.slam.keyframes import Match
from rt_robot_os.features.mapping.slam.matching import OdometryDelta
from rt_robot_os.features.mapping.slam.matching import prior_of
from rt_robot_os.features.mapping.slam.pose_graph import PoseEdge
from rt_robot_os.features.mapping.slam.transforms import between
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.features.mapping.slam.tuning import MapperTuning

_COMMON: Final = np.array((0.02, 0.02, 0.004))


def edges_of_match(keyframes: Sequence[Keyframe], bases: Iterable[int], match: Match,
                   way: OdometryDelta,
                   tuning: MapperTuning) -> list[PoseEdge]:
    """
    Return edges from the match, and from odometry in directions that the match leaves open.

    :param bases: keyframes with which it was matched; it becomes the one after the last.
    :param way: odometry since the last match.
    """
    known = replace(match.aligned, information=match.aligned.information
                    + prior_of(way.sigmas(tuning), tuning))
    return [edge_of(base, len(keyframes), keyframes[base].pose, known, tuning.match_noise_m,
                    _COMMON) for base in bases]


def edge_of_odometry(keyframes: Sequence[Keyframe], base: int, pose: Floats, way: OdometryDelta
                     ) -> PoseEdge:
    """
    Return the edge of an unmatched scan to the keyframe of the last match.

    :param pose: shape (3,): its pose by odometry.
    """
    sigmas = np.array((0.1 + 0.1 * way.way_m, 0.1 + 0.1 * way.way_m, 0.03 + 0.05 * way.turn_rad))
    return PoseEdge(base, len(keyframes), between(keyframes[base].pose, pose),
                    np.diag(sigmas ** -2))
