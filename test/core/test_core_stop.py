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


"""A core ends when it is told to, whatever its modules do, and their outputs come to rest."""

from __future__ import annotations

from pathlib import Path
import signal
import subprocess
import sys
import time

from core_tools import Start
from processes import has_ended
from processes import wait_until
import pytest

pytest.importorskip('geometry_msgs', reason='ROS 2 messages are not installed')

MODULE = 'core_ending_modules:'
# Prints the pid of the core that it starts, and waits to be killed.
NODE = """
import os, subprocess, sys, time
process = subprocess.Popen([sys.executable, *sys.argv[1:], '--parent', str(os.getpid())],
                           stdin=open(os.environ['SETTINGS']))
print(process.pid, flush=True)
time.sleep(600)
"""


# A signal that comes while a core tidies up, as that of a parent that takes long to die.
TOLD_TWICE = """
import os, signal, sys
from rt_robot_os.core.command import run
from rt_robot_os.core.simulators import Simulators
stop = Simulators.stop
def told_again(self):
    os.kill(os.getpid(), signal.SIGTERM)
    stop(self)
Simulators.stop = told_again
sys.exit(run(sys.argv[1:]))
"""


def computes(process: subprocess.Popen[str], path: Path) -> None:
    until = time.monotonic() + 60
    while not (path.exists() and 'computes' in path.read_text()):
        assert process.poll() is None and time.monotonic() < until, 'no job began'
        time.sleep(0.02)


@pytest.fixture
def output(folder: Path) -> Path:
    return folder / 'output'


@pytest.mark.parametrize('signo', [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
@pytest.mark.parametrize('module', ['Endless', 'Resisting'])
def test_a_job_without_end_is_ended_and_the_output_comes_to_rest(
        start: Start, output: Path, module: str, signo: int) -> None:
    process = start('timeout_s: 0', f'{module}, path: {output}, priority: 1', prefix=MODULE)
    computes(process, output)
    process.send_signal(signo)
    errors = process.communicate(timeout=60)[1]
    assert process.returncode == 3, errors
    assert output.read_text().splitlines()[-1] == 'it rests'
    assert "task 'it'" in errors
    assert module == 'Resisting' or signal.Signals(signo).name in errors


def test_one_that_does_not_let_itself_be_deactivated_goes_to_its_safe_state(
        start: Start, output: Path) -> None:
    process = start('timeout_s: 0', f'StuckAtTheEnd, path: {output}, priority: 1', prefix=MODULE)
    computes(process, output)
    process.terminate()
    errors = process.communicate(timeout=60)[1]
    assert process.returncode == 3, errors
    assert output.read_text().splitlines()[-1] == 'it is safe'
    assert 'it: deactivate failed: TaskAborted' in errors


def test_a_native_call_at_the_end_ends_with_the_process(start: Start, output: Path) -> None:
    process = start('timeout_s: 0', f'NativeAtTheEnd, path: {output}, priority: 1', prefix=MODULE)
    computes(process, output)
    process.terminate()
    errors = process.communicate(timeout=60)[1]
    assert process.returncode == -signal.SIGABRT
    assert 'in deactivate' in errors


def test_a_core_that_ends_by_itself_says_so(start: Start, output: Path) -> None:
    process = start('timeout_s: 0', 'Noted')
    until = time.monotonic() + 60
    while not (output.parent / 'robot.sock').exists():
        assert time.monotonic() < until
        time.sleep(0.02)
    process.terminate()
    process.communicate(timeout=60)
    assert process.returncode == 0


def test_a_core_whose_node_was_killed_ends_although_a_job_does_not(
        folder: Path, output: Path, core_environment: dict[str, str]) -> None:
    from rt_robot_os.settings import load
    from rt_robot_os.settings import to_json
    path = folder / 'robot.yaml'
    path.write_text(f"""\
robot:
  ros__parameters:
    core: {{cpu: -2, scheduler_priority: 0, lock_memory: false, black_box_folder: {folder}}}
    modules: [it]
    it: {{type: '{MODULE}Endless', rate_hz: 100.0, priority: 1, path: {output}}}
""")
    (folder / 'settings').write_text(to_json(load([path])))
    node = subprocess.Popen(
        [sys.executable, '-c', NODE, '-m', 'rt_robot_os.core.program', '--settings', '-',
         '--socket', str(folder / 'robot.sock')], stdout=subprocess.PIPE, text=True,
        env={**core_environment, 'SETTINGS': str(folder / 'settings')})
    assert node.stdout is not None
    with node.stdout:
        pid = int(node.stdout.readline())
    computes(node, output)
    node.kill()
    node.wait()
    wait_until(lambda: has_ended(pid), 'the end of the core')
    assert output.read_text().splitlines()[-1] == 'it rests'


def test_a_second_signal_leaves_nothing_behind(
        folder: Path, core_environment: dict[str, str]) -> None:
    path = folder / 'robot.yaml'
    path.write_text('robot: {ros__parameters: {core: {cpu: -2, scheduler_priority: 0}}}\n')
    process = subprocess.run(
        [sys.executable, '-c', TOLD_TWICE, '--duration', '0.05', '--ros-args', '--params-file',
         str(path)], cwd='/', stderr=subprocess.PIPE, text=True, env=core_environment)
    assert process.returncode == 0, process.stderr
    assert [each.name for each in folder.iterdir() if each != path] == []
