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


"""An actuator in a core: what is checked when it is loaded, planned, and done when it ends."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.core.app import Core
from rt_robot_os.kernel import FailurePolicy
from rt_robot_os.kernel import TaskState
from rt_robot_os.sim.pty_port import PtyPort
from rt_robot_os.tools.plan.robot import robot_tasks
from wheels import install

MakeCore = Callable[[str], Core]
MS = 1_000_000
S = 1_000_000_000
STEERING = """
devices: [base]
modules: [guard]
topics: [cmd_vel]
cmd_vel: {message: geometry_msgs/msg/Twist}
base: {type: wheels, port: PORT, baud: 0, command_topic: cmd_vel_safe, rate_hz: 50.0}
guard: {type: twist_guard, rate_hz: 50.0, priority: 40}
"""


@pytest.fixture
def port(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[PtyPort]:
    """Plug in a wire, and have the wheels of the tests installed."""
    install(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    made = PtyPort(tmp_path / 'wheels')
    made.plug()
    yield made
    made.unplug()


def heard(port: PtyPort) -> list[str]:
    """Return the orders so far; each is on its way for a moment."""
    data = b''
    for _ in range(50):
        data += port.read()
    return data.decode().split('\r')[:-1]


def test_its_settings_are_those_of_a_device_its_ports_and_its_age_limit(
        make_core: MakeCore, port: PtyPort) -> None:
    core = make_core(STEERING.replace('PORT', str(port.link)))
    device = core.sensors.devices[0].device
    assert device.settings['command_topic'] == 'cmd_vel_safe'
    assert device.settings['command_timeout_s'] == 0.3
    assert [each.name for each in core.bus.topic('cmd_vel_safe').subscribers] == ['base']
    core.parameters.change('base.command_timeout_s', 0.2)
    assert device.value('command_timeout_s') == 0.2


@pytest.mark.parametrize('topic, text', [
    ('cmd_val_safe', "device base reads 'cmd_val_safe': no part declares this topic, did you mean "
     "'cmd_vel_safe'"),
    ('wheels/speed', "device base reads 'wheels/speed' as geometry_msgs/msg/Twist, but it is "
     'geometry_msgs/msg/Vector3Stamped'),
])
def test_what_it_reads_is_checked_when_it_is_loaded(
        make_core: MakeCore, port: PtyPort, topic: str, text: str) -> None:
    with pytest.raises(ConfigError, match=text):
        make_core(STEERING.replace('PORT', str(port.link)).replace('cmd_vel_safe', topic))


def test_the_plan_knows_what_releases_it(make_core: MakeCore, port: PtyPort) -> None:
    core = make_core(STEERING.replace('PORT', str(port.link)))
    tasks = {task.name: task for task in robot_tasks(core.settings).tasks}
    events = tasks['base/arrival'].events
    assert [event.source for event in events] == ['guard', '']
    assert events[1].period_ns == 300 * MS
    assert {task.name for task in core.kernel.tasks} >= {'base', 'base/arrival'}


def test_a_loop_over_a_device_is_no_circle(make_core: MakeCore, port: PtyPort) -> None:
    core = make_core(
        f'devices: [base]\nmodules: [control]\nbase: {{type: wheels, port: "{port.link}", '
        'baud: 0, rate_hz: 50.0}\ncontrol: {type: "core_port_modules:Control"}')
    assert [each.name for each in core.bus.topic('cmd_vel').wakes] == ['base/arrival']


def run(core: Core, milliseconds: int, at_ms: dict[int, Callable[[], object]]) -> None:
    """Let time pass; do something at some moments of it."""
    begin_ns = core.kernel.now_ns()

    def look() -> None:
        for moment in [m for m in at_ms if core.kernel.now_ns() - begin_ns >= m * MS]:
            at_ms.pop(moment)()

    core.kernel.add_task('test', look, priority=90, rate_hz=1000.0)
    core.prepare_modules()
    core.kernel.run(milliseconds * MS)


def test_the_core_brings_it_to_rest_before_modules_are_deactivated(
        make_core: MakeCore, port: PtyPort) -> None:
    core = make_core(STEERING.replace('PORT', str(port.link)))
    command = core.bus.publisher('cmd_vel')
    command.msg.linear.x = 0.5
    run(core, 300, {200: command.publish})
    assert set(heard(port)) == {'m 0 0', 'm 500 500'}
    order: list[str] = []
    module: Any = core.modules[0]
    module.deactivate = lambda: order.extend(heard(port))
    core.close()
    assert order == ['m 0 0']


def test_the_watchdog_brings_it_to_rest(make_core: MakeCore, port: PtyPort) -> None:
    core = make_core(STEERING.replace('PORT', str(port.link)).replace(
        'priority: 40}', 'priority: 40, critical: true}')
        + 'watchdog: {timeout_s: 0.1, action: safe_state}')
    command = core.bus.publisher('cmd_vel')
    command.msg.linear.x = 0.5

    def stop() -> None:
        core.kernel.hold(core.kernel.task('guard'), FailurePolicy.STOP, 'a test')

    # Before the last command is too old.
    run(core, 500, {200: command.publish, 250: stop})
    assert heard(port)[-2:] == ['m 500 500', 'm 0 0']
    assert core.kernel.task('base').state is TaskState.SAFE
