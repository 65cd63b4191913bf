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

"""The host of captures and journals leaves alone what belongs to the host that follows it."""

import errno
import os
from pathlib import Path
import socket
import subprocess

import pytest

from rt_robot_os.devices.capture import host as host_module
from rt_robot_os.devices.capture.host import CaptureHost


def can_connect(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as client:
        return client.connect_ex(str(path)) == 0


def test_a_host_that_ends_late_leaves_the_socket_of_the_next_one(tmp_path: Path) -> None:
    path = tmp_path / 'robot.captures'
    killed, following = CaptureHost(path), CaptureHost(path)
    killed.open()
    path.unlink()  # as the core that follows does
    following.open()
    killed.close()
    assert can_connect(path)
    following.close()
    assert not path.exists()


def test_a_host_that_cannot_start_a_worker_serves_the_next_connection(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tries: list[int] = []

    def start(*arguments: object) -> subprocess.Popen[bytes]:
        tries.append(1)
        if len(tries) == 1:
            raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))
        return subprocess.Popen(['sleep', '60'])

    monkeypatch.setattr(host_module, 'start_worker', start)
    host = CaptureHost(tmp_path / 'robot.captures')
    host.open()
    try:
        assert can_connect(host.path)
        host.serve()
        assert host.workers == []
        assert can_connect(host.path)
        host.serve()
        assert len(host.workers) == 1
    finally:
        host.close()
