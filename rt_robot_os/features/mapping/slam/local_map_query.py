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
"""Select the keyframes near the robot whose relative poses are certain by the graph."""

from __future__ import annotations

from typing import Any
from typing import Final
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rt_robot_os.features.mapping.slam.graph import MapGraph
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.features.mapping.slam.tuning import MapperTuning

#: Smallest arm at which an error of an angle counts as a distance.
_ARM_M: Final = 5.0
#: Largest distance of keyframes that are selected as near, and largest driven distance since
#: those that are selected as recent.
_NEAR_M: Final = 6.0
_LAST_M: Final = 15.0
#: An edge with a smaller weight is ignored.
_LINK_WEIGHT_LEAST: Final = 0.3


class _Links(NamedTuple):
    """
    The best edge of each pair of keyframes.

    :ivar first: index of one keyframe,
    :ivar way: variances of the distance in m^2 and
    :ivar turn: of the angle in rad^2.
    :ivar order: indices of the edges in the rows of a sparse matrix,
    :ivar columns: their columns, and
    :ivar begins: the start of each row.
    """

    first: npt.NDArray[Any]
    way: Floats
    turn: Floats
    order: npt.NDArray[Any]
    columns: npt.NDArray[np.int32]
    begins: npt.NDArray[np.int32]


class LocalMapQuery:
    """
    Queries of a graph at one time.

    :ivar poses: shape (n, 3), of the keyframes.
    :ivar travelled_m: shape (n,).
    """

    def __init__(self, graph: MapGraph) -> None:
        self.poses: Floats = np.array([each.pose for each in graph.keyframes])
        self.travelled_m: Floats = np.array([each.travelled_m for each in graph.keyframes])
        self._edges = graph.edge_arrays()
        self._known: _Links | None = None

    def spread(self, index: int) -> tuple[Floats, Floats]:
        """
        Return standard deviations in m and rad of a keyframe, relative to each keyframe.

        An error of an angle far away moves it in proportion to the distance.

        :param index: of that keyframe.
        """
        return (self._deviations(self._path_lengths(index), index, np.inf),
                self._deviations(self._links().turn, index, np.inf))

    def tied(self, index: int, within_m: float) -> npt.NDArray[np.bool_]:
        """Return which keyframes are certain to a standard deviation, relative to another one."""
        found: npt.NDArray[np.bool_] = self._deviations(self._path_lengths(index), index,
                                                        within_m) <= within_m
        return found

    def _path_lengths(self, index: int) -> Floats:
        ties = self._links()
        arms = np.hypot(*(self.poses[ties.first, :2] - self.poses[index, :2]).T)
        ways: Floats = ties.way + ties.turn * np.maximum(arms, _ARM_M) ** 2
        return ways

    def _deviations(self, variances: Floats, index: int, limit: float) -> Floats:
        """Return the sums over the most certain paths, as deviations; inf beyond a limit."""
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import dijkstra
        ties = self._links()
        size = len(self.poses)
        graph = csr_array((variances[ties.order], ties.columns, ties.begins), (size, size))
        # It has each edge in both directions.
        found: Floats = np.sqrt(dijkstra(graph, indices=index, limit=limit ** 2))
        return found

    def _links(self) -> _Links:
        if self._known is None:
            self._known = self._best_links()
        return self._known

    def _best_links(self) -> _Links:
        edges, size = self._edges, len(self.poses)
        if not len(edges.first):
            nothing = np.zeros(0, np.int32)
            return _Links(nothing, np.zeros(0), np.zeros(0), nothing, nothing,
                          np.zeros(size + 1, np.int32))
        covariances = edges.covariances
        way = covariances[:, 0, 0] + covariances[:, 1, 1]
        turn = covariances[:, 2, 2]
        total = way + turn * _ARM_M ** 2
        believed = edges.errors(self.poses)[1] > _LINK_WEIGHT_LEAST
        # Of several edges between two keyframes the best is used: a matrix would add them up.
        low, high = np.minimum(edges.first, edges.second), np.maximum(edges.first, edges.second)
        order = np.argsort(total, kind='stable')
        order = order[believed[order]]
        _, best = np.unique(low[order] * size + high[order], return_index=True)
        kept = order[best]
        low, high = low[kept], high[kept]
        rows, columns = np.concatenate((low, high)), np.concatenate((high, low))
        by_row = np.lexsort((columns, rows))
        begins = np.searchsorted(rows[by_row], np.arange(size + 1))
        return _Links(low, way[kept], turn[kept], by_row % len(kept),
                      columns[by_row].astype(np.int32), begins.astype(np.int32))

    def near(self, pose: Floats, anchor: int, travelled_m: float, tuning: MapperTuning
             ) -> list[int]:
        """
        Return the keyframes of the local map of a scan.

        :param pose: shape (3,): of the scan.
        :param anchor: the keyframe of the last match.
        :param travelled_m: the distance driven until now.
        """
        last = len(self.poses) - 1
        first = max(0, last + 1 - tuning.local_keyframes)
        chosen = [index for index in range(first, last + 1)
                  if travelled_m - self.travelled_m[index] < _LAST_M]
        apart = np.hypot(self.poses[:, 0] - pose[0], self.poses[:, 1] - pose[1])
        apart[~self.tied(anchor, tuning.tied_m)] = np.inf
        apart[chosen] = np.inf
        most = tuning.near_keyframes + tuning.local_keyframes - len(chosen)
        nearest = np.argsort(apart, kind='stable')[:most]
        chosen += nearest[apart[nearest] < _NEAR_M].tolist()
        return sorted(chosen) or [anchor]
