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
Remove deleted data from the files of a database.

A deleted row stays in free pages, in the write-ahead log and, with PostgreSQL, in dead rows and in
statistics until these are overwritten.
"""

from __future__ import annotations

from contextlib import closing
import sqlite3
import time
from typing import Final

from rt_robot_os.monitor.store.engine import POSTGRES
from rt_robot_os.monitor.store.metadata import METADATA
from sqlalchemy import Engine
from sqlalchemy import text
from sqlalchemy.exc import DBAPIError

#: How long to wait for readers and writers.
PATIENCE_S: Final = 30.0
_PAUSE_S: Final = 0.1
_WAL: Final = ('the write-ahead log of PostgreSQL, until the server has recycled it: force it '
               'with pg_switch_wal() and CHECKPOINT; its archives and replicas have a copy')


def forget_deleted(engine: Engine) -> list[str]:
    """
    Rewrite the files without deleted data. Writers wait meanwhile.

    :return: descriptions of what may still hold a copy; empty for SQLite on success.
    """
    return _postgres(engine) if engine.dialect.name == POSTGRES else _sqlite(engine)


def _sqlite(engine: Engine) -> list[str]:
    try:
        with closing(sqlite3.connect(engine.url.database or '', timeout=PATIENCE_S,
                                     isolation_level=None)) as connection:
            connection.execute('PRAGMA secure_delete = ON')
            connection.execute('VACUUM')
            end = time.monotonic() + PATIENCE_S
            # A reader of an older state keeps the log; it may have ended by the next attempt.
            while connection.execute('PRAGMA wal_checkpoint(TRUNCATE)').fetchone()[0]:
                if time.monotonic() > end:
                    return ['the write-ahead log, which another process reads: end it, then '
                            'erase again']
                time.sleep(_PAUSE_S)
    except sqlite3.Error as error:
        return [f'free pages and the write-ahead log ({error}): erase again when nothing else '
                'uses the database and the disk has room for a second copy of it']
    return []


def _postgres(engine: Engine) -> list[str]:
    left = [_WAL]
    with engine.connect().execution_options(isolation_level='AUTOCOMMIT') as connection:
        for table in METADATA.sorted_tables:
            try:
                # Statistics contain frequent values, so they are rebuilt as well.
                connection.execute(text(f'VACUUM (FULL, ANALYZE) "{table.name}"'))
            except DBAPIError as error:
                left.append(f'dead rows of {table.name} ({str(error.orig).strip()[:100]}): run '
                            'VACUUM FULL ANALYZE as its owner')
    return left
