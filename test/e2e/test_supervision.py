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

"""The node keeps a core running: it kills none that lives, and goes on whatever happens."""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path
import resource
import signal
import time
from typing import Any

from processes import TIMEOUT_S
import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402, I100
from geometry_msgs.msg import Twist  # noqa: E402
from rt_robot_os.link import LinkClient  # noqa: E402
from sensor_msgs.msg import Imu  # noqa: E402

pytestmark = pytest.mark.one_build

Until = Callable[..., Any]

ROOT = Path(__file__).resolve().parents[2]
MODULE = """
from rt_robot_os.modules import Module
import time


class Planner(Module):
    def activate(self):
        self.jobs = 0

    def step(self):
        self.jobs += 1
        end = time.monotonic() + (5.0 if self.jobs == 20 else 0.0)
        while time.monotonic() < end:
            sum(range(100))

    def statistics(self):
        return {'jobs': self.jobs, **{f'value {n} \\ud800': '\\x1b' * 300 for n in range(250)}}
"""
ROBOT = """
robot:
  ros__parameters:
    core: {cpu: -2, scheduler_priority: 0, heartbeat_s: 0.4}
    modules: [guard]
    guard: {type: twist_guard, rate_hz: 100.0, priority: 40}
    topics: [cmd_vel]
    cmd_vel: {message: geometry_msgs/msg/Twist, depth: 8}
    mirrors: [safe_out]
    safe_out: {topic: cmd_vel_safe, direction: out}
"""
PLANNING = ROBOT.replace('modules: [guard]', """modules: [guard, planner]
    planner: {type: 'planner_module:Planner', rate_hz: 10.0, priority: 5}""").replace(
        'heartbeat_s: 0.4', 'heartbeat_s: 0.5')


def start(world: Any) -> Any:
    """Start the robot with the planner, of which there is much to tell: once a second."""
    (world.folder / 'planner_module.py').write_text(MODULE)
    return world.robot(PLANNING, '-p', 'diagnostics_rate_hz:=1.0', PYTHONPATH=os.pathsep.join(
        [str(world.folder), str(ROOT), os.environ.get('PYTHONPATH', '')]))


def core_of(diagnostics: list[Any]) -> tuple[int, str]:
    """Give the core's process id, 0 when there is none, and its message."""
    for message in reversed(list(diagnostics)):
        for status in message.status:
            if status.name == 'robot: core':
                pid = next((int(v.value) for v in status.values if v.key == 'pid'), 0)
                return pid, status.message
    return 0, ''


def test_a_job_of_five_seconds_at_low_priority_does_not_kill_the_core(
        world: Any, until: Until) -> None:
    diagnostics = world.listen(DiagnosticArray, '/diagnostics')
    robot = start(world)
    robot.wait_for_line('its link has been starved')
    robot.wait_for_line("'planner' runs")
    pid = until(lambda: core_of(diagnostics)[0], 'a core')
    until(lambda: 'link has been starved' in core_of(diagnostics)[1], 'the reason told')
    until(lambda: 'has been starved' not in core_of(diagnostics)[1], 'the end of the job')
    with LinkClient(world.folder / 'robot.sock', 'watch', timeout_s=TIMEOUT_S) as watch:
        assert watch.core['pid'] == pid
        planner = next(m for m in watch.statistics().modules if m['name'] == 'planner')
        assert planner['values']['jobs'] >= 20
    assert not robot.said('liveness counter') and not robot.said('again in')


def test_a_node_that_was_stopped_does_not_kill_the_core(world: Any, until: Until) -> None:
    diagnostics = world.listen(DiagnosticArray, '/diagnostics')
    robot = world.robot(ROBOT)
    pid = until(lambda: core_of(diagnostics)[0], 'a core')
    for _ in range(3):
        os.kill(robot.process.pid, signal.SIGSTOP)
        time.sleep(1.6)  # four heartbeats
        os.kill(robot.process.pid, signal.SIGCONT)
        seen = len(diagnostics)
        until(lambda n=seen: len(diagnostics) > n + 1, 'diagnostics again')
    assert core_of(diagnostics)[0] == pid
    assert not robot.said('liveness counter') and not robot.said('again in')


def test_a_core_is_started_again_after_a_time_without_descriptors(
        world: Any, until: Until) -> None:
    diagnostics = world.listen(DiagnosticArray, '/diagnostics')
    robot = world.robot(ROBOT)
    pid = until(lambda: core_of(diagnostics)[0], 'a core')
    soft, hard = resource.prlimit(robot.process.pid, resource.RLIMIT_NOFILE)
    resource.prlimit(robot.process.pid, resource.RLIMIT_NOFILE, (3, hard))
    os.kill(pid, signal.SIGKILL)
    robot.wait_for_line('cannot be started')
    resource.prlimit(robot.process.pid, resource.RLIMIT_NOFILE, (soft, hard))
    until(lambda: core_of(diagnostics)[0] not in (0, pid), 'a new core')
    assert not robot.said('Traceback')
    assert robot.end() == 0


def test_a_core_is_started_again_after_a_folder_stood_in_its_place(
        world: Any, until: Until) -> None:
    diagnostics = world.listen(DiagnosticArray, '/diagnostics')
    robot = world.robot(ROBOT)
    pid = until(lambda: core_of(diagnostics)[0], 'a core')
    path = world.folder / 'robot.sock'
    os.kill(robot.process.pid, signal.SIGSTOP)
    os.kill(pid, signal.SIGKILL)
    path.unlink()
    path.mkdir()
    os.kill(robot.process.pid, signal.SIGCONT)
    robot.wait_for_line('exists and is not a socket')
    path.rmdir()
    until(lambda: core_of(diagnostics)[0] not in (0, pid), 'a new core')
    assert not robot.said('Traceback')
    assert robot.end() == 0


def test_what_a_module_and_a_client_say_does_not_stop_the_node(
        world: Any, until: Until) -> None:
    diagnostics = world.listen(DiagnosticArray, '/diagnostics')
    safe = world.listen(Twist, '/cmd_vel_safe')
    robot = start(world)
    pid = until(lambda: core_of(diagnostics)[0], 'a core')
    with LinkClient(world.folder / 'robot.sock', 'watch', timeout_s=TIMEOUT_S) as watch:
        watch.request('hello', name='\ud800\x1b[2Jbad\nname')
    robot.wait_for_line('\\ud800\\x1b[2Jbad\\nname')
    assert not any('\x1b[2J' in line for line in robot.lines)
    seen, told = len(safe), len(diagnostics)
    until(lambda: len(diagnostics) > told + 2 and len(safe) > seen + 20, 'the robot running on')
    assert core_of(diagnostics)[0] == pid
    names = {v.key for m in diagnostics for s in m.status if s.name == 'robot: module planner'
             for v in s.values}
    assert 'value 249 \\ud800' in names


SIMULATED = """
robot:
  ros__parameters:
    core: {cpu: -2, scheduler_priority: 0}
    devices: [imu]
    imu: {type: witmotion, port: sim, rate_hz: 100.0, timeout_s: 0.3, retry_s: 0.1,
          retry_max_s: 0.2}
    mirrors: [imu_data]
    imu_data: {topic: imu/data}
"""


def simulators_of(world: Any) -> list[int]:
    found = []
    for entry in Path('/proc').iterdir():
        try:
            if (entry.name.isdigit() and b'simulator_process' in (entry / 'cmdline').read_bytes()
                    and str(world.folder).encode() in (entry / 'environ').read_bytes()):
                found.append(int(entry.name))
        except OSError:
            continue
    return found


def test_a_simulator_that_was_killed_is_started_again_counted_and_told(
        world: Any, until: Until) -> None:
    imu = world.listen(Imu, '/imu/data')
    diagnostics = world.listen(DiagnosticArray, '/diagnostics')
    robot = world.robot(SIMULATED)
    until(lambda: len(imu) > 20, 'samples')
    simulator, = simulators_of(world)
    os.kill(simulator, signal.SIGKILL)
    robot.wait_for_line('was ended by SIGKILL; started again')
    robot.wait_for_line('imu]: active again')
    seen = len(imu)
    until(lambda: len(imu) > seen + 20, 'samples again')
    until(lambda: any(v.key == 'simulators_restarted' and v.value == '1'
                      for m in list(diagnostics)[-1:] for s in m.status for v in s.values),
          'the count in /diagnostics')
    assert robot.end() == 0
    assert world.leftovers() == []
