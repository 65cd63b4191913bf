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

"""How the programs of a robot start, and how they refuse to."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
import os
from pathlib import Path
import resource
import signal
import subprocess
import sys
from typing import Any

from processes import TIMEOUT_S
import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402, I100
from rt_robot_os.link import LinkClient  # noqa: E402
from rt_robot_os.link.stamp_mapper import StampMapper  # noqa: E402
from rt_robot_os.ros.supervisor import Supervisor  # noqa: E402

pytestmark = pytest.mark.one_build

Until = Callable[..., Any]
ROOT = Path(__file__).resolve().parents[2]
PROGRAMS = {'core': 'rt_robot_os.core.program', 'robot': 'rt_robot_os.ros.program',
            'top': 'rt_robot_os.tools.top.program'}
ROBOT = """
robot:
  ros__parameters:
    core: {cpu: -2, scheduler_priority: 0, lock_memory: false}
"""


def run(program: str, *arguments: str, folder: Path, before: Any = None,
        **environment: str | None) -> subprocess.CompletedProcess[str]:
    """Run a program until it ends by itself."""
    env = {**os.environ, 'RT_ROBOT_OS_RUNTIME_DIR': str(folder), **environment,
           'PYTHONPATH': os.pathsep.join([str(ROOT), os.environ.get('PYTHONPATH', '')])}
    return subprocess.run(
        [sys.executable, '-c', f'import sys; from {PROGRAMS[program]} import main; '
         'sys.exit(main())', *arguments], capture_output=True, text=True, timeout=60, cwd=folder,
        env={key: value for key, value in env.items() if value is not None}, preexec_fn=before)


def test_a_second_robot_of_the_name_is_refused_and_the_first_lives_on(
        world: Any, until: Until) -> None:
    first = world.robot(ROBOT)
    first.wait_for_line('connected to the core')
    for program in ('robot', 'core'):
        second = run(program, folder=world.folder)
        assert second.returncode == 2
        assert second.stderr.startswith(f'{program}: the ')
        assert 'already runs on this machine (pid ' in second.stderr
        assert second.stderr.count('\n') == 1
    with LinkClient(world.folder / 'robot.sock', timeout_s=TIMEOUT_S) as client:
        assert client.request('reset_statistics') == {}
    assert first.end() == 0
    assert world.leftovers() == []


def test_a_robot_of_another_name_runs_beside_it(world: Any) -> None:
    world.robot(ROBOT).wait_for_line('connected to the core')
    other = world.robot(ROBOT.replace('robot:', 'other:', 1), '-r', '__node:=other')
    other.wait_for_line('connected to the core')
    top = run('top', '--robot', '/third', '--once', folder=world.folder)
    assert top.returncode == 1
    assert 'Running robots: --robot /other, --robot /robot' in top.stderr


def test_a_node_attaches_to_a_core_of_its_name(world: Any) -> None:
    world.start('rt_robot_os.core.program', '--ros-args', '--params-file',
                str(_written(world.folder, ROBOT))).wait_for_line('timer slack')
    beside = world.robot(ROBOT)
    beside.wait_for_line('the core robot already runs on this machine')
    assert beside.process.wait(60) == 2
    attached = world.robot(ROBOT, '-p', 'core.spawn:=false')
    attached.wait_for_line('connected to the core')


def _written(folder: Path, text: str) -> Path:
    path = folder / 'core.yaml'
    path.write_text(text)
    return path


@pytest.mark.parametrize(('arguments', 'words'), [
    (['my.yaml'], 'my.yaml: cannot be read: No such file'),
    (['--params-file', 'x.yaml'], 'Write: robot --ros-args --params-file x.yaml'),
    (['--params-file=x y.yaml', '--simulate'],
     "Write: robot --simulate --ros-args --params-file 'x y.yaml'"),
    (['imu.rate_hz:=5', '--ros-args', '-r', '__node:=a'],
     'Write: robot --ros-args -p imu.rate_hz:=5 -r __node:=a'),
    (['--simulat'], 'did you mean --simulate?'), (['what'], 'robot --help'),
    (['--ros-args', '--params-file', 'nix.yaml'], 'nix.yaml: cannot be read: No such file'),
    (['--ros-args', '--log-level', 'loud'], 'must be one of debug, info'),
    (['--ros-args', '-r', 'a!b:=c'], 'ROS 2 does not start: failed to initialize rcl: '),
    (['--ros-args', '-r', f'__node:={"a" * 90}'], 'Linux allows 107'),
    (['--ros-args', '-r', f'__node:={"a" * 300}'], 'must be at most 255 characters'),
])
def test_what_is_not_understood_is_refused_with_what_would_be_right(
        tmp_path: Path, arguments: list[str], words: str) -> None:
    tmp_path.chmod(0o700)
    done = run('robot', *arguments, folder=tmp_path)
    assert done.returncode == 2
    assert words in done.stderr and 'Traceback' not in done.stderr
    assert not (tmp_path / 'robot.sock').exists()


@pytest.mark.parametrize(('arguments', 'words'), [
    (['--settings', 'nix.json'], '--settings nix.json: cannot be read: No such file'),
    (['my.yaml'], 'my.yaml: cannot be read: No such file')])
def test_core_refuses_in_the_same_way(tmp_path: Path, arguments: list[str], words: str) -> None:
    tmp_path.chmod(0o700)
    done = run('core', *arguments, folder=tmp_path)
    assert done.returncode == 2 and words in done.stderr


def test_no_pending_signals_is_no_reason_to_try_again(tmp_path: Path) -> None:
    tmp_path.chmod(0o700)
    done = run('robot', '--simulate', folder=tmp_path, before=lambda: resource.setrlimit(
        resource.RLIMIT_SIGPENDING, (0, 0)))
    assert done.returncode == 2
    assert 'pending signals are limited to 0' in done.stderr and 'Traceback' not in done.stderr


@pytest.mark.parametrize('environment', [
    {'HOME': None, 'ROS_LOG_DIR': None, 'ROS_HOME': None},
    {'ROS_LOG_DIR': '/dev/null/log'}])
def test_a_robot_runs_without_a_place_for_logs(world: Any, environment: dict[str, Any]) -> None:
    program = ('env', *(f'-u{name}' for name, value in environment.items() if value is None))
    given = {name: value for name, value in environment.items() if value is not None}
    robot = world.robot(ROBOT, prefix=program, **given)
    robot.wait_for_line('connected to the core')
    assert not robot.said('Traceback')
    assert robot.end() == 0


@pytest.mark.parametrize(('arguments', 'level'), [([], b'\1'), (['--simulate'], b'\0')])
def test_simulated_sensors_are_told(world: Any, until: Until, arguments: list[str],
                                    level: bytes) -> None:
    diagnostics = world.listen(DiagnosticArray, '/diagnostics')
    robot = world.start('rt_robot_os.ros.program', *arguments)

    until(lambda: any((status.name, status.level, status.message) ==
                      ('robot: simulated', level, 'simulated: imu, gps')
                      for message in list(diagnostics) for status in message.status), 'the status')
    robot.wait_for_line('simulated: imu, gps')
    assert 'simulated: imu, gps' in robot.lines[0]
    assert ('WARNING' in robot.lines[0]) == (not arguments)
    top = run('top', '--once', folder=world.folder)
    assert 'simulated: imu, gps' in top.stdout


def test_a_device_that_is_off_is_not_there(world: Any) -> None:
    robot = world.start('rt_robot_os.ros.program', '--simulate', '--ros-args', '-p',
                        'gps.enabled:=false')
    robot.wait_for_line('imu]: active')
    with LinkClient(world.folder / 'robot.sock', timeout_s=TIMEOUT_S) as client:
        assert [device['name'] for device in client.statistics().devices] == ['imu']
        assert 'gps/fix' in client.topics
    assert robot.end() == 0


def test_the_links_of_a_killed_simulator_are_removed(world: Any, until: Until) -> None:
    robot = world.start('rt_robot_os.ros.program', '--simulate')
    robot.wait_for_line('imu]: active')
    found = []
    for entry in Path('/proc').iterdir():
        if entry.name.isdigit():
            with suppress(OSError):  # it has ended meanwhile
                words = (entry / 'cmdline').read_bytes()
                if b'simulator_process' in words and os.fsencode(world.folder) in words:
                    found.append(int(entry.name))
    os.kill(found[0], signal.SIGKILL)
    assert robot.end() == 0
    assert world.leftovers() == []


def test_who_is_to_end_waits_for_no_core(tmp_path: Path) -> None:
    supervisor = Supervisor(
        tmp_path / 'robot.sock', None, StampMapper(), lambda *_: None, lambda *_: None,
        name='robot', on_connect=lambda _: None, on_disconnect=lambda: None, heartbeat_s=1.0,
        statistics_period_s=1.0)
    assert not supervisor.wait(1e9, iter([False, True]).__next__)


def test_an_early_ctrl_c_shows_no_traceback(tmp_path: Path) -> None:
    tmp_path.chmod(0o700)
    code = ('import os, signal, sys\n'
            'class Finder:\n'
            '    def find_spec(self, name, path=None, target=None):\n'
            '        if name == "rt_robot_os.settings": os.kill(os.getpid(), signal.SIGINT)\n'
            'sys.meta_path.insert(0, Finder())\n'
            'from rt_robot_os.ros.program import main\nsys.exit(main())\n')
    done = subprocess.run([sys.executable, '-c', code], cwd=ROOT, capture_output=True, text=True,
                          timeout=60, env={**os.environ, 'RT_ROBOT_OS_RUNTIME_DIR': str(tmp_path)})
    assert done.returncode == -signal.SIGINT and done.stderr == ''
