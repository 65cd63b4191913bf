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

"""A grid map of keyframes at their present poses, drawn in one call."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from rt_robot_os.features.mapping.slam.growing_grid import GrowingGrid
from rt_robot_os.features.mapping.slam.keyframes import Keyframe
from rt_robot_os.motion.grid_map import GridMap

#: A larger map gets larger cells.
_CELLS_MOST: Final = 1 << 26


def grid_of(keyframes: Sequence[Keyframe], cell_m: float = 0.05) -> GridMap:
    """
    Return the map of keyframes at their present poses.

    :param cell_m: edge of a cell.
    """
    growing = GrowingGrid(cell_m, cells_most=_CELLS_MOST)
    while not growing.update(keyframes):
        pass
    return growing.grid()
