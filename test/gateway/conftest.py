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

"""A core, a server that a test scripts, and a gateway between them in a thread."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from collections.abc import Iterator
from contextlib import AbstractContextManager
from contextlib import contextmanager
import json
from pathlib import Path
import threading
from typing import Any

from alarms_core import Core
from alarms_core_fixtures import core
from alarms_core_fixtures import running
from fake_server import FakeServer
from fake_server import serving
from fake_server import TOKEN
import pytest

pytest.importorskip('std_msgs', reason='ROS 2 messages are not installed')

from rt_robot_os.gateway.gateway import Gateway  # noqa: E402
from rt_robot_os.gateway.settings import GatewaySettings  # noqa: E402
from rt_robot_os.gateway.settings import load  # noqa: E402

__all__ = ['core', 'gateway', 'running', 'server']
Make = Callable[..., AbstractContextManager[Gateway]]


@pytest.fixture
def server() -> Iterator[FakeServer]:
    with serving(FakeServer()) as made:
        yield made


def settings_of(folder: Path, url: str, **more: Any) -> GatewaySettings:
    token = folder / 'token'
    token.write_text(TOKEN + '\n')
    token.chmod(0o600)
    path = folder / 'gateway.yaml'
    path.write_text(json.dumps({'/**/gateway': {'ros__parameters': {
        'server': url, 'token_file': str(token), 'heartbeat_s': 0.1, 'idle_hz': 10.0, **more}}}))
    return load([path], {})


@pytest.fixture
def gateway(tmp_path: Path, server: FakeServer) -> Make:
    """Make what runs a gateway of this core and server meanwhile."""
    @contextmanager
    def make(core: Core, said: list[str] | None = None, url: str = '', **more: Any
             ) -> Iterator[Gateway]:
        made = Gateway(settings_of(tmp_path, url or server.url, **more), 'robot',
                       core.folder / 'robot.sock', tmp_path / 'files',
                       (said if said is not None else []).append)
        ended = threading.Event()
        failed: list[BaseException] = []

        def run() -> None:
            try:
                asyncio.run(made.run(ended.is_set))
            except BaseException as error:
                failed.append(error)

        thread = threading.Thread(target=run)
        thread.start()
        try:
            yield made
        finally:
            ended.set()
            thread.join()
        assert not failed, failed

    return make
