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

"""A planner in two rooms, for tests: goals and scans in, plans and states out."""

from __future__ import annotations

from collections.abc import Callable
import math
from pathlib import Path
from typing import Any

from live_maps import map_topic
from live_maps import put_grid
import numpy as np
import numpy.typing as npt
from rt_robot_os.features.navigation.planner import Planner
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.testing.module_bench import ModuleBench

S = 1_000_000_000
RAYS = 360
ANGLES = -math.pi + 2 * math.pi / RAYS * np.arange(RAYS)


def rooms(door: bool = True) -> npt.NDArray[np.int8]:
    """Return 6 m x 4 m: two rooms, a wall between them, and a door in it, or two."""
    cells = np.zeros((80, 120), np.int8)
    cells[0] = cells[-1] = 100
    cells[:, 0] = cells[:, -1] = 100
    cells[:, 60] = 100
    cells[15:35, 60] = 0  # from 0.75 m to 1.75 m
    if door:
        cells[55:75, 60] = 0
    return cells


def write_map(path: Path, door: bool = True) -> str:
    """Write that map."""
    GridMap(rooms(door), 0.05).save(path / 'rooms.yaml')
    return str(path / 'rooms.yaml')


class Planned:
    """A planner, and what comes out of it."""

    def __init__(self, folder: Path, doors: int = 2, **changes: Any) -> None:
        self.bench = ModuleBench()
        self.bench.mountings['laser'] = Mounting((0.1, 0.0, 0.2))
        fixed = {'header.frame_id': 'map'}
        self.goal_out = self.bench.topic('goal_pose', 'geometry_msgs/msg/PoseStamped', fixed)
        self.pose_out = self.bench.topic(
            'pose', 'geometry_msgs/msg/PoseWithCovarianceStamped', fixed)
        self.bench.bus.declare('trajectory/state', 'std_msgs/msg/String', tail=200)
        self.state_out = self.bench.bus.publisher('trajectory/state')
        self.scan = self.bench.topic('scan', 'sensor_msgs/msg/LaserScan', {
            'header.frame_id': 'laser', 'ranges': RAYS, 'intensities': 0})
        self.map_out = map_topic(self.bench.bus)
        self.cancel_out = self.bench.topic('trajectory_cancel', 'std_msgs/msg/Bool')
        self.planner = self.bench.add(
            Planner, 'planner', rate_hz=10.0, priority=5,
            **{'map': write_map(folder, doors == 2), 'scan_topics': ['scan'], **changes})
        self.plans: list[tuple[float, list[tuple[float, float, float]]]] = []
        self.states: list[tuple[float, str]] = []
        kernel, bus = self.bench.kernel, self.bench.bus
        task = kernel.add_task('note', self._note, priority=60)
        self._plan = bus.subscribe('plan', 'note', task=task)
        self._state = bus.subscribe('planner/state', 'note', task=task)
        self.pose: tuple[float, float] | None = (1.0, 1.25)
        self.seen: tuple[float, float] | None = None
        kernel.add_task('localiser', self._localise, priority=50, rate_hz=20.0)

    def _localise(self) -> None:
        if self.pose is None:
            return
        message = self.pose_out.msg.pose.pose
        message.position.x, message.position.y = self.pose
        message.orientation.w = 1.0
        self.pose_out.publish()
        message = self.scan.msg
        message.angle_min, message.angle_increment = -math.pi, 2 * math.pi / RAYS
        message.range_min, message.range_max = 0.02, 10.0
        message.ranges[:] = math.inf
        if self.seen is not None:
            for shift in np.linspace(-0.2, 0.2, 9):
                x, y = self.seen[0] - self.pose[0] - 0.1, self.seen[1] + shift - self.pose[1]
                ray = round((math.atan2(y, x) + math.pi) / (2 * math.pi / RAYS)) % RAYS
                message.ranges[ray] = math.hypot(x, y)
        self.scan.publish()

    def _note(self) -> None:
        now_s = self.bench.kernel.now_ns() / S
        while self._plan.take():
            data = [float(each) for each in self._plan.msg.data]
            self.plans.append((now_s, list(zip(data[0::3], data[1::3], data[2::3]))))
        while self._state.take():
            self.states.append((now_s, str(self._state.msg.data)))

    def go(self, x: float, y: float, at_s: float = 0.2) -> None:
        def do() -> None:
            pose = self.goal_out.msg.pose
            pose.position.x, pose.position.y, pose.orientation.w = x, y, 1.0
            self.goal_out.publish()
        self.bench.at(at_s, do)

    def chart(self, cells: npt.NDArray[np.int8], at_s: float, origin: tuple[float, float] = (0, 0),
              damage: Callable[[Any], object] = lambda message: None) -> None:
        """Publish a live map."""
        def do() -> None:
            damage(put_grid(self.map_out, GridMap(cells, 0.05, (*origin, 0.0))))
            self.map_out.publish()
        self.bench.at(at_s, do)

    def say(self, state: str, at_s: float) -> None:
        def do() -> None:
            self.state_out.msg.data = state
            self.state_out.publish()
        self.bench.at(at_s, do)

    def told(self) -> list[str]:
        return [text for _, text in self.states]


def through(plan: list[tuple[float, float, float]]) -> float:
    """Return where a plan passes the wall."""
    return next(y for x, y, _ in plan if x > 3.0)
