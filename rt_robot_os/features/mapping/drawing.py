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

"""The map as a grid: redrawn when the graph changes, in pieces between scans."""

from __future__ import annotations

import numpy as np

from rt_robot_os.features.mapping.slam.graph import MapGraph
from rt_robot_os.features.mapping.slam.growing_grid import GrowingGrid
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.grid_map import UNKNOWN


class Drawing:
    """
    A grid that is drawn from a graph.

    :ivar grid: the last one that was complete.
    :ivar version: increases with each new grid; 0 before the first.
    :ivar drawn_ns: stamp of the newest scan on the grid; 0 for a loaded map.
    :ivar is_done: nothing remains to be drawn.
    """

    def __init__(self, cell_m: float) -> None:
        self.grid = GridMap(np.full((1, 1), UNKNOWN, np.int8), cell_m)
        self.version = 0
        self.drawn_ns = 0
        self._cell_m = cell_m
        self.restart()

    def restart(self) -> None:
        """Start with another map; the last grid stays until there is a new one."""
        self._growing = GrowingGrid(self._cell_m)
        self._of = -1
        self.is_done = True

    def set_version(self, graph_version: int) -> None:
        """Record the version of the graph."""
        self.is_done &= self._of == graph_version

    def draw(self, graph: MapGraph | None, graph_version: int, stamp_ns: int) -> None:
        """
        Draw a piece.

        :param graph_version: the current one.
        :param stamp_ns: of the newest scan in the graph.
        """
        self._of = graph_version
        self.is_done = graph is None or self._growing.update(graph.keyframes)
        if self.is_done and self._growing.grid() is not self.grid:
            self.show(self._growing.grid(), stamp_ns)

    def show(self, grid: GridMap, stamp_ns: int) -> None:
        """Show a given grid."""
        self.grid = grid
        self.version += 1
        self.drawn_ns = stamp_ns

    @property
    def counts(self) -> dict[str, int]:
        """Return the counters of the grid."""
        return self._growing.counts
