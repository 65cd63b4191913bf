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


"""The words for systemd, over a real socket."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import socket
import tempfile

import pytest

from rt_robot_os.linux.service_manager import ServiceManager


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with tempfile.TemporaryDirectory(prefix='rtr') as folder, socket.socket(
            socket.AF_UNIX, socket.SOCK_DGRAM) as made:
        made.bind(str(Path(folder) / 'notify'))
        made.settimeout(60)
        yield made


def test_it_is_told_in_its_own_words(listener: socket.socket) -> None:
    manager = ServiceManager({'NOTIFY_SOCKET': listener.getsockname(), 'WATCHDOG_USEC': '500000'})
    assert manager.present and manager.watchdog_ns == 500_000_000
    manager.notify('READY=1', 'STATUS=running')
    manager.notify('WATCHDOG=1')
    assert listener.recv(100) == b'READY=1\nSTATUS=running'
    assert listener.recv(100) == b'WATCHDOG=1'
    manager.close()
    manager.close()
    manager.notify('WATCHDOG=1')
    assert manager.failed == 0


def test_an_abstract_name_is_one() -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind('')  # Linux chooses an abstract name
        listener.settimeout(60)
        name = listener.getsockname().decode().replace('\0', '@')
        manager = ServiceManager({'NOTIFY_SOCKET': name})
        manager.notify('READY=1')
        assert listener.recv(100) == b'READY=1'
        manager.close()


@pytest.mark.parametrize('environment', [
    {}, {'NOTIFY_SOCKET': ''}, {'NOTIFY_SOCKET': 'vsock:2:1'}, {'WATCHDOG_USEC': '5'}])
def test_without_a_manager_nothing_happens(environment: dict[str, str]) -> None:
    manager = ServiceManager(environment)
    assert not manager.present and manager.watchdog_ns == 0
    manager.notify('READY=1')
    manager.close()
    assert manager.failed == 0


@pytest.mark.parametrize('text', ['', 'soon', '-1', '1' * 50])
def test_nonsense_in_its_variables_is_ignored(text: str, listener: socket.socket) -> None:
    manager = ServiceManager({'NOTIFY_SOCKET': listener.getsockname(), 'WATCHDOG_USEC': text})
    assert manager.present and manager.watchdog_ns == 0
    manager.close()


def test_a_manager_that_does_not_read_blocks_nothing(listener: socket.socket) -> None:
    manager = ServiceManager({'NOTIFY_SOCKET': listener.getsockname()})
    for _ in range(2000):
        manager.notify('WATCHDOG=1')
    assert manager.failed > 0
    listener.close()
    manager.notify('WATCHDOG=1')
    manager.close()
