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

"""A core in a process of its own, and clients of it."""

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

from rt_robot_os.errors import LinkError
from rt_robot_os.link import LinkClient

ROOT = Path(__file__).resolve().parents[2]
TIMEOUT_S = 60.0
YAML = """
robot:
  ros__parameters:
    core: {cpu: -2, scheduler_priority: 0, lock_memory: false}
    modules: [guard]
    guard: {type: twist_guard, rate_hz: 100.0, priority: 40}
    topics: [cmd_vel, text, picture]
    picture:
      {message: sensor_msgs/msg/CompressedImage, depth: 16, tail: 100000, fixed: {format: jpeg}}
    cmd_vel: {message: geometry_msgs/msg/Twist, depth: 64}
    text: {message: std_msgs/msg/String, depth: 16, tail: 100}
"""


def wait_until(condition: Callable[[], Any], what: str) -> Any:
    deadline = time.monotonic() + TIMEOUT_S
    while True:
        value = condition()
        if value:
            return value
        if time.monotonic() > deadline:
            pytest.fail(f'{what} did not happen within {TIMEOUT_S:g} s')
        time.sleep(0.005)


class CoreUnderTest:
    """A core process with a runtime folder of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.path = folder / 'robot.sock'
        self.clients: list[LinkClient] = []
        (folder / 'robot.yaml').write_text(YAML)
        self.process = self.spawn()

    def spawn(self) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, '-m', 'rt_robot_os.core.program', '--ros-args', '--params-file',
             str(self.folder / 'robot.yaml')], cwd='/', stderr=subprocess.DEVNULL,
            env={**os.environ, 'PYTHONPATH': os.pathsep.join(
                [str(ROOT), os.environ.get('PYTHONPATH', '')]), 'OPENBLAS_NUM_THREADS': '1',
                'RT_ROBOT_OS_RUNTIME_DIR': str(self.folder)})

    def client(self, name: str = 'test') -> LinkClient:
        def connect() -> LinkClient | None:
            try:
                return LinkClient(self.path, name)
            except LinkError:
                assert self.process.poll() is None, 'the core has ended'
                return None

        made: LinkClient = wait_until(connect, 'a connection')
        self.clients.append(made)
        return made

    def end(self, signo: int = signal.SIGTERM) -> int:
        if self.process.poll() is None:
            self.process.send_signal(signo)
        return self.process.wait(TIMEOUT_S)

    def close(self) -> None:
        for client in self.clients:
            client.close()
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()


@pytest.fixture
def core() -> Iterator[CoreUnderTest]:
    pytest.importorskip('geometry_msgs', reason='ROS 2 messages are not installed')
    # Short: a Unix socket's path has 108 bytes.
    with tempfile.TemporaryDirectory(prefix='rtl') as folder:
        made = CoreUnderTest(Path(folder))
        try:
            yield made
        finally:
            made.close()


@pytest.fixture
def until() -> Callable[..., Any]:
    """Give :func:`wait_until`."""
    return wait_until
