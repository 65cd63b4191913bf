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


"""Tasks that are held, and a watchdog that ends the core, as ROS 2 sees them."""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402, I100
from diagnostic_msgs.msg import DiagnosticStatus  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

Until = Callable[..., Any]

# The modules of the tests of the core.
MODULES = Path(__file__).resolve().parents[1] / 'core'
YAML = """
robot:
  ros__parameters:
    core: {{cpu: -2, scheduler_priority: 0}}
    watchdog: {{{watchdog}}}
    modules: [it]
    it: {{rate_hz: 100.0, critical: true, type: 'core_modules:{module}}}
"""


def path() -> str:
    root = Path(__file__).resolve().parents[2]
    return os.pathsep.join([str(root), str(MODULES), os.environ.get('PYTHONPATH', '')])


def status_of(diagnostics: list[Any], name: str) -> Any:
    for message in reversed(list(diagnostics)):
        for status in message.status:
            if status.name == name:
                return status
    return DiagnosticStatus(name='none yet')


def test_a_task_in_its_safe_state_is_an_error_until_it_is_rearmed(
        world: Any, until: Until) -> None:
    diagnostics = world.listen(DiagnosticArray, '/diagnostics')
    # What was lately is told for one second, not for ten.
    robot = world.robot(YAML.format(
        watchdog='timeout_s: 0.0',
        module="Safe', failure: safe_state, raises: 50, heals: 51"), PYTHONPATH=path(), prelude="""
from rt_robot_os.ros import diagnostics
Recent = diagnostics.Recent
diagnostics.Recent = lambda: Recent(hold_s=1.0)
""")
    robot.wait_for_line('connected to the core')

    def status() -> Any:
        return status_of(diagnostics, 'robot: task it')

    until(lambda: status().level == DiagnosticStatus.ERROR
          and 'in its safe state' in status().message, 'the error in /diagnostics')
    assert status().message == ('in its safe state; see the log. To re-arm it: ros2 '
                                'service call /robot/rearm std_srvs/srv/Trigger')
    values = {v.key: v.value for v in status().values}
    assert values['state'] == 'safe' and values['failures'] == '1'
    answer = world.call(Trigger, '/robot/rearm', Trigger.Request())
    assert (answer.success, answer.message) == (True, 're-armed: it')
    until(lambda: status().level == DiagnosticStatus.OK and {
        v.key: v.value for v in status().values}['state'] == 'active', 'a task that runs again')
    answer = world.call(Trigger, '/robot/rearm', Trigger.Request())
    assert (answer.success, answer.message) == (True, 'no task was held')


def test_a_core_that_its_watchdog_ends_is_started_again_and_told_why(
        world: Any, until: Until) -> None:
    robot = world.robot(YAML.format(
        watchdog='timeout_s: 0.5, action: exit, exit_code: 71', module="Noted', raises: 50"),
        PYTHONPATH=path())
    robot.wait_for_line("watchdog]: task 'it' has ended no job well for")
    robot.wait_for_line('the core ended with code 71: a critical task was unhealthy; see the '
                        'report of its watchdog above; again in 0.5 s')

    def order() -> list[str]:
        return [word for line in list(robot.lines) for word in ('connected', 'ended with code 71')
                if word in line]

    until(lambda: order().count('connected') > 1 or robot.process.poll() is not None, 'a new core')
    assert order()[:3] == ['connected', 'ended with code 71', 'connected']
    assert robot.process.poll() is None


def test_a_core_that_hangs_dies_and_the_robot_says_where(world: Any) -> None:
    robot = world.robot(YAML.format(watchdog='timeout_s: 0.3', module="Hanging'"),
                        PYTHONPATH=path())
    robot.wait_for_line('the core was ended by SIGABRT: its watchdog could not run')
    robot.wait_for_line('in hang')
