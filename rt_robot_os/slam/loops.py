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

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.slam.correlation import Window
from rt_robot_os.slam.keyframes import edge_of
from rt_robot_os.slam.keyframes import Keyframe
from rt_robot_os.slam.keyframes import LocalMap
from rt_robot_os.slam.pose_graph import Edge
from rt_robot_os.slam.transforms import Floats
from rt_robot_os.slam.tuning import Tuning

#: An arm at which an error of an angle is counted as a way.
_ARM_M: Final = 5.0
#: Keyframes on each side of the nearest that make up a place, and how far from it.
_PLACE: Final = 6
_PLACE_M: Final = 5.0
#: Between two candidates of one place there are fewer keyframes than that.
_SAME_PLACE: Final = 10
#: A direction of which a scan says less than this part of the other is not known by it.
_ONE_WAY: Final = 0.05
_LOOP_COMMON: Final = np.array((0.03, 0.03, 0.008))
_WINDOW_MOST_M: Final = 3.0
_WINDOW_MOST_RAD: Final = float(np.radians(30.0))


@dataclass(frozen=True)
class Place:
    """
    Keyframes that may be where the robot is.

    :ivar nearest: the keyframe to which an edge would go.
    :ivar members: those around it.
    :ivar sigma_m: how far the pose may be wrong, seen from there; sigma_rad its angle.
    """

    nearest: int
    members: tuple[int, ...]
    sigma_m: float
    sigma_rad: float


def spread(edges: Sequence[Edge], count: int, to: int) -> tuple[Floats, Floats]:
    """
    Return standard deviations in m and rad of a keyframe, seen from each of all.

    :param count: of the keyframes.
    :param to: index of that keyframe.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import dijkstra
    covariances = np.linalg.inv(np.array([each.information for each in edges]))
    way = covariances[:, 0, 0] + covariances[:, 1, 1]
    turn = covariances[:, 2, 2]
    first = np.array([each.first for each in edges])
    second = np.array([each.second for each in edges])
    # Of several edges between two keyframes the matrix would hold the sum: a little too much.
    graph = coo_matrix((way + turn * _ARM_M ** 2, (first, second)), (count, count)).tocsr()
    total = dijkstra(graph, directed=False, indices=to)
    # How much of it is the angle's is taken from all edges together.
    part = turn.sum() / (way + turn * _ARM_M ** 2).sum()
    return np.sqrt(total), np.sqrt(total * part)


def places_near(keyframes: Sequence[Keyframe], edges: Sequence[Edge], tuning: Tuning
                ) -> list[Place]:
    """Return where the last keyframe may be as well, the nearest first."""
    last = keyframes[-1]
    travelled = np.array([each.travelled_m for each in keyframes])
    old = np.flatnonzero(last.travelled_m - travelled > tuning.loop_apart_m)
    if not len(old):
        return []
    at = np.array([keyframes[index].pose[:2] for index in old.tolist()])
    distances = np.hypot(at[:, 0] - last.pose[0], at[:, 1] - last.pose[1])
    if distances.min() > tuning.loop_reach_most_m:
        return []
    sigma_m, sigma_rad = spread(edges, len(keyframes), len(keyframes) - 1)
    reach = np.minimum(tuning.loop_reach_m + 2.0 * sigma_m[old], tuning.loop_reach_most_m)
    near = np.flatnonzero(distances < reach)
    groups = np.split(near, np.flatnonzero(np.diff(old[near]) > _SAME_PLACE) + 1)
    found = [_place(int(group[distances[group].argmin()]), old, at, sigma_m, sigma_rad)
             for group in sorted((g for g in groups if len(g)), key=lambda g: distances[g].min())]
    return found[:tuning.loop_candidates]


def _place(nearest: int, old: npt.NDArray[np.int64], at: Floats, sigma_m: Floats,
           sigma_rad: Floats) -> Place:
    low, high = max(0, nearest - _PLACE), nearest + _PLACE + 1
    members = [int(old[index]) for index in range(low, min(high, len(old)))
               if np.hypot(*(at[index] - at[nearest])) < _PLACE_M]
    index = int(old[nearest])
    return Place(index, tuple(members), float(sigma_m[index]), float(sigma_rad[index]))


def close(keyframes: Sequence[Keyframe], place: Place, tuning: Tuning) -> Edge | None:
    """Return the edge from a place to the last keyframe, or None: it is another place."""
    local = LocalMap([keyframes[index] for index in place.members])
    last = keyframes[-1]
    if local.is_empty or not len(last.surface):
        return None
    window = Window(
        last.pose, min(_WINDOW_MOST_M, 0.3 + 2.0 * place.sigma_m),
        min(_WINDOW_MOST_RAD, float(np.radians(3.0)) + 2.0 * place.sigma_rad))
    match = local.search(last.surface, window, None)
    if match.aligned.share < tuning.loop_share or match.score < tuning.loop_score:
        return None
    known = np.linalg.eigvalsh(match.aligned.information[:2, :2])
    if known[0] < _ONE_WAY * known[1]:
        return None
    return edge_of(place.nearest, len(keyframes) - 1, keyframes[place.nearest].pose,
                   match.aligned, tuning.match_noise_m, _LOOP_COMMON, True)
