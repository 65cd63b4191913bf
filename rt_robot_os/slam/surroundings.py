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
"""Which keyframes are where the robot is, and in place there as far as the graph knows."""

from __future__ import annotations

from typing import Any
from typing import Final

import numpy as np

from rt_robot_os.slam.graph import Graph
from rt_robot_os.slam.pose_graph import Edges
from rt_robot_os.slam.transforms import Floats
from rt_robot_os.slam.tuning import Tuning

#: The least arm at which an error of an angle is counted as a way.
_ARM_M: Final = 5.0
#: Nothing further away is matched with for being near, and nothing that was kept longer ago than
#: this way for being the last.
_NEAR_M: Final = 6.0
_LAST_M: Final = 15.0
#: An edge that counts less than that ties nothing.
_TIES: Final = 0.3


class Surroundings:
    """
    A graph as it is at one moment.

    :ivar poses: shape (n, 3), of the keyframes.
    :ivar travelled_m: shape (n,).
    """

    def __init__(self, graph: Graph) -> None:
        self.poses: Floats = np.array([each.pose for each in graph.keyframes])
        self.travelled_m: Floats = np.array([each.travelled_m for each in graph.keyframes])
        self._edges = graph.edges
        self._known: tuple[Any, ...] | None = None

    def spread(self, index: int) -> tuple[Floats, Floats]:
        """
        Return standard deviations in m and rad of a keyframe, seen from each of all.

        An angle that is wrong far away moves it by as much of the way from there.

        :param index: of that keyframe.
        """
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import dijkstra
        if self._known is None:
            self._known = self._variances()
        first, second, way, turn = self._known
        size = (len(self.poses),) * 2
        arms = np.hypot(*(self.poses[first, :2] - self.poses[index, :2]).T)
        total = way + turn * np.maximum(arms, _ARM_M) ** 2
        ways, turns = (dijkstra(coo_matrix((each, (first, second)), size).tocsr(),
                                directed=False, indices=index) for each in (total, turn))
        return np.sqrt(ways), np.sqrt(turns)

    def _variances(self) -> tuple[Any, ...]:
        """Return between which keyframes edges go, and their variances of way and angle."""
        edges = Edges(self._edges)
        if not len(edges.first):
            nothing = np.zeros(0, np.intp)
            return nothing, nothing, np.zeros(0), np.zeros(0)
        covariances = np.linalg.inv(edges.information)
        way = covariances[:, 0, 0] + covariances[:, 1, 1]
        turn = covariances[:, 2, 2]
        total = way + turn * _ARM_M ** 2
        believed = edges.errors(self.poses)[1] > _TIES
        # Of several edges between two keyframes the best counts: a matrix would add them up.
        low, high = np.minimum(edges.first, edges.second), np.maximum(edges.first, edges.second)
        order = np.argsort(total, kind='stable')
        order = order[believed[order]]
        _, best = np.unique(low[order] * len(self.poses) + high[order], return_index=True)
        kept = order[best]
        return low[kept], high[kept], way[kept], turn[kept]

    def near(self, pose: Floats, anchor: int, travelled_m: float, tuning: Tuning) -> list[int]:
        """
        Return the keyframes with which a scan is matched.

        :param pose: shape (3,): where it is.
        :param anchor: the keyframe that is known to be there.
        :param travelled_m: the way until now.
        """
        last = len(self.poses) - 1
        first = max(0, last + 1 - tuning.local_keyframes)
        chosen = [index for index in range(first, last + 1)
                  if travelled_m - self.travelled_m[index] < _LAST_M]
        apart = np.hypot(self.poses[:, 0] - pose[0], self.poses[:, 1] - pose[1])
        apart[self.spread(anchor)[0] > tuning.tied_m] = np.inf
        apart[chosen] = np.inf
        most = tuning.near_keyframes + tuning.local_keyframes - len(chosen)
        nearest = np.argsort(apart, kind='stable')[:most]
        chosen += nearest[apart[nearest] < _NEAR_M].tolist()
        return sorted(chosen) or [anchor]
