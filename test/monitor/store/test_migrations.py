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

"""Every step of the schema goes up and down with rows in it, on both databases."""

from __future__ import annotations

from pathlib import Path
import sqlite3
from typing import Any

from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from databases import Databases
import pytest
from rt_robot_os.base.errors import StartError
from rt_robot_os.monitor.store import tables
from rt_robot_os.monitor.store.engine import open_engine
from rt_robot_os.monitor.store.engine import read_url
from rt_robot_os.monitor.store.metadata import METADATA
from rt_robot_os.monitor.store.migrate import downgrade
from rt_robot_os.monitor.store.migrate import upgrade
from rt_robot_os.monitor.store.migrate import version
from rt_robot_os.monitor.store.migrate import versions
from rt_robot_os.monitor.store.store import Store
from sqlalchemy import Engine
from sqlalchemy import func
from sqlalchemy import insert
from sqlalchemy import LargeBinary
from sqlalchemy import MetaData
from sqlalchemy import select
from sqlalchemy import String
from sqlalchemy import Table
from sqlalchemy import Text

assert tables


def _row(table: Table) -> dict[str, Any]:
    made: dict[str, Any] = {}
    for column in table.columns:
        if isinstance(column.type, LargeBinary):
            made[column.name] = b'1'
        elif isinstance(column.type, (String, Text)):
            made[column.name] = '1'
        elif column.type.python_type is bool:
            made[column.name] = True
        else:
            made[column.name] = 1
    return made


def _fill(engine: Engine) -> dict[str, int]:
    """Give each table that is empty a row; return how many each has."""
    metadata = MetaData()
    metadata.reflect(engine)
    counts = {}
    with engine.begin() as connection:
        for table in metadata.sorted_tables:
            if table.name != 'alembic_version':
                if not connection.execute(select(func.count()).select_from(table)).scalar():
                    connection.execute(insert(table), _row(table))
                counts[table.name] = connection.execute(
                    select(func.count()).select_from(table)).scalar() or 0
    return counts


def _left(counts: dict[str, int], names: set[str]) -> dict[str, int]:
    return {name: count for name, count in counts.items() if name in names}


@pytest.mark.parametrize('kind', ['sqlite', 'postgresql'])
def test_every_step_goes_up_and_down_and_keeps_the_rows(
        kind: str, all_databases: Databases) -> None:
    url = all_databases.empty(kind)
    engine = open_engine(read_url(url))
    counts: dict[str, dict[str, int]] = {}
    for step in versions():
        assert upgrade(engine, step) == step
        counts[step] = _fill(engine)
        assert all(counts[step].values())
    for below, above in list(zip(versions(), versions()[1:]))[::-1]:
        assert downgrade(engine, below) == below
        assert _fill(engine) == _left(counts[above], set(counts[below])), (above, below)
    assert downgrade(engine, 'base') == ''
    assert _fill(engine) == {}
    assert upgrade(engine) == version(engine) == versions()[-1]
    engine.dispose()
    all_databases.drop(url)


def test_what_migrations_make_is_what_the_store_uses(url: str) -> None:
    engine = open_engine(read_url(url))
    with engine.connect() as connection:
        context = MigrationContext.configure(connection, opts={
            'compare_type': True,
            'include_object': lambda thing, name, kind, reflected, _: not (
                kind == 'table' and reflected and name not in METADATA.tables)})
        assert compare_metadata(context, METADATA) == []
    engine.dispose()


def test_a_newer_database_is_left_alone(url: str) -> None:
    engine = open_engine(read_url(url))
    with engine.begin() as connection:
        connection.exec_driver_sql("UPDATE alembic_version SET version_num = '9999'")
    with pytest.raises(StartError, match='a newer release made it .version 9999.*backup'):
        Store.open(url)
    with pytest.raises(StartError, match='there are base, 0001'):
        downgrade(engine, 'yesterday')
    engine.dispose()


def test_a_step_that_fails_leaves_nothing_behind(
        all_databases: Databases, monkeypatch: pytest.MonkeyPatch) -> None:
    url = all_databases.empty('sqlite')
    engine = open_engine(read_url(url))
    with engine.begin() as connection:
        connection.exec_driver_sql('CREATE TABLE unknown (id INTEGER)')
    with pytest.raises(StartError, match='unknown already exists'):
        Store.open(url)
    names = MetaData()
    names.reflect(engine)
    assert set(names.tables) == {'unknown'}
    engine.dispose()


@pytest.mark.parametrize(('url', 'text'), [
    ('mysql://root:secret@host/x', 'neither sqlite nor postgresql'),
    ('sqlite://', 'needs a file'), ('postgresql://:secret@host:port/x', 'not a URL'),
    ('postgresql://monitor:secret@127.0.0.1:1/x', 'Is PostgreSQL running')])
def test_a_url_that_does_not_work_is_said_without_its_password(url: str, text: str) -> None:
    with pytest.raises(StartError, match=text) as raised:
        Store.open(url)
    assert 'secret' not in str(raised.value)


def test_a_file_that_is_no_database_is_said(tmp_path: Path) -> None:
    path = tmp_path / 'monitor.db'
    path.write_text('dear diary' * 1000)
    with pytest.raises(StartError, match='file is not a database'):
        Store.open(str(path))
    assert path.read_text() == 'dear diary' * 1000
    with pytest.raises(StartError, match='choose another with --database'):
        Store.open(f'{path}/monitor.db')


def test_the_database_of_somebody_else_is_said(tmp_path: Path) -> None:
    path = tmp_path / 'monitor.db'
    with sqlite3.connect(path) as connection:
        connection.execute('CREATE TABLE robots (id INTEGER)')
    connection.close()
    with pytest.raises(StartError, match='robots already exists'):
        Store.open(str(path))
