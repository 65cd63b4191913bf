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


"""How far a robot goes on in silence, and the speed that follows from it."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from rt_robot_os.motion.run_on import RunOn
from rt_robot_os.motion.run_on import slowest

TIMES = st.floats(0.0, 60.0)


@given(TIMES, TIMES, st.floats(0.0, 5.0), st.floats(0.0, 100.0))
def test_at_its_speed_it_stops_within_the_way(
        silence_s: float, coast_s: float, reaction_s: float, way_m: float) -> None:
    run_on = RunOn(silence_s, coast_s)
    speed_m_s = run_on.speed_m_s(way_m, reaction_s)
    if math.isinf(speed_m_s):
        # It stops immediately, or so nearly that the speed overflows: no limit follows.
        assert run_on.way_m(1.0) < 1e-300
    else:
        assert run_on.way_m(speed_m_s) + reaction_s * speed_m_s <= way_m * (1 + 1e-9) + 1e-9


def test_behind_an_obstacle_there_is_no_speed() -> None:
    assert RunOn(1.0, 0.5).speed_m_s(-0.2) == 0.0


def test_the_board_that_goes_on_the_farthest_counts() -> None:
    assert slowest([RunOn(0.5, 0.4), RunOn(2.0, 0.1), RunOn()]) == RunOn(2.0, 0.1)
    assert slowest([]) == RunOn()
