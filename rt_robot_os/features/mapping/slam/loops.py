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
#: Of places that fit equally well the expected one is taken: the ends of a corridor look alike.
_SIGMA_LEAST_M: Final = 0.2
_SIGMA_LEAST_RAD: Final = 0.05
#: Where the pose may be this wrong, so many places are tried.
_UNSURE_M: Final = 0.2
_TRIES: Final = 4
#: A loop that would move the robot far is closed when so many keyframes, some of the way apart,
#: say the same: rooms look alike, and doors of a corridor are as far from each other. One that
#: rests on a short overlap, or says only how far across a corridor the robot is, when so many do.
_FAR_PLACES: Final = 3
_SHORT_PLACES: Final = 2
#: From this share of what is visible a place that is not taken is a near miss.
_NEARLY: Final = 0.5
#: A short overlap in which the scan sees through so much of the place is another place.
_CONTRADICTED: Final = 0.1


@dataclass(frozen=True)
class LoopCandidate:
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


def loop_candidates(around: LocalMapQuery, index: int, tuning: MapperTuning
                    ) -> list[LoopCandidate]:
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
    What became of looking at a place that fits at least nearly.

    :ivar keyframe: the one that may have come back to
    :ivar nearest: this one.
    :ivar share: of its points that lie on lines of the place, and
    :ivar of_visible: of those that the place looked at.
    :ivar score: how well they fit.
    :ivar reason: why no loop is closed; empty: one is.
    :ivar edge: the loop; None where ``why`` says that there is none.
    :ivar places_needed: at so many places, some way apart, loops have to say the same.
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
    Look whether a keyframe is at a place, in pieces of some milliseconds.

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
    Leave out what a scan does not say: how far along a corridor it was taken.

    :return: how it lies, with the place that is expected along the direction of which it says
        nothing; and whether there is one.
    """
    values, vectors = np.linalg.eigh(aligned.information[:2, :2])
    if values[0] >= _ONE_WAY * values[1]:
        return aligned, False
    along = np.array((*vectors[:, 0], 0.0))
    across = np.eye(3) - np.outer(along, along)
    pose = aligned.pose + along * (along @ (expected - aligned.pose))
    return Aligned(pose, across @ aligned.information @ across, aligned.share), True
