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
Detect loops: places that were seen before, which remove the accumulated error.

The uncertainty of the pose, relative to an older keyframe, is the sum over the most certain path
through the graph between them. It determines the radius of candidates and the search window.
"""

from __future__ import annotations

from collections.abc import Generator
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from rt_robot_os.features.mapping.slam.alignment import Aligned
from rt_robot_os.features.mapping.slam.correlation import SearchWindow
from rt_robot_os.features.mapping.slam.keyframes import edge_of
from rt_robot_os.features.mapping.slam.keyframes import Keyframe
from rt_robot_os.features.mapping.slam.keyframes import LocalMap
from rt_robot_os.features.mapping.slam.keyframes import Match
from rt_robot_os.features.mapping.slam.local_map_query import LocalMapQuery
from rt_robot_os.features.mapping.slam.overlap import Overlap
from rt_robot_os.features.mapping.slam.overlap import overlap_of
from rt_robot_os.features.mapping.slam.pose_graph import PoseEdge
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.features.mapping.slam.tuning import MapperTuning

#: Keyframes of a candidate at most, and their distance from the nearest one.
_PLACE: Final = 13
_PLACE_M: Final = 5.0
#: A direction with less than this part of the information of the other one is not determined.
_ONE_WAY: Final = 0.05
_LOOP_COMMON: Final = np.array((0.03, 0.03, 0.008))
_WINDOW_MOST_M: Final = 8.0
#: A loop that would move the robot further than this must match better: rooms look alike.
_FAR_M: Final = 1.5
_FAR_SHARE: Final = 0.7
_FAR_SCORE: Final = 0.6
_WINDOW_MOST_RAD: Final = float(np.radians(30.0))
#: Of equal matches the expected one is used: the ends of a corridor look alike.
_SIGMA_LEAST_M: Final = 0.2
_SIGMA_LEAST_RAD: Final = 0.05
#: From this uncertainty on several matches are aligned.
_UNSURE_M: Final = 0.2
_TRIES: Final = 4
#: A loop that would move the robot far needs this many consistent keyframes, some distance apart:
#: rooms look alike, and doors of a corridor are evenly spaced. The second number is for a loop
#: with a short overlap, or one that determines only the position across a corridor.
_FAR_PLACES: Final = 3
_SHORT_PLACES: Final = 2
#: Share of visible points from which a rejected candidate is a near miss.
_NEARLY: Final = 0.5
#: A short overlap is rejected when the scan sees through more than this share of the place.
_CONTRADICTED: Final = 0.1


@dataclass(frozen=True)
class LoopCandidate:
    """
    A place to which a keyframe may have returned.

    :ivar keyframe: the new one.
    :ivar nearest: the keyframe to which an edge would lead.
    :ivar members: those around it.
    :ivar sigma_m: uncertainty of the pose relative to it; sigma_rad that of the angle.
    """

    keyframe: int
    nearest: int
    members: tuple[int, ...]
    sigma_m: float
    sigma_rad: float


def loop_candidates(around: LocalMapQuery, index: int, tuning: MapperTuning
                    ) -> list[LoopCandidate]:
    """
    Return the loop candidates of a keyframe, the nearest first.

    :param around: query of the present graph.
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
    found: list[LoopCandidate] = []
    while len(near) and len(found) < tuning.loop_candidates:
        nearest = int(near[0])
        joined = around.tied(nearest, tuning.place_tied_m)
        apart = np.hypot(*(around.poses[:, :2] - around.poses[nearest, :2]).T)
        those = np.flatnonzero(joined & (apart < _PLACE_M) & (
            travelled[index] - travelled > tuning.loop_apart_m))
        members = those[np.argsort(apart[those], kind='stable')][:_PLACE]
        found.append(LoopCandidate(index, nearest, tuple(members.tolist()),
                                   float(sigma_m[nearest]),
                                   float(sigma_rad[nearest])))
        near = near[~joined[near]]
    return found


@dataclass(frozen=True)
class LoopVerdict:
    """
    The result for a candidate that matches at least nearly.

    :ivar keyframe: the one that may have returned to
    :ivar nearest: this one.
    :ivar share: of its points that lie on lines of the place, and
    :ivar of_visible: of those that the place observed.
    :ivar score: of the match.
    :ivar reason: why no loop is closed; empty: one is.
    :ivar edge: the loop; None if there is a reason against it.
    :ivar places_needed: number of places, some distance apart, with consistent loops.
    """

    keyframe: int
    nearest: int
    share: float
    of_visible: float
    score: float
    reason: str
    edge: PoseEdge | None = None
    places_needed: int = 1


def is_far(pose: Floats, other: Floats) -> bool:
    """Return whether a loop from one pose to another would move the robot far."""
    return bool(np.hypot(*(other - pose)[:2]) > _FAR_M)


def verified(keyframes: Sequence[Keyframe], place: LoopCandidate, tuning: MapperTuning
             ) -> Generator[None, None, LoopVerdict | None]:
    """
    Verify a candidate, in pieces of some milliseconds.

    :return: None: it is another place.
    """
    around = [keyframes[index] for index in place.members]
    local = LocalMap(around)
    last = keyframes[place.keyframe]
    if local.is_empty or not len(last.surface):
        return None
    window = SearchWindow(
        last.pose, min(_WINDOW_MOST_M, 0.3 + 2.0 * place.sigma_m),
        min(_WINDOW_MOST_RAD, float(np.radians(3.0)) + 2.0 * place.sigma_rad),
        max(_SIGMA_LEAST_M, place.sigma_m), max(_SIGMA_LEAST_RAD, place.sigma_rad))
    match = yield from local.searching(
        last.surface, window, None, _TRIES if place.sigma_m > _UNSURE_M else 1, tuning.loop_share)
    if match.aligned.share < tuning.share_least:
        return None
    yield
    is_short = match.aligned.share < tuning.loop_share or match.score < tuning.loop_score
    overlap = overlap_of(around, last.surface, match.aligned.pose) if is_short else None
    return _judged(match, overlap, keyframes, place, tuning)


def _judged(match: Match, overlap: Overlap | None, keyframes: Sequence[Keyframe],
            place: LoopCandidate,
            tuning: MapperTuning) -> LoopVerdict | None:
    share, score = match.aligned.share, match.score
    visible = 1.0 if overlap is None else overlap.visible
    of_visible = share / max(visible, share)
    if of_visible < _NEARLY:
        return None
    verdict = partial(LoopVerdict, place.keyframe, place.nearest, share, of_visible, score)
    if overlap is not None:
        if of_visible < tuning.loop_share or score / max(visible, score) < tuning.loop_score:
            return verdict('too little of what is visible fits')
        if overlap.contradicted > _CONTRADICTED:
            return verdict('it sees through what is known')
    aligned, is_one_way = _as_known(match.aligned, keyframes[place.keyframe].pose)
    far = is_far(keyframes[place.keyframe].pose, aligned.pose)
    if far and (is_one_way or share < _FAR_SHARE or score < _FAR_SCORE):
        return verdict('too far for how well it fits')
    edge = edge_of(place.nearest, place.keyframe, keyframes[place.nearest].pose, aligned,
                   tuning.match_noise_m, _LOOP_COMMON, True)
    return verdict('', edge, _FAR_PLACES if far else
                   _SHORT_PLACES if overlap is not None or is_one_way else 1)


def _as_known(aligned: Aligned, expected: Floats) -> tuple[Aligned, bool]:
    """
    Remove the direction that a scan does not determine: along a corridor.

    :return: the alignment, with the expected position along that direction; and whether there is
        one.
    """
    values, vectors = np.linalg.eigh(aligned.information[:2, :2])
    if values[0] >= _ONE_WAY * values[1]:
        return aligned, False
    along = np.array((*vectors[:, 0], 0.0))
    across = np.eye(3) - np.outer(along, along)
    pose = aligned.pose + along * (along @ (expected - aligned.pose))
    return Aligned(pose, across @ aligned.information @ across, aligned.share), True
