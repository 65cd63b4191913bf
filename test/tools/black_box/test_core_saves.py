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


"""A real core saves its black box: after a fault, on a signal, and when it is asked."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
import os
from pathlib import Path
import signal
import subprocess
import sys
import tempfile
import time
from typing import Any

import pytest

from rt_robot_os.base.errors import LinkError
from rt_robot_os.link import LinkClient
from rt_robot_os.tools.black_box import dumps
from rt_robot_os.tools.black_box import Outcome
from rt_robot_os.tools.black_box import read_dump
from rt_robot_os.tools.black_box import understand
from rt_robot_os.tools.black_box.program import main

ROOT = Path(__file__).resolve().parents[3]
TIMEOUT_S = 60.0
MODULE = """
import os
from rt_robot_os.modules import Module

class Walker(Module):
    jobs = 0

    def step(self):
        self.jobs += 1
        if os.path.exists('hang'):
            while True:
                pass
        if os.path.exists('stumble'):
            raise ValueError(f'stumbled {self.jobs}')
"""
YAML = """
robot:
  ros__parameters:
    core: {{cpu: -2, scheduler_priority: 0, lock_memory: false, black_box_folder: '{folder}'}}
    modules: [walker]
    walker: {{type: 'walker_module:Walker', rate_hz: 200.0, priority: 40, critical: true}}
    watchdog: {{timeout_s: 2.0, action: exit, exit_code: 71}}
"""


def _until(condition: Callable[[], Any], what: str) -> Any:
    deadline = time.monotonic() + TIMEOUT_S
    while not (value := condition()):
        if time.monotonic() > deadline:
            pytest.fail(f'{what} did not happen within {TIMEOUT_S:g} s')
        time.sleep(0.01)
    return value


class Core:
    """A core in a process and a folder of its own."""

    def __init__(self, folder: Path, dump_folder: Path) -> None:
        self.folder = folder
        self.dumps = dump_folder
        (folder / 'walker_module.py').write_text(MODULE)
        (folder / 'robot.yaml').write_text(YAML.format(folder=dump_folder))
        self.log = folder / 'log'
        with self.log.open('wb') as log:
            self.process = subprocess.Popen(
                [sys.executable, '-m', 'rt_robot_os.core.program', '--ros-args', '--params-file',
                 str(folder / 'robot.yaml')], cwd=folder, stderr=log, env={
                    **os.environ, 'RT_ROBOT_OS_RUNTIME_DIR': str(folder),
                    'OPENBLAS_NUM_THREADS': '1', 'PYTHONPATH': os.pathsep.join(
                        [str(ROOT), str(folder), os.environ.get('PYTHONPATH', '')])})

    def client(self) -> LinkClient:
        def connect() -> LinkClient | None:
            try:
                return LinkClient(self.folder / 'robot.sock', 'test', timeout_s=TIMEOUT_S)
            except LinkError:
                assert self.process.poll() is None, self.log.read_text()
                return None

        client: LinkClient = _until(connect, 'a connection')
        return client

    def saved(self, number: int) -> list[Path]:
        def enough() -> list[Path]:
            assert self.process.poll() is None, self.log.read_text()
            found = dumps(self.dumps)
            return found if len(found) >= number else []

        found: list[Path] = _until(enough, f'dump {number}')
        return found

    def said(self, text: str) -> None:
        _until(lambda: text in self.log.read_text(), f'the report {text!r}')

    def stumble(self) -> None:
        """Let jobs fail, until one more has been reported, then no more."""
        text = 'ValueError: stumbled'
        before = self.log.read_text().count(text)
        (self.folder / 'stumble').touch()
        _until(lambda: self.log.read_text().count(text) > before, 'another failure')
        (self.folder / 'stumble').unlink()


@pytest.fixture
def start() -> Iterator[Callable[..., Core]]:
    made: list[Core] = []
    with tempfile.TemporaryDirectory(prefix='rtb') as name:  # short, for the path of the socket
        def begin(dump_folder: Path | None = None) -> Core:
            made.append(Core(Path(name), dump_folder or Path(name) / 'dumps'))
            return made[-1]

        yield begin
        for core in made:
            if core.process.poll() is None:
                core.process.kill()
            core.process.wait()


def test_a_fault_is_saved_once_a_minute_at_most(start: Callable[..., Core]) -> None:
    core = start()
    core.client().close()
    core.stumble()
    path, = core.saved(1)
    core.said(f'black box: saved as {path} (')
    found = read_dump(path)
    assert found.dump.reason.startswith("task 'walker': ValueError: stumbled ")
    assert found.facts['robot'] == 'robot' and found.facts['pid'] == core.process.pid
    history = understand(found.dump)
    tasks = [task.name for task in history.tasks]
    assert any(job.outcome is Outcome.FAILED and tasks[job.task] == 'walker'
               for job in history.jobs)
    assert {tasks[task] for task, _, _ in found.dump.running} == {'core/watch'}
    core.stumble()
    core.process.send_signal(signal.SIGUSR1)
    first, second = core.saved(2)
    assert first == path
    reason = read_dump(second).dump.reason
    assert 'SIGUSR1' in reason and reason.endswith('x faults before it, not saved)')


def test_a_signal_saves_as_often_as_it_comes(start: Callable[..., Core]) -> None:
    core = start()
    core.client().close()
    for number in (1, 2):
        core.process.send_signal(signal.SIGUSR1)
        assert read_dump(core.saved(number)[-1]).dump.reason == 'SIGUSR1'
    core.process.send_signal(signal.SIGTERM)
    assert core.process.wait(TIMEOUT_S) == 0


def test_the_program_asks_for_a_dump(start: Callable[..., Core], tmp_path: Path,
                                     monkeypatch: pytest.MonkeyPatch) -> None:
    core = start()
    core.client().close()
    monkeypatch.setenv('RT_ROBOT_OS_RUNTIME_DIR', str(core.folder))
    path = tmp_path / 'mine.gz'
    assert main(['dump', str(path), '--reason', 'curious']) == 0
    found = read_dump(path)
    assert found.dump.reason == 'curious'
    assert understand(found.dump).jobs
    assert main(['--folder', str(tmp_path / 'all'), 'dump']) == 0
    assert len(dumps(tmp_path / 'all', 'robot')) == 1
    assert not core.dumps.exists()


def test_clients_that_ask_again_and_again_get_whole_dumps(start: Callable[..., Core]) -> None:
    core = start()
    with core.client() as client:
        for _ in range(5):
            parts = client.request_all('black_box')
            assert parts[0]['reason'] == 'asked by test'
            assert parts[-1]['end'] == sum(len(p.get('records', ())) for p in parts)
        assert client.request('change', name='walker.rate_hz', value=50.0) == {'value': 50.0}


def test_a_folder_that_cannot_be_written_is_reported_and_nothing_else_happens(
    start: Callable[..., Core], tmp_path: Path,
) -> None:
    (tmp_path / 'file').write_text('')
    core = start(tmp_path / 'file' / 'sub')
    core.client().close()
    core.stumble()
    core.said('black box: not saved: ')
    core.said('choose another folder (core.black_box_folder)')
    core.client().close()


def test_a_fault_just_before_the_end_is_saved(start: Callable[..., Core]) -> None:
    core = start()
    core.client().close()
    (core.folder / 'stumble').touch()
    core.said('ValueError: stumbled')
    core.process.send_signal(signal.SIGTERM)
    assert core.process.wait(TIMEOUT_S) == 0
    assert len(dumps(core.dumps)) == 1
    assert 'black box: saved as' in core.log.read_text()


def test_a_writer_that_died_is_reported_and_the_core_goes_on(start: Callable[..., Core]) -> None:
    core = start()
    core.client().close()
    children = Path(f'/proc/{core.process.pid}/task/{core.process.pid}/children')
    writer, = children.read_text().split()
    os.kill(int(writer), signal.SIGKILL)
    core.stumble()
    core.said('black box: not saved: its writer')
    core.client().close()


def test_a_core_that_the_watchdog_ends_is_saved_before(start: Callable[..., Core]) -> None:
    core = start()
    core.client().close()
    core.stumble()  # the next fault comes soon after this one
    core.saved(1)
    (core.folder / 'hang').touch()
    assert core.process.wait(TIMEOUT_S) != 0
    last = _until(lambda: dumps(core.dumps)[1:], 'the last dump')[0]
    dump = read_dump(last).dump
    assert dump.reason.startswith('watchdog: ') and 'walker' in dump.reason
    running = [dump.tasks[task].name for task, _, _ in dump.running]
    assert running[-2:] == ['walker', 'core/watchdog']
