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

"""The planner on a map that somebody is making: it grows, it changes, it may be none at all."""

from __future__ import annotations

from collections.abc import Callable
import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from planned_rooms import Planned
from planned_rooms import rooms
from planned_rooms import through
import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.navigation.planner import Planner
from rt_robot_os.testing.fakes import settings_of

pytest.importorskip('nav_msgs', reason='ROS 2 messages are not installed')

LIVE: dict[str, Any] = {'map': '', 'map_topic': 'map', 'scan_topics': []}


def seen_up_to(column: int, doors: bool = True) -> npt.NDArray[np.int8]:
    """Return the map of both rooms, without what lies beyond a column."""
    cells = rooms(doors)
    cells[:, column:] = -1
    return cells


def test_there_must_be_a_map_on_a_topic_or_in_a_file() -> None:
    with pytest.raises(ConfigError, match='map and map_topic are both empty'):
        Planner('planner', settings_of(Planner))


def test_it_waits_for_the_first_map_and_plans_when_it_comes(tmp_path: Path) -> None:
    robot = Planned(tmp_path, **LIVE)
    robot.go(5.0, 1.25)
    robot.bench.run(0.9)
    assert (robot.told(), robot.plans) == (['waiting: no map yet'], [])
    robot.chart(rooms(), 0.1)
    robot.bench.run(1.0)
    assert robot.told()[-1] == 'planned: 4.00 m'
    assert robot.planner.statistics()['map'] == '120 x 80 of 0.05 m'


def test_the_file_is_the_map_until_one_comes(tmp_path: Path) -> None:
    robot = Planned(tmp_path, map_topic='map')
    robot.go(5.0, 1.25)
    closed = rooms()
    closed[15:35, 60] = 100
    robot.chart(closed, 1.0)
    robot.go(5.0, 1.25, at_s=2.0)
    robot.bench.run(3.0)
    assert through(robot.plans[0][1]) < 1.75
    assert through(robot.plans[-1][1]) > 2.75


def test_what_nobody_has_seen_is_refused_until_the_map_has_grown_there(tmp_path: Path) -> None:
    robot = Planned(tmp_path, **LIVE)
    robot.chart(seen_up_to(61)[:, :75], 0.1)
    robot.go(5.0, 1.25, at_s=0.5)
    robot.go(3.65, 3.9, at_s=1.0)
    robot.bench.run(1.5)
    assert robot.told() == ['planning', (
        'refused: the goal 5.00, 1.25 lies in ground that nobody has seen yet, off the map, which '
        'goes from 0, 0 to 3.75, 4'), 'planning', (
        'refused: the goal 3.65, 3.90 lies in ground that nobody has seen yet, and the robot can '
        'stand nowhere within 0.5 m of it')]
    assert robot.plans == []
    # Larger on all sides: the first cell is another one.
    grown = np.full((100, 150), -1, np.int8)
    grown[10:90, 20:140] = rooms()
    robot.chart(grown, 0.0, (-1.0, -0.5))
    robot.go(5.0, 1.25, at_s=0.5)
    robot.bench.run(1.5)
    assert robot.told()[-1] == 'planned: 4.00 m'
    assert through(robot.plans[-1][1]) < 1.75


def test_a_way_that_stays_open_is_driven_on_and_one_that_is_closed_is_not(tmp_path: Path) -> None:
    robot = Planned(tmp_path, **LIVE)
    robot.chart(rooms(), 0.1)
    robot.go(5.0, 1.25)
    robot.say('driving', 1.0)
    beside = rooms()
    beside[70:75, 20:30] = 100  # far from it
    beside[31:36, 30:40] = 100  # beside it, nearer than anybody would plan
    robot.chart(beside, 2.0)
    closed = beside.copy()
    closed[15:35, 60] = 100
    robot.bench.run(3.9)
    assert len(robot.plans) == 1
    assert robot.planner.statistics()['map_changes'] == 2
    robot.chart(closed, 0.1)
    robot.bench.run(2.0)
    assert len(robot.plans) == 2
    assert through(robot.plans[1][1]) > 2.7
    assert robot.planner.statistics()['ways_closed_by_map'] == 1


def test_without_another_way_it_stops_waits_and_goes_on_when_the_map_says_so(
        tmp_path: Path) -> None:
    robot = Planned(tmp_path, **LIVE, patience_s=20.0)
    robot.chart(rooms(False), 0.1)
    robot.go(5.0, 1.25)
    robot.say('driving', 1.0)
    closed = rooms(False)
    closed[15:35, 60] = 100
    robot.chart(closed, 2.0)
    robot.say('stopped: the planner took the plan back', 3.0)
    robot.chart(rooms(False), 6.0)
    robot.bench.run(8.0)
    assert [bool(plan) for _, plan in robot.plans] == [True, False, True]
    assert 'waiting: no way to the goal is wide enough' in robot.told()
    assert robot.told()[-1] == 'planned: 4.00 m'


def test_whether_unknown_ground_is_entered_may_be_changed_while_it_runs(tmp_path: Path) -> None:
    robot = Planned(tmp_path, **LIVE)
    robot.chart(seen_up_to(70), 0.1)
    robot.go(5.0, 1.25, at_s=0.5)
    robot.bench.run(1.0)
    assert robot.told()[-1].startswith('refused: ')
    robot.planner.change('unknown_is_free', True)
    robot.go(5.0, 1.25)
    robot.bench.run(1.0)
    assert robot.told()[-1] == 'planned: 4.00 m'
    robot.planner.change('unknown_is_free', False)
    robot.bench.run(1.0)
    assert robot.plans[-1][1] == []  # taken back: it leads where nobody has been


def nothing(message: Any) -> None:
    message.info.width = message.info.height = 0


@pytest.mark.parametrize(('damage', 'text'), [
    (lambda m: setattr(m.info, 'width', 121), 'it has 9600 cells instead of 121 x 80'),
    (nothing, 'it is empty: 0 x 0'),
    (lambda m: setattr(m.info, 'width', 2**31), 'cells are more than 4000000'),
    (lambda m: setattr(m.info, 'resolution', math.nan), 'its cells are nan m wide'),
    (lambda m: setattr(m.info, 'resolution', 1e-3), 'its cells are 0.001 m wide'),
    (lambda m: setattr(m.info, 'resolution', 0.0), 'its cells are 0 m wide'),
    (lambda m: setattr(m.info.origin.position, 'x', math.nan), 'its origin is at nan, 0'),
    (lambda m: setattr(m.info.origin, 'orientation', (0.7, 0.0, 0.0, 0.7)), 'tilted'),
    (lambda m: setattr(m.info.origin, 'orientation', (0.0, 0.0, math.nan, 1.0)), 'not a rotation'),
    (lambda m: m.data.fill(-1), 'cells are unknown'),
    (lambda m: m.data.fill(101), 'it has the value 101')])
def test_a_map_that_is_none_is_refused_and_the_one_before_is_kept(
        tmp_path: Path, damage: Callable[[Any], object], text: str) -> None:
    robot = Planned(tmp_path, **LIVE)
    robot.chart(rooms(), 0.1)
    robot.chart(rooms(), 0.6, damage=damage)
    robot.go(5.0, 1.25, at_s=1.0)
    robot.bench.run(2.0)
    statistics = robot.planner.statistics()
    assert text in statistics['warning']
    assert (statistics['maps'], statistics['maps_refused']) == (1, 1)
    assert robot.told()[-1] == 'planned: 4.00 m'
    robot.chart(rooms(), 0.1)
    robot.bench.run(0.5)
    assert robot.planner.statistics()['warning'] == ''
