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

"""A server of the monitor in a thread of this process, on a free port of loopback."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping
from contextlib import contextmanager
from functools import cache
import json
from pathlib import Path
from tempfile import TemporaryDirectory
import threading
import time
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request
from urllib.request import urlopen

from fake_robot import token_of
from rt_robot_os.monitor.security.roles import Role
from rt_robot_os.monitor.security.sessions import SECOND_NS
from rt_robot_os.monitor.security.sessions import SessionLimits
from rt_robot_os.monitor.security.tables import robot_accounts
from rt_robot_os.monitor.security.tables import sessions
from rt_robot_os.monitor.security.tokens import csrf_token
from rt_robot_os.monitor.security.tokens import kept
from rt_robot_os.monitor.server import DATABASE
from rt_robot_os.monitor.server import listen
from rt_robot_os.monitor.server import make_server
from rt_robot_os.monitor.server import make_services
from rt_robot_os.monitor.services import Services
from rt_robot_os.monitor.settings import MonitorSettings
from rt_robot_os.monitor.store.store import Store
from websockets.sync.client import ClientConnection
from websockets.sync.client import connect


@contextmanager
def served(services: Services) -> Iterator[str]:
    """Serve; give its address without the scheme, such as ``127.0.0.1:40123``."""
    server = make_server(services)
    listening = listen(services.settings)
    thread = threading.Thread(target=server.run, args=([listening],), daemon=True)
    thread.start()
    while not server.started and thread.is_alive():
        time.sleep(0.002)
    try:
        yield f'127.0.0.1:{listening.getsockname()[1]}'
    finally:
        server.should_exit = True
        thread.join(20)
        listening.close()


def quick_services(folder: Path, **settings: Any) -> Services:
    """Make the parts of a server that lets the robot ``robot`` in."""
    (folder / DATABASE).write_bytes(_empty_database())
    services = make_services(MonitorSettings(port=0, where=folder, **settings))
    let_robot_in(services, 'robot')
    return services


@cache
def _empty_database() -> bytes:
    """Return a database without rows: to make one takes longer than most tests."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / DATABASE
        Store.open(str(path)).close()
        return path.read_bytes()


def let_robot_in(services: Services, name: str) -> None:
    """Let a robot in, whose id is its name, and whose token that of the tests."""
    services.accounts.robots.add(name)
    with services.store.writing() as connection:
        connection.execute(robot_accounts.update().where(robot_accounts.c.name == name).values(
            id=name, token=kept(token_of(name))))
    services.accounts.residents.accept_first_hello(name)


def logged_in(services: Services, name: str = 'olga', role: Role = Role.OWNER,
              people: tuple[str, ...] = ('*',)) -> dict[str, str]:
    """Add a user without a password, and return the headers of a browser with their session."""
    user = services.accounts.users.add(name, role, people, 'test', 'no password')
    _, secret = services.accounts.sessions.begin(user.id, '127.0.0.1', 'test')
    return {'Cookie': f'session={secret}', 'X-CSRF-Token': csrf_token(secret)}


def ask(address: str, headers: dict[str, str], method: str, path: str, content: Any = None
        ) -> tuple[int, Any]:
    """Ask the server for something, as the page does."""
    body = None if content is None else json.dumps(content).encode()
    request = Request(f'http://{address}{path}', body, {
        **headers, 'Content-Type': 'application/json', 'Origin': f'http://{address}'},
        method=method)
    try:
        with urlopen(request, timeout=30) as found:
            return found.status, json.loads(found.read())
    except HTTPError as error:
        with error:
            return error.code, json.loads(error.read())['detail']


def lock_sessions(services: Services, user: str | None = None) -> None:
    """
    Lock sessions, as if they had not been used for a quarter of an hour.

    :param user: id of whose; None is everybody.
    """
    idle_ns = int(SessionLimits().idle_s * SECOND_NS)
    changed = sessions.update().values(seen_ns=time.time_ns() - idle_ns)
    if user is not None:
        changed = changed.where(sessions.c.user == user)
    with services.store.writing() as connection:
        connection.execute(changed)


class Page:
    """
    The live connection of a browser.

    :param headers: of :func:`logged_in`.
    """

    def __init__(self, address: str, headers: Mapping[str, str], path: str = '/live',
                 **options: Any) -> None:
        self._connecting = connect(
            f'ws://{address}{path}', compression=None, proxy=None,
            additional_headers=headers, **{'origin': f'http://{address}', **options})

    def __enter__(self) -> Page:
        """Connect."""
        self.socket: ClientConnection = self._connecting.__enter__()
        return self

    def __exit__(self, *what: Any) -> None:
        """Close it."""
        self._connecting.__exit__(*what)

    def say(self, **message: Any) -> None:
        """Send a message."""
        self.socket.send(json.dumps(message))

    def next(self, kind: str, patience_s: float = 20.0,  # noqa: A003
             **content: Any) -> dict[str, Any]:
        """Return the next message of a kind, with such a content."""
        while True:
            found: dict[str, Any] = json.loads(self.socket.recv(patience_s))
            if found['kind'] == kind and content.items() <= found.items():
                return found
