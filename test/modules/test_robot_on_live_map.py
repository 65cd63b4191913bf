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

"""A robot that drives while its map grows, is corrected, and moves under it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from live_maps import put_grid
from live_maps import Seen
import numpy as np
import numpy.typing as npt
import pytest

from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.poses import composed
from test_service_robot import ANGLES
from test_service_robot import Robot
from test_service_robot import two_rooms

FLAT = Path(__file__).resolve().parents[2] / 'config' / 'maps' / 'flat.yaml'
LIVE: dict[str, Any] = {'map_topic': 'map'}
CORRECTED: dict[str, Any] = {'correction_topic': 'slam/correction'}


class Charted(Robot):
    """A robot whose map comes on a topic, and moves."""

    def __init__(self, folder: Path, **changes: Any) -> None:
        self.grid = changes.get('grid') or two_rooms(folder, changes.get('doors', 2))[1]
        super().__init__(folder, **{**LIVE, **changes})
        self.way: list[tuple[float, float, float]] = []
        self.bench.kernel.add_task('note', self._note, priority=89, rate_hz=10.0)

    def _note(self) -> None:
        self.way.append((*self.pose[:2], self.velocity[0]))

    def publish_map(self, cells: npt.NDArray[np.int8] | None = None) -> None:
        """Publish the true map, or other cells of it, where it is on that of the robot."""
        put_grid(self.chart, self.grid, cells, self.map_at)
        self.chart.publish()

    def close_a_loop(self, moved: Pose, at_s: float, map_after_s: float = 0.7,
                     told: bool = True) -> None:
        """Let the map move under the robot; the corrected map comes later than the pose."""
        def jump() -> None:
            self.map_at = composed(moved, self.map_at)
            pose = self.correction.msg.pose.pose
            pose.position = *moved[:2], 0.0
            pose.orientation = 0.0, 0.0, math.sin(moved[2] / 2), math.cos(moved[2] / 2)
            if told:
                self.correction.publish()
        self.bench.at(at_s, jump)
        self.bench.at(at_s + map_after_s, self.publish_map)

    def goal_is_there(self, place: Pose) -> bool:
        """Return whether it is at a pose of its map."""
        x, y, yaw = composed(self.map_at, self.pose)
        return math.dist((x, y), place[:2]) < 0.06 and abs(
            math.remainder(yaw - place[2], math.tau)) < 0.1


def after(robot: Charted, from_s: float, to_s: float) -> npt.NDArray[np.float64]:
    """Return x, y and speed of the robot ten times a second."""
    return np.array(robot.way[round(10 * from_s):round(10 * to_s)])


@pytest.mark.parametrize('moved', [(0.1, 0.05, 0.02), (0.0, -0.1, 0.0), (-0.15, 0.1, -0.03)])
def test_a_map_that_moves_a_little_takes_the_way_along_and_nobody_swerves(
        tmp_path: Path, moved: Pose) -> None:
    robot = Charted(tmp_path, **CORRECTED)
    robot.drive_to(5.0, 1.25, 0.0)
    robot.close_a_loop(moved, 4.0, map_after_s=1.0)
    robot.bench.run(30.0)
    x, y, speed = after(robot, 3.5, 5.0).T
    assert np.abs(y - 1.25).max() < 0.005  # beside it nothing has moved
    assert speed.min() > 0.25
    assert robot.goal_is_there((5.0, 1.25, 0.0)), robot.said('planner/state')
    # On the new map it is planned anew, as the goal is another place.
    assert [text[:7] for text in robot.said('planner/state')] == [
        'plannin', 'planned', 'plannin', 'planned', 'done']


def test_a_map_that_moves_far_stops_the_robot_until_the_next_map_and_it_goes_on(
        tmp_path: Path) -> None:
    robot = Charted(tmp_path, **CORRECTED)
    robot.drive_to(5.0, 2.2, 0.0)
    robot.close_a_loop((0.0, 1.0, 0.0), 4.0, map_after_s=2.0)
    robot.bench.run(40.0)
    assert 'waiting: the map moved by 1.00 m' in robot.said('planner/state')
    x, y, speed = after(robot, 4.0, 8.0).T
    assert np.abs(y - 1.25).max() < 0.01
    assert speed[16] == 0.0
    assert speed[-1] > 0.2
    assert robot.goal_is_there((5.0, 2.2, 0.0)), robot.said('planner/state')
    assert robot.nearest_m > 0.03


def test_a_robot_that_is_off_its_path_on_a_live_map_gets_another_one(tmp_path: Path) -> None:
    robot = Charted(tmp_path)  # nobody says that the map moves
    robot.drive_to(5.0, 2.2, 0.0)
    robot.close_a_loop((0.0, 1.0, 0.0), 4.0, told=False)
    robot.bench.run(40.0)
    assert robot.goal_is_there((5.0, 2.2, 0.0)), robot.said('planner/state')
    assert robot.nearest_m > 0.03


class Mapping(Charted):
    """A robot in the flat, whose map shows what it has seen."""

    def __init__(self, folder: Path, **changes: Any) -> None:
        self.seen = Seen(GridMap.load(FLAT))
        super().__init__(folder, **{'grid': self.seen.grid, 'map': '', **changes})
        self.pose = (3.44, 1.0, 2.09)
        self.entered = 0
        self.maps = 0
        self.bench.kernel.add_task('mapping', self._map, priority=30, rate_hz=2.0)
        self.bench.kernel.add_task('watch', self._watch, priority=29, rate_hz=10.0)

    def _map(self) -> None:
        x, y, yaw = self.pose
        ranges = np.minimum(self.walls.cast(x, y, ANGLES + yaw, 5.0), 5.0)
        self.seen.look(x, y, ANGLES + yaw, ranges)
        self.maps += 1
        if self.maps % 2:
            put_grid(self.chart, self.seen.part())
            self.chart.publish()

    def _watch(self) -> None:
        """Count how often the middle of the robot is where nobody has been looking."""
        row, column = self.seen.grid.cell(*self.pose[:2]) or (0, 0)
        self.entered += bool(self.seen.cells[row, column] < 0)


def test_a_goal_behind_an_unknown_door_is_refused_then_seen_and_driven_to(tmp_path: Path) -> None:
    robot = Mapping(tmp_path)
    robot.drive_to(3.2, 6.4, 1.57, at_s=2.0)
    robot.bench.run(3.0)
    assert robot.said('planner/state')[-1].startswith(
        'refused: the goal 3.20, 6.40 lies in ground that nobody has seen yet')
    robot.drive_to(2.45, 3.4, 1.57, at_s=0.1)
    robot.bench.run(14.0)
    robot.drive_to(3.2, 6.4, 1.57, at_s=0.1)
    robot.bench.run(18.0)
    assert robot.is_at(3.2, 6.4, 1.57), (robot.pose, robot.said('planner/state'))
    # The map changed with almost every look, and no plan was made anew.
    assert robot.planner.statistics()['map_changes'] > 10
    assert robot.planner.statistics()['plans'] == 2
    assert robot.entered == 0
    assert robot.nearest_m > 0.03
