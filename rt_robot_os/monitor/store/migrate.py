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

"""Migrate the schema of a database from Python: there is no alembic.ini."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Final

from alembic.command import downgrade as alembic_downgrade
from alembic.command import upgrade as alembic_upgrade
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from alembic.util.exc import CommandError
from rt_robot_os.base.errors import StartError
from rt_robot_os.monitor.store.engine import POSTGRES
from rt_robot_os.monitor.store.engine import SQLITE
from rt_robot_os.monitor.store.engine import writing
from sqlalchemy import Connection
from sqlalchemy import Engine
from sqlalchemy import text

HEAD: Final = 'head'
_FOLDER: Final = Path(__file__).with_name('migrations')
_MIGRATORS: Final = 0x72745F6F74


def _config(connection: Connection | None = None) -> Config:
    config = Config()
    config.set_main_option('script_location', str(_FOLDER).replace('%', '%%'))
    config.attributes['connection'] = connection
    return config


@cache
def versions() -> tuple[str, ...]:
    """Return the versions that this release knows, the oldest first."""
    script = ScriptDirectory.from_config(_config())
    return tuple(each.revision for each in reversed(list(script.walk_revisions())))


def version(engine: Engine) -> str:
    """Return the version of a database; empty for an empty database."""
    with engine.connect() as connection:
        return MigrationContext.configure(connection).get_current_revision() or ''


def upgrade(engine: Engine, to: str = HEAD) -> str:
    """
    Upgrade a database to a version, by default the newest; all of it or nothing.

    :return: its version.
    :raises StartError: a newer release created it, or there is no such version.
    """
    known = versions()
    with _exclusively(engine) as connection:
        found = MigrationContext.configure(connection).get_current_revision() or ''
        if found and found not in known:
            raise StartError(f'database: a newer release made it (version {found}; this one knows '
                             f'{known[-1]}): install that, or restore a backup')
        if found != known[-1]:
            try:
                alembic_upgrade(_config(connection), to)
            except CommandError as error:
                raise StartError(f'database: {error}; there are {", ".join(known)}') from error
    return version(engine)


def downgrade(engine: Engine, to: str) -> str:
    """
    Downgrade a database to a version; ``base`` empties it.

    :raises StartError: there is no such version.
    """
    with _exclusively(engine) as connection:
        try:
            alembic_downgrade(_config(connection), to)
        except CommandError as error:
            raise StartError(f'database: {error}; there are base, {", ".join(versions())}'
                             ) from error
    return version(engine)


@contextmanager
def _exclusively(engine: Engine) -> Iterator[Connection]:
    """Yield a connection in a transaction, for one process at a time."""
    if engine.dialect.name == POSTGRES:
        with engine.begin() as connection:
            connection.execute(text('SELECT pg_advisory_xact_lock(:key)'), {'key': _MIGRATORS})
            yield connection
        return
    assert engine.dialect.name == SQLITE
    with writing(engine) as connection:
        # Tables are copied to change them, so foreign keys are checked at the end.
        connection.exec_driver_sql('PRAGMA defer_foreign_keys = ON')
        yield connection
