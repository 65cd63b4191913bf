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
Erase a person: their measurements, alarms about them, and their name everywhere else.

The audit retains who saw whose data: that is its purpose. The operator of the server deletes
backups.
"""

from __future__ import annotations

from collections.abc import Collection
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any
from typing import Final

from rt_robot_os.monitor.security.tables import grants
from rt_robot_os.monitor.security.tables import users
from rt_robot_os.monitor.store.engine import reading
from rt_robot_os.monitor.store.engine import writing
from rt_robot_os.monitor.store.erased_files import forget_deleted
from rt_robot_os.monitor.store.metadata import METADATA
from rt_robot_os.monitor.store.person_name import PersonName
from rt_robot_os.monitor.store.retention import drop
from rt_robot_os.monitor.store.tables import ALARMS
from rt_robot_os.monitor.store.tables import MEDIA
from rt_robot_os.monitor.store.tables import OBSERVATIONS
from rt_robot_os.monitor.store.tables import PEOPLE
from rt_robot_os.monitor.store.tables import PLACES
from rt_robot_os.monitor.store.tables import ROBOT_PEOPLE
from rt_robot_os.monitor.store.tables import ROBOTS
from rt_robot_os.monitor.store.tables import SERIES
from rt_robot_os.monitor.store.tables import UNKNOWN
from sqlalchemy import Column
from sqlalchemy import Connection
from sqlalchemy import delete
from sqlalchemy import Engine
from sqlalchemy import select
from sqlalchemy import String
from sqlalchemy import Table
from sqlalchemy import tuple_
from sqlalchemy import UniqueConstraint
from sqlalchemy import update

#: Tables that are never changed: the audit is a chain that proves who saw what.
KEPT_TABLES: Final = frozenset({'audit', 'audit_head', 'progress'})
#: Columns that only the server writes: random ids, hashes, fixed words.
MADE_HERE: Final = frozenset({
    'robots.robot', 'robots.residents', 'media.path', 'users.id', 'users.role', 'users.password',
    'sessions.id', 'sessions.token', 'sessions.user', 'emergencies.id', 'emergencies.user',
    'emergencies.session', 'invitations.token', 'invitations.user', 'robot_accounts.id',
    'robot_accounts.token', 'grants.user'})
#: Tables of accounts: a user with the same name may be another person, and is erased only on
#: request.
OF_ACCOUNTS: Final = frozenset({'users.name', 'users.key'})
#: Large tables in which one value occurs in many rows.
_REPEATED: Final = frozenset({'observations.source', 'places.room'})
_STEP: Final = 1000


@dataclass
class Erased:
    """
    What was erased.

    :ivar rows: number of deleted rows, by table.
    :ivar changed: number of other rows that contained the name.
    :ivar files: pictures and clips that have to be deleted: robot and SHA-256.
    :ivar accounts: users whose name is or contains the name; they are not erased.
    :ivar left: descriptions of what may still hold a copy.
    """

    rows: dict[str, int]
    changed: int
    files: list[tuple[str, str]]
    accounts: list[str]
    left: list[str]


def erase(engine: Engine, person: str, with_account: bool = False) -> Erased:
    """
    Erase a person, by any spelling of the name; after an error call it again.

    :param with_account: also the account of a user with this name.
    :raises StoreError: the database is away or full.
    """
    name = PersonName(person)
    with reading(engine) as connection:
        people = [row.id for row in connection.execute(select(PEOPLE)) if name.is_of(row.person)]
        series = list(connection.execute(select(SERIES.c.id).where(
            SERIES.c.person_id.in_(people))).scalars())
    # Most of it in steps, so that records of robots can be written meanwhile.
    rows = {'observations': sum(drop(engine, OBSERVATIONS, OBSERVATIONS.c.series_id == each)
                                for each in series),
            'places': sum(drop(engine, PLACES, PLACES.c.person_id == each) for each in people)}
    with writing(engine) as connection:
        files = _delete(connection, name, people, rows)
        if with_account:
            accounts = [row.id for row in connection.execute(
                select(users.c.id, users.c.name, users.c.key))
                        if name.is_of(row.name) or name.is_of(row.key)]
            rows['users'] = connection.execute(delete(users).where(
                users.c.id.in_(accounts))).rowcount
    rows['unknown'] = _delete_aside(engine, name)
    changed = sum(_take_out(engine, table, name) for table in METADATA.sorted_tables
                  if table.name not in KEPT_TABLES)
    with reading(engine) as connection:
        left = [row.name for row in connection.execute(select(users.c.name)) if name.is_in(
            row.name)]
    return Erased(rows, changed, files, left, forget_deleted(engine))


def _delete(connection: Connection, name: PersonName, people: Collection[int],
            rows: dict[str, int]) -> list[tuple[str, str]]:
    """Delete the rows about this person only; return the files that are no longer referenced."""
    subjects = [each for each in connection.execute(
        select(ALARMS.c.subject).distinct()).scalars() if name.is_of(each)]
    files = _media(connection, subjects, rows)
    rows['alarms'] = connection.execute(delete(ALARMS).where(
        ALARMS.c.subject.in_(subjects))).rowcount
    granted = [each for each in connection.execute(
        select(grants.c.person).distinct()).scalars() if name.is_of(each)]
    rows['grants'] = connection.execute(delete(grants).where(
        grants.c.person.in_(granted))).rowcount
    connection.execute(delete(ROBOT_PEOPLE).where(ROBOT_PEOPLE.c.person_id.in_(people)))
    rows['people'] = connection.execute(delete(PEOPLE).where(PEOPLE.c.id.in_(people))).rowcount
    return files


def _media(connection: Connection, subjects: Collection[str], rows: dict[str, int]
           ) -> list[tuple[str, str]]:
    """Delete the media of a person's alarms; return the files that are no longer referenced."""
    about = (MEDIA.c.robot_id == ALARMS.c.robot_id) & (MEDIA.c.alarm == ALARMS.c.alarm)
    found = connection.execute(select(MEDIA.c.id, ROBOTS.c.robot, MEDIA.c.sha256).join(
        ROBOTS, ROBOTS.c.id == MEDIA.c.robot_id).join(ALARMS, about).where(
            ALARMS.c.subject.in_(subjects))).all()
    for one in found:
        connection.execute(delete(MEDIA).where(MEDIA.c.id == one.id))
    rows['media'] = len(found)
    left = {(each.robot, each.sha256) for each in connection.execute(select(
        ROBOTS.c.robot, MEDIA.c.sha256).join(ROBOTS, ROBOTS.c.id == MEDIA.c.robot_id).where(
            MEDIA.c.sha256.in_([each.sha256 for each in found])))}
    return sorted({(each.robot, each.sha256) for each in found} - left)


def _delete_aside(engine: Engine, name: PersonName) -> int:
    """Delete records stored aside that name the person: they may contain measurements."""
    count = 0
    for rows in _steps(engine, UNKNOWN):
        found = [row['id'] for row in rows if any(
            name.is_in(row[column] or '') for column in ('type', 'why', 'content'))]
        if found:
            with writing(engine) as connection:
                count += connection.execute(delete(UNKNOWN).where(
                    UNKNOWN.c.id.in_(found))).rowcount
    return count


def _take_out(engine: Engine, table: Table, name: PersonName) -> int:
    """Replace the name in all strings of a table; return how many rows were changed."""
    columns = [each for each in table.c if isinstance(each.type, String)
               and str(each) not in MADE_HERE | OF_ACCOUNTS]
    changed = 0
    for column in [each for each in columns if str(each) in _REPEATED]:
        changed += _replace_repeated(engine, table, column, name)
        columns.remove(column)
    if not columns:
        return changed
    unique = _unique(table)
    for rows in _steps(engine, table):
        changes = []
        for row in rows:
            values = {}
            for column in columns:
                old = row[column.name]
                if old and (new := name.without(old)) != old:
                    values[column.name] = _fitting(
                        new, column, ''.join(str(row[key.name])[-12:] for key in
                                             table.primary_key) if column.name in unique else '')
            if values:
                changes.append((row, values))
        if changes:
            with writing(engine) as connection:
                for row, values in changes:
                    connection.execute(update(table).where(*(
                        key == row[key.name] for key in table.primary_key)), values)
            changed += len(changes)
    return changed


def _replace_repeated(engine: Engine, table: Table, column: Column[Any], name: PersonName) -> int:
    with reading(engine) as connection:
        texts = [each for each in connection.execute(select(column).distinct()).scalars()
                 if each and name.is_in(each)]
    changed = 0
    for each in texts:
        with writing(engine) as connection:
            changed += connection.execute(update(table).where(column == each), {
                column.name: _fitting(name.without(each), column)}).rowcount
    return changed


def _fitting(text: str, column: Column[Any], suffix: str = '') -> str:
    """Return a string that fits into the column; a suffix makes it unique."""
    length = getattr(column.type, 'length', None) or len(text) + len(suffix) + 1
    return f'{text[:length - len(suffix) - 1]}~{suffix}' if suffix else text[:length]


def _unique(table: Table) -> set[str]:
    found = {column.name for each in table.constraints if isinstance(each, UniqueConstraint)
             for column in each.columns}
    return found | {column.name for column in table.c if column.unique or column.primary_key}


def _steps(engine: Engine, table: Table) -> Iterable[list[Any]]:
    """Yield all rows of a table in batches, in order of the primary key."""
    key = list(table.primary_key)
    after: list[Any] = []
    while True:
        statement = select(table).order_by(*key).limit(_STEP)
        if after:
            statement = statement.where(tuple_(*key) > tuple_(*after))
        with reading(engine) as connection:
            rows = [dict(row) for row in connection.execute(statement).mappings()]
        if not rows:
            return
        yield rows
        after = [rows[-1][column.name] for column in key]
