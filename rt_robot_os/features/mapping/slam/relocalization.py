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
"""Global relocalisation on the growing map: of a kidnapped robot, or after the start."""

from __future__ import annotations

from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.mapping.slam.global_localization import FoundPose
from rt_robot_os.features.mapping.slam.global_localization import GlobalLocalizer
from rt_robot_os.features.mapping.slam.graph import MapGraph
from rt_robot_os.features.mapping.slam.occupancy import grid_of
from rt_robot_os.features.mapping.slam.scan import Scan
from rt_robot_os.features.mapping.slam.tuning import MapperTuning

#: Unmatched scans while the wheels hardly turned, after which the robot counts as kidnapped.
_SCANS: Final = 10
_STILL_M: Final = 0.5
#: After this distance without a match the robot is on unmapped ground.
_NEW_GROUND_M: Final = 10.0


class Relocalization:
    """
    Detect that the pose is lost, and search for it.

    :param is_placed: the pose is known at the start.
    :ivar is_searching: the pose is lost.
    """

    def __init__(self, graph: MapGraph, tuning: MapperTuning, is_placed: bool) -> None:
        self._graph, self._tuning = graph, tuning
        self._is_placed = is_placed
        self._finder: GlobalLocalizer | None = None
        self._scans = 0
        self.is_searching = not is_placed

    @property
    def is_unplaced(self) -> bool:
        """Return whether the pose was never known."""
        return not self._is_placed

    def confirm(self) -> None:
        """Note that the pose is known: a scan matched, or it was set."""
        self._is_placed, self.is_searching = True, False
        self._finder, self._scans = None, 0

    def add_unmatched_scan(self, scan: Scan, way_m: float) -> FoundPose | None:
        """
        Process an unmatched scan; return its pose as soon as the search is unambiguous.

        :param way_m: distance by odometry since the last match.
        """
        self._scans += 1
        if not self.is_searching:
            self.is_searching = self._scans >= _SCANS and way_m < _STILL_M
        elif self._is_placed and way_m > _NEW_GROUND_M:
            self.confirm()
        return self._search(scan) if self.is_searching else None

    def process_pending(self) -> bool:
        """Do a piece of the search; return whether there is more to do."""
        return self._finder is not None and self._finder.process_pending()

    def _search(self, scan: Scan) -> FoundPose | None:
        if self._finder is None:
            try:
                self._finder = GlobalLocalizer(grid_of(self._graph.keyframes), self._graph,
                                               self._tuning)
            except ConfigError:
                return None  # the map has nothing to search in
        return self._finder.add_scan(scan)
