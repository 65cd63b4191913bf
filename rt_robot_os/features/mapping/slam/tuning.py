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

"""The settings of a mapper, one set for all buildings."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MapperTuning:
    """
    The parameters of a mapper.

    :ivar range_max_m: longer beams are ignored.
    :ivar keyframe_m: after this distance, or
    :ivar keyframe_rad: this turn, a scan becomes a keyframe.
    :ivar keep_share: of the points on lines; a scan of which more lie on the map
    :ivar cover_m: this near to a keyframe does not become one.
    :ivar local_keyframes: number of recent ones in the local map,
    :ivar near_keyframes: and of those near the pose, if they are certain by the graph
    :ivar tied_m: to this standard deviation;
    :ivar place_tied_m: the same of the keyframes of a place at which a loop may be closed.
    :ivar place_most: maximum number of keyframes
    :ivar place_m: within this distance of each other,
    :ivar keyframes_most: and in all.
    :ivar trajectory_most: scans whose poses are stored.
    :ivar odometry_m: standard deviation of a step of odometry, and
    :ivar odometry_per_m: more for each metre of it;
    :ivar odometry_rad: of its turn, and
    :ivar odometry_per_rad: more for each radian.
    :ivar match_noise_m: standard deviation of a point of a scan on its line, with what points of
        one wall have in common.
    :ivar point_noise_m: the same, as far as it makes the pose of one scan uncertain.
    :ivar share_good: of the points on lines, from which a match is used unmodified;
    :ivar share_least: below it a match is rejected, and odometry is used.
    :ivar loop_apart_m: distance since a place was left, from which a return is a loop; a radian
        counts as half a metre.
    :ivar loop_reach_m: search radius for loops in addition to the uncertainty of the pose.
    :ivar loop_reach_most_m: its maximum.
    :ivar loop_share: of the points on lines, from which a loop is closed.
    :ivar loop_score: and the smallest score.
    :ivar loop_candidates: candidates that are tried for each keyframe.
    """

    range_max_m: float = 20.0
    keyframe_m: float = 0.3
    keyframe_rad: float = 0.2
    keep_share: float = 0.9
    cover_m: float = 1.0
    local_keyframes: int = 12
    near_keyframes: int = 6
    tied_m: float = 0.1
    place_tied_m: float = 0.3
    place_most: int = 8
    place_m: float = 0.5
    keyframes_most: int = 2000
    trajectory_most: int = 200_000
    odometry_m: float = 0.05
    odometry_per_m: float = 0.15
    odometry_rad: float = 0.05
    odometry_per_rad: float = 0.25
    match_noise_m: float = 0.1
    point_noise_m: float = 0.05
    share_good: float = 0.45
    share_least: float = 0.3
    loop_apart_m: float = 10.0
    loop_reach_m: float = 4.0
    loop_reach_most_m: float = 10.0
    loop_share: float = 0.6
    loop_score: float = 0.5
    loop_candidates: int = 3
