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

"""A real core on simulated devices, and the programs record and replay."""

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

import pytest
from rt_robot_os.base.errors import LinkError
from rt_robot_os.link.client import LinkClient

pytest.importorskip('mcap', reason='recordings need mcap')

sys.path.insert(0, str(Path(__file__).parent))

ROOT = Path(__file__).resolve().parents[2]
CORE = ['-p', 'core.scheduler_priority:=0', '-p', 'core.cpu:=-2', '-p', 'core.lock_memory:=false']
LIMIT_S = 180.0


def wait_for(condition: Callable[[], object], what: str) -> None:
    """Wait until a condition holds; fail the test with ``what`` otherwise."""
    end = time.monotonic() + LIMIT_S
    while not condition():
        if time.monotonic() > end:
            pytest.fail(f'{what} did not happen within {LIMIT_S:g} s')
        time.sleep(0.02)


class Robot:
    """A runtime folder of its own, and the programs that a test starts in it."""

    ORDINARY = CORE

    def __init__(self, folder: Path, output: Path) -> None:
        self.folder = folder
        self.output = output
        self.logs = 0
        self.programs: list[subprocess.Popen[bytes]] = []

    def start(self, module: str, *arguments: str, **options: object
              ) -> tuple[subprocess.Popen[bytes], Path]:
        """Start a program of the package; give it and the file of its output."""
        self.logs += 1
        log = self.output / f'{self.logs}.log'
        with log.open('wb') as stream:
            program = subprocess.Popen(
                [sys.executable, '-m', module, *arguments], stdout=stream, stderr=stream,
                cwd=self.output, env={
                    **os.environ, 'RT_ROBOT_OS_RUNTIME_DIR': str(self.folder),
                    'OPENBLAS_NUM_THREADS': '1',
                    'PYTHONPATH': os.pathsep.join([str(ROOT), os.environ.get('PYTHONPATH', '')])},
                **options)  # type: ignore[call-overload]
        self.programs.append(program)
        return program, log

    def core(self, *more: str) -> subprocess.Popen[bytes]:
        """Start the default robot's core and wait until its devices deliver."""
        program, log = self.start('rt_robot_os.core.program', '--ros-args', *CORE, *more)
        wait_for(lambda: b'gps: active' in log.read_bytes() or program.poll() is not None,
                 'a core with devices')
        assert program.poll() is None, log.read_text()
        return program

    def connect(self) -> LinkClient:
        """Connect to the core; its socket is there some time before anybody listens."""
        found: list[LinkClient] = []

        def answers() -> bool:
            try:
                found.append(LinkClient(self.folder / 'robot.sock', 'test', timeout_s=LIMIT_S))
            except LinkError:
                return False
            return True

        wait_for(answers, 'a core that answers')
        return found[0]

    def until(self, condition: Callable[[], object], what: str) -> None:
        """Wait until a condition holds."""
        wait_for(condition, what)

    def record(self, *arguments: str, **options: object) -> tuple[subprocess.Popen[bytes], Path]:
        """Start to record, and wait until something is on the disk."""
        return self.start('rt_robot_os.recording.record_program', *arguments, **options)

    def messages(self, log: Path) -> int:
        """Give how many messages the recorder said that it has."""
        words = log.read_text().split()
        return max((int(words[i - 1]) for i, word in enumerate(words)
                    if word == 'messages' and words[i - 1].isdigit()), default=0)

    def wait_for_messages(self, log: Path, program: subprocess.Popen[bytes], count: int) -> None:
        """Wait until the recorder said that it has so many messages."""
        wait_for(lambda: self.messages(log) >= count or program.poll() is not None,
                 f'{count} recorded messages')

    def end(self, program: subprocess.Popen[bytes], signo: int = signal.SIGINT) -> int:
        """Send a signal and wait."""
        program.send_signal(signo)
        return program.wait(LIMIT_S)

    def run(self, module: str, *arguments: str) -> tuple[int, str]:
        """Run a program to its end; give its exit code and output."""
        program, log = self.start(module, *arguments)
        return program.wait(LIMIT_S), log.read_text()

    def close(self) -> None:
        for program in self.programs:
            if program.poll() is None:
                program.terminate()
                try:
                    program.wait(10.0)
                except subprocess.TimeoutExpired:
                    program.kill()
                    program.wait()


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[Robot]:
    # Short: a Unix socket's path has 108 bytes.
    with tempfile.TemporaryDirectory(prefix='rtr') as folder:
        made = Robot(Path(folder), tmp_path)
        try:
            yield made
        finally:
            made.close()


@pytest.fixture(scope='module')
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Run one core of the default robot for the tests that only look on; give its folder."""
    with tempfile.TemporaryDirectory(prefix='rtr') as folder:
        made = Robot(Path(folder), tmp_path_factory.mktemp('running'))
        try:
            made.core()
            yield made.folder
        finally:
            made.close()


@pytest.fixture
def beside(running: Path, tmp_path: Path) -> Iterator[Robot]:
    """Give what starts programs beside a core that runs already."""
    made = Robot(running, tmp_path)
    try:
        yield made
    finally:
        made.close()


@pytest.fixture(scope='session')
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record the default robot from its first moment on; who changes it works on a copy."""
    output = tmp_path_factory.mktemp('recording')
    with tempfile.TemporaryDirectory(prefix='rtr') as folder:
        made = Robot(Path(folder), output)
        try:
            recorder, log = made.record('-o', str(output / 'bag'))
            wait_for(lambda: b'waiting' in log.read_bytes(), 'a waiting recorder')
            made.core('-p', 'core.record_bytes:=true')
            made.wait_for_messages(log, recorder, 1000)
            assert made.end(recorder) == 0, log.read_text()
        finally:
            made.close()
    return output / 'bag'
