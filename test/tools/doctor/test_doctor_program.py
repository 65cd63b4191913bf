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

"""The program as it is started: arguments, exit codes, Ctrl-C, this very machine."""

from __future__ import annotations

import json
import os
from pathlib import Path
import signal
import subprocess
import sys

import pytest
from recorded import CHECKS

from rt_robot_os.linux.clock_discipline import clock_state
from rt_robot_os.tools.doctor import examination
from rt_robot_os.tools.doctor.command import run
from rt_robot_os.tools.doctor.finding import Check
from rt_robot_os.tools.doctor.finding import State
from rt_robot_os.tools.doctor.options import parse
from rt_robot_os.tools.doctor.registry import ask
from rt_robot_os.tools.doctor.registry import Group
from rt_robot_os.tools.doctor.system import ProbeError
from rt_robot_os.tools.doctor.system import System

ROOT = Path(__file__).resolve().parents[3]


def _start(*arguments: str, before: str = '', variables: dict[str, str] | None = None,
           **options) -> subprocess.Popen[str]:
    environ = {**os.environ, **(variables or {}), 'PYTHONPATH': os.pathsep.join(
        filter(None, [before, str(ROOT), os.environ.get('PYTHONPATH', '')]))}
    return subprocess.Popen(
        [sys.executable, '-m', 'rt_robot_os.tools.doctor.program', *arguments], env=environ,
        text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, **options)


def test_this_machine_as_json() -> None:
    process = _start('--json', '--seconds', '0.6')
    output, errors = process.communicate(timeout=120)
    value = json.loads(output)
    assert errors == ''
    assert process.returncode == value['exit_code'] in (0, 1, 2)
    assert set(CHECKS) <= {one['check'] for one in value['findings']}
    assert [one for one in value['findings'] if 'please report it' in one['found']] == []
    assert value['wakeup']['kernel']['count'] > 0
    total = sum(row[2] for row in value['wakeup']['machine']['histogram'])
    assert total == value['wakeup']['machine']['count']


@pytest.mark.parametrize('arguments, words', [
    (('--seconds', 'soon'), "'soon' is not a number"), (('--seconds', '0'), 'from 0.1'),
    (('--seconds', 'nan'), 'from 0.1'), (('--cpu', '-1'), '--cpu'), (('--what',), '--what'),
    (('--all', '--quiet'), 'not allowed with')])
def test_bad_arguments_have_an_exit_code_of_their_own(arguments, words, capsys) -> None:
    with pytest.raises(SystemExit) as ended:
        parse(arguments)
    assert ended.value.code == 3
    assert words in capsys.readouterr().err


def test_a_wrong_configuration_is_told_and_nothing_is_looked_at(tmp_path, capsys) -> None:
    path = tmp_path / 'robot.yaml'
    path.write_text('robot:\n  ros__parameters:\n    core: {cpu: lots}\n')
    assert run(['--ros-args', '--params-file', str(path)]) == 3
    told = capsys.readouterr()
    assert 'robot.yaml' in told.err and 'core.cpu' in told.err
    assert told.out == ''


def test_the_configuration_says_what_the_core_asks_for(tmp_path) -> None:
    path = tmp_path / 'robot.yaml'
    path.write_text(
        'robot:\n  ros__parameters:\n    core: {cpu: 1, scheduler_priority: 42}\n'
        '    devices: [imu]\n    imu: {type: witmotion, port: /dev/ttyUSB5, topic: imu/data}\n')
    arguments = ['--ros-args', '--params-file', str(path)]
    _, wanted = parse(arguments)
    assert (wanted.cpu, wanted.priority, wanted.ports) == (1, 42, ('/dev/ttyUSB5',))
    _, wanted = parse(['--cpu', '0', *arguments])
    assert (wanted.cpu, wanted.source) == (0, 'the given configuration, --cpu')


def test_the_folder_of_a_journal_is_no_port_and_room_is_tried_there(tmp_path) -> None:
    path = tmp_path / 'robot.yaml'
    path.write_text(
        'robot:\n  ros__parameters:\n    devices: [kept]\n'
        f'    kept: {{type: journal, port: {tmp_path}/alarms, limit_kb: 64}}\n'
        '    topics: [records]\n'
        '    records: {topic: alarms/journal, message: std_msgs/msg/String, tail: 3000}\n')
    _, wanted = parse(['--ros-args', '--params-file', str(path)])
    assert wanted.ports == ()
    assert wanted.journals == ((f'{tmp_path}/alarms', 3 * 96 * 1024),)
    before = list(tmp_path.iterdir())
    (finding,) = ask(CHECKS['memory.journal'], System(wanted))
    assert finding.state in (State.OK, State.WARN, State.UNKNOWN), finding
    assert list(tmp_path.iterdir()) == before


def test_ctrl_c_ends_it_and_the_measurement() -> None:
    process = _start('--seconds', '60', start_new_session=True)
    stream = process.stdout
    assert stream is not None
    # The last group but one is written: the measurement has begun or is about to.
    for line in stream:
        if line.startswith('earlier runs'):
            break
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert errors.strip() == 'doctor: interrupted'


def test_it_works_where_the_package_does_not(tmp_path) -> None:
    for name in ('numpy', 'yaml', 'serial', 'rclpy'):
        (tmp_path / f'{name}.py').write_text(f'raise ImportError("no {name} here", name="{name}")')
    process = _start('--json', '--seconds', '0.2', before=str(tmp_path))
    output, errors = process.communicate(timeout=120)
    findings = {one['check']: one for one in json.loads(output)['findings']}
    assert (process.returncode, errors) == (2, '')
    assert 'no numpy here' in findings['python.numpy']['found']
    assert 'no rclpy here' in findings['ros.rclpy']['found']
    assert findings['measured.kernel']['state'] != 'unknown'


def test_a_reader_that_leaves_early_causes_no_noise() -> None:
    process = _start('--no-wakeup')
    assert process.stdout is not None
    process.stdout.close()
    assert process.stderr is not None
    errors = process.stderr.read()
    process.stderr.close()
    process.wait(timeout=60)
    assert errors == ''


def test_names_that_the_terminal_cannot_show_do_not_end_it(tmp_path) -> None:
    folder = tmp_path / 'd\udc80\u2603'
    process = _start('--no-wakeup', variables={
        'ROS_LOG_DIR': str(folder), 'PYTHONIOENCODING': 'ascii', 'LC_ALL': 'C'})
    output, errors = process.communicate(timeout=60)
    assert (errors, process.returncode in (0, 1, 2)) == ('', True)
    assert '\\u2603' in output


def test_a_check_that_raises_does_not_end_the_doctor(monkeypatch, capsys) -> None:
    def broken(system):
        raise ZeroDivisionError('x')

    monkeypatch.setattr(examination, 'GROUPS', (
        Group('a', 'A', (Check('a.b', 'broken', 'why', broken),)),))
    assert run(['--no-wakeup']) == 0
    told = capsys.readouterr().out
    assert 'unknown  broken' in told and 'ZeroDivisionError' in told
    assert 'ready: nothing to fix; wake-ups were not measured; 1 could not be determined' in told


def test_a_measurement_that_fails_is_a_line(monkeypatch, capsys) -> None:
    def broken(*arguments):
        raise ProbeError('the measurement ended with code 1')

    monkeypatch.setattr(examination, 'GROUPS', ())
    monkeypatch.setattr(examination.wakeup, 'measure', broken)
    assert run([]) == 0
    assert 'the measurement ended with code 1' in capsys.readouterr().out


def test_a_defect_of_the_doctor_has_its_exit_code(monkeypatch, capsys) -> None:
    monkeypatch.setattr(examination, 'describe', lambda system: {})
    assert run(['--no-wakeup']) == 3
    assert 'please report it' in capsys.readouterr().err


@pytest.mark.parametrize('name, arguments, keys', [
    ('scheduler', (0, -2), {'affinity_ok', 'lock_ok'}),
    ('clock', (), {'resolution_ns', 'read_ns', 'adjtimex'}),
    ('python', (), {'version', 'debug', 'free_threaded', 'observers', 'switch_interval'}),
    ('compiled', (), {'compiled', 'text', 'obstacle'})])
def test_probes_for_real(name, arguments, keys) -> None:
    assert keys <= set(System().probe(name, *arguments))


def test_a_probe_sees_what_its_environment_switches_on() -> None:
    facts = System(environ={**os.environ, 'PYTHONDEVMODE': '1'}).probe('python')
    assert 'development mode' in facts['observers']


def test_a_probe_that_does_not_exist_is_told() -> None:
    with pytest.raises(ProbeError, match="'nonsense' ended with code 1: KeyError"):
        System().probe('nonsense')


def test_the_state_of_the_clock_changes_nothing() -> None:
    state = clock_state()
    assert state.synchronised is not bool(state.status & 0x40)
    assert state.max_error_us >= 0


def test_large_files_of_proc_are_read_whole() -> None:
    system = System()
    assert system.text('/proc/sys/kernel/hostname') == os.uname().nodename
    assert system.read('/proc/no/such/file', 'default') == 'default'
