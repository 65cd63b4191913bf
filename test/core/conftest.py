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


"""A core on the virtual clock, from YAML, with modules that a test brings along."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from pathlib import Path
import sys
import tempfile

import pytest

from rt_robot_os.core.app import Core
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.settings import load

sys.path.insert(0, str(Path(__file__).parent))

S = 1_000_000_000
MakeCore = Callable[[str], Core]


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
