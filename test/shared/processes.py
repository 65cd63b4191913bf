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

"""Programs of this package as processes, and the world of a test: a folder and what runs in it."""

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
from typing import Any
from typing import Protocol
from typing import TypeVar

import pytest

ROOT = Path(__file__).resolve().parents[2]
TIMEOUT_S = 60.0
# A core without devices, on whatever machine; append the topics.
GUARD_YAML = """
robot:
  ros__parameters:
    core: {cpu: -2, scheduler_priority: 0, lock_memory: false}
    modules: [guard]
    guard: {type: twist_guard, rate_hz: 100.0, priority: 40}
"""
COMMANDS_YAML = f"""{GUARD_YAML}\
    topics: [cmd_vel]
    cmd_vel: {{message: geometry_msgs/msg/Twist, depth: 64}}
"""


class _World(Protocol):
    def close(self) -> None: ...


_W = TypeVar('_W', bound=_World)


def wait_until(condition: Callable[[], Any], what: str, timeout_s: float = TIMEOUT_S) -> Any:
    """Wait until something is true, and give it."""
    deadline = time.monotonic() + timeout_s
    while True:
        value = condition()
        if value:
            return value
        if time.monotonic() > deadline:
            pytest.fail(f'{what} did not happen within {timeout_s:g} s')
        time.sleep(0.005)


def has_ended(pid: int) -> bool:
    """Tell whether a process is gone, or only waits for whoever takes note of its end."""
    try:
        return Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()[0] == 'Z'
    except OSError:
        return True


def environment(folder: Path) -> dict[str, str]:
    """Give the environment of programs whose runtime folder is this one."""
    return {**os.environ, 'OPENBLAS_NUM_THREADS': '1', 'RT_ROBOT_OS_RUNTIME_DIR': str(folder),
            'PYTHONPATH': os.pathsep.join([str(ROOT), os.environ.get('PYTHONPATH', '')])}


def start_core(folder: Path) -> subprocess.Popen[bytes]:
    """Start a core with ``robot.yaml`` of its runtime folder."""
    return subprocess.Popen(
        [sys.executable, '-m', 'rt_robot_os.core.program', '--ros-args', '--params-file',
         str(folder / 'robot.yaml')], cwd='/', stderr=subprocess.DEVNULL, env=environment(folder))


@contextmanager
def in_a_folder(make: Callable[[Path], _W]) -> Iterator[_W]:
    """Make something in a temporary folder, and close it; a Unix socket's path has 108 bytes."""
    with tempfile.TemporaryDirectory(prefix='rt') as folder:
        made = make(Path(folder))
        try:
            yield made
        finally:
            made.close()
