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
The lines of a saved map near a place, to which scans are aligned.

They come from the graph, if there is one, as its points are exact; else from the grid, whose
surface is smoothed over some cells. Points of the graph count where the grid is still occupied:
erased walls and people who walked by are ignored.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from rt_robot_os.features.mapping.slam.alignment import Aligned
from rt_robot_os.features.mapping.slam.alignment import SurfaceLines
from rt_robot_os.features.mapping.slam.correlation import best_fit
from rt_robot_os.features.mapping.slam.correlation import SearchWindow
from rt_robot_os.features.mapping.slam.graph import MapGraph
from rt_robot_os.features.mapping.slam.known_map import KnownMap
from rt_robot_os.features.mapping.slam.likelihood import LikelihoodField
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.features.mapping.slam.transforms import placed
from rt_robot_os.features.mapping.slam.transforms import rotation
from rt_robot_os.features.mapping.slam.transforms import wrapped

#: Radius of the lines, and distance after which they are collected again.
_REACH_M: Final = 14.0
_AGAIN_M: Final = 3.0
#: Points of the graph that are further away are not used.
_MEASURED_M: Final = 20.0
#: Neighbours on each side that make a line of the grid.
_AROUND: Final = 3
_LINE_LEAST: Final = 4
#: Largest ratio of the variances across and along a line.
_THIN: Final = 0.3
#: One point of the graph is used for each square of this edge.
_SQUARE_M: Final = 0.03
_FEW: Final = 30


class KnownLines:
    """
    The lines near a robot; all in the grid's own frame.

    :param graph: None: of the grid.
    """

    def __init__(self, known: KnownMap, graph: MapGraph | None) -> None:
        self._known = known
        self._frames = [] if graph is None else graph.keyframes
        poses = np.array([each.pose for each in self._frames]).reshape(-1, 3)
        self._poses = known.inside(poses)
        self._middle: Floats | None = None
        self._lines: SurfaceLines | None = None
        self._field: LikelihoodField | None = None

    def near(self, pose: Floats) -> SurfaceLines | None:
        """
        Return the lines around a pose; None where there are too few.

        Takes 1 ms, and some 30 ms each few metres.
        """
        if self._middle is None or math.dist(self._middle, pose[:2]) > _AGAIN_M:
            self._middle, self._field = pose[:2].copy(), None
            if self._frames:
                self._known.measure_near(self._middle, _MEASURED_M)
            points, normals = self._of_graph(self._middle)
            if len(points) < _FEW:
                points, normals = self._of_grid(self._middle)
            self._lines = SurfaceLines(points, normals) if len(points) >= _FEW else None
        return self._lines

    def search(self, pose: Floats, points: Floats, window: SearchWindow, prior: Floats
               ) -> Aligned | None:
        """Search a scan in a window around a pose, then align it exactly."""
        lines = self.near(pose)
        if lines is None:
            return None
        if self._field is None:
            self._field = LikelihoodField(lines.points)
        start, _ = best_fit(self._field, points, window)
        return lines.align(points, start, window.centre, prior)

    def _of_graph(self, middle: Floats) -> tuple[Floats, Floats]:
        near = np.flatnonzero(np.hypot(*(self._poses[:, :2] - middle).T) < _REACH_M).tolist()
        points, normals = [np.zeros((0, 2))], [np.zeros((0, 2))]
        for at in near:
            surface, pose = self._frames[at].surface, self._poses[at]
            points.append(placed(pose, surface.points[surface.lined]))
            normals.append(surface.normals[surface.lined] @ rotation(pose[2]).T)
        there, across = np.concatenate(points), np.concatenate(normals)
        good = self._known.away(there[:, 0], there[:, 1]) < 1.6 * self._known.cell_m
        there, across = there[good], across[good]
        squares = np.floor(there / _SQUARE_M).astype(np.int64)
        _, first = np.unique(squares[:, 0] * 4_000_037 + squares[:, 1], return_index=True)
        return there[first], across[first]

    def _of_grid(self, middle: Floats) -> tuple[Floats, Floats]:
        h, surface = self._known.cell_m, self._known.surface
        low = np.maximum(np.floor((middle - _REACH_M) / h).astype(np.int64), 0)
        high = np.maximum(np.ceil((middle + _REACH_M) / h).astype(np.int64), 0)
        part = np.pad(surface[low[1]:high[1], low[0]:high[0]], _AROUND)
        up, across = np.nonzero(part)
        arms = np.arange(-_AROUND, _AROUND + 1)
        dy, dx = (each.ravel() for each in np.meshgrid(arms, arms, indexing='ij'))
        there = part[up[:, None] + dy, across[:, None] + dx].astype(np.float64)
        count = there.sum(1)
        mean_x, mean_y = there @ dx / count, there @ dy / count
        xx, yy = there @ dx ** 2 / count - mean_x ** 2, there @ dy ** 2 / count - mean_y ** 2
        xy = there @ (dx * dy) / count - mean_x * mean_y
        half, mixed = (xx + yy) / 2.0, np.hypot((xx - yy) / 2.0, xy)
        is_line = (count >= _LINE_LEAST) & (half - mixed < _THIN * (half + mixed))
        along = 0.5 * np.arctan2(2.0 * xy, xx - yy)
        normals = np.stack((-np.sin(along), np.cos(along)), -1)
        # Projected to the line through its neighbours, as cells are large.
        off = (normals * np.stack((mean_x, mean_y), -1)).sum(1)
        cells = np.stack((across, up), -1) - _AROUND + low + 0.5 + normals * off[:, None]
        return cells[is_line] * h, normals[is_line]


def astray(found: Floats, start: Floats, far_m: float, far_rad: float) -> bool:
    """Return whether a pose is further from another than it may be."""
    off = found - start
    return bool(math.hypot(off[0], off[1]) > far_m or abs(float(wrapped(off[2]))) > far_rad)


def load_libraries() -> None:
    """Import slow libraries, some 0.1 s, so that no piece of work is delayed by them."""
    import scipy.ndimage  # noqa: F401
    import scipy.sparse.csgraph  # noqa: F401
    import scipy.sparse.linalg  # noqa: F401
    import scipy.spatial  # noqa: F401
