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


"""What YAML declares of a task, in force: policies, restarts, safe states, resources, rates."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from core_modules import Noted
import pytest

from rt_robot_os.base import plugins
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import TaskError
from rt_robot_os.core.app import Core
from rt_robot_os.devices.state import DeviceState
from rt_robot_os.features.navigation.twist_guard import TwistGuard
from rt_robot_os.kernel import BudgetPolicy
from rt_robot_os.kernel import CooperativeClock
from rt_robot_os.kernel import FailurePolicy
from rt_robot_os.kernel import OverrunPolicy
from rt_robot_os.kernel import TaskState
from rt_robot_os.modules import Module

MakeCore = Callable[[str], Core]
MS = 1_000_000
S = 1_000_000_000

IMU = """\
devices: [imu]
imu: {type: witmotion, port: /dev/null, rate_hz: 100.0}
"""


def module(core: Core, name: str = 'it') -> Any:
    return next(m for m in core.modules if m.name == name)


def run(core: Core, duration_ns: int) -> None:
    """Run as :meth:`Core.run` does, but leave everything open afterwards."""
    core.kernel.run(duration_ns)


def prepare(core: Core) -> Core:
    for each in core.modules:
        each.configure()
        each.activate()
    return core


def it(keys: str) -> str:
    return f"modules: [it]\nit: {{type: 'core_modules:Safe', rate_hz: 100.0, {keys}}}\n"


def test_every_key_reaches_the_kernel(make_core: MakeCore) -> None:
    core = make_core(it(
        'phase_us: 1.5, deadline_us: 9000, budget_us: 4000, on_budget: abort, '
        'overrun: catch_up, catch_up: 3, overrun_limit: 7, overrun_leak: 9, failure: restart, '
        'restart_s: 0.25, restart_max_s: 4, critical: true, resources: [arm], '
        'execution_us: 100'))
    task = core.kernel.task('it')
    spec = task.spec
    assert (spec.phase_ns, spec.deadline_ns, spec.budget_ns) == (1500, 9 * MS, 4 * MS)
    assert (spec.on_budget, spec.overrun) == (BudgetPolicy.ABORT, OverrunPolicy.CATCH_UP)
    assert (spec.catch_up, spec.overrun_limit, spec.overrun_leak) == (3, 7, 9)
    assert spec.failure is FailurePolicy.RESTART
    assert (spec.restart_ns, spec.restart_maximum_ns) == (S // 4, 4 * S)
    assert spec.critical and not spec.logical
    assert core.kernel.resource('arm').users == (task,)


def test_a_module_that_fails_is_restarted_without_being_configured_again(
        make_core: MakeCore) -> None:
    core = prepare(make_core(it('raises: 3, heals: 4, failure: restart, restart_s: 0.1')))
    run(core, S // 2)
    assert module(core).calls == ['configure', 'activate', 'deactivate', 'activate']
    assert module(core).steps > 30
    statistics = core.kernel.task('it').statistics()
    assert statistics.failures == 1 and statistics.state is TaskState.ACTIVE
    assert statistics.missed >= 9  # while it paused
    assert 'restarted' in [r.text for r in core.reports.since(0)[2]]


def test_one_that_cannot_even_be_deactivated_begins_anew_all_the_same(
        make_core: MakeCore) -> None:
    core = prepare(make_core(it('raises: 3, heals: 4, failure: restart')))
    broken = module(core)

    def deactivate() -> None:
        raise OSError('stuck')

    broken.deactivate = deactivate
    run(core, S // 2)
    assert broken.calls == ['configure', 'activate', 'activate']
    assert 'deactivate failed: stuck' in [r.text for r in core.reports.since(0)[2]]
    assert core.kernel.task('it').statistics().failures == 1


def test_the_safe_state_is_entered_once_and_left_by_rearming(make_core: MakeCore) -> None:
    core = prepare(make_core(it('raises: 3, heals: 4, failure: safe_state')))
    run(core, S // 2)
    task = core.kernel.task('it')
    assert task.state is TaskState.SAFE
    assert module(core).calls == ['configure', 'activate', 'safe_state']
    assert module(core).steps == 3


@pytest.mark.parametrize('logical', ['true', 'false'])
def test_a_guard_in_its_safe_state_stands_still(logical: str, make_core: MakeCore) -> None:
    core = make_core(f"""\
modules: [guard]
guard: {{type: twist_guard, rate_hz: 100.0, failure: safe_state, logical_execution: {logical}}}
topics: [cmd_vel]
cmd_vel: {{message: geometry_msgs/msg/Twist}}
""")
    core.modules[0].step = lambda: 1 / 0  # type: ignore[method-assign]
    safe = core.bus.subscribe('cmd_vel_safe', 'test')
    moving = core.bus.publisher('cmd_vel_safe')
    moving.msg.linear = (1.0, 2.0, 3.0)
    run(core, S // 2)
    assert core.kernel.task('guard').state is TaskState.SAFE
    assert safe.take()
    assert list(safe.msg.linear) == list(safe.msg.angular) == [0.0, 0.0, 0.0]
    assert not safe.take()  # once


def test_logical_execution_delays_outputs_to_the_deadline(make_core: MakeCore) -> None:
    core = make_core("""\
modules: [guard]
guard: {type: twist_guard, rate_hz: 100.0, logical_execution: true, deadline_us: 4000}
topics: [cmd_vel]
cmd_vel: {message: geometry_msgs/msg/Twist}
""")
    safe = core.bus.subscribe('cmd_vel_safe', 'test')
    seen: list[int] = []

    def look() -> None:
        while safe.take():
            seen.append(core.kernel.now_ns() - core.kernel.start_ns)

    core.kernel.add_task('look', look, priority=90, rate_hz=1000.0, phase_ns=MS // 2)
    run(core, 21 * MS)
    assert seen == [4 * MS + MS // 2, 14 * MS + MS // 2]


def test_a_device_with_logical_execution_publishes_at_its_deadline(make_core: MakeCore) -> None:
    core = make_core(IMU.replace('100.0}', '100.0, logical_execution: true, deadline_us: 4000}'))
    managed = core.sensors.devices[0]
    device: Any = managed.device
    imu = core.bus.subscribe('imu/data', 'test')
    device.open = lambda: None

    def read(now_ns: int) -> int:
        device._publishers[0].publish(now_ns)
        return 1

    device.read = read
    seen: list[int] = []

    def look() -> None:
        while imu.take():
            seen.append((core.kernel.now_ns() - core.kernel.start_ns) % (10 * MS))

    core.kernel.add_task('look', look, priority=90, rate_hz=1000.0, phase_ns=MS // 2)
    run(core, S // 5)
    assert len(seen) > 5 and set(seen) == {4 * MS + MS // 2}


def test_a_shared_resource_is_one(make_core: MakeCore) -> None:
    core = prepare(make_core("""\
modules: [low, high]
low: {type: 'core_modules:Noted', rate_hz: 10.0, priority: 10, work_us: 15000, asks: arm,
  resources: [arm]}
high: {type: 'core_modules:Noted', rate_hz: 100.0, priority: 50, work_us: 10, asks: arm,
  resources: [arm]}
"""))
    run(core, S // 2)
    statistics = core.kernel.resource('arm').statistics()
    assert statistics.users == ('low', 'high') and statistics.ceiling == 50
    assert statistics.entries == 5 + 50
    # high waits for the end of low's use, once in ten jobs
    assert core.kernel.task('high').statistics().latency.maximum_ns >= 5 * MS - 1000


def test_a_resource_that_is_not_declared_is_told_before_anything_runs(
        make_core: MakeCore) -> None:
    core = make_core(it('asks: arm'))
    with pytest.raises(ConfigError, match=r"it\.resources does not list 'arm', which the module "
                                          'uses: add it'):
        module(core).configure()
    with pytest.raises(ConfigError, match='is available from'):
        Noted('alone', {'asks': ''}).resource('arm')


def test_a_module_without_rate_is_released_by_its_input(make_core: MakeCore) -> None:
    core = make_core("""\
modules: [echo]
echo: {type: 'core_modules:Woken', rate_hz: 0}
topics: [cmd_vel]
cmd_vel: {message: geometry_msgs/msg/Twist}
""")
    task = core.kernel.task('echo')
    assert task.period_ns == 0
    publisher = core.bus.publisher('cmd_vel')
    core.kernel.add_task('source', publisher.publish, priority=1, rate_hz=10.0)
    run(core, S)
    assert task.statistics().runs == 10


CIRCLE = """\
modules: [there, back]
there: {type: 'core_modules:Relay', rate_hz: 0, into_topic: a, out_topic: b}
back: {type: 'core_modules:Relay', rate_hz: 0, into_topic: b, out_topic: a}
"""


def test_real_modules_that_release_each_other_are_refused(make_core: MakeCore) -> None:
    with pytest.raises(ConfigError, match='endlessly: there -> topic b -> back -> topic a -> '
                                          'there'):
        make_core(CIRCLE)
    there, back = CIRCLE.rsplit('back: ', 1)
    make_core(f"{there}back: {back.replace('Relay', 'SeldomRelay')}")  # it comes to rest


def test_a_rate_that_contradicts_the_budget_is_refused_by_the_kernel_too(
        make_core: MakeCore) -> None:
    core = make_core(it('budget_us: 5000, on_budget: abort'))
    task = core.kernel.task('it')
    task.set_rate_hz(200.0)
    with pytest.raises(TaskError, match='budget_ns 5000000 is above the period'):
        task.set_rate_hz(400.0)
    assert task.rate_hz == 200.0


def test_a_device_that_is_restarted_is_opened_anew(make_core: MakeCore) -> None:
    core = make_core(IMU)
    managed = core.sensors.devices[0]
    opened: list[str] = []
    managed.device.open = lambda: opened.append('open')  # type: ignore[method-assign]
    managed.device.close = lambda: opened.append('close')  # type: ignore[method-assign]
    managed.device.read = lambda now_ns: 1  # type: ignore[method-assign]
    run(core, S // 5)
    assert managed.state is DeviceState.ACTIVE and opened == ['open']
    core.kernel.add_task('once', managed.restart, priority=1, rate_hz=1.0)
    run(core, S // 2)
    assert opened == ['open', 'close', 'open'] and managed.state is DeviceState.ACTIVE
    assert managed.faults == 0


def test_a_driver_that_runs_away_is_aborted_and_opened_anew(make_core: MakeCore) -> None:
    core = make_core(IMU.replace('100.0}', '100.0, budget_us: 1000, on_budget: abort, failure: '
                                 'restart, restart_s: 0.1}'))
    managed = core.sensors.devices[0]
    opened: list[str] = []
    managed.device.open = lambda: opened.append('open')  # type: ignore[method-assign]
    managed.device.close = lambda: None  # type: ignore[method-assign]

    def read(now_ns: int) -> int:
        if len(opened) == 1 and now_ns > core.kernel.start_ns + S // 5:
            core.kernel.clock.spend(5 * MS)
        return 1

    managed.device.read = read  # type: ignore[method-assign]
    run(core, S)
    statistics = core.kernel.task('imu').statistics()
    assert (statistics.aborted, statistics.state) == (1, TaskState.ACTIVE)
    assert opened == ['open', 'open'] and managed.state is DeviceState.ACTIVE


def test_a_device_with_outputs_has_a_safe_state(make_core: MakeCore) -> None:
    core = make_core(IMU)
    device = core.sensors.devices[0].device
    calls: list[str] = []
    device.safe_state = lambda: calls.append('safe')  # type: ignore[method-assign]
    device.open = lambda: None  # type: ignore[method-assign]
    managed = core.sensors.devices[0]
    managed.safe_state()
    assert calls == []  # closed: there is nothing to write to
    managed.recover()
    managed.safe_state()
    assert calls == ['safe']


def test_the_dispatcher_is_chosen(make_core: MakeCore, tmp_path: Any) -> None:
    settings = make_core('core: {dispatcher: cooperative, spin_us: 50}').settings
    core = Core(settings, tmp_path / 'robot.sock')
    assert isinstance(core.kernel.clock, CooperativeClock)
    assert core.kernel.spin_ns == 50_000


def test_modules_need_no_safe_state() -> None:
    assert not Module.has_safe_state()
    assert TwistGuard.has_safe_state()


@pytest.mark.filterwarnings('ignore:type old_imu')
def test_a_device_of_an_old_entry_point_group_runs_and_is_told_where_it_belongs(
        make_core: MakeCore, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plugins, 'installed', lambda path: {
        'rt_robot_os.drivers': {'old_imu': 'rt_robot_os.devices.witmotion.driver:WitMotion'}})
    core = make_core(IMU.replace('witmotion', 'old_imu'))
    assert core.kernel.task('imu').spec.period_ns == 10 * MS
    told = [report.text for report in core.reports.since(0)[2] if report.source == 'imu']
    assert told == ['type old_imu: the entry-point group rt_robot_os.drivers will be removed '
                    'in the next release: its package must name it in rt_robot_os.devices '
                    '(docs/writing_a_driver.md)']
