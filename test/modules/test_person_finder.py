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
"""Where the robot sees somebody: bodies on the floor, people who walk by, chairs, nobody."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from live_maps import map_topic
from live_maps import put_grid
import numpy as np
import pytest
from rt_robot_os.features.agent.person_finder import PersonFinder
from rt_robot_os.features.agent.standoff import StandoffPlanner
from rt_robot_os.motion.clearing import Clearing
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.sim.world import World
from rt_robot_os.sim.world_settings import WorldSettings
from rt_robot_os.testing.module_bench import ModuleBench

S = 10**9
MAP = str(Path(__file__).resolve().parents[2] / 'config' / 'maps' / 'flat.yaml')
RAYS, STEP = 682, math.radians(240.0) / 681
LASER = (0.12, 0.0, 0.25)
POSE = 'geometry_msgs/msg/PoseStamped'
Pose = tuple[float, float, float]
#: As that of the agent, with its defaults.
BESIDE = StandoffPlanner(Clearing(GridMap.load(MAP), 0.42), 1.0, 0.2)
#: In the living room, looking to where anna lies.
ROBOT: Pose = (3.4, 1.2, 2.2)


class Room:
    """A robot that looks into the flat, without a world of its own clock: people stand still."""

    def __init__(self, robot: Pose = ROBOT, *, by_nodes: tuple[float, float] = (2.2, 3.0),
                 state: str = 'approach anna: fall', noise_m: float = 0.01,
                 people: tuple[str, ...] = ('anna 0.0 2.2 3.0 2.3 3.0', 'chair 0.0 9 6 9.1 6'),
                 **settings: Any) -> None:
        self.world = World(WorldSettings(map=MAP, start=robot, people=people))
        self.world.advance(0)
        self.robot = robot
        self.bench = bench = ModuleBench()
        bench.mountings['laser'] = Mounting(LASER)
        fixed = {'header.frame_id': 'map'}
        self.pose = bench.topic('pose', 'geometry_msgs/msg/PoseWithCovarianceStamped', fixed)
        self.bob = bench.topic('health/bob/place', POSE, fixed)
        bench.bus.declare('agent/state', 'std_msgs/msg/String', tail=200)
        self.state = bench.bus.publisher('agent/state')
        self.scan = bench.topic('scan', 'sensor_msgs/msg/LaserScan', {
            'header.frame_id': 'laser', 'ranges': RAYS, 'intensities': 0})
        self.nodes = bench.topic('health/anna/place_by_nodes', POSE, fixed)
        self.charts = map_topic(bench.bus)
        self.finder = bench.add(PersonFinder, 'anna_seen', rate_hz=5.0,
                                **{'map': MAP, 'person': 'anna', **settings})
        self.seen = bench.watch('health/anna/seen')
        self._random = np.random.default_rng(1)
        self._noise_m = noise_m
        bench.at(0.1, lambda: self.say(state))
        bench.at(0.1, lambda: self.hear(*by_nodes))
        bench.kernel.add_task('laser', self._measure, priority=60, rate_hz=25.0)

    def say(self, text: str) -> None:
        self.state.msg.data = text
        self.state.publish()

    def hear(self, x: float, y: float) -> None:
        self.nodes.msg.pose.position.x, self.nodes.msg.pose.position.y = x, y
        self.nodes.publish()

    def lie(self, name: str, x: float, y: float, heading: float) -> None:
        person = next(each for each in self.world.people if each.name == name)
        person.stand(x, y)
        person.fall(heading)
        person.step(2.0, -9.0, -9.0, 0.2)

    def stand(self, name: str, x: float, y: float) -> None:
        next(each for each in self.world.people if each.name == name).stand(x, y)

    def _measure(self) -> None:
        x, y, yaw = self.robot
        message = self.pose.msg.pose.pose
        message.position.x, message.position.y = x, y
        message.orientation.z, message.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
        self.pose.publish()
        scan, first = self.scan.msg, -STEP * (RAYS - 1) / 2
        scan.angle_min, scan.angle_increment = first, STEP
        scan.range_min, scan.range_max = 0.02, 5.6
        ranges = self.world.cast(
            x + LASER[0] * math.cos(yaw), y + LASER[0] * math.sin(yaw),
            yaw + first + STEP * np.arange(RAYS), 5.6, LASER[2])
        scan.ranges[:] = ranges + self._random.normal(0.0, self._noise_m, RAYS)
        self.scan.publish()

    def run(self, seconds: float) -> list[tuple[float, float, float]]:
        """Return when, and where, the person was seen."""
        self.bench.run(seconds)
        found = []
        while self.seen.take():
            position = self.seen.msg.pose.position
            found.append((self.seen.stamp_ns / S, float(position.x), float(position.y)))
        return found


def from_body_m(room: Room, x: float, y: float, name: str = 'anna') -> float:
    """Return how far a point is from the skin of somebody: 0 on it."""
    person = next(each for each in room.world.people if each.name == name)
    return abs(min(math.hypot(disc_x - x, disc_y - y) - radius
                   for disc_x, disc_y, radius in person.discs()))


def nearest_m(room: Room, name: str = 'anna') -> float:
    """Return how far the robot is from the nearest part of somebody."""
    return from_body_m(room, *room.robot[:2], name)


@pytest.mark.parametrize('x, y, heading, robot', [
    (2.2, 3.0, 0.3, ROBOT), (2.2, 3.0, 1.9, ROBOT), (2.2, 3.0, -1.0, ROBOT),
    (3.2, 6.2, 0.0, (2.45, 5.0, 1.0)), (7.6, 2.4, 2.5, (6.3, 1.2, 0.7))])
def test_who_lies_is_seen_where_their_body_is_nearest(
        x: float, y: float, heading: float, robot: Pose) -> None:
    for off_x, off_y in ((1.5, 0.5), (-1.2, -1.2), (0.0, 0.0)):
        room = Room(robot, by_nodes=(x + off_x, y + off_y))
        room.lie('anna', x, y, heading)
        seen = room.run(4.0)
        assert len(seen) > 10
        assert seen[0][0] == pytest.approx(1.3, abs=0.25)
        for _, seen_x, seen_y in seen:
            assert from_body_m(room, seen_x, seen_y) < 0.1
            away_m = math.dist((seen_x, seen_y), room.robot[:2])
            assert away_m == pytest.approx(nearest_m(room), abs=0.1)
            # Where the agent goes it has its distance from all of the body.
            goal = BESIDE.places((seen_x, seen_y), room.robot[:2], 1)[0]
            assert from_body_m(room, *goal[:2]) > 0.7


def test_who_stands_is_seen_too() -> None:
    room = Room()
    room.stand('anna', 2.0, 3.2)
    seen = room.run(3.0)
    assert seen
    assert all(from_body_m(room, x, y) < 0.1 for _, x, y in seen)


def test_whoever_walks_by_is_not_taken_and_does_not_take_the_place_of_who_lies() -> None:
    room = Room(people=('anna 0.0 9 6 9.1 6', 'bob 0.5 1.2 2.4 3.6 2.4'))
    room.bench.kernel.add_task(
        'bob', lambda: room.world.people[1].step(0.02, -9.0, -9.0, 0.2), priority=70,
        rate_hz=50.0)
    # To and fro, and where they turn round is no place to stay either.
    assert not room.run(4.0)
    room.lie('anna', 2.4, 3.4, 0.2)
    seen = room.run(12.0)
    assert seen
    assert all(from_body_m(room, x, y) < 0.1 for _, x, y in seen)


def test_a_chair_far_from_the_place_is_nobody() -> None:
    room = Room(by_nodes=(1.2, 3.4), search_m=2.0)
    room.lie('anna', 9.0, 6.0, 0.0)
    room.stand('chair', 4.4, 3.4)
    assert not room.run(4.0)


def test_nobody_is_seen_where_nobody_is_also_with_noise_and_a_pose_that_is_off() -> None:
    room = Room(noise_m=0.03)
    room.lie('anna', 9.0, 6.0, 0.0)
    x, y, yaw = room.robot
    measure = room._measure

    def beside_itself() -> None:
        measure()
        room.pose.msg.pose.pose.position.x = x + 0.05
        room.pose.msg.pose.pose.orientation.z = math.sin((yaw + 0.02) / 2)
        room.pose.msg.pose.pose.orientation.w = math.cos((yaw + 0.02) / 2)
        room.pose.publish()

    room.bench.kernel.add_task('off', beside_itself, priority=61, rate_hz=25.0)
    assert not room.run(4.0)
    assert room.finder.statistics()['scans'] > 10


def test_it_keeps_to_whom_it_has_taken_and_lets_go_when_nodes_say_elsewhere() -> None:
    room = Room(by_nodes=(2.2, 3.0))
    room.lie('anna', 2.0, 3.2, 0.3)
    # A chair that is about as near appears later, and one moment it is the nearer one.
    room.bench.at(2.0, lambda: room.stand('chair', 3.4, 3.0))
    room.bench.at(4.0, lambda: room.hear(2.8, 3.0))
    seen = room.run(7.0)
    assert all(from_body_m(room, x, y) < 0.1 for _, x, y in seen)
    assert seen[-1][0] > 6.5
    room.bench.at(1.0, lambda: room.hear(8.6, 3.0))
    assert 7.5 < room.run(4.0)[-1][0] < 8.3


def test_of_things_about_as_near_the_one_as_long_as_a_body_is_taken() -> None:
    room = Room(by_nodes=(2.6, 2.6))
    room.lie('anna', 1.8, 3.4, 0.8)
    room.stand('chair', 3.2, 2.8)
    seen = room.run(4.0)
    assert seen
    assert all(from_body_m(room, x, y) < 0.1 for _, x, y in seen)


def test_what_is_nearer_to_where_somebody_else_is_said_to_be_is_them() -> None:
    for bob, is_seen in (((4.5, 3.8), False), ((9.0, 2.0), True)):
        room = Room(by_nodes=(2.0, 2.2), others=['bob'])
        room.lie('anna', 9.0, 6.0, 0.0)  # out of sight
        room.stand('chair', 3.9, 3.2)
        room.bob.msg.pose.position.x, room.bob.msg.pose.position.y = bob
        room.bench.at(0.5, room.bob.publish)
        assert bool(room.run(3.0)) == is_seen


def test_it_says_nothing_more_when_they_are_gone() -> None:
    room = Room()
    room.lie('anna', 2.2, 3.0, 0.3)
    room.bench.at(3.0, lambda: room.lie('anna', 9.0, 6.0, 0.0))
    seen = room.run(6.0)
    assert 2.5 < seen[-1][0] <= 3.05


@pytest.mark.parametrize('state', ['idle', 'return anna: fall', 'approach bob: fall',
                                   'approach annabel: fall', 'held anna: fall', ''])
def test_it_looks_only_while_the_agent_serves_that_person(state: str) -> None:
    room = Room(state=state)
    room.lie('anna', 2.2, 3.0, 0.3)
    assert not room.run(3.0)
    assert room.finder.statistics()['scans'] == 0
    room.bench.at(0.5, lambda: room.say('confirm anna: fall'))
    assert room.run(3.0)


def test_who_lies_still_and_comes_onto_the_live_map_is_seen_until_the_agent_has_ended() -> None:
    room = Room(map='', map_topic='map')
    room.lie('anna', 2.2, 3.0, 0.3)
    assert not room.run(2.0)
    assert room.finder.statistics()['warning'] == 'no map yet on map'
    grid = GridMap.load(MAP)
    put_grid(room.charts, grid)
    room.charts.publish()
    room.bench.at(0.1, lambda: room.say('idle'))
    room.bench.at(0.3, lambda: room.say('approach anna: fall'))
    assert room.run(4.0)
    cells = grid.cells.copy()
    row, column = grid.cell(2.2, 3.0) or (0, 0)
    cells[row - 25:row + 25, column - 25:column + 25] = 100
    put_grid(room.charts, grid, cells)
    room.charts.publish()
    assert len(room.run(4.0)) > 10
    room.bench.at(0.1, lambda: room.say('idle'))
    room.bench.at(0.3, lambda: room.say('approach anna: fall'))
    assert not [at_s for at_s, _, _ in room.run(4.0) if at_s > 10.5]


def test_a_turn_in_place_shows_no_walls_beside_themselves() -> None:
    room = Room()
    room.lie('anna', 9.0, 6.0, 0.0)

    def turn() -> None:
        x, y, yaw = room.robot
        room.robot = x, y, yaw + 0.8 / 25.0

    room.bench.kernel.add_task('turn', turn, priority=62, rate_hz=25.0)
    assert not room.run(8.0)
    assert room.finder.statistics()['scans_while_turning'] > 20
