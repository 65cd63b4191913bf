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

"""Planner, trajectory, multiplexer and guard together: a robot among walls and somebody."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from live_maps import map_topic
import numpy as np
import pytest

from rt_robot_os.features.navigation.collision_guard import CollisionGuard
from rt_robot_os.features.navigation.planner import Planner
from rt_robot_os.features.navigation.trajectory import Trajectory
from rt_robot_os.features.navigation.velocity_mux import VelocityMux
from rt_robot_os.motion.angles import wrapped
from rt_robot_os.motion.differential import moved
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.motion.poses import composed
from rt_robot_os.motion.walls import Walls
from rt_robot_os.testing.module_bench import ModuleBench

pytest.importorskip('nav_msgs', reason='ROS 2 messages are not installed')

RADIUS_M, PERSON_M, STEP_S = 0.22, 0.2, 0.02
RAYS = 240
ANGLES = np.linspace(-2.0, 2.0, RAYS)


def two_rooms(folder: Path, doors: int) -> tuple[str, GridMap]:
    cells = np.zeros((80, 120), np.int8)
    cells[0] = cells[-1] = 100
    cells[:, 0] = cells[:, -1] = 100
    cells[:, 60:62] = 100
    cells[15:35, 60:62] = 0
    if doors == 2:
        cells[55:75, 60:62] = 0
    grid = GridMap(cells, 0.05)
    grid.save(folder / 'rooms.yaml')
    return str(folder / 'rooms.yaml'), grid


class Robot:
    """The modules of a service robot, and a robot that does what comes out."""

    SOURCES = {'trajectory': 40, 'ros': 20}
    GUARD: dict[str, Any] = {}
    TRAJECTORY: dict[str, Any] = {}
    SWITCHES = ('estop', 'estop_release')

    def __init__(self, folder: Path, doors: int = 2, grid: GridMap | None = None,
                 **planner: Any) -> None:
        self.bench = bench = ModuleBench()
        path, rooms = two_rooms(folder, doors)
        grid = grid or rooms
        self.walls = Walls.of(grid)
        ys, xs = np.nonzero(grid.occupied_mask())
        self.solid = np.stack(grid.centre(ys, xs), axis=1)
        bench.mountings['laser'] = Mounting((0.1, 0.0, 0.2))
        on_map = {'header.frame_id': 'map'}
        self.goal = bench.topic('goal_pose', 'geometry_msgs/msg/PoseStamped', on_map)
        self.located = bench.topic(
            'pose', 'geometry_msgs/msg/PoseWithCovarianceStamped', on_map, rate_hz=50.0)
        self.odom = bench.topic('odom', 'nav_msgs/msg/Odometry', {
            'header.frame_id': 'odom', 'child_frame_id': 'base_link'}, rate_hz=50.0)
        self.scan = bench.topic('scan', 'sensor_msgs/msg/LaserScan', {
            'header.frame_id': 'laser', 'ranges': RAYS, 'intensities': 0}, rate_hz=10.0)
        self.correction = bench.topic(
            'slam/correction', 'geometry_msgs/msg/PoseWithCovarianceStamped', on_map)
        self.chart = map_topic(bench.bus)
        bench.topic('cmd_vel', 'geometry_msgs/msg/Twist')
        self.estop, self.release, *_ = (bench.topic(name, 'std_msgs/msg/Bool')
                                        for name in self.SWITCHES)
        # Each of the two reads what the other writes.
        bench.bus.declare('plan', 'std_msgs/msg/Float64MultiArray', depth=2, tail=3000)
        bench.add(Trajectory, 'trajectory', rate_hz=50.0, priority=45, goal_topic='',
                  plan_topic='plan', **self.TRAJECTORY)
        self.planner = bench.add(Planner, 'planner', rate_hz=10.0, priority=5, **{
            'map': path, 'scan_topics': ['scan'], 'robot_radius_m': RADIUS_M, **planner})
        self.add_more(path)
        bench.add(VelocityMux, 'mux', priority=65, sources=list(self.SOURCES), source_topics=[
                      'cmd_vel' if name == 'ros' else f'cmd_vel_{name}' for name in self.SOURCES],
                  source_priorities=list(self.SOURCES.values()),
                  source_timeouts_s=[0.5] * len(self.SOURCES), dead_man_sources=[])
        self.guard = bench.add(CollisionGuard, 'guard', priority=66, robot_radius_m=RADIUS_M,
                               **self.GUARD)
        self.safe = bench.watch('cmd_vel_safe')
        self.told = {name: bench.watch(name) for name in (
            'planner/state', 'trajectory/state', 'stop_reason', 'steering')}
        self.pose, self.velocity = (1.0, 1.25, 0.0), (0.0, 0.0)
        self.map_at: Pose = (0.0, 0.0, 0.0)  # where the true map is on that of the robot
        self.person: tuple[float, float] | None = None
        self.nearest_m = self.nearest_person_m = math.inf
        self._ticks = 0
        bench.kernel.add_task('plant', self._live, priority=90, rate_hz=1 / STEP_S)

    def add_more(self, path: str) -> None:
        """Add modules that steer; for robots that have more."""

    def _live(self) -> None:
        if self.safe.latest():
            self.velocity = self.safe.msg.linear.x, self.safe.msg.angular.z
        v, w = self.velocity
        self.pose = x, y, yaw = moved(self.pose, v * STEP_S, w * STEP_S)
        self.nearest_m = min(self.nearest_m, float(
            np.hypot(*(self.solid - (x, y)).T).min()) - RADIUS_M)
        if self.person:
            gap_m = math.dist(self.person, (x, y)) - RADIUS_M - PERSON_M
            self.nearest_person_m = min(self.nearest_person_m, gap_m)
        for message, pose in ((self.located.msg.pose.pose, composed(self.map_at, self.pose)),
                              (self.odom.msg.pose.pose, self.pose)):
            message.position = *pose[:2], 0.0
            message.orientation = 0.0, 0.0, math.sin(pose[2] / 2), math.cos(pose[2] / 2)
        self.odom.msg.twist.twist.linear.x, self.odom.msg.twist.twist.angular.z = v, w
        covariance = self.located.msg.pose.covariance
        covariance[0] = covariance[7] = covariance[35] = 1e-4
        self.odom.publish()
        self.located.publish()
        if self._ticks % 5 == 0:
            self._look()
        self._ticks += 1

    def _look(self) -> None:
        x, y, yaw = self.pose
        x, y = x + 0.1 * math.cos(yaw), y + 0.1 * math.sin(yaw)
        ranges = self.walls.cast(x, y, ANGLES + yaw, 5.0)
        if self.person:
            dx, dy = self.person[0] - x, self.person[1] - y
            away, aside = math.hypot(dx, dy), ANGLES + yaw - math.atan2(dy, dx)
            off = away * np.sin(aside)
            hit = (np.abs(off) < PERSON_M) & (np.cos(aside) > 0.0)
            front = away * np.cos(aside) - np.sqrt(np.maximum(PERSON_M ** 2 - off ** 2, 0.0))
            ranges = np.where(hit, np.minimum(ranges, front), ranges)
        msg = self.scan.msg
        msg.angle_min, msg.angle_increment = -2.0, 4.0 / (RAYS - 1)
        msg.range_min, msg.range_max = 0.02, 5.0
        msg.ranges[:] = ranges
        self.scan.publish()

    def drive_to(self, x: float, y: float, yaw: float, at_s: float = 0.5) -> None:
        def do() -> None:
            pose = self.goal.msg.pose
            pose.position = x, y, 0.0
            pose.orientation = 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)
            self.goal.publish()
        self.bench.at(at_s, do)

    def stand(self, where: tuple[float, float] | None, at_s: float) -> None:
        def do() -> None:
            self.person = where
        self.bench.at(at_s, do)

    def said(self, name: str) -> list[str]:
        found, read = [], self.told[name]
        read.rewind()
        while read.take():
            text = str(read.msg.data)
            if not found or found[-1] != text:
                found.append(text)
        return found

    def is_at(self, x: float, y: float, yaw: float) -> bool:
        return (math.dist(self.pose[:2], (x, y)) < 0.05
                and abs(wrapped(self.pose[2] - yaw)) < 0.1)


def test_it_drives_through_a_door_to_a_goal_behind_the_wall(tmp_path: Path) -> None:
    robot = Robot(tmp_path)
    robot.drive_to(5.0, 3.0, 1.5)
    robot.bench.run(45.0)
    assert robot.is_at(5.0, 3.0, 1.5), (robot.pose, robot.said('trajectory/state'))
    assert robot.nearest_m > 0.03
    assert robot.said('planner/state')[-1] == 'done'
    assert robot.velocity == (0.0, 0.0)
    assert robot.said('steering')[-1] == 'nobody'


@pytest.mark.parametrize('until_s', [15.0, 26.0], ids=['soon', 'when the follower has stopped'])
def test_it_stops_for_somebody_in_the_only_door_and_goes_on_when_they_left(
        tmp_path: Path, until_s: float) -> None:
    robot = Robot(tmp_path, doors=1, obstacle_memory_s=2.0)
    robot.drive_to(5.0, 1.25, 0.0)
    robot.stand((3.0, 1.3), 2.0)
    robot.bench.run(14.0)
    assert robot.velocity == (0.0, 0.0)
    assert 1.2 < robot.pose[0] < 2.9
    robot.stand(None, until_s - 14.0)
    robot.bench.run(46.0)
    assert robot.is_at(5.0, 1.25, 0.0), (robot.pose, robot.said('planner/state'))
    assert robot.nearest_person_m > 0.1
    assert robot.nearest_m > 0.03


def test_it_takes_the_other_door_when_somebody_stays_in_the_first(tmp_path: Path) -> None:
    robot = Robot(tmp_path)
    robot.drive_to(5.0, 1.25, 0.0)
    robot.stand((3.0, 1.3), 2.0)
    robot.bench.run(80.0)
    assert robot.is_at(5.0, 1.25, 0.0), (robot.pose, robot.said('planner/state'))
    assert robot.nearest_person_m > 0.1
    assert robot.nearest_m > 0.03
    assert len([text for text in robot.said('planner/state') if 'planned' in text]) >= 2


def test_a_goal_right_before_a_wall_is_moved_to_where_the_guard_lets_it_go(
        tmp_path: Path) -> None:
    robot = Robot(tmp_path)
    robot.drive_to(5.7, 1.25, 0.0)
    robot.bench.run(40.0)
    states = robot.said('planner/state')
    assert states[-1] == 'done', states
    assert 'goal moved by 0.1' in states[-2]
    assert 5.4 < robot.pose[0] < 5.65


def test_a_goal_that_is_refused_on_the_way_stops_it(tmp_path: Path) -> None:
    robot = Robot(tmp_path)
    robot.drive_to(5.0, 3.0, 1.5)
    robot.drive_to(50.0, 3.0, 1.5, at_s=4.0)
    robot.bench.run(8.0)
    assert robot.velocity == (0.0, 0.0)
    assert robot.said('planner/state')[-1].startswith('refused: the goal 50.00, 3.00 is off the')
    assert robot.said('trajectory/state')[-1].startswith('stopped: ')


def test_the_e_stop_holds_it_whatever_is_planned_until_it_is_released(tmp_path: Path) -> None:
    robot = Robot(tmp_path)
    robot.drive_to(5.0, 1.25, 0.0)

    def press(switch: Any, value: bool) -> None:
        switch.msg.data = value
        switch.publish()

    robot.bench.at(3.0, lambda: press(robot.estop, True))
    robot.bench.run(5.0)
    stopped_at = robot.pose
    assert robot.velocity == (0.0, 0.0)
    robot.drive_to(5.0, 3.0, 0.0, at_s=0.5)
    robot.bench.run(5.0)
    assert robot.pose == stopped_at
    assert robot.said('steering')[-1] == 'nobody: e-stop, asked for on estop'
    robot.bench.at(0.1, lambda: press(robot.estop, False))
    robot.bench.at(0.2, lambda: press(robot.release, True))
    robot.drive_to(5.0, 3.0, 0.0, at_s=0.5)
    robot.bench.run(30.0)
    assert robot.is_at(5.0, 3.0, 0.0), (robot.pose, robot.said('trajectory/state'))
