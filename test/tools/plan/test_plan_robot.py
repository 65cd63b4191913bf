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

"""From settings to tasks: they must be those that the core really makes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.core.app import Core
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.settings import load
from rt_robot_os.settings import RobotSettings
from rt_robot_os.tools.plan.analysis import analyse
from rt_robot_os.tools.plan.given import Given
from rt_robot_os.tools.plan.given import RobotTasks
from rt_robot_os.tools.plan.measured import Measured
from rt_robot_os.tools.plan.measured import MeasuredTask
from rt_robot_os.tools.plan.result import Verdict
from rt_robot_os.tools.plan.robot import robot_tasks
from rt_robot_os.tools.plan.task import Event

ROOT = Path(__file__).resolve().parents[3]
ROBOTS = [ROOT / 'config' / f'{name}.yaml'
          for name in ('all_devices', 'assisted_living', 'camera', 'robot', 'serial',
                       'service_robot')]
ROBOT = Path(__file__).with_name('plan_robot.yaml')
pytest.importorskip('sensor_msgs', reason='the ROS 2 message packages are not installed')


SLOW_BOARD = """/**/robot:
  ros__parameters:
    devices: [base]
    base: {type: arduino_bridge, port: sim, wheel_radius_m: 0.0325, wheel_separation_m: 0.2,
           ticks_per_revolution: 1440.0}
"""
COMMANDS = """
    topics: [cmd_vel_safe]
    cmd_vel_safe: {message: geometry_msgs/msg/Twist, rate_hz: 20.0}
"""


def settings_of(path: Path = ROBOT, /, **overrides: object) -> RobotSettings:
    return load([path], {key.replace('__', '.'): value for key, value in overrides.items()})


def seen(priority: int, period_ns: int, execution_ns: int = 100_000) -> MeasuredTask:
    return MeasuredTask(priority, period_ns, 1000, 1000, execution_ns, 20_000, 50_000, 90_000)


def measured(robot: RobotTasks, **more: object) -> Measured:
    tasks = {task.name: seen(task.priority, task.period_ns) for task in robot.tasks}
    return Measured(10 ** 10, tasks, **more)  # type: ignore[arg-type]


MODULES = {'modules': ['guard', 'third', 'both', 'second', 'waiter'], **{
    f'{name}.{key}': value for name in ('third', 'both', 'second', 'waiter') for key, value in (
        ('type', f'plan_modules:{name.capitalize()}'), ('rate_hz', 0.0), ('execution_us', 90.0))}}


def test_the_tasks_of_the_shipped_robots_are_those_of_the_core(tmp_path: Path) -> None:
    for path in ROBOTS:
        assert_the_core_has_the_same_tasks(settings_of(path), tmp_path)


@pytest.mark.parametrize('overrides', [
    {}, MODULES, {'imu__read': 'interrupt', 'core__link_priority': 7, 'guard__phase_us': 1500.0},
    {'watchdog__timeout_s': 0.5, 'guard__critical': True}])
def test_the_tasks_are_those_of_the_core(tmp_path: Path, overrides: dict[str, object]) -> None:
    assert_the_core_has_the_same_tasks(settings_of(**overrides), tmp_path)


def assert_the_core_has_the_same_tasks(settings: RobotSettings, tmp_path: Path) -> None:
    core = Core(settings, tmp_path / 'core.sock', clock=VirtualClock())
    planned = {task.name: task for task in robot_tasks(settings).tasks}
    # A task that is new in the core has to be added in rt_robot_os/tools/plan/robot.py.
    assert {t.name: (t.priority, t.period_ns) for t in core.kernel.tasks} == {
        name: (task.priority, task.period_ns) for name, task in planned.items()}
    core.close()


def test_nothing_is_judged_before_execution_times_are_known() -> None:
    robot = robot_tasks(settings_of())
    # The sign of life is above all others: unknown, it would make all of them unknown for ever.
    assert robot.origins.pop('link/life') == 'declared'
    assert set(robot.origins.values()) == {'unknown'}
    found = analyse(robot.tasks, robot.overhead)
    assert [r.task.name for r in found.unjudged] == ['imu', 'gps', 'guard']
    assert not found.failed


def test_execution_times_in_the_order_option_declared_measured_budget() -> None:
    settings = settings_of(imu__execution_us=300.0, gps__budget_us=500.0, gps__on_budget='abort',
                           guard__budget_us=200.0)
    robot = robot_tasks(settings, None, Given(execution_ns={'core/watch': 7000}))
    assert {k: v for k, v in robot.origins.items() if v != 'unknown'} == {
        'imu': 'declared', 'gps': 'budget', 'core/watch': 'option', 'link/life': 'declared'}
    again = robot_tasks(settings, measured(robot))
    times = {task.name: task.execution_ns for task in again.tasks}
    assert (times['imu'], times['gps'], times['guard']) == (300_000, 120_000, 120_000)
    assert again.origins['gps'] == 'measured'


def test_how_far_the_robot_goes_on_when_its_computer_falls_silent_is_said(tmp_path: Path) -> None:
    path = tmp_path / 'slow.yaml'
    path.write_text(SLOW_BOARD + COMMANDS)
    faster = {'base.maximum_wheel_speed_m_s': 0.5}
    for changes, told in (
            ({}, '0.49 m at 0.20 m/s'), (faster, '1.22 m at 0.50 m/s'),
            ({**faster, 'base.auto_stop_s': 0.5, 'base.coast_s': 0.1}, '0.32 m at 0.50 m/s')):
        assert any(note.startswith('base: without this computer') and note.endswith(told)
                   for note in robot_tasks(load([path], changes)).notes)
    path.write_text(SLOW_BOARD + """
    modules: [guard]
    guard: {type: twist_guard, rate_hz: 20.0, priority: 40}
    topics: [cmd_vel]
    cmd_vel: {message: geometry_msgs/msg/Twist}
""")
    notes = robot_tasks(load([path], faster)).notes
    assert any('0.50 m at 0.21 m/s, to which guard slows it' in note for note in notes)


def test_a_declared_time_that_was_exceeded_is_told() -> None:
    settings = settings_of(imu__execution_us=90.0)
    notes = robot_tasks(settings, measured(robot_tasks(settings))).notes
    assert 'imu: execution_us is 90, but 100 us were measured: raise it' in notes


def test_a_budget_below_the_execution_time_is_told() -> None:
    settings = settings_of(guard__execution_us=300.0, guard__budget_us=200.0)
    assert robot_tasks(settings).notes == (
        'guard: budget_us is 200, and a job may take 300 us: such a job is counted as too long',)


def test_a_device_that_did_not_deliver_was_not_measured() -> None:
    settings = settings_of()
    found = robot_tasks(settings, measured(robot_tasks(settings), idle={'gps': 'silent'}))
    assert found.origins['gps'] == 'unknown'
    assert 'gps: was not measured, silent' in found.notes


def test_deadline_phase_catch_up_and_resources_are_taken_over() -> None:
    settings = settings_of(
        guard__deadline_us=30_000.0, guard__overrun='catch_up', guard__catch_up=2,
        guard__phase_us=1500.0, guard__resources=['map'], imu__resources=['map'],
        guard__execution_us=900.0, imu__execution_us=100.0)
    robot = robot_tasks(settings)
    guard = next(task for task in robot.tasks if task.name == 'guard')
    assert (guard.deadline_ns, guard.backlog, guard.phase_ns) == (30_000_000, 2, 1_500_000)
    blocking = analyse(robot.tasks).task('imu').blocking
    assert (blocking.by, blocking.what, blocking.length_ns) == ('guard', 'map', 900_000)


def test_a_cooperative_dispatcher_lets_whole_jobs_block() -> None:
    settings = settings_of(core__dispatcher='cooperative')
    found = robot_tasks(settings, measured(robot_tasks(settings)), Given(
        execution_ns={'core/watch': 4_000_000}))
    blocking = analyse(found.tasks, found.overhead).task('imu').blocking
    assert (blocking.by, blocking.what, blocking.length_ns) == (
        'core/watch', 'whole job', 4_000_000)


def test_commands_come_at_the_rate_of_their_topic_or_are_not_known() -> None:
    commands = {task.name: task for task in robot_tasks(settings_of()).tasks}['link/commands']
    assert Event('', 50_000_000) in commands.events and not commands.unknown
    unknown = robot_tasks(settings_of(cmd_vel__rate_hz=0.0)).tasks
    commands = {task.name: task for task in unknown}['link/commands']
    assert "how often ROS publishes 'cmd_vel' is not known" in commands.unknown
    told = robot_tasks(settings_of(cmd_vel__rate_hz=0.0), None,
                       Given(rates_hz={'link/commands': 9.0}))
    assert not {task.name: task for task in told.tasks}['link/commands'].unknown


def test_what_waits_for_a_task_of_unknown_rate_is_not_judged() -> None:
    settings = settings_of(imu__read='interrupt')
    base = robot_tasks(settings)
    data = measured(base)
    quiet = replace(data, tasks={name: replace(task, runs=0) if name == 'imu/arrival' else task
                                 for name, task in data.tasks.items()})
    robot = robot_tasks(settings, quiet, Given(execution_ns={'imu/arrival': 50_000}))
    found = analyse(robot.tasks, robot.overhead).task('guard')
    assert found.verdict is Verdict.UNKNOWN
    assert 'how often bytes arrive is not known' in found.reason
    robot = robot_tasks(settings, data, Given(rates_hz={'imu/arrival': 200.0}))
    assert analyse(robot.tasks, robot.overhead).task('guard').verdict is Verdict.OK


def test_names_that_do_not_exist_are_refused_all_at_once() -> None:
    data = Measured(10 ** 9, {'imuu': seen(80, 5_000_000), 'core/new': seen(1, 10 ** 9)})
    with pytest.raises(ConfigError) as caught:
        robot_tasks(settings_of(), data, Given(
            execution_ns={'gpss': 5}, rates_hz={'imu': 5.0, 'nobody': 1.0}))
    assert caught.value.problems == (
        "--execution gpss: no such task, did you mean 'gps'?",
        '--rate nobody: no such task, known: core/watch, gps, guard, imu, link/accept, '
        'link/beat, link/commands, link/life, link/service, sensors/recovery',
        '--rate imu: it is not released from outside; what is: link/accept, link/commands',
        "measurement: task 'imuu' is not in this configuration: measure again")


def test_a_task_that_the_core_has_besides_counts() -> None:
    base = robot_tasks(settings_of())
    data = measured(base)
    more = replace(data, tasks={**data.tasks, 'core/new': seen(99, 10 ** 7, 10 ** 6)})
    robot = robot_tasks(settings_of(), more)
    assert robot.owners['core/new'] == 'core'
    with_it, without = (analyse(robot_tasks(settings_of(), each).tasks) for each in (more, data))
    assert (with_it.task('imu').response_ns or 0) - (without.task('imu').response_ns or 0) == (
        1_200_000)


def test_late_timers_are_jitter() -> None:
    base = robot_tasks(settings_of())
    late = robot_tasks(settings_of(), measured(base)).tasks
    assert {task.jitter_ns for task in late} == {0, 50_000}
    given = Given(jitter_ns=0)
    assert {t.jitter_ns for t in robot_tasks(settings_of(), measured(base), given).tasks} == {0}


def test_modules_are_released_as_their_inputs_say() -> None:
    tasks = {task.name: task for task in robot_tasks(settings_of(**MODULES)).tasks}
    # The IMU gives 100 samples a second and is polled twice as often.
    assert tasks['third'].events == (Event('imu', 30_000_000, 5_000_000),)
    assert tasks['second'].events == (Event('third', every=2),)
    # The GPS gives one a second, so that decides; what was there before makes one more.
    assert tasks['both'].events == (Event('gps', 10 ** 9, 50_000_000, waits=True),)
    assert 'it is a coroutine' in tasks['waiter'].unknown
    given = Given(rates_hz={'waiter': 3.0})
    tasks = {task.name: task for task in robot_tasks(settings_of(**MODULES), None, given).tasks}
    assert tasks['waiter'].events == (Event('', 333_333_333),)
    assert not tasks['waiter'].unknown


def test_a_coroutine_goes_on_with_its_own_rounds_and_with_what_it_awaits() -> None:
    woken = {'type': 'plan_modules:Woken', 'rate_hz': 0.0, 'execution_us': 90.0}
    settings = settings_of(**{**MODULES, 'modules': [*MODULES['modules'], 'woken'], **{
        f'woken.{key}': value for key, value in woken.items()}})
    task = {each.name: each for each in robot_tasks(settings).tasks}['woken']
    assert task.events == (Event('third'), Event('', 50_000_000))
    assert not task.unknown and not task.period_ns


def test_a_circle_of_modules_that_promise_to_write_seldom_has_a_bound() -> None:
    names = ('asking', 'answering')
    settings = settings_of(**{'modules': ['guard', *names], **{
        f'{name}.{key}': value for name in names for key, value in (
            ('type', f'plan_modules:{name.capitalize()}'), ('rate_hz', 0.0),
            ('execution_us', 90.0))}})
    made = robot_tasks(settings, None, Given(execution_ns={
        'imu': 300_000, 'gps': 400_000, 'guard': 100_000, 'link/commands': 100_000}))
    tasks = {task.name: task for task in made.tasks}
    assert tasks['answering'].events == (Event('asking', 500_000_000, promised=True),)
    found = analyse(made.tasks, made.overhead)
    assert not found.unjudged and not found.failed
    assert found.task('asking').utilisation == pytest.approx(90e3 / 250e6 + 90e3 / 50e6)
    assert found.task('answering').utilisation == pytest.approx(90e3 / 500e6)


def test_the_load_of_chains_that_count_is_that_of_what_releases() -> None:
    times = {'imu': 300_000, 'gps': 400_000, 'guard': 100_000, 'link/commands': 100_000}
    made = robot_tasks(settings_of(**MODULES), None, Given(
        execution_ns=times, rates_hz={'waiter': 3.0}))
    found = analyse(made.tasks, made.overhead)
    assert not found.failed and not found.unjudged
    assert found.task('third').utilisation == pytest.approx(90e3 / 30e6)
    assert found.task('second').utilisation == pytest.approx(90e3 / 60e6)
    assert found.task('both').utilisation == pytest.approx(90e3 / 1e9)


def test_the_core_own_tasks_may_want_more_than_there_is() -> None:
    made = robot_tasks(settings_of(), measured(robot_tasks(settings_of())), Given(
        execution_ns={'link/service': 10 ** 9}))
    found = analyse(made.tasks, made.overhead)
    assert found.task('link/service').verdict is Verdict.OVERLOAD
    assert not found.failed
    assert found.service > 1 > found.utilisation


def test_what_only_a_client_could_publish_is_told_and_not_counted() -> None:
    config = ROOT / 'config'
    made = robot_tasks(load([config / 'service_robot.yaml', config / 'mapping.yaml']))
    told, = (note for note in made.notes if 'is not counted' in note)
    # `mapping` is a process of its own; nobody has written here that it runs.
    assert {'slam/pose', 'slam/correction'} <= set(told.partition(':')[0].split(', '))
    assert not any('is not counted' in note for note in robot_tasks(settings_of()).notes)
