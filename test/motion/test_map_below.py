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

"""A map that grows, upon one that was there before."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from rt_robot_os.motion.base_map import BaseMap
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.grid_map import UNKNOWN


def all_of(below: BaseMap, above: GridMap) -> GridMap:
    """Fill a map in one go."""
    work = below.filled(above)
    while True:
        try:
            next(work)
        except StopIteration as ended:
            found: GridMap = ended.value
            return found


def flat(columns: int = 40, rows: int = 30, cell_m: float = 0.05) -> GridMap:
    """Return a plan with walls round it and one in the middle."""
    cells = np.zeros((rows, columns), np.int8)
    cells[[0, -1]] = 100
    cells[:, [0, columns // 2, -1]] = 100
    return GridMap(cells, cell_m, (-0.5, 0.25, 0.0))


def test_what_was_seen_counts_and_what_was_not_is_as_it_was() -> None:
    plan = flat()
    seen = np.full((10, 12), UNKNOWN, np.int8)
    seen[2:8, 2:6] = 0
    seen[4, 4] = 100  # a chair
    above = GridMap(seen, 0.05, (0.2, 0.5, 0.0))
    found = all_of(BaseMap(plan), above)
    assert (found.rows, found.columns, found.origin) == (30, 40, pytest.approx((-0.5, 0.25, 0.0)))
    x, y = above.centre(4, 4)
    assert found.value(x, y) == 100 and plan.value(x, y) == 0
    changed = np.argwhere(found.cells != plan.cells).tolist()
    assert changed == [[9, 18]]  # the chair alone
    # And where a wall was taken down since:
    seen[:, :] = 0
    wide = all_of(BaseMap(plan), GridMap(np.zeros((10, 12), np.int8), 0.05, (0.4, 0.5, 0.0)))
    assert plan.value(0.52, 0.7) == 100 and wide.value(0.52, 0.7) == 0
    assert wide.value(0.52, 1.2) == 100


def test_what_is_seen_beyond_the_plan_is_added_to_it() -> None:
    plan = flat()
    above = GridMap(np.zeros((80, 100), np.int8), 0.05, (-2.0, -1.0, 0.0))
    found = all_of(BaseMap(plan), above)
    assert (found.rows, found.columns) == (80, 100) and not found.cells.any()
    left = all_of(BaseMap(plan), GridMap(np.zeros((4, 4), np.int8), 0.05, (-1.5, 0.3, 0.0)))
    assert left.bounds == pytest.approx((-1.5, 0.25, 1.5, 1.75))
    assert left.value(-1.4, 0.4) == 0 and left.value(-1.0, 0.4) == UNKNOWN


@given(x=st.floats(-3.0, 3.0), y=st.floats(-3.0, 3.0), yaw=st.floats(-math.pi, math.pi),
       cell_m=st.sampled_from([0.03, 0.05, 0.1]))
def test_a_map_that_lies_askew_shows_the_plan_where_it_is(x: float, y: float, yaw: float,
                                                          cell_m: float) -> None:
    plan = flat()
    cells = np.full((7, 9), UNKNOWN, np.int8)
    cells[3, 4] = 37
    above = GridMap(cells, cell_m, (x, y, yaw))
    found = all_of(BaseMap(plan), above)
    xs, ys = found.centres()
    expected = plan.values(xs, ys)
    own = np.argwhere(found.cells == 37)
    assert len(own) == 1 and found.centre(*own[0].tolist()) == pytest.approx(above.centre(3, 4))
    expected[tuple(own[0])] = 37
    # The middle of a cell may lie on the edge of one of the plan.
    assert (found.cells != expected).mean() < 0.02


def test_a_map_of_the_same_size_costs_no_second_look_at_the_plan() -> None:
    below, above = BaseMap(flat(400, 300)), GridMap(np.zeros((4, 4), np.int8), 0.05)

    def pieces() -> int:
        return sum(1 for _ in below.filled(above))
    first, again = pieces(), pieces()
    assert first > 30 > again


def test_both_together_are_no_larger_than_a_map_may_be() -> None:
    far = GridMap(np.zeros((4, 4), np.int8), 0.05, (500.0, 500.0, 0.0))
    assert all_of(BaseMap(flat()), far) is far
