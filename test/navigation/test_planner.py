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

"""The planner: goals in, ways out, and what it does when something stands in the way."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from planned_rooms import Planned
from planned_rooms import through
from planned_rooms import write_map
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.navigation.planner import Planner
from rt_robot_os.settings import default_path
from rt_robot_os.settings import load
from rt_robot_os.testing.module_bench import ModuleBench

pytest.importorskip('nav_msgs', reason='ROS 2 messages are not installed')


def test_a_goal_becomes_a_way_through_the_door(tmp_path: Path) -> None:
    robot = Planned(tmp_path)
    robot.go(5.0, 1.25)
    robot.bench.run(1.0)
    [(at_s, plan)] = robot.plans
    assert plan[0][:2] == (1.0, 1.25)
    assert plan[-1] == (5.0, 1.25, 0.0)
    assert 0.95 < through(plan) < 1.55
    assert 0.2 <= at_s < 0.8
    assert robot.told() == ['planning', 'planned: 4.00 m']
    assert robot.planner.statistics()['plans'] == 1


def test_a_done_of_the_goal_before_ends_nothing_and_that_of_this_one_does(tmp_path: Path) -> None:
    robot = Planned(tmp_path)
    robot.say('done', 0.1)
    robot.go(5.0, 1.25)
    robot.say('done', 0.9)  # said again, each second
    robot.say('driving', 1.0)
    robot.bench.run(1.1)
    assert robot.told()[-1] == 'planned: 4.00 m'
    robot.say('done', 0.2)
    robot.bench.run(0.5)
    assert robot.told()[-1] == 'done'


def test_something_in_the_door_is_gone_round_through_the_other(tmp_path: Path) -> None:
    robot = Planned(tmp_path, obstacle_range_m=4.0, blocked_s=1.0)
    robot.go(5.0, 1.25)
    robot.say('driving', 1.0)

    def appear() -> None:
        robot.seen = (3.0, 1.25)

    robot.bench.at(2.0, appear)
    robot.bench.run(4.0)
    assert len(robot.plans) == 2
    assert 3.0 <= robot.plans[1][0] < 4.0  # it waits whether it goes away
    assert through(robot.plans[1][1]) > 2.7


def test_who_only_passes_makes_no_new_way(tmp_path: Path) -> None:
    robot = Planned(tmp_path, obstacle_range_m=4.0, obstacle_memory_s=60.0)

    def place(where: tuple[float, float] | None) -> None:
        robot.seen = where

    robot.go(5.0, 1.25)
    robot.bench.at(2.0, lambda: place((3.0, 1.25)))
    robot.bench.at(4.5, lambda: place(None))  # what is seen through is not there any more
    robot.bench.run(10.0)
    assert len(robot.plans) == 1
    assert robot.planner.statistics()['obstacle_cells'] == 0


def test_without_a_way_round_it_waits_and_gives_up_when_its_patience_ends(tmp_path: Path) -> None:
    robot = Planned(tmp_path, doors=1, obstacle_range_m=4.0, patience_s=6.0,
                    blocked_s=0.1)
    robot.seen = (3.0, 1.25)
    robot.go(5.0, 1.25, at_s=0.5)
    robot.bench.run(12.0)
    assert robot.plans == []
    assert robot.told()[1] == (
        'waiting: no way to the goal is wide enough beside what stands there now')
    assert robot.told()[-1] == 'refused: blocked for 6 s'


def test_when_the_obstacle_leaves_the_door_it_goes_on(tmp_path: Path) -> None:
    robot = Planned(tmp_path, doors=1, obstacle_range_m=4.0, obstacle_memory_s=1.0,
                    blocked_s=0.1)
    robot.seen = (3.0, 1.25)

    def leave() -> None:
        robot.seen = None

    robot.go(5.0, 1.25, at_s=0.5)
    robot.bench.at(3.0, leave)
    robot.bench.run(8.0)
    assert [at_s > 3.0 for at_s, _ in robot.plans] == [True]
    assert robot.told()[-1].startswith('planned')


def test_a_follower_that_is_blocked_gets_a_way_round_at_once(tmp_path: Path) -> None:
    robot = Planned(tmp_path, obstacle_range_m=4.0, blocked_s=50.0)
    robot.go(5.0, 1.25)
    robot.say('driving', 1.0)

    def appear() -> None:
        robot.seen = (3.0, 1.25)

    robot.bench.at(1.5, appear)
    robot.say('stopped: blocked: no progress for 5 s', 2.0)
    robot.bench.run(3.0)
    assert len(robot.plans) == 2
    assert through(robot.plans[1][1]) > 2.7


def test_a_follower_that_stopped_for_another_reason_is_left_alone(tmp_path: Path) -> None:
    robot = Planned(tmp_path)
    robot.go(5.0, 1.25)
    robot.say('driving', 1.0)
    robot.say('stopped: cancelled', 2.0)
    robot.bench.run(5.0)
    assert len(robot.plans) == 1
    assert robot.told()[-1] == 'stopped: cancelled'


def test_a_robot_that_somebody_carried_off_its_path_stays_there(tmp_path: Path) -> None:
    robot = Planned(tmp_path)
    robot.go(5.0, 1.25)
    robot.say('driving', 1.0)
    robot.say('stopped: off the path by 0.80 m, at most 0.5', 2.0)
    robot.bench.run(5.0)
    assert len(robot.plans) == 1
    assert robot.told()[-1].startswith('stopped: off the path')


@pytest.mark.parametrize(('goal', 'text'), [
    ((50.0, 1.0), 'off the map'), ((math.nan, 1.0), 'the goal is no pose'),
    ((3.02, 2.3), 'planned')])
def test_goals_that_cannot_be_are_refused_or_moved_and_it_says_so(
        tmp_path: Path, goal: tuple[float, float], text: str) -> None:
    robot = Planned(tmp_path)
    robot.go(*goal)
    robot.bench.run(1.0)
    assert text in robot.told()[-1]
    if text == 'planned':
        assert 'goal moved by 0.' in robot.told()[-1]
    else:
        assert robot.plans == []
        assert robot.told()[-1].startswith('refused: ')
        assert robot.planner.statistics()['goals_refused'] == 1
        assert robot.planner.statistics()['warning']


def test_a_goal_that_is_refused_stops_who_follows_the_way_to_the_one_before(
        tmp_path: Path) -> None:
    robot = Planned(tmp_path)
    robot.go(5.0, 1.25)
    robot.say('driving', 1.0)
    robot.go(50.0, 1.25, at_s=2.0)
    robot.go(60.0, 1.25, at_s=3.0)
    robot.bench.run(4.0)
    assert [bool(plan) for _, plan in robot.plans] == [True, False]  # nobody drives the second


def test_what_the_map_forbids_is_refused_whatever_stands_about(tmp_path: Path) -> None:
    robot = Planned(tmp_path, obstacle_range_m=4.0, blocked_s=0.1)
    robot.seen = (2.0, 2.0)
    robot.go(50.0, 1.25, at_s=1.0)
    robot.bench.run(3.0)
    assert robot.planner.statistics()['obstacle_cells'] > 0
    assert robot.told()[-1].startswith('refused: the goal 50.00, 1.25 is off the map')


def test_nobody_drives_on_to_the_goal_before_while_it_waits(tmp_path: Path) -> None:
    robot = Planned(tmp_path, doors=1, obstacle_range_m=4.0, blocked_s=0.1)
    robot.seen = (3.0, 1.25)
    robot.go(1.0, 3.0, at_s=0.5)
    robot.say('driving', 1.0)
    robot.go(5.0, 1.25, at_s=2.0)
    robot.bench.run(6.0)
    assert [bool(plan) for _, plan in robot.plans] == [True, False]
    assert robot.told()[-1].startswith('waiting: no way')
    assert robot.planner.statistics()['warning'] == robot.told()[-1]


def test_without_a_pose_it_waits_for_one(tmp_path: Path) -> None:
    robot = Planned(tmp_path)
    robot.pose = None
    robot.go(5.0, 1.25)
    robot.bench.run(1.0)
    assert (robot.told(), robot.plans) == (['waiting: no pose yet'], [])
    robot.pose = (1.0, 1.25)
    robot.bench.run(1.0)
    assert len(robot.plans) == 1


def test_planning_leaves_pauses_in_which_others_run(tmp_path: Path) -> None:
    robot = Planned(tmp_path)
    robot.go(5.0, 1.25)
    robot.bench.run(1.0)
    task = robot.planner.task
    assert task is not None
    assert task.runs > 12  # ten a second, and more while it plans
    [(at_s, _)] = robot.plans
    assert at_s > 0.2


def test_a_new_goal_takes_the_place_of_the_one_before(tmp_path: Path) -> None:
    robot = Planned(tmp_path)
    robot.go(5.0, 1.25, at_s=0.2)
    robot.go(5.0, 3.0, at_s=0.203)
    robot.bench.run(1.0)
    assert [plan[-1][:2] for _, plan in robot.plans][-1] == (5.0, 3.0)


@pytest.mark.parametrize(('changes', 'text'), [
    ({'map': '/nowhere/map.yaml'}, '/nowhere/map.yaml'),
    ({'goal_topic': 'other'}, 'declare both in the frame of the map')])
def test_a_map_that_is_not_there_and_frames_that_differ_are_told(
        tmp_path: Path, changes: dict[str, Any], text: str) -> None:
    bench = ModuleBench()
    for name, frame in (('goal_pose', 'map'), ('other', 'odom')):
        bench.topic(name, 'geometry_msgs/msg/PoseStamped', {'header.frame_id': frame})
    bench.topic('pose', 'geometry_msgs/msg/PoseWithCovarianceStamped', {'header.frame_id': 'map'})
    bench.add(Planner, 'planner', **{'map': write_map(tmp_path), 'followed_topic': '', **changes})
    with pytest.raises(ConfigError, match=text):
        bench.run(0.1)


@pytest.mark.parametrize(('name', 'found'), [
    ('rooms.yaml', '{folder}/rooms.yaml'), ('maps/flat.yaml', '{config}/maps/flat.yaml'),
    ('/srv/map.yaml', '/srv/map.yaml')])
def test_the_map_is_looked_for_beside_the_file_that_names_it_and_in_config(
        tmp_path: Path, name: str, found: str) -> None:
    write_map(tmp_path)
    file = tmp_path / 'robot.yaml'
    file.write_text(ROBOT.replace('MAP', name))
    [planner] = load([file]).modules
    assert planner.settings['map'] == found.format(
        folder=tmp_path, config=default_path().parent)


ROBOT = """
robot:
  ros__parameters:
    devices: []
    modules: [planner]
    planner: {type: planner, map: MAP, followed_topic: ''}
    topics: [goal_pose, pose]
    goal_pose: {message: geometry_msgs/msg/PoseStamped, fixed: {header.frame_id: map}}
    pose: {message: geometry_msgs/msg/PoseWithCovarianceStamped, fixed: {header.frame_id: map}}
    mirrors: []
"""
