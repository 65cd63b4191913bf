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

"""Operations on a whole database: check, back up while in use, show statistics."""

from __future__ import annotations

import os
from pathlib import Path
import shutil
import sqlite3
import subprocess
from typing import Any

from rt_robot_os.base.errors import StoreError
from rt_robot_os.monitor.store.engine import SQLITE
from rt_robot_os.monitor.store.metadata import METADATA
from rt_robot_os.monitor.store.migrate import version
from rt_robot_os.monitor.store.rollups import LEVELS
from rt_robot_os.monitor.store.rollups import waiting
from rt_robot_os.monitor.store.store import Store
from sqlalchemy import inspect
from sqlalchemy import text

#: Most problems that are reported.
PROBLEMS_MOST = 20
# Each of these queries counts rows that should not exist.
_WRONG = {
    'alarms without events': 'SELECT count(*) FROM alarms WHERE NOT EXISTS (SELECT 1 FROM '
                             'alarm_events WHERE alarm_id = alarms.id)',
    'alarms older than their newest event': 'SELECT count(*) FROM alarms WHERE last_seq < (SELECT '
                                            'max(event_seq) FROM alarm_events WHERE alarm_id = '
                                            'alarms.id)',
    **{f'{table.name} that are invalid': f'SELECT count(*) FROM {table.name} WHERE '
                                         f'low > high OR count < 1 OR t_ns % {span_ns} <> 0'
       for table, span_ns in LEVELS}}


def check(store: Store) -> list[str]:
    """
    Check for damage: pages, foreign keys, and invariants of the store.

    :return: the problems; empty if there are none.
    """
    found: list[str] = []
    with store.reading() as connection:
        if connection.dialect.name == SQLITE:
            found += [str(row[0]) for row in connection.exec_driver_sql(
                f'PRAGMA integrity_check({PROBLEMS_MOST})') if row[0] != 'ok']
            found += [f'{row[0]} {row[1]}: its {row[2]} is missing'
                      for row in connection.exec_driver_sql('PRAGMA foreign_key_check').fetchmany(
                          PROBLEMS_MOST)]
        else:
            # Every row of every table is read: reading a damaged page fails.
            for name in inspect(connection).get_table_names():
                connection.execute(text(f'SELECT count(*), max(length(x::text)) FROM "{name}" x'))
        for what, statement in _WRONG.items():
            count = connection.execute(text(statement)).scalar()
            if count:
                found.append(f'{count} {what}')
    return found


def status(store: Store) -> dict[str, Any]:
    """Return its version, its size, and the number of rows of each table."""
    with store.reading() as connection:
        tables = set(inspect(connection).get_table_names())
        rows = {name: connection.execute(text(f'SELECT count(*) FROM "{name}"')).scalar()
                for name in sorted(tables & set(METADATA.tables))}
        left = waiting(connection)
        if connection.dialect.name == SQLITE:
            path = store.engine.url.database or ''
            size = sum(os.path.getsize(path + end) for end in ('', '-wal')
                       if os.path.exists(path + end))
        else:
            size = connection.execute(
                text('SELECT pg_database_size(current_database())')).scalar() or 0
    return {'database': store.engine.url.render_as_string(hide_password=True),
            'version': version(store.engine), 'bytes': size, 'not_rolled_up': left, 'rows': rows}


def backup(store: Store, path: Path) -> None:
    """
    Back up the database while it is in use, as of one moment; readable by its owner only.

    SQLite: a database file. PostgreSQL: the output of ``pg_dump``, for ``pg_restore``.

    :raises StoreError: a file of that name exists, the disk is full, or ``pg_dump`` is missing.
    """
    try:
        os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600))
        try:
            _copy(store, path)
            with open(path, 'rb+') as file:
                os.fsync(file.fileno())
        except BaseException:
            path.unlink()
            raise
    except StoreError:
        raise
    except (OSError, sqlite3.Error) as error:
        raise StoreError(f'backup {path}: {getattr(error, "strerror", "") or error}') from error


def _copy(store: Store, path: Path) -> None:
    if store.engine.dialect.name == SQLITE:
        source = sqlite3.connect(f'file:{store.engine.url.database}?mode=ro', uri=True)
        target = sqlite3.connect(path)
        try:
            source.backup(target, pages=-1)
            target.execute('PRAGMA journal_mode = DELETE')
        finally:
            target.close()
            source.close()
        return
    program = shutil.which('pg_dump')
    if program is None:
        raise StoreError('a backup of PostgreSQL needs pg_dump: install postgresql-client')
    url = store.engine.url.set(drivername='postgresql')
    # The list of processes must not show the password.
    done = subprocess.run(
        [program, '--format=custom', '--no-owner', '--file', str(path),
         url.set(password=None).render_as_string()], capture_output=True, text=True,
        env={**os.environ, **({'PGPASSWORD': str(url.password)} if url.password else {})})
    if done.returncode:
        raise StoreError(f'backup {path}: {done.stderr.strip()[:300]}')
