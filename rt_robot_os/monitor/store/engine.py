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

"""
Open a database: SQLite in a file, or PostgreSQL by a URL.

SQLite runs in WAL mode with ``synchronous=FULL``: a commit is on the disk before it is
acknowledged. With NORMAL a power cut would lose the last commits, which the robot has deleted
after their acknowledgement. The cost, one sync per commit, is shared by the records of all robots
that arrived meanwhile (:mod:`~rt_robot_os.monitor.store.writer`).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
import os
from pathlib import Path
import sqlite3
import threading
from typing import Any
from typing import Final
from weakref import WeakKeyDictionary

from rt_robot_os.base.errors import StartError
from rt_robot_os.base.errors import StoreError
from rt_robot_os.base.needs import require
from rt_robot_os.monitor.store.turns import Turns
from sqlalchemy import Connection
from sqlalchemy import create_engine
from sqlalchemy import Engine
from sqlalchemy import event
from sqlalchemy import text
from sqlalchemy.engine import make_url
from sqlalchemy.engine import URL
from sqlalchemy.exc import ArgumentError
from sqlalchemy.exc import DBAPIError
from sqlalchemy.exc import TimeoutError as PoolTimeout

SQLITE: Final = 'sqlite'
POSTGRES: Final = 'postgresql'
#: How long a connection waits for another one that writes.
BUSY_MS: Final = 5000
_MODE: Final = 0o600
_CACHE_KIB: Final = 65536
# Pages of the WAL before a checkpoint: 32 MB, so that pages changed by many commits are written
# once.
_CHECKPOINT_PAGES: Final = 8000
_CONNECTIONS: Final = 8
# Key of the advisory lock that a process holds during one transaction that writes.
_WRITERS: Final = 0x72745F6F73
_TURNS: Final[WeakKeyDictionary[Engine, Turns]] = WeakKeyDictionary()
_TURNS_LOCK: Final = threading.Lock()


def read_url(text: str) -> URL:
    """
    Parse the location of a database: a URL, or the path of an SQLite file.

    :raises StartError: it is neither; the message never contains the password.
    """
    if '://' not in text:
        return URL.create(SQLITE, database=str(Path(text).expanduser()))
    try:
        url = make_url(text)
    except (ArgumentError, ValueError) as error:
        raise StartError('database: not a URL such as sqlite:////var/lib/monitor/monitor.db or '
                         'postgresql://user@host/monitor') from error
    name = url.get_backend_name()
    if name in (POSTGRES, 'postgres'):
        require('a PostgreSQL database', 'psycopg')
        try:
            import_module('psycopg')
        except ImportError as error:  # libpq or the binary part of psycopg is missing
            raise StartError(f'psycopg cannot be imported: {error}') from error
        return url.set(drivername='postgresql+psycopg')
    if name != SQLITE:
        raise StartError(f'database: {name[:40]!r} is neither sqlite nor postgresql')
    if not url.database or url.database == ':memory:':
        raise StartError('database: SQLite needs a file, such as sqlite:////tmp/monitor.db; one '
                         'in memory is lost with the process')
    return url.set(drivername=SQLITE)


def open_engine(url: URL) -> Engine:
    """
    Open a database; its file is created with access for its owner only.

    :raises StartError: the file cannot be created, or this user may not write to it.
    """
    if url.get_backend_name() == SQLITE:
        _make_file(Path(url.database or ''))
        engine = create_engine(url, pool_size=_CONNECTIONS, max_overflow=0, pool_timeout=10.0,
                               connect_args={'timeout': BUSY_MS / 1000,
                                             'check_same_thread': False})
        event.listen(engine, 'connect', _set_up_sqlite)
        event.listen(engine, 'begin', _begin_sqlite)
        return engine
    return create_engine(url, pool_size=_CONNECTIONS, max_overflow=0, pool_timeout=10.0,
                         pool_pre_ping=True, connect_args={
                             'connect_timeout': 5, 'application_name': 'monitor',
                             'options': '-c timezone=UTC -c synchronous_commit=on'})


def _make_file(path: Path) -> None:
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        os.close(os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, _MODE))
        # SQLite gives its -wal and -shm the mode of the file.
        if path.stat().st_uid == os.geteuid():
            path.chmod(_MODE)
    except OSError as error:
        raise StartError(f'database {path}: {error.strerror}; choose another with --database'
                         ) from error


def _set_up_sqlite(connection: sqlite3.Connection, _: object) -> None:
    # The driver begins no transaction by itself: see _begin_sqlite.
    connection.isolation_level = None
    for pragma in (f'busy_timeout = {BUSY_MS}', 'journal_mode = WAL', 'synchronous = FULL',
                   'foreign_keys = ON', f'cache_size = -{_CACHE_KIB}', 'temp_store = MEMORY',
                   f'wal_autocheckpoint = {_CHECKPOINT_PAGES}',
                   'journal_size_limit = 67108864'):
        connection.execute(f'PRAGMA {pragma}')


def _begin_sqlite(connection: Connection) -> None:
    # A transaction that will write begins as a writer: a reader that becomes a writer fails,
    # without waiting, when another process wrote meanwhile.
    writes = connection.get_execution_options().get('writes', False)
    connection.exec_driver_sql('BEGIN IMMEDIATE' if writes else 'BEGIN')


@contextmanager
def reading(engine: Engine) -> Iterator[Connection]:
    """
    Yield a connection whose statements all see the same state of the database.

    :raises StoreError: the database is unavailable.
    """
    with _told(), engine.connect() as connection:
        if connection.dialect.name == POSTGRES:
            connection.execution_options(isolation_level='REPEATABLE READ')
        yield connection


@contextmanager
def writing(engine: Engine) -> Iterator[Connection]:
    """
    Yield a connection that writes, one at a time over all processes; commit at the end.

    Within this process the order is fair; between processes the database decides.

    :raises StoreError: the database is unavailable, locked or full; nothing is done.
    """
    with _turns_of(engine).turn(), _told(), engine.connect().execution_options(
            writes=True) as connection:
        with connection.begin():
            if connection.dialect.name == POSTGRES:
                connection.execute(text('SELECT pg_advisory_xact_lock(:key)'), {'key': _WRITERS})
            yield connection


def _turns_of(engine: Engine) -> Turns:
    with _TURNS_LOCK:
        return _TURNS.setdefault(engine, Turns())


@contextmanager
def _told() -> Iterator[None]:
    try:
        yield
    except DBAPIError as error:
        if is_passing(error):
            raise StoreError(f'database: {_cause(error.orig)}') from error
        raise
    except PoolTimeout as error:
        raise StoreError('database: all its connections are in use') from error


def is_passing(error: DBAPIError) -> bool:
    """Return whether the cause is outside of the program, so that a later attempt may succeed."""
    name = type(error.orig).__name__
    # psycopg: DiskFull, TooManyConnections, AdminShutdown ... are OperationalErrors.
    return bool(error.connection_invalidated) or isinstance(error.orig, sqlite3.OperationalError) \
        or any(each.__name__ in ('OperationalError', 'InterfaceError')
               for each in type(error.orig).__mro__) or name == 'ReadOnlySqlTransaction'


def _cause(error: Any) -> str:
    lines = str(error).strip().splitlines()
    return lines[0][:200] if lines else type(error).__name__
