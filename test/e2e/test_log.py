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


"""The log on its way out: /rosout with names and moments, a file that is bounded, a full disk."""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402, I100
from rcl_interfaces.msg import Log  # noqa: E402
from rcl_interfaces.msg import Parameter  # noqa: E402
from rcl_interfaces.msg import ParameterType  # noqa: E402
from rcl_interfaces.msg import ParameterValue  # noqa: E402
from rcl_interfaces.srv import SetParameters  # noqa: E402
from rclpy.qos import DurabilityPolicy  # noqa: E402
from rclpy.qos import QoSProfile  # noqa: E402

Until = Callable[..., Any]

MODULE = """
from rt_robot_os.modules import Module


class Talker(Module):
    def activate(self):
        self.jobs = 0

    def deactivate(self):
        self.log.info('goodbye after %d jobs', self.jobs)

    def step(self):
        self.jobs += 1
        self.log.debug('detail %d', self.jobs)
        self.log.warn('job %d of %s', self.jobs, [1, 2], throttle_s=0.5)
"""
ROBOT = """
robot:
  ros__parameters:
    core: {cpu: -2, scheduler_priority: 0, lock_memory: false}
    log: {folder: %s}
    modules: [talker]
    talker: {type: 'talker_module:Talker', rate_hz: 100.0, priority: 40}
"""


def start(world: Any, folder: str) -> tuple[Any, list[Any]]:
    (world.folder / 'talker_module.py').write_text(MODULE)
    found: list[Any] = []
    world.node.create_subscription(Log, '/rosout', found.append, QoSProfile(
        depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    robot = world.robot(ROBOT % folder, PYTHONPATH=os.pathsep.join(
        [str(world.folder), str(Path(__file__).parents[2]), os.environ.get('PYTHONPATH', '')]))
    return robot, found


def lost(diagnostics: list[Any]) -> int:
    return max((int(value.value) for message in list(diagnostics) for status in message.status
                if status.name == 'robot: log' for value in status.values
                if value.key == 'lost'), default=0)


def set_level(world: Any, level: str) -> Any:
    request = SetParameters.Request(parameters=[Parameter(
        name='talker.log_level', value=ParameterValue(
            type=ParameterType.PARAMETER_STRING, string_value=level))])
    return world.call(SetParameters, '/robot/set_parameters', request).results[0]


def test_a_module_logs_to_rosout_to_the_console_and_to_the_file(
        world: Any, until: Until, tmp_path: Path) -> None:
    robot, found = start(world, str(tmp_path))

    def lines() -> list[Any]:
        return [m for m in list(found) if m.name == 'robot.talker']

    until(lambda: any(' more in 0.5 s, the last: job ' in m.msg for m in lines()), 'a summary')
    first = lines()[0]
    assert first.msg == 'job 1 of [1, 2]' and first.level == 30
    assert [m.msg for m in lines()].count(first.msg) == 1  # once, not once more by rclpy
    age_ns = world.node.get_clock().now().nanoseconds - (
        first.stamp.sec * 10**9 + first.stamp.nanosec)
    assert 0 < age_ns < 120 * 10**9
    robot.wait_for_line('[robot.talker]: job 1 of [1, 2]')
    assert not any(m.level == 10 for m in lines())
    assert not set_level(world, 'loud').successful
    changed = set_level(world, 'debug')
    assert changed.successful, changed.reason
    until(lambda: any(m.msg.startswith('detail ') for m in lines()), 'a line of DEBUG')
    assert robot.end() == 0
    written = (tmp_path / 'robot.log').read_text()
    assert ' WARN talker: job 1 of [1, 2]\n' in written and ' DEBUG talker: detail ' in written
    assert ' INFO node: connected to the core' in written
    assert ' INFO talker: goodbye after ' in written


@pytest.mark.skipif(not os.path.exists('/dev/full'), reason='there is no /dev/full')
def test_a_full_disk_is_told_once_and_the_robot_runs_on(
        world: Any, until: Until, tmp_path: Path) -> None:
    (tmp_path / 'robot.log').symlink_to('/dev/full')
    robot, found = start(world, str(tmp_path))
    diagnostics = world.listen(DiagnosticArray, '/diagnostics')
    until(lambda: sum(m.name == 'robot.talker' for m in list(found)) > 4, 'lines on /rosout')
    until(lambda: lost(diagnostics) > 4, 'lost lines in /diagnostics')
    robot.wait_for_line('No space left on device')
    assert sum('No space left on device' in line for line in robot.lines) == 1
    assert robot.end() == 0
