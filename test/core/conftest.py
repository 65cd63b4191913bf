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


"""A core on the virtual clock, or as a process, with modules that a test brings along."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
import os
from pathlib import Path
import subprocess
import sys
import tempfile

import pytest

from rt_robot_os.core.app import Core
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.settings import load

sys.path.insert(0, str(Path(__file__).parent))

HERE = Path(__file__).resolve().parent
S = 1_000_000_000
MakeCore = Callable[[str], Core]
YAML = """\
robot:
  ros__parameters:
    core: {{cpu: -2, scheduler_priority: 0, lock_memory: false, black_box_folder: {folder}}}
    watchdog: {{{watchdog}}}
    modules: [it]
    it: {{rate_hz: 100.0, critical: true, type: '{module}'}}
"""


@pytest.fixture
def make_core() -> Iterator[MakeCore]:
    """Make a core of the parameters below ``ros__parameters``, its time at 100 s."""
    pytest.importorskip('geometry_msgs', reason='ROS 2 messages are not installed')
    made: list[Core] = []
    with tempfile.TemporaryDirectory(prefix='rtc') as name:
        folder = Path(name)

        def make(parameters: str) -> Core:
            path = folder / 'robot.yaml'
            lines = ''.join(f'    {line}\n' for line in parameters.splitlines())
            path.write_text(f'robot:\n  ros__parameters:\n{lines}')
            made.append(Core(load([path]), folder / 'robot.sock',
                             clock=VirtualClock(start_ns=100 * S)))
            return made[-1]

        yield make
        for core in made:
            core.close()


@pytest.fixture
def folder() -> Iterator[Path]:
    # Short: a Unix socket's path has 108 bytes.
    with tempfile.TemporaryDirectory(prefix='rtw') as name:
        yield Path(name)


@pytest.fixture
def core_environment(folder: Path) -> dict[str, str]:
    """Give the environment of a core of its own, with the modules that are here."""
    paths = [str(HERE.parents[1]), str(HERE), os.environ.get('PYTHONPATH', '')]
    return {**os.environ, 'PYTHONPATH': os.pathsep.join(paths),
            'RT_ROBOT_OS_RUNTIME_DIR': str(folder)}


@pytest.fixture
def start(folder: Path, core_environment: dict[str, str]
          ) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Start the program core with one module."""
    started: list[subprocess.Popen[str]] = []

    def run(watchdog: str, module: str = 'Noted, raises: 20', prefix: str = 'core_modules:',
            **environment: str) -> subprocess.Popen[str]:
        kind, _, rest = module.partition(',')
        text = YAML.format(folder=folder, watchdog=watchdog, module=prefix + kind)
        if rest:
            text = text.rstrip().removesuffix('}') + f',{rest}}}\n'
        (folder / 'robot.yaml').write_text(text)
        started.append(subprocess.Popen(
            [sys.executable, '-m', 'rt_robot_os.core.program', '--ros-args', '--params-file',
             str(folder / 'robot.yaml')], cwd='/', stderr=subprocess.PIPE, text=True,
            env={**core_environment, **environment}))
        return started[-1]

    yield run
    for process in started:
        if process.poll() is None:
            process.kill()
        process.communicate()
