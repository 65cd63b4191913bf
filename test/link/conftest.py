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
from pathlib import Path
import signal
import subprocess
import sys
from typing import Any

from processes import GUARD_YAML
from processes import in_a_folder
from processes import start_core
from processes import TIMEOUT_S
from processes import wait_until
import pytest

from rt_robot_os.base.errors import LinkError
from rt_robot_os.link import LinkClient

YAML = f"""{GUARD_YAML}\
    topics: [cmd_vel, text, picture]
    picture:
      message: sensor_msgs/msg/CompressedImage
      depth: 16
      tail: 100000
      fixed: {{format: jpeg}}
    cmd_vel: {{message: geometry_msgs/msg/Twist, depth: 64}}
    text: {{message: std_msgs/msg/String, depth: 16, tail: 100}}
"""
sys.path.insert(0, str(Path(__file__).parent))


class CoreUnderTest:
    """A core process with a runtime folder of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.path = folder / 'robot.sock'
        self.clients: list[LinkClient] = []
        (folder / 'robot.yaml').write_text(YAML)
        self.process = self.spawn()

    def spawn(self) -> subprocess.Popen[bytes]:
        return start_core(self.folder)

    def client(self, name: str = 'test') -> LinkClient:
        def connect() -> LinkClient | None:
            try:
                return LinkClient(self.path, name, timeout_s=TIMEOUT_S)
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
    with in_a_folder(CoreUnderTest) as made:
        yield made


@pytest.fixture
def until() -> Callable[..., Any]:
    """Give :func:`wait_until`."""
    return wait_until
