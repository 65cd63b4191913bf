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
Ensures that one server uses a database: a second one is refused when it starts.

Each of two servers would show only its own robots, and commands and alarms for the other's robots
would be lost.
"""

from __future__ import annotations

import os
from pathlib import Path
import time
from typing import Any
from typing import Final

from rt_robot_os.base.errors import StartError
from rt_robot_os.linux.lock_file import holder
from rt_robot_os.linux.lock_file import LockFile
from rt_robot_os.monitor.store.engine import POSTGRES
from sqlalchemy import Connection
from sqlalchemy import create_engine
from sqlalchemy import Engine
from sqlalchemy import NullPool
from sqlalchemy import text
from sqlalchemy.exc import DBAPIError

#: PostgreSQL may still hold the connection of a server that has just ended.
WAIT_S: Final = 5.0
_PAUSE_S: Final = 0.2
_KEY: Final = 0x72745F6F75
_NAME: Final = 'monitor server'
# They limit how long PostgreSQL keeps the lock of a server whose machine lost power.
_SESSION: Final = ('SET tcp_keepalives_idle = 10', 'SET tcp_keepalives_interval = 5',
                   'SET tcp_keepalives_count = 3')
_HOLDER: Final = text(
    'SELECT client_addr, backend_start FROM pg_stat_activity WHERE application_name = :name '
    'AND datname = current_database() AND pid <> pg_backend_pid() '
    'AND pid IN (SELECT pid FROM pg_locks WHERE locktype = :kind AND granted)')


class SoleServer:
    """
    The lock on serving a database; the system releases it however the process ends.

    SQLite: a lock on a file next to the database. PostgreSQL: an advisory lock, on a connection of
    its own.
    """

    def __init__(self, engine: Engine) -> None:
        self._is_postgres = engine.dialect.name == POSTGRES
        self._connection: Connection | None = None
        if self._is_postgres:
            self._engine = create_engine(
                engine.url, poolclass=NullPool, isolation_level='AUTOCOMMIT',
                connect_args={'connect_timeout': 5, 'application_name': _NAME})
        else:
            self._lock = LockFile(Path(f'{engine.url.database}.server'))

    def acquire(self, wait_s: float | None = None) -> None:
        """
        Acquire it.

        :param wait_s: how long to wait for a server that is ending; :data:`WAIT_S` when absent.
        :raises StartError: another server holds it; the message names that server.
        """
        deadline_s = time.monotonic() + (WAIT_S if wait_s is None else wait_s)
        while (other := self._try()) is not None:
            if time.monotonic() >= deadline_s:
                raise StartError(f'database: another server uses it{other}; stop that one first. '
                                 'After a power failure of its machine wait for half a minute')
            time.sleep(_PAUSE_S)

    def check(self) -> str:
        """
        Acquire it again when the connection to PostgreSQL was lost.

        :return: the problem; empty when this process holds it, or the database is unavailable.
        """
        if not self._is_postgres:
            return ''
        try:
            if self._connection is not None:
                self._connection.execute(text('SELECT 1'))
                return ''
        except DBAPIError:
            self._drop()
        try:
            other = self._try()
        except DBAPIError:
            return ''  # the writer reports it
        return '' if other is None else f'another server has taken the database{other}: stop one'

    def release(self) -> None:
        """Release it; may be called twice."""
        if self._is_postgres:
            self._drop()
        else:
            self._lock.release()

    def _try(self) -> str | None:
        """Acquire it if it is free: return None, or else a description of the holder."""
        return self._try_postgres() if self._is_postgres else self._try_file()

    def _try_file(self) -> str | None:
        try:
            if self._lock.acquire():
                self._lock.note(pid=os.getpid())
                return None
        except OSError as error:
            raise StartError(f'{self._lock.path}: {error.strerror}; may this user write to its '
                             'folder?') from error
        found: Any = holder(self._lock.path) or {}
        return f', process {found["pid"]}' if 'pid' in found else ''

    def _try_postgres(self) -> str | None:
        connection = self._engine.connect()
        try:
            for statement in _SESSION:
                connection.exec_driver_sql(statement)
            if connection.execute(text('SELECT pg_try_advisory_lock(:key)'), {
                    'key': _KEY}).scalar():
                self._connection, connection = connection, None  # type: ignore[assignment]
                return None
            row = connection.execute(_HOLDER, {'name': _NAME, 'kind': 'advisory'}).first()
            return '' if row is None else (
                f', at {row.client_addr or "this machine"} since {row.backend_start:%F %T %Z}')
        finally:
            if connection is not None:
                connection.close()

    def _drop(self) -> None:
        connection, self._connection = self._connection, None
        if connection is not None:
            try:
                connection.close()
            except DBAPIError:
                pass  # The connection was lost.
