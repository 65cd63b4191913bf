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

"""A small server of accounts in this process, with passwords that are quick to compare."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

from argon2 import PasswordHasher
from fastapi import FastAPI
from rt_robot_os.monitor.api import audit as audit_api
from rt_robot_os.monitor.api import session as session_api
from rt_robot_os.monitor.api import users as users_api
from rt_robot_os.monitor.security.accounts import Accounts
from rt_robot_os.monitor.security.protection import protect
from rt_robot_os.monitor.security.roles import PERMISSIONS
from rt_robot_os.monitor.security.roles import Role
from rt_robot_os.monitor.security.users import User
from rt_robot_os.monitor.store.engine import open_engine
from rt_robot_os.monitor.store.engine import read_url
from rt_robot_os.monitor.store.migrate import upgrade
from sqlalchemy import Engine
from starlette.testclient import TestClient

#: Nothing that is worth anything: a test compares dozens of passwords.
QUICK = PasswordHasher(time_cost=1, memory_cost=8, parallelism=1)
PASSWORD = 'seven wet umbrellas'
BASE = 'http://localhost'
SECOND_NS = 1_000_000_000


@cache
def empty_database() -> bytes:
    """Return a database without rows: to make one takes longer than most tests."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / 'monitor.db'
        engine = open_engine(read_url(str(path)))
        upgrade(engine)
        engine.dispose()
        return path.read_bytes()


class Clock:
    """A clock that stands."""

    def __init__(self) -> None:
        """Begin on some day."""
        self.ns = 1_800_000_000 * SECOND_NS

    def __call__(self) -> int:
        """Return the time."""
        return self.ns

    def forward(self, seconds: float) -> None:
        """Let time pass."""
        self.ns += int(seconds * SECOND_NS)


class Monitor:
    """Accounts and an app that serves them; ``routers`` are more of its endpoints."""

    def __init__(self, folder: Path) -> None:
        """Make them, on a database of their own."""
        self.clock = Clock()
        (folder / 'monitor.db').write_bytes(empty_database())
        self.engine: Engine = open_engine(read_url(str(folder / 'monitor.db')))
        self.accounts = Accounts.open(self.engine, folder, hasher=QUICK, now_ns=self.clock)
        self.accounts.lock_out._now_ns = self.clock
        #: What the pages of an admin and of a viewer were told.
        self.told: dict[str, list[str]] = {'adam': [], 'vera': []}
        pages = [SimpleNamespace(actor=SimpleNamespace(may=PERMISSIONS[role].__contains__),
                                 send=self.told[name].append)
                 for name, role in (('adam', Role.ADMIN), ('vera', Role.VIEWER))]
        self.services: Any = SimpleNamespace(accounts=self.accounts, audit=self.accounts.audit,
                                             hub=SimpleNamespace(clients=pages))
        self._hash = self.accounts.passwords.hash(PASSWORD)

    @cached_property
    def app(self) -> FastAPI:
        """Return the app; not each test needs one."""
        found = FastAPI()
        found.state.services = self.services
        for each in self.apis():
            found.include_router(each.router(self.services))
        protect(found)
        return found

    @staticmethod
    def apis() -> tuple[Any, ...]:
        """Return the modules of endpoints."""
        return session_api, users_api, audit_api

    def user(self, name: str, role: Role = Role.CARER, people: tuple[str, ...] = ('*',)) -> User:
        """Add a user with the password of all users."""
        return self.accounts.users.add(name, role, people, 'test', self._hash)

    def restart(self, folder: Path) -> None:
        """End the server and start it again, on the same database."""
        self.accounts.close()
        self.accounts = Accounts.open(self.engine, folder, hasher=QUICK, now_ns=self.clock)
        self.accounts.lock_out._now_ns = self.clock
        self.accounts.restore_limits()
        self.services.accounts, self.services.audit = self.accounts, self.accounts.audit
        self.__dict__.pop('app', None)

    def client(self, base: str = BASE, address: str = '127.0.0.1') -> TestClient:
        """Return a browser of somebody who is not logged in."""
        return TestClient(self.app, base, client=(address, 50000),
                          headers={'origin': base, 'sec-fetch-site': 'same-origin'})

    def signed_in(self, name: str, role: Role | None = None, **more: Any) -> TestClient:
        """Return a browser of somebody who is; with a role they are added first."""
        if role is not None:
            self.user(name, role, **more)
        client = self.client()
        answer = client.post('/api/session', json={'name': name, 'password': PASSWORD})
        assert answer.status_code == 200, answer.text
        client.headers['x-csrf-token'] = answer.json()['csrf']
        return client

    def audited(self) -> list[tuple[str, str, str]]:
        """Return name, action and object of each row of the audit."""
        return [(row['name'], row['action'], row['object'])
                for row in self.accounts.audit.all_rows()]

    def close(self) -> None:
        """Let go of all of it."""
        self.accounts.close()
        self.engine.dispose()


@contextmanager
def monitor(folder: Path) -> Iterator[Monitor]:
    """Give a server of accounts."""
    found = Monitor(folder)
    try:
        yield found
    finally:
        found.close()
