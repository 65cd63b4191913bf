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

"""Real processes, real ptys, real DDS: a robot as its user starts it, and a node that listens."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
import os
from pathlib import Path
import signal
import subprocess
import sys
import tempfile
import threading
import time
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

import rclpy  # noqa: E402, I100
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
TIMEOUT_S = 180.0
ASK_AGAIN_S = 10.0


def wait_for(condition: Callable[[], Any], what: str, timeout_s: float = TIMEOUT_S) -> Any:
    """Wait until a condition gives something true; fail the test with ``what`` otherwise."""
    deadline = time.monotonic() + timeout_s
    while True:
        value = condition()
        if value:
            return value
        if time.monotonic() > deadline:
            pytest.fail(f'{what} did not happen within {timeout_s:g} s')
        time.sleep(0.01)


class Program:
    """
    A program of this package as a child process, with its output.

    :param prelude: code that the process runs first, to shorten a time that no setting says.
    """

    def __init__(self, module: str, *arguments: str, env: dict[str, str] | None = None,
                 prefix: tuple[str, ...] = (), prelude: str = '') -> None:
        path, _, function = module.partition(':')
        function = function or 'main'
        code = f'{prelude}\nimport sys; from {path} import {function}; sys.exit({function}())'
        self.process = subprocess.Popen(
            [*prefix, sys.executable, '-c', code, *arguments], cwd='/',
            env={**os.environ, 'PYTHONPATH': os.pathsep.join(
                [str(ROOT), os.environ.get('PYTHONPATH', '')]), **(env or {})},
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        self.lines: list[str] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        with self.process.stdout as lines:
            for line in lines:
                self.lines.append(line.rstrip())

    @property
    def output(self) -> str:
        return '\n'.join(self.lines)

    def said(self, text: str) -> bool:
        return any(text in line for line in list(self.lines))

    def wait_for_line(self, text: str, timeout_s: float = TIMEOUT_S) -> None:
        wait_for(lambda: self.said(text) or self.process.poll() is not None,
                 f'{text!r} in the output', timeout_s)
        if self.process.poll() is not None:
            self.join()  # its last lines may still be on their way
        assert self.said(text), f'ended with {self.process.returncode}:\n{self.output}'

    def end(self, signo: int = signal.SIGINT, timeout_s: float = TIMEOUT_S) -> int:
        if self.process.poll() is None:
            self.process.send_signal(signo)
        try:
            code = self.process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            self.process.kill()
            pytest.fail(f'did not end after signal {signo}:\n{self.output}')
        self.join()
        return code

    def join(self) -> None:
        """Wait for the end of the output: the last child holds it open."""
        self._reader.join(10.0)


class World:
    """A runtime folder of its own, programs, and a listening node."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.programs: list[Program] = []
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = Node('listener', context=self.context, use_global_arguments=False)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._stopping = False
        self._thread.start()

    def _spin(self) -> None:
        while not self._stopping:
            self._executor.spin_once(timeout_sec=0.05)

    def start(self, module: str, *arguments: str, prefix: tuple[str, ...] = (),
              prelude: str = '', **env: str) -> Program:
        program = Program(module, *arguments, prefix=prefix, prelude=prelude,
                          env={'RT_ROBOT_OS_RUNTIME_DIR': str(self.folder), **env})
        self.programs.append(program)
        return program

    def robot(self, parameters: str | None = None, *arguments: str, **options: Any) -> Program:
        """
        Start the robot with this YAML, or with the package's own configuration.

        Diagnostics come often, as many tests wait for the next ones.
        """
        ros = ['-p', 'diagnostics_rate_hz:=10.0']
        if parameters is not None:
            path = self.folder / 'test.yaml'
            path.write_text(parameters)
            ros += ['--params-file', str(path)]
        return self.start(
            'rt_robot_os.ros.program', '--ros-args', *ros, *arguments, **options)

    def play(self, log: Path, port: Path, *arguments: str) -> Program:
        """Play a recording through a pty as soon as somebody has opened it."""
        return self.start('rt_robot_os.sim.player_program', str(log), '--link', str(port),
                          '--wait', *arguments)

    def listen(self, message: Any, topic: str, depth: Any = 2000) -> list[Any]:
        """Collect what comes on a topic; depth may be a quality of service."""
        received: list[Any] = []
        self.node.create_subscription(message, topic, received.append, depth)
        return received

    def call(self, service: Any, name: str, request: Any) -> Any:
        """
        Call a service and wait for its answer.

        DDS loses an answer to a client that it has not made known to the server yet, and a server
        that has just ended still seems to be there: then it is asked again. The client is
        destroyed with the node: what the thread spins on must not be.
        """
        client = self.node.create_client(service, name)
        asked: list[Any] = []
        assert client.wait_for_service(TIMEOUT_S), f'no service {name}'

        def answered() -> list[Any]:
            if time.monotonic() > began + len(asked) * ASK_AGAIN_S:
                asked.append(client.call_async(request))
            return [future for future in asked if future.done()]

        began = time.monotonic()
        return wait_for(answered, f'the answer of {name}')[0].result()

    def leftovers(self) -> list[str]:
        """List processes of ours and files of theirs that are still there."""
        # os.walk passes over a folder that is removed meanwhile; Path.rglob of Python 3.11 fails.
        found = [os.path.relpath(Path(folder) / name, self.folder)
                 for folder, folders, files in os.walk(self.folder) for name in folders + files
                 if not name.endswith('.yaml')]
        for entry in Path('/proc').iterdir():
            if not entry.name.isdigit() or int(entry.name) == os.getpid():
                continue
            try:
                environment = (entry / 'environ').read_bytes()
                state = (entry / 'stat').read_text().rpartition(')')[2].split()[0]
            except OSError:
                continue
            if state != 'Z' and f'RT_ROBOT_OS_RUNTIME_DIR={self.folder}'.encode() in environment:
                found.append(f'process {entry.name}')
        return found

    def close(self) -> None:
        self._stopping = True
        for program in self.programs:
            if program.process.poll() is None:
                program.process.kill()
            program.process.wait()
            program.join()
        # Without a limit: what a thread still spins on must not be destroyed.
        self._thread.join()
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self.context)


@pytest.fixture
def world() -> Iterator[World]:
    # Short: a Unix socket's path has 108 bytes.
    with tempfile.TemporaryDirectory(prefix='rtr') as folder:
        made = World(Path(folder))
        try:
            yield made
        finally:
            made.close()


@pytest.fixture
def until() -> Callable[..., Any]:
    """Give :func:`wait_for`."""
    return wait_for
