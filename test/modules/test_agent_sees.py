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
"""The agent goes to where the robot sees somebody lie, not to where nodes say that they are."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from rt_robot_os.features.agent.person_finder import PersonFinder
from rt_robot_os.features.health.whereabouts import Whereabouts
from rt_robot_os.motion.walls import disc_distances
from rt_robot_os.sim.world.people import SimulatedPerson
from rt_robot_os.sim.world.scene import WalkingRoute
from test_agent_drive import Helper
from test_service_robot import ANGLES

BODY = (4.2, 3.0)
#: The sensor of presence that notices her hangs here: the robot would go beside it.
NODE = (5.0, 1.2)


class Seeing(Helper):
    """A robot that nodes tell where somebody is, roughly, and that has a scanner."""

    HEADING = 0.0
    FINDER = True

    def __init__(self, folder: Path) -> None:
        self.robot = SimulatedPerson(WalkingRoute('anna', 0.0, (BODY, (9.0, 9.0))))
        self.robot.fall(self.HEADING)
        self.robot.step(2.0, -9.0, -9.0, 0.2)
        self.gaps_m: list[float] = []
        super().__init__(folder)

    def add_places(self, path: str) -> None:
        bench, pose = self.bench, 'geometry_msgs/msg/PoseStamped'
        self.presence = bench.topic('wsn/hall/presence', 'std_msgs/msg/Float64')
        bench.bus.declare('agent/state', 'std_msgs/msg/String', tail=4000)
        seen = 'health/anna/seen' if self.FINDER else ''
        if seen:
            bench.topic('health/anna/seen', pose, {'header.frame_id': 'map'})
        bench.add(Whereabouts, 'anna_is', rate_hz=1.0, priority=28, person='anna',
                  nodes=[f'hall {NODE[0]} {NODE[1]} 2 presence'], seen_topic=seen)
        if seen:
            bench.add(PersonFinder, 'anna_seen', rate_hz=5.0, priority=28, person='anna',
                      map=path)

    def _tell_place(self) -> None:
        self.presence.msg.data = 1.0
        self.presence.publish()
        self.gaps_m.append(self.from_body_m())

    def from_body_m(self) -> float:
        """Return how far the middle of the robot is from the nearest part of her."""
        return min(math.dist((x, y), self.pose[:2]) - radius_m
                   for x, y, radius_m in self.robot.discs())

    def _look(self) -> None:
        x, y, yaw = self.pose
        x, y = x + 0.1 * math.cos(yaw), y + 0.1 * math.sin(yaw)
        msg, rays = self.scan.msg, ANGLES + yaw
        ranges = self.walls.cast(x, y, rays, 5.0)
        for disc_x, disc_y, radius_m in self.robot.discs():
            ranges = np.minimum(ranges, disc_distances(disc_x - x, disc_y - y, rays, radius_m))
        msg.angle_min, msg.angle_increment = -2.0, 4.0 / (ANGLES.size - 1)
        msg.range_min, msg.range_max = 0.02, 5.0
        msg.ranges[:] = ranges
        self.scan.publish()


class WithoutFinder(Seeing):
    """The same without eyes."""

    FINDER = False


@pytest.mark.parametrize('heading', [0.2, 1.5, 2.6])
def test_it_stops_beside_the_body_and_looks_at_it(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, heading: float) -> None:
    monkeypatch.setattr(Seeing, 'HEADING', heading)
    found = {}
    for kind in (Seeing, WithoutFinder):
        robot = kind(tmp_path)
        robot.bench.at(1.0, lambda: robot.alarm('raised'))
        robot.bench.run(50.0)
        assert robot.path() == ['approach', 'observe', 'report', 'stay']
        x, y, yaw = robot.pose
        off = min(abs(math.remainder(math.atan2(disc_y - y, disc_x - x) - yaw, math.tau))
                  for disc_x, disc_y, _ in robot.robot.discs())
        found[kind] = robot.from_body_m(), min(robot.gaps_m), off
    away_m, nearest_m, off = found[Seeing]
    assert 0.75 < away_m < 1.3
    assert nearest_m > 0.6
    assert off < 0.3
    # Without it the robot stands beside the node.
    assert found[WithoutFinder][2] > 0.3 or found[WithoutFinder][0] > 1.3
