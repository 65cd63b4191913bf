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

"""Where the robot stands: beside somebody, on their side of the wall, and where it has room."""

from __future__ import annotations

import math

from agent_world import World
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import numpy as np
import pytest
from rt_robot_os.features.agent.drive import GoalFollower
from rt_robot_os.features.agent.inputs import Goal
from rt_robot_os.features.agent.standoff import StandoffPlanner
from rt_robot_os.motion.clearing import Clearing
from rt_robot_os.motion.grid_map import GridMap

CELLS = np.zeros((80, 120), np.int8)
CELLS[0] = CELLS[-1] = 100
CELLS[:, 0] = CELLS[:, -1] = 100
CELLS[:30, 60:62] = CELLS[45:, 60:62] = 100  # a wall with a door at 3.05, 1.9
CELLS[50:80, 90:120] = 100  # a bed in the corner
GRID = GridMap(CELLS, 0.05)
BESIDE = StandoffPlanner(Clearing(GRID, 0.4), 1.0, 0.2)


def test_nobody_is_looked_at_through_a_wall() -> None:
    # The nearest free place is on the other side.
    for pose in BESIDE.places((3.4, 0.8), (2.0, 0.8), 4):
        assert pose[0] > 3.1
        assert BESIDE.sees(pose[:2], (3.4, 0.8))
    assert not BESIDE.sees((2.4, 0.8), (4.4, 0.8))


def test_who_lies_in_bed_is_looked_at_from_beside_it() -> None:
    found = BESIDE.places((4.8, 3.0), (1.0, 1.0), 4)
    assert found
    assert GRID.occupied(4.8, 3.0)
    for x, y, yaw in found:
        assert 0.8 <= math.dist((x, y), (4.8, 3.0)) <= 2.0
        assert math.cos(yaw - math.atan2(3.0 - y, 4.8 - x)) > 0.999


def test_where_no_place_is_free_there_is_none() -> None:
    assert BESIDE.places((90.0, 3.0), (1.0, 1.0), 4) == []
    drive = GoalFollower(4, 1, 1, 1)
    drive.begin([], 0)
    assert drive.problem == 'no place to stand beside it'


@given(x=st.floats(0.1, 5.9), y=st.floats(0.1, 3.9), most=st.integers(1, 8))
@settings(max_examples=60, deadline=None)
def test_each_place_is_free_and_apart_from_the_others(x: float, y: float, most: int) -> None:
    found = BESIDE.places((x, y), (1.0, 1.0), most)
    assert len(found) <= most
    for number, pose in enumerate(found):
        assert GRID.free(*pose[:2])
        assert 0.79 <= math.dist(pose[:2], (x, y)) <= 2.01
        assert all(math.dist(pose[:2], other[:2]) > 0.49 for other in found[:number])


def test_a_drive_takes_what_was_said_before_its_goal_for_nothing() -> None:
    drive = GoalFollower(4, 10, 10, 1)
    drive.begin([(5.0, 0.0, 0.0), (7.0, 0.0, 0.0)], 0)
    drive.update('done', 0, (5.0, 0.0, 0.0))
    assert not drive.arrived and drive.next_goal(0) == (5.0, 0.0, 0.0)
    drive.update('done', 1, (0.0, 0.0, 0.0))  # of a goal before
    assert not drive.arrived
    drive.update('waiting: somebody', 2, None)
    drive.tick(11)
    assert not drive.problem
    drive.tick(12)
    assert drive.next_goal(13) == (7.0, 0.0, 0.0)
    drive.update('stopped: blocked', 14, None)
    assert drive.problem == 'blocked (2 places tried)'


@pytest.mark.parametrize('pose', [(math.nan, 0.0), (1e300, 0.0)])
def test_what_is_no_place_is_beside_nothing(pose: tuple[float, float]) -> None:
    assert BESIDE.places(pose, (1.0, 1.0), 4) == []


def test_a_goal_that_turns_out_to_be_on_top_of_somebody_is_given_up_for_another() -> None:
    world = World(approach_s=60.0)
    world.planner = 'driving'
    world.alarm('raised')
    world.run(2.0)
    first, = (each.pose for each in world.orders if isinstance(each, Goal))
    assert first is not None
    # The robot sees her now: nearer to its goal than it was told, but by less than follow_m.
    share = 0.4 / math.dist(first[:2], (4.0, 4.0))
    seen = 4.0 + share * (first[0] - 4.0), 4.0 + share * (first[1] - 4.0)
    world.move_anna(*seen)
    world.run(2.0)
    goals = [each.pose for each in world.orders if isinstance(each, Goal)]
    assert len(goals) == 2 and goals[1] is not None
    assert math.dist(goals[1][:2], seen) > 0.79


def test_who_turns_out_to_be_beside_the_robot_already_stops_it() -> None:
    world = World(approach_s=60.0)
    world.planner = 'driving'
    world.alarm('raised')
    world.run(2.0)
    world.move_anna(0.7, 0.7)
    world.run(2.0)
    goals = [each.pose for each in world.orders if isinstance(each, Goal)]
    assert len(goals) == 2 and goals[1] is None
    assert [each.target.value for each in world.made] == ['approach', 'observe']
