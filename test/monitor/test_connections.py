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

"""Many connections, slow peers, and where it may be reached from."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import closing
from contextlib import ExitStack
from contextlib import suppress
from pathlib import Path
import socket
import threading
from types import SimpleNamespace
from typing import Any
from urllib.request import urlopen

from monitor_server import quick_services
from monitor_server import served
import pytest
from rt_robot_os.base.errors import StartError
from rt_robot_os.monitor.command import check_reach
from rt_robot_os.monitor.command import run
from rt_robot_os.monitor.connections import Connections
from rt_robot_os.monitor.connections import HANDSHAKES
from rt_robot_os.monitor.connections import PATIENCE_S
from rt_robot_os.monitor.connections import TooManyError
from rt_robot_os.monitor.services import Services
from rt_robot_os.monitor.settings import MonitorSettings

MOST = 20


@pytest.fixture(scope='module')
def services(tmp_path_factory: pytest.TempPathFactory) -> Services:
    return quick_services(tmp_path_factory.mktemp('monitor'), connections=MOST)


@pytest.fixture(scope='module')
def address(services: Services) -> Iterator[str]:
    with served(services) as found:
        yield found


def opened(address: str, said: bytes = b'') -> socket.socket:
    """Open a connection and say something on it."""
    host, _, port = address.partition(':')
    found = socket.create_connection((host, int(port)), 20)
    found.sendall(said)
    return found


@pytest.mark.parametrize('said', [b'', b'GET /healthz HTTP/1.1\r\nHost: local',
                                  b'POST /api/session HTTP/1.1\r\nHost: localhost\r\n'
                                  b'Content-Length: 900\r\n\r\n{"name":'])
def test_ten_times_as_many_connections_as_there_may_be_keep_nobody_out(
        address: str, services: Services, said: bytes) -> None:
    before = services.connections.counts['gave_way']
    with ExitStack() as stack:
        idle = [stack.enter_context(opened(address, said)) for _ in range(10 * MOST)]
        for _ in range(3):
            with urlopen(f'http://{address}/healthz', timeout=20) as found:
                assert found.status == 200
        assert services.connections.open <= MOST
        assert services.connections.counts['gave_way'] >= before + 9 * MOST
        # The oldest have given way.
        with suppress(ConnectionResetError):
            assert idle[0].recv(1) == b''


class Clock:
    """A clock of the loop of this thread that is moved by hand: a server runs in another."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s = 1000.0
        self.waits = 0
        mine = threading.get_ident()
        sleep, running_loop = asyncio.sleep, asyncio.get_running_loop
        loop = SimpleNamespace(time=lambda: self.now_s)
        monkeypatch.setattr(asyncio, 'get_running_loop', lambda: (
            loop if threading.get_ident() == mine else running_loop()))
        monkeypatch.setattr(asyncio, 'sleep', lambda seconds: (
            self._sleep if threading.get_ident() == mine else sleep)(seconds))

    async def _sleep(self, seconds: float) -> None:
        self.now_s += seconds
        self.waits += 1
        if self.waits > 3 * PATIENCE_S:
            raise asyncio.CancelledError


class One:
    """A connection."""

    def __init__(self) -> None:
        self.since_s = 0.0
        self.gone_at: list[float] = []
        self.transport: Any = SimpleNamespace(abort=lambda: self.gone_at.append(0))


def test_who_keeps_the_server_waiting_is_cut_off_and_who_waits_for_it_is_not(
        monkeypatch: pytest.MonkeyPatch) -> None:
    Clock(monkeypatch)
    all_ = Connections(10)
    slow, busy, again = One(), One(), One()
    for each in (slow, busy, again):
        all_.made(each)  # type: ignore[arg-type]
    all_.works(busy)  # type: ignore[arg-type]
    with closing(asyncio.new_event_loop()) as loop, pytest.raises(asyncio.CancelledError):
        loop.run_until_complete(all_.check_timeouts())
    assert slow.gone_at and again.gone_at
    assert not busy.gone_at
    assert all_.counts['too_slow'] == 2


def test_handshakes_that_never_end_are_bounded() -> None:
    all_ = Connections(10)
    for _ in range(HANDSHAKES):
        all_.admit()
    with pytest.raises(TooManyError):
        all_.admit()
    all_.admitted()
    all_.admit()


@pytest.mark.parametrize('host', ['0.0.0.0', '::', '192.168.1.4', 'example.org'])
def test_it_cannot_be_reached_from_elsewhere_without_tls(
        host: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(StartError, match=f'{host}.*TLS.*certificate'):
        run(['--host', host, '--folder', str(tmp_path / 'none')])
    assert not (tmp_path / 'none').exists()


@pytest.mark.parametrize('host', ['127.0.0.1', '::1', 'localhost', '127.9.9.9'])
def test_on_loopback_it_needs_none(host: str) -> None:
    check_reach(MonitorSettings(host=host))
    check_reach(MonitorSettings(host='0.0.0.0', certificate='c.pem', key='k.pem'))
    with pytest.raises(StartError, match='belong together'):
        check_reach(MonitorSettings(host=host, certificate='c.pem'))


def test_wrong_settings_are_told_before_anything_is_opened(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / 'monitor.yaml'
    file.write_text('/**/monitor: {ros__parameters: {prot: 8080, heartbeat_s: -1.0}}\n')
    assert run(['--folder', str(tmp_path / 'none'), '--ros-args', '--params-file',
                str(file)]) == 2
    said = capsys.readouterr().err
    assert 'prot' in said and 'heartbeat_s' in said
    assert not (tmp_path / 'none').exists()


def test_a_port_that_is_taken_is_told(tmp_path: Path) -> None:
    from rt_robot_os.monitor.server import listen
    with socket.socket() as other:
        other.bind(('127.0.0.1', 0))
        other.listen()
        with pytest.raises(StartError, match='--port'):
            listen(MonitorSettings(port=other.getsockname()[1]))
