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

"""A console that nobody reads, floods of lines, and the levels that the user has set."""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path
import signal
import subprocess
import sys
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402, I100
from geometry_msgs.msg import Twist  # noqa: E402
from rcl_interfaces.msg import Log  # noqa: E402
from rclpy.qos import DurabilityPolicy  # noqa: E402
from rclpy.qos import QoSProfile  # noqa: E402

pytestmark = pytest.mark.one_build

Until = Callable[..., Any]

ROOT = Path(__file__).resolve().parents[2]
MODULE = """
from rt_robot_os.modules import Module


class Talker(Module):
    def activate(self):
        self.jobs = 0

    def step(self):
        self.jobs += 1
        self.log.info('job %d says a lot: ' + 'x' * LENGTH, self.jobs)
        if self.jobs % 50 == 0:
            self.log.error('trouble %d', self.jobs)
            self.log.debug('detail %d', self.jobs)
"""
ROBOT = """
robot:
  ros__parameters:
    core: {cpu: -2, scheduler_priority: 0}
    modules: [guard, talker]
    talker: {type: 'noisy_module:Talker', rate_hz: RATE, priority: 30}
    guard: {type: twist_guard, rate_hz: 50.0, priority: 40}
    topics: [cmd_vel]
    cmd_vel: {message: geometry_msgs/msg/Twist, depth: 8}
    mirrors: [safe_out]
    safe_out: {topic: cmd_vel_safe, direction: out}
"""


def environment(world: Any, length: int = 200) -> dict[str, str]:
    (world.folder / 'noisy_module.py').write_text(MODULE.replace('LENGTH', str(length)))
    return {'PYTHONPATH': os.pathsep.join(
        [str(world.folder), str(ROOT), os.environ.get('PYTHONPATH', '')])}


def log_values(diagnostics: list[Any]) -> dict[str, str]:
    for message in reversed(list(diagnostics)):
        for status in message.status:
            if status.name == 'robot: log':
                return {'message': status.message, **{v.key: v.value for v in status.values}}
    return {}


def test_a_console_that_nobody_reads_holds_up_neither_samples_nor_the_end(
        world: Any, until: Until) -> None:
    safe = world.listen(Twist, '/cmd_vel_safe')
    diagnostics = world.listen(DiagnosticArray, '/diagnostics')
    parameters = world.folder / 'test.yaml'
    parameters.write_text(ROBOT.replace('RATE', '1000.0').replace(
        'core: {', 'diagnostics_rate_hz: 10.0\n    core: {'))
    read, write = os.pipe()
    try:
        code = 'import sys; from rt_robot_os.ros.program import main; sys.exit(main())'
        process = subprocess.Popen(
            [sys.executable, '-c', code, '--ros-args', '--params-file', str(parameters)],
            cwd='/', stdout=write, stderr=write, env={
                **os.environ, **environment(world, length=1900),
                'RT_ROBOT_OS_RUNTIME_DIR': str(world.folder)})
        try:
            until(lambda: int(log_values(diagnostics).get('untold', 0)) > 500, 'lines untold')
            assert 'were not shown' in log_values(diagnostics)['message']
            seen, told = len(safe), len(diagnostics)
            until(lambda: len(safe) > seen + 100 and len(diagnostics) > told + 3,
                  'samples and diagnostics while nobody reads')
            process.send_signal(signal.SIGTERM)
            # It ends by itself, although its last lines cannot be told.
            assert process.wait(60) == 0
        finally:
            process.kill()
            process.wait()
    finally:
        os.close(read)
        os.close(write)
    until(lambda: not [x for x in world.leftovers() if x.startswith('process')], 'everything gone')


@pytest.mark.parametrize(('arguments', 'silent', 'told'), [
    (('--log-level', 'warn'), '[robot.talker]: job ', '[robot.talker]: trouble '),
    (('--log-level', 'robot.talker:=error'), '[robot.talker]: job ', '[robot.talker]: trouble '),
    (('-p', 'talker.log_level:=debug'), 'nothing', '[robot.talker]: detail '),
], ids=['all', 'one', 'of the core'])
def test_the_levels_that_ros_is_given_count_for_the_lines_of_the_core(
        world: Any, until: Until, arguments: tuple[str, ...], silent: str, told: str) -> None:
    found: list[Any] = []
    world.node.create_subscription(Log, '/rosout', found.append, QoSProfile(
        depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    robot = world.robot(ROBOT.replace('RATE', '100.0'), *arguments, **environment(world))
    for _ in range(3):
        seen = len(robot.lines)
        until(lambda n=seen: any(told in line for line in robot.lines[n:]), told)
    assert not robot.said(silent)
    until(lambda: any(m.name == 'robot.talker' for m in found), 'lines on /rosout')
    assert not any(f'[{m.name}]: {m.msg}'.startswith(silent) for m in found)
