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

"""The program: its text, its JSON, its exit codes, and a measurement of the real core."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from rt_robot_os.ros.core_process import CoreProcess
from rt_robot_os.settings import load
from rt_robot_os.settings import to_json
from rt_robot_os.tools.plan.analysis import analyse
from rt_robot_os.tools.plan.command import run
from rt_robot_os.tools.plan.given import Given
from rt_robot_os.tools.plan.measure import measure
from rt_robot_os.tools.plan.measured import Measured
from rt_robot_os.tools.plan.measured import MeasuredTask
from rt_robot_os.tools.plan.measured import read_measured
from rt_robot_os.tools.plan.robot import robot_tasks
from rt_robot_os.tools.plan.text_table import ms
from rt_robot_os.tools.plan.text_table import percent
from rt_robot_os.tools.plan.text_table import table
from rt_robot_os.tools.plan.typical import shipped

pytest.importorskip('sensor_msgs', reason='the ROS 2 message packages are not installed')

ROBOT = str(Path(__file__).with_name('plan_robot.yaml'))
CONFIG = Path(__file__).parents[3] / 'config'
ROBOTS = [CONFIG / f'{name}.yaml' for name in ('all_devices', 'camera', 'robot', 'serial',
                                               'service_robot')]
TIMES = [f'--execution={name}={us}' for name, us in (
    ('imu', 300), ('gps', 400), ('guard', 100), ('link/commands', 150))]


class NoCore(CoreProcess):
    """Must not be started."""

    def start(self) -> None:
        raise AssertionError('nothing was to be measured')


def plan(*arguments: str, ros: tuple[str, ...] = ()) -> int:
    more = [part for each in ros for part in ('-p', each)]
    return run([*arguments, '--ros-args', '--params-file', ROBOT, *more], NoCore)


def test_without_execution_times_the_code_is_3_and_the_remedy_is_told(
        capsys: pytest.CaptureFixture[str]) -> None:
    assert plan('--no-typical') == 3
    text = capsys.readouterr().out
    assert 'not judged: imu, gps, guard: its execution time is not known' in text
    assert 'plan --measure 10' in text


def test_a_schedulable_robot(capsys: pytest.CaptureFixture[str]) -> None:
    assert plan(*TIMES) == 0
    text = capsys.readouterr().out
    assert "schedulable: every task ends before its deadline; the least margin has 'imu'" in text
    assert 'hyper-period: 0.1 s' in text
    assert all(len(line) <= 100 for line in text.splitlines())


def test_a_robot_that_is_not_schedulable_names_the_task_and_the_margin(
        capsys: pytest.CaptureFixture[str]) -> None:
    assert plan(*TIMES, '--execution', 'guard=13000', ros=('guard.deadline_us:=12000.0',)) == 1
    text = capsys.readouterr().out
    assert "not schedulable: task 'guard' may need " in text
    assert ' ms of its 12.000 ms deadline: ' in text
    assert "first thing to do: make 'guard' compute at most" in text
    assert all(len(line) <= 100 for line in text.splitlines())


def test_more_work_than_time_ends_and_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    assert plan(*TIMES, '--execution', 'imu=6000') == 1
    text = capsys.readouterr().out
    assert "not schedulable: task 'imu': the tasks of its priority and above want 12" in text


def test_json_says_the_same(capsys: pytest.CaptureFixture[str]) -> None:
    assert plan(*TIMES, '--json') == 0
    found = json.loads(capsys.readouterr().out)
    assert found['schedulable'] is True
    tasks = {task['name']: task for task in found['tasks']}
    assert tasks['imu']['execution_ns'] == 300_000
    assert tasks['imu']['execution_from'] == 'option'
    assert tasks['imu']['verdict'] == 'ok'
    assert tasks['core/watch']['execution_from'] == 'typical'
    assert found['hyper_period_ns'] == 100_000_000
    assert plan('--json', '--no-typical') == 3
    assert json.loads(capsys.readouterr().out)['schedulable'] is None


def test_the_robot_of_the_assisted_flat_is_schedulable() -> None:
    made = robot_tasks(load([CONFIG / 'assisted_living.yaml']), None, Given(typical=shipped()))
    found = analyse(made.tasks, made.overhead)
    assert not found.failed and not found.unjudged
    assert found.utilisation < 0.65


@pytest.mark.parametrize('path', ROBOTS, ids=lambda path: path.stem)
def test_a_shipped_configuration_is_answered_without_a_measurement(
        path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(['--json', '--ros-args', '--params-file', str(path)], NoCore) == 0
    found = json.loads(capsys.readouterr().out)
    assert found['schedulable'] is True
    assert {task['execution_from'] for task in found['tasks']} == {'typical'}
    assert not {task['verdict'] for task in found['tasks']} & {'unknown', 'overload'}
    assert any(note.startswith('typical execution times are no bounds') for note in found['notes'])


def test_a_module_of_somebody_has_no_typical_time(capsys: pytest.CaptureFixture[str]) -> None:
    ros = ('modules:=[guard, third]', 'third.type:=plan_modules:Third', 'third.rate_hz:=5.0')
    assert plan(ros=ros) == 3
    assert 'not judged: third' in capsys.readouterr().out


def test_a_device_that_finds_more_samples_in_a_poll_takes_longer() -> None:
    def time_ns(rate_hz: float) -> int:
        settings = load([ROBOT], {'imu.rate_hz': rate_hz, 'imu.output_rate_hz': 200.0})
        tasks = {task.name: task for task in robot_tasks(
            settings, given=Given(typical=shipped())).tasks}
        return tasks['imu'].execution_ns or 0

    assert time_ns(20.0) == 10 * time_ns(200.0) == 10 * time_ns(400.0)


def test_what_is_measured_or_declared_goes_before_typical_times_and_these_before_budgets() -> None:
    settings = load([ROBOT], {'imu.execution_us': 70.0, 'gps.budget_us': 300.0,
                              'gps.on_budget': 'abort'})
    typical = Given(typical=shipped())
    origins = robot_tasks(settings, given=typical).origins
    assert [origins[name] for name in ('imu', 'gps', 'guard')] == [
        'declared', 'typical', 'typical']
    only_gps = Measured(10 ** 9, {'gps': MeasuredTask(60, 0, 9, 9, 10 ** 6, 0, 0, 0)})
    origins = robot_tasks(settings, only_gps, typical).origins
    assert [origins[name] for name in ('imu', 'gps', 'guard')] == [
        'declared', 'measured', 'unknown']


def test_all_bad_input_is_told_at_once(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert plan('--measured', str(tmp_path / 'none'), ros=('imu.rate_hz:=-5.0',)) == 2
    error = capsys.readouterr().err
    assert 'plan: 2 problems, nothing was analysed:' in error
    assert 'imu.rate_hz = -5.0: must be' in error
    assert 'cannot be read: No such file' in error


@pytest.mark.parametrize(('arguments', 'expected'), [
    (['--measure', '0'], "argument --measure: '0': must be seconds from 0.1"),
    (['--margin', 'x'], "argument --margin: 'x': must be a factor from 1"),
    (['--execution', 'imu'], "'imu': must be NAME=NUMBER, microseconds above 0"),
    (['--execution', 'imu=-3'], "'imu=-3': must be NAME=NUMBER, microseconds above 0"),
    (['--tick-us', 'nan'], "'nan': must be microseconds from 0"),
    (['--save-measured', 'x'], 'give --measure S as well'),
    (['--measure', '3', '--measured', 'x'], 'not allowed with')])
def test_a_bad_argument_ends_with_code_2(
        arguments: list[str], expected: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        plan(*arguments)
    assert ended.value.code == 2
    assert expected in capsys.readouterr().err


def test_a_file_that_is_not_there_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert plan('robot.yaml') == 2
    assert 'robot.yaml: cannot be read: No such file' in capsys.readouterr().err


def test_the_real_core_is_measured_and_kept(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv('RT_ROBOT_OS_RUNTIME_DIR', str(tmp_path / 'run'))
    kept = tmp_path / 'measured.json'
    # How long it takes depends on the machine: whatever the verdict, the times are known.
    code = run(['--measure', '0.5', '--save-measured', str(kept), '--json', '--ros-args',
                '--params-file', ROBOT, '-p', 'core.lock_memory:=false'], CoreProcess)
    found = json.loads(capsys.readouterr().out)
    assert code in (0, 1)
    origins = {task['name']: task['execution_from'] for task in found['tasks']}
    assert {origins[name] for name in ('imu', 'gps', 'guard', 'link/commands')} == {'measured'}
    measured = read_measured(kept)
    assert measured.fed and not measured.idle
    assert all(measured.tasks[name].runs for name in ('imu', 'gps', 'guard', 'link/service'))
    assert plan('--measured', str(kept)) == code
    assert os.listdir(tmp_path / 'run') == []


def test_what_is_begun_while_measuring_is_not_disturbed_by_samples_of_ros(tmp_path: Path) -> None:
    settings = load([Path(ROBOT)], {'core.lock_memory': False})
    path = tmp_path / 'core.sock'
    asked: list[bool] = []
    measured = measure(settings, CoreProcess(to_json(settings), path), path, 0.1,
                       lambda text: None, begun=lambda: asked.append(path.exists()))
    assert asked == [True]  # once, and the core runs
    assert not measured.fed and measured.tasks['imu'].runs


def test_a_core_that_cannot_start_is_told(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv('RT_ROBOT_OS_RUNTIME_DIR', str(tmp_path))

    def make(settings: str, path: Path) -> CoreProcess:
        return CoreProcess('{}', path)

    assert run(['--measure', '0.5'], make) == 2
    assert 'plan: the core ended with code 2; see its message above' in capsys.readouterr().err


def test_a_measured_response_above_its_bound_is_told(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    seen = MeasuredTask(40, 20_000_000, 500, 500, 90_000, 5_000, 40_000, 12_345_000)
    Measured(10 ** 10, {'guard': seen}).save(tmp_path / 'm.json')
    measured = ('--measured', str(tmp_path / 'm.json'))
    assert plan(*TIMES, *measured) == 0
    text = ' '.join(capsys.readouterr().out.split())
    assert 'note: guard: a response of 12.345 ms was measured, more than the bound of ' in text
    # With other priorities it says nothing about this robot.
    assert plan(*TIMES, *measured, ros=('guard.priority:=41',)) == 0
    assert 'was measured, more than' not in capsys.readouterr().out


# ---- tables ------------------------------------------------------------------------------------

def test_numbers_have_as_many_digits_as_matter() -> None:
    assert [ms(value) for value in (0, 1_234, 99_999_000, 123_456_789, 12_345_678_901)] == [
        '0.000', '0.001', '99.999', '123.46', '12346']
    assert [percent(value) for value in (0.1234, -1.5, 20.0)] == ['12.3', '-150.0', '2000']


def test_a_table_is_aligned() -> None:
    assert list(table(('task', 'C\nms'), [('a', '1.0'), ('bcdef', '10.0')])) == [
        'task      C', '         ms', 'a       1.0', 'bcdef  10.0']
    wide = list(table(('task', 'what'), [('a_very_long_name', 'x' * 90)]))
    assert max(len(line) for line in wide) == 100
    assert wide[1].startswith('a_very_.. x')


def test_a_parameter_file_needs_no_flag(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(['--ros-args', '--params-file', ROBOT], CoreProcess) in (0, 1, 3)
    expected = capsys.readouterr().out
    assert run([ROBOT], CoreProcess) in (0, 1, 3)
    assert capsys.readouterr().out == expected
    assert run(['/never/there.yaml'], CoreProcess) == 2
    assert '/never/there.yaml' in capsys.readouterr().err


def test_what_was_measured_must_be_writable_before_it_is_measured(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / 'none' / 'm.json'
    assert run([ROBOT, '--measure', '60', '--save-measured', str(path)], CoreProcess) == 2
    assert f'--save-measured {path}: there is no folder' in capsys.readouterr().err
