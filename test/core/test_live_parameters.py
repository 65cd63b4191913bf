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

"""The parameters of a running core: asked for, changed and saved over the link, without ROS."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import subprocess
import sys
import tempfile
import time

from processes import TIMEOUT_S
import pytest

from rt_robot_os.base.errors import LinkError
from rt_robot_os.link import LinkClient
from rt_robot_os.settings import from_json
from rt_robot_os.settings import load
from rt_robot_os.settings import to_json
from rt_robot_os.tools.parameters.program import main

pytest.importorskip('geometry_msgs', reason='ROS 2 messages are not installed')

ROOT = Path(__file__).resolve().parents[2]
YAML = """\
robot:
  ros__parameters:
    core: {cpu: -2, scheduler_priority: 0, lock_memory: false}
    devices: [sonar]
    sonar: {type: maxbotix, port: sim, rate_hz: 30.0}
    modules: [guard, woken]
    guard: {type: twist_guard, rate_hz: 100.0, budget_us: 5000.0, on_budget: abort}
    woken: {type: 'core_parameter_modules:Woken', rate_hz: 0.0}
    topics: [cmd_vel]
    cmd_vel: {message: geometry_msgs/msg/Twist}
"""

Run = Callable[..., 'tuple[int, str]']


@pytest.fixture
def folder(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    # Short: a Unix socket's path has 108 bytes.
    with tempfile.TemporaryDirectory(prefix='rtp') as name:
        monkeypatch.setenv('RT_ROBOT_OS_RUNTIME_DIR', name)
        monkeypatch.setenv('ROS_HOME', f'{name}/ros')
        (Path(name) / 'robot.yaml').write_text(YAML)
        yield Path(name)


@contextmanager
def core(folder: Path, *files: str, stdin: str = '') -> Iterator[LinkClient]:
    arguments = ['--ros-args'] if not stdin else ['--settings', '-']
    for file in files:
        arguments += ['--params-file', str(folder / file)]
    paths = [str(ROOT), str(Path(__file__).parent), os.environ.get('PYTHONPATH', '')]
    process = subprocess.Popen(
        [sys.executable, '-m', 'rt_robot_os.core.program', *arguments], cwd='/', text=True,
        stdin=subprocess.PIPE, stderr=subprocess.PIPE,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(paths)})
    assert process.stdin is not None
    process.stdin.write(stdin)
    process.stdin.close()
    process.stdin = None
    try:
        deadline = time.monotonic() + 60
        while True:
            try:
                client = LinkClient(folder / 'robot.sock', 'test', timeout_s=TIMEOUT_S)
                break
            except LinkError:
                assert process.poll() is None and time.monotonic() < deadline
                time.sleep(0.02)
        with client:
            yield client
    finally:
        process.terminate()
        process.communicate()


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    def program(*arguments: str) -> tuple[int, str]:
        code = main(arguments)
        said = capsys.readouterr()
        return code, said.out + said.err

    return program


def test_saved_parameters_survive_a_new_start(folder: Path, run: Run) -> None:
    with core(folder, 'robot.yaml'):
        assert run('set', 'guard.rate_hz', '80') == (0, 'guard.rate_hz = 80.0, was 100.0\n')
        assert run('set', 'sonar.rate_hz', '15.0')[0] == 0
        assert run('set', 'guard.timeout_s', '0.25')[0] == 0
        assert run('set', 'guard.log_level', 'debug')[0] == 0
        code, said = run('list')
        assert code == 0
        marks = {line.split()[1]: line.split()[2] for line in said.splitlines()
                 if line.startswith('*')}
        assert marks == {'guard.log_level': "'debug'", 'guard.rate_hz': '80.0',
                         'guard.timeout_s': '0.25', 'sonar.rate_hz': '15.0'}
        assert 'woken.rate_hz' not in said
        code, said = run('save')
        assert code == 0
        file = folder / 'ros' / 'robot.saved.yaml'
        assert said.startswith(f"{file}: guard.log_level = 'debug', ")
    with core(folder, 'robot.yaml', 'ros/robot.saved.yaml') as client:
        assert run('get', 'guard.rate_hz') == (0, '80.0\n')
        assert run('get', 'guard.log_level') == (0, "'debug'\n")
        assert run('get', 'guard.timeout_s') == (0, '0.25\n')
        assert '*' not in run('list')[1]
        periods = {task.name: task.period_ns for task in client.statistics().tasks}
        assert periods['sonar'] == round(1e9 / 15.0)


def test_a_core_that_was_started_again_knows_what_was_loaded(folder: Path, run: Run) -> None:
    sys.path.insert(0, str(Path(__file__).parent))
    try:
        loaded = load([folder / 'robot.yaml'])
    finally:
        sys.path.pop(0)
    text = to_json(loaded)
    now = text.replace('"rate_hz": 100.0', '"rate_hz": 50.0')
    assert from_json(now) != loaded
    with core(folder, stdin=f'{now}\n{text}'):
        assert run('get', 'guard.rate_hz') == (0, '50.0\n')
        run('save', str(folder / 'it.yaml'))
    assert 'rate_hz: 50.0' in (folder / 'it.yaml').read_text()


def test_nonsense_is_refused_with_the_reason(folder: Path, run: Run) -> None:
    with core(folder, 'robot.yaml') as client:
        digest = client.statistics().core['parameters']
        for arguments, reason in {
                ('set', 'guard.rate_hz', 'fast'): "guard.rate_hz = 'fast': must be a number from "
                                                  '0.1 to 10000 (Hz)',
                ('set', 'guard.rate_hz', '60'): '',
                ('set', 'guard.rate_hz', '1000'): 'guard.budget_us = 5000.0 does not fit: it '
                                                  'is above the period',
                ('set', 'guard.timeout', '1.0'): "did you mean 'guard.timeout_s'?",
                ('set', 'guard.timeout_s', '[1'): 'guard.timeout_s: ',
                ('set', 'guard.timeout_s', '{a: 1}'): 'must be one value',
                ('get', 'woken.rate_hz'): 'no parameter that can be changed',
                ('save', str(folder / 'robot.yaml')): 'is not a file of saved parameters'}.items():
            code, said = run(*arguments)
            assert reason in said
            assert code == (1 if reason else 0)
        assert client.statistics().core['parameters'] != digest
    code, said = run('list')
    assert code == 1
    assert 'is the robot running?' in said
