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

"""A real PostgreSQL server for tests, of the wheel pgserver or of Debian, as root or not."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextlib import ExitStack
from importlib.util import find_spec
import os
from pathlib import Path
import pwd
import shutil
import subprocess
import tempfile
import time
from typing import Any

import pytest

# What ends when whoever started it ends, however that ends.
_UNTIL_EOF = '"$@" & cat > /dev/null; kill -INT $!; wait $!'
_SETTINGS = ('fsync=off', 'full_page_writes=off', 'shared_buffers=64MB', 'max_connections=50',
             'autovacuum=off', 'listen_addresses=')


def program_folders() -> list[Path]:
    """Return folders with the programs of PostgreSQL, the first one preferred."""
    spec = find_spec('pgserver')
    wheels = [Path(each, 'pginstall', 'bin')
              for each in (spec.submodule_search_locations or ()) if spec] if spec else []
    newest = sorted(Path('/usr/lib/postgresql').glob('*/bin'), reverse=True)
    return [each for each in (*wheels, *newest) if (each / 'initdb').is_file()]


def _as_user(folder: Path) -> dict[str, Any]:
    """Return how a program is run by somebody other than root, who owns a folder."""
    if os.geteuid():
        return {'cwd': '/'}
    nobody = pwd.getpwnam('nobody')
    os.chown(folder, nobody.pw_uid, nobody.pw_gid)
    return {'cwd': '/', 'user': nobody.pw_uid, 'group': nobody.pw_gid, 'extra_groups': []}


@contextmanager
def postgres_server(*settings: str) -> Iterator[str]:
    """
    Give the URL of a server, that of ``RT_ROBOT_OS_POSTGRES`` or one of its own.

    :param settings: other than those for quick tests, such as ``fsync=on``.
    """
    if given := os.environ.get('RT_ROBOT_OS_POSTGRES'):
        yield given
        return
    pytest.importorskip('psycopg', reason='needs psycopg')
    folder = Path(tempfile.mkdtemp(prefix='rt_robot_os_pg_'))
    how = _as_user(folder)
    try:
        programs = _made(folder, how)
        server = subprocess.Popen(
            ['sh', '-c', _UNTIL_EOF, 'sh', programs / 'postgres', '-D', folder / 'data', '-k',
             folder, *(part for each in (*_SETTINGS, *settings) for part in ('-c', each))],
            stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, **how)
        try:
            url = f'postgresql://monitor@/postgres?host={folder}'
            _wait(url, server)
            yield url
        finally:
            server.communicate(timeout=60)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def lazily() -> Iterator[Iterator[str]]:
    """Give one that starts a server when the first URL is asked for."""
    with ExitStack() as stack:
        yield (stack.enter_context(postgres_server()) for _ in range(1))


def _made(folder: Path, how: dict[str, Any]) -> Path:
    found = program_folders()
    for programs in found:
        try:
            if not subprocess.run(
                    [programs / 'initdb', '-D', folder / 'data', '--no-sync', '-A', 'trust', '-U',
                     'monitor', '-E', 'UTF8', '--locale=C'], stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL, **how).returncode:
                return programs
        except OSError:
            continue  # Such as a folder that nobody but root may enter.
    pytest.skip('no PostgreSQL that starts: pip install pgserver, or set RT_ROBOT_OS_POSTGRES')


def _wait(url: str, server: subprocess.Popen[bytes]) -> None:
    import psycopg
    deadline = time.monotonic() + 60
    while True:
        try:
            psycopg.connect(url).close()
            return
        except psycopg.OperationalError:
            if server.poll() is not None or time.monotonic() > deadline:
                pytest.skip('PostgreSQL does not start here')
            time.sleep(0.02)


def execute(url: str, *statements: str) -> None:
    """Run statements outside of a transaction."""
    import psycopg
    with psycopg.connect(url, autocommit=True) as connection:
        for statement in statements:
            connection.execute(statement)


def other(url: str, name: str) -> str:
    """Return the URL of another database of the same server."""
    from sqlalchemy.engine import make_url
    return make_url(url).set(database=name).render_as_string(hide_password=False)


def name_of(url: str) -> str:
    """Return the name of a database."""
    from sqlalchemy.engine import make_url
    return make_url(url).database or ''


class Databases:
    """Fresh databases of both kinds; each is a copy of one that was migrated once."""

    def __init__(self, folder: Path, server: Iterator[str]) -> None:
        self._folder = folder
        self._server = server
        self._url = ''
        self._count = 0
        self._templates: dict[str, str] = {}

    def empty(self, kind: str) -> str:
        """Return the URL of a database with nothing in it."""
        self._count += 1
        if kind == 'sqlite':
            return f'sqlite:///{self._folder}/{self._count}.db'
        self._url = self._url or next(self._server)
        name = f'test_{os.getpid()}_{self._count}'
        execute(self._url, f'CREATE DATABASE {name}')
        return other(self._url, name)

    def fresh(self, kind: str) -> str:
        """Return the URL of one with the tables of this release."""
        if kind not in self._templates:
            from rt_robot_os.monitor.store.store import Store
            self._templates[kind] = self.empty(kind)
            Store.open(self._templates[kind]).close()
        self._count += 1
        if kind == 'sqlite':
            path = self._folder / f'{self._count}.db'
            shutil.copy(self._templates[kind].removeprefix('sqlite:///'), path)
            return f'sqlite:///{path}'
        name = f'test_{os.getpid()}_{self._count}'
        execute(self._url, f'CREATE DATABASE {name} TEMPLATE {name_of(self._templates[kind])}')
        return other(self._url, name)

    def drop(self, url: str) -> None:
        """Remove one."""
        if url.startswith('postgresql'):
            execute(self._url, f'DROP DATABASE IF EXISTS {name_of(url)} WITH (FORCE)')

    @contextmanager
    def away(self, url: str) -> Iterator[None]:
        """Let nobody in, and throw out who is."""
        name = name_of(url)
        execute(self._url, f'ALTER DATABASE {name} ALLOW_CONNECTIONS false',
                f"SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = '{name}'")
        yield
        execute(self._url, f'ALTER DATABASE {name} ALLOW_CONNECTIONS true')
