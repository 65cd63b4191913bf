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

"""Look-ups of single places say what a terrain of the whole map says."""

from __future__ import annotations

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import numpy as np

from rt_robot_os.motion.clearing import Clearing
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.terrain import Terrain


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.1), st.sampled_from([0.0, 0.1, 0.42]),
       st.sampled_from([0.05, 0.1]), st.sampled_from([0.0, 0.6]))
def test_a_clearing_and_a_terrain_agree(seed: int, share: float, radius_m: float,
                                        resolution_m: float, yaw: float) -> None:
    chance = np.random.default_rng(seed)
    cells = (chance.random((30, 40)) < share).astype(np.int8) * 100
    cells[chance.random((30, 40)) < share] = -1
    grid = GridMap(cells, resolution_m, (1.0, -2.0, yaw))
    within_m = float(chance.choice([0.0, 0.15, 0.2]))
    terrain = Terrain(grid, radius_m, within_m + resolution_m, False)
    clearing = Clearing(grid, radius_m)
    x, y = np.array([grid.point(*each) for each in chance.uniform(
        -0.2, 41 * resolution_m, (300, 2))]).T
    cost = terrain.static[terrain.cells(x, y)]
    assert [clearing.is_free(*place) for place in zip(x, y)] == np.isfinite(cost).tolist()
    near = terrain.beside_wall(x, y, within_m)
    assert clearing.beside_wall(x, y, within_m).tolist() == near.tolist()
