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

"""The agent with planner, trajectory, multiplexer and guard: it gets to whoever needs help."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest
from rt_robot_os.features.agent.module import AgentModule
from rt_robot_os.motion.angles import wrapped
from test_service_robot import PERSON_M
from test_service_robot import RADIUS_M
from test_service_robot import Robot

pytest.importorskip('nav_msgs', reason='ROS 2 messages are not installed')


class Helper(Robot):
    """A service robot with an agent, and somebody in the other room."""

    SOURCES = {'agent': 60, **Robot.SOURCES}
    GUARD = {'speed_limit_topic': 'speed_limit'}
    SWITCHES = (*Robot.SWITCHES, 'trajectory_cancel')
    TRAJECTORY = {'speed_m_s': 0.5, 'linear_max_m_s': 0.6, 'cancel_topic': 'trajectory_cancel'}
    AGENT: dict[str, Any] = {}

    def __init__(self, folder: Path, **more: Any) -> None:
        super().__init__(folder, **{'cancel_topic': 'trajectory_cancel', **more})
        self.person = self.anna = 4.6, 3.0
        self.speeds: list[tuple[float, float]] = []
        self.bench.kernel.add_task('person', self._tell_place, priority=70, rate_hz=10.0)

    def add_more(self, path: str) -> None:
        bench = self.bench
        bench.bus.declare('alarms/events', 'std_msgs/msg/String', tail=6000, depth=64)
        self.events = bench.bus.publisher('alarms/events')
        self.add_places(path)
        # The multiplexer, which comes later, writes it.
        bench.bus.declare('steering', 'std_msgs/msg/String', tail=200)
        self.agent = bench.add(
            AgentModule, 'agent', priority=40, people=['anna'], map=path,
            robot_radius_m=RADIUS_M, report_s=0.5, observe=[], home=[1.0, 1.25, 0.0],
            **self.AGENT, **{f'{name}_topic': '' for name in (
                'battery', 'answer', 'observed', 'command')})
        self.said_in = bench.watch('agent/transitions')

    def add_places(self, path: str) -> None:
        """Add who tells where anna is."""
        self.place = self.bench.topic('health/anna/place', 'geometry_msgs/msg/PoseStamped',
                                      {'header.frame_id': 'map'})

    def _tell_place(self) -> None:
        self.place.msg.pose.position = *self.anna, 0.0
        self.place.publish()
        gap_m = math.dist(self.anna, self.pose[:2]) - RADIUS_M - PERSON_M
        self.speeds.append((gap_m, abs(self.velocity[0])))

    def alarm(self, state: str) -> None:
        self.events.msg.data = json.dumps({
            'alarm': '1', 'state': state, 'level': 'critical', 'subject': 'anna',
            'kinds': ['fall']})
        self.events.publish()

    def path(self) -> list[str]:
        found = []
        self.said_in.rewind()
        while self.said_in.take():
            found.append(json.loads(str(self.said_in.msg.data))['to'])
        return found


def test_it_drives_to_somebody_in_another_room_looks_stays_and_comes_home(
        tmp_path: Path) -> None:
    robot = Helper(tmp_path)
    robot.bench.at(1.0, lambda: robot.alarm('raised'))
    stayed: list[tuple[float, float]] = []

    def look() -> None:
        x, y, yaw = robot.pose
        dx, dy = 4.6 - x, 3.0 - y
        stayed.append((math.hypot(dx, dy), abs(wrapped(math.atan2(dy, dx) - yaw))))
        robot.alarm('resolved')

    robot.bench.at(30.0, look)
    robot.bench.run(60.0)
    assert robot.path() == ['approach', 'observe', 'report', 'stay', 'return', 'idle']
    (away_m, off_rad), = stayed
    assert 0.75 < away_m < 1.25 and off_rad < 0.3
    assert robot.nearest_m > 0.03 and robot.nearest_person_m > 0.3
    assert robot.is_at(1.0, 1.25, 0.0), robot.pose
    # Slowly near people.
    assert max(speed for gap_m, speed in robot.speeds if gap_m < 1.9) <= 0.31
    assert max(speed for gap_m, speed in robot.speeds) > 0.4


def test_whom_it_cannot_reach_it_gives_up_with_the_reason(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Helper, 'AGENT', {'places': 2, 'retries': 0, 'give_up_s': 1.0})
    robot = Helper(tmp_path, doors=1, patience_s=4.0, retry_s=1.0)
    robot.person = 3.05, 1.25  # somebody else, in the only door
    robot.bench.at(1.0, lambda: robot.alarm('raised'))
    robot.bench.run(40.0)
    assert robot.path() == ['approach', 'give_up', 'return', 'idle'], robot.said('planner/state')
    robot.said_in.rewind()
    assert robot.said_in.take() and robot.said_in.take()
    cause = json.loads(str(robot.said_in.msg.data))['cause']
    assert cause.startswith('blocked: ') and '(2 places tried)' in cause
    assert robot.nearest_person_m > 0.1


def test_once_it_has_given_up_it_stands_though_the_way_becomes_free(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Helper, 'AGENT', {
        'places': 1, 'retries': 0, 'waiting_s': 2.0, 'give_up_s': 60.0})
    robot = Helper(tmp_path, doors=1, patience_s=60.0, retry_s=0.5)
    robot.person = 3.05, 1.25  # somebody else, in the only door
    stood: list[tuple[float, float, float]] = []

    def leave() -> None:
        stood.append(robot.pose)
        robot.person = 5.0, 5.0

    robot.bench.at(1.0, lambda: robot.alarm('raised'))
    robot.bench.at(14.0, leave)
    robot.bench.run(24.0)
    assert robot.path() == ['approach', 'give_up'], robot.said('planner/state')
    assert robot.is_at(*stood[0]), (stood, robot.pose, robot.said('planner/state'))
