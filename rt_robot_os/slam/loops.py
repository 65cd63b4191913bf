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
Notice that a place was seen before: loops, which take back what the way has summed up.

How far the pose may be wrong, seen from an older keyframe, is the sum over the best known way
through the graph between them. That is how far around is looked, and in how large a window.
"""

from __future__ import annotations

from collections.abc import Generator
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from rt_robot_os.slam.correlation import Window
from rt_robot_os.slam.keyframes import edge_of
from rt_robot_os.slam.keyframes import Keyframe
from rt_robot_os.slam.keyframes import LocalMap
from rt_robot_os.slam.pose_graph import Edge
from rt_robot_os.slam.surroundings import Surroundings
from rt_robot_os.slam.transforms import Floats
from rt_robot_os.slam.tuning import Tuning

#: Keyframes that make up a place at most, and how far from the nearest.
_PLACE: Final = 13
_PLACE_M: Final = 5.0
#: A direction of which a scan says less than this part of the other is not known by it.
_ONE_WAY: Final = 0.05
_LOOP_COMMON: Final = np.array((0.03, 0.03, 0.008))
_WINDOW_MOST_M: Final = 8.0
#: A loop that would move the robot further than this has to fit better: rooms look alike.
_FAR_M: Final = 1.5
_FAR_SHARE: Final = 0.7
_FAR_SCORE: Final = 0.6
_WINDOW_MOST_RAD: Final = float(np.radians(30.0))


@dataclass(frozen=True)
class Place:
    """
    Keyframes that may be where the robot is.

    :ivar keyframe: the one that was kept there.
    :ivar nearest: the keyframe to which an edge would go.
    :ivar members: those around it.
    :ivar sigma_m: how far the pose may be wrong, seen from there; sigma_rad its angle.
    """

    keyframe: int
    nearest: int
    members: tuple[int, ...]
    sigma_m: float
    sigma_rad: float


def places_near(around: Surroundings, index: int, tuning: Tuning) -> list[Place]:
    """
    Return where a keyframe may be as well, the nearest first.

    :param around: the graph as it is now.
    :param index: of the keyframe.
    """
    here = around.poses[index]
    travelled = around.travelled_m
    old = np.flatnonzero(travelled[index] - travelled > tuning.loop_apart_m)
    distances = np.hypot(around.poses[old, 0] - here[0], around.poses[old, 1] - here[1])
    if not len(old) or distances.min() > tuning.loop_reach_most_m:
        return []
    sigma_m, sigma_rad = around.spread(index)
    reach = np.minimum(tuning.loop_reach_m + 2.0 * sigma_m[old], tuning.loop_reach_most_m)
    near = old[distances < reach]
    near = near[np.argsort(distances[distances < reach], kind='stable')]
    found: list[Place] = []
    while len(near) and len(found) < tuning.loop_candidates:
        nearest = int(near[0])
        tied = around.spread(nearest)[0] < tuning.tied_m
        apart = np.hypot(*(around.poses[:, :2] - around.poses[nearest, :2]).T)
        those = np.flatnonzero(tied & (apart < _PLACE_M) & (
            travelled[index] - travelled > tuning.loop_apart_m))
        members = those[np.argsort(apart[those], kind='stable')][:_PLACE]
        found.append(Place(index, nearest, tuple(members.tolist()), float(sigma_m[nearest]),
                           float(sigma_rad[nearest])))
        near = near[~tied[near]]
    return found


def is_far(pose: Floats, other: Floats) -> bool:
    """Return whether a loop from one pose to another would move the robot far."""
    return bool(np.hypot(*(other - pose)[:2]) > _FAR_M)


def closing(keyframes: Sequence[Keyframe], place: Place, tuning: Tuning
            ) -> Generator[None, None, Edge | None]:
    """
    Look whether a keyframe is at a place, in pieces of some milliseconds.

    :return: the edge from the place to the keyframe, or None: it is another place.
    """
    local = LocalMap([keyframes[index] for index in place.members])
    last = keyframes[place.keyframe]
    if local.is_empty or not len(last.surface):
        return None
    window = Window(
        last.pose, min(_WINDOW_MOST_M, 0.3 + 2.0 * place.sigma_m),
        min(_WINDOW_MOST_RAD, float(np.radians(3.0)) + 2.0 * place.sigma_rad))
    match = yield from local.searching(last.surface, window, None)
    if match.aligned.share < tuning.loop_share or match.score < tuning.loop_score:
        return None
    if is_far(last.pose, match.aligned.pose) and (
            match.aligned.share < _FAR_SHARE or match.score < _FAR_SCORE):
        return None
    known = np.linalg.eigvalsh(match.aligned.information[:2, :2])
    if known[0] < _ONE_WAY * known[1]:
        return None
    return edge_of(place.nearest, place.keyframe, keyframes[place.nearest].pose,
                   match.aligned, tuning.match_noise_m, _LOOP_COMMON, True)
