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

"""Nothing names a person who was erased: no column, no file, no memory."""

from __future__ import annotations

from collections.abc import Iterator
import json
from pathlib import Path
from typing import Any

from broad import examples
from fake_robot import FakeRobot
from fake_robot import RobotScript
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies
from monitor_server import logged_in
from monitor_server import Page
from monitor_server import quick_services
from monitor_server import served
import pytest
from rt_robot_os.monitor.command import run
from rt_robot_os.monitor.security.accounts import Accounts
from rt_robot_os.monitor.store.engine import SQLITE
from rt_robot_os.monitor.store.erasure import KEPT_TABLES
from rt_robot_os.monitor.store.erasure import MADE_HERE
from rt_robot_os.monitor.store.metadata import METADATA
from rt_robot_os.monitor.store.person_name import ERASED
from rt_robot_os.monitor.store.person_name import PersonName
from rt_robot_os.monitor.store.store import Store
from rt_robot_os.monitor.store.upkeep import check
from sqlalchemy import Boolean
from sqlalchemy import Column
from sqlalchemy import insert
from sqlalchemy import LargeBinary
from sqlalchemy import select
from sqlalchemy import String
from sqlalchemy import Table

NAME = 'zoraya'
SPELLINGS = ('zoraya', 'Zoraya', 'ZORAYA', 'zoRAya')
#: Of another person, in whose name hers is.
OTHER = 'azorayab'
#: Rows of each table that others refer to, which stay.
_PARENTS = 6


def texts() -> Iterator[tuple[Table, Column[Any]]]:
    """Return every column with text that is not a random id, a hash or a word of the server."""
    for table in METADATA.sorted_tables:
        for column in table.c:
            if (isinstance(column.type, String) and table.name not in KEPT_TABLES
                    and str(column) not in MADE_HERE):
                yield table, column


def value(column: Column[Any], number: int) -> Any:
    """Return a value for a column that is of no interest."""
    if isinstance(column.type, String):
        return '[]' if column.name == 'kinds' else '{}' if column.name in (
            'content', 'details') else f'{column.name[:8]}{number}'
    if isinstance(column.type, LargeBinary):
        return b'\0'
    return False if isinstance(column.type, Boolean) else number


def said(column: Column[Any], spelling: str, number: int) -> str:
    """Return a text with the name, as it may stand in that column."""
    if column.name in ('content', 'details'):
        return json.dumps({'words': [f'where is {spelling}?', f'\n{spelling}'], spelling: number,
                           f'bed_of_{spelling}': OTHER})
    if str(column) in ('people.person', 'alarms.subject', 'grants.person', 'users.name',
                       'users.key'):
        return spelling
    return f'{number} {spelling}s bed'


def fill(store: Store) -> dict[str, int]:
    """Put each spelling into each text of each table, one row for each; return how many rows."""
    number = 1000
    counts: dict[str, int] = {}
    parents: dict[str, list[Any]] = {}
    with store.writing() as connection:
        for table in METADATA.sorted_tables:
            if table.name in KEPT_TABLES:
                continue
            mine = [column for each, column in texts() if each is table]
            rows = [(None, '')] * _PARENTS + [
                (column, spelling) for column in mine for spelling in SPELLINGS]
            for index, (column, spelling) in enumerate(rows):
                number += 1
                row = {each.name: value(each, number) for each in table.c}
                for place, key in enumerate(sorted(table.foreign_keys, key=str)):
                    row[key.parent.name] = parents[key.column.table.name][
                        index // _PARENTS ** place % _PARENTS]
                if column is not None:
                    row[column.name] = said(column, spelling, number)
                connection.execute(insert(table), row)
                counts[table.name] = counts.get(table.name, 0) + 1
                if column is None:
                    parents.setdefault(table.name, []).append(
                        row[list(table.primary_key)[0].name])
    return counts


def named(store: Store) -> list[str]:
    """Return the columns in which the name stands, in any spelling."""
    found = set()
    with store.reading() as connection:
        for table, column in texts():
            for each in connection.execute(select(column)).scalars():
                if NAME in (each or '').lower().replace(OTHER, ''):
                    found.add(str(column))
    return sorted(found)


def test_no_column_names_a_person_who_was_erased_in_any_spelling(store: Store) -> None:
    counts = fill(store)
    assert len(named(store)) == len(list(texts())) > 40
    erased = store.erase('ZorayA', with_account=True)
    assert named(store) == []
    assert erased.accounts == []
    assert erased.rows['people'] == erased.rows['alarms'] == erased.rows['grants'] == 4
    # Rows of others stay, without the name.
    with store.reading() as connection:
        left = {table.name: len(connection.execute(select(table)).all())
                for table in METADATA.sorted_tables if table.name in counts}
        events = connection.execute(select(METADATA.tables['events'].c.content)).scalars().all()
    assert left['events'] == counts['events'] and left['robots'] == counts['robots']
    assert left['robot_people'] == counts['robot_people']
    assert sum(ERASED in each and OTHER in each for each in events) == 4
    assert store.erase(NAME).changed == 0
    if store.engine.dialect.name == SQLITE:
        assert erased.left == []
        assert [each for each in check(store) if 'missing' in each or 'page' in each.lower()] == []
        folder = Path(store.engine.url.database or '').parent
        files = [path for path in folder.iterdir() if path.is_file()]
        assert any(path.suffix == '.db' for path in files)
        for path in files:
            assert NAME.encode() not in path.read_bytes().lower().replace(OTHER.encode(), b'')
    else:
        assert ['write-ahead log' in each for each in erased.left] == [True]


def test_an_account_of_the_same_name_stays_unless_it_is_said(tmp_path: Path) -> None:
    store = Store.open(str(tmp_path / 'monitor.db'))
    fill(store)
    assert NAME in store.erase(NAME).accounts
    assert named(store) == ['users.key', 'users.name']
    store.close()


def test_no_file_of_the_folder_names_a_person_whom_the_command_erases(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    where = ['--folder', str(tmp_path)]
    store = Store.open(str(tmp_path / 'monitor.db'))
    fill(store)
    store.close()
    assert run(['database', 'erase', NAME, '--yes', '--with-account', *where]) == 0
    capsys.readouterr()
    for path in tmp_path.rglob('*'):
        if path.is_file():
            assert NAME.encode() not in path.read_bytes().lower().replace(OTHER.encode(), b'')
    # The audit has the deed, without the name.
    store = Store.open(str(tmp_path / 'monitor.db'))
    accounts = Accounts.open(store.engine, tmp_path)
    row = list(accounts.audit.all_rows())[-1]
    assert (row['action'], row['object']) == (
        'person.erase', accounts.audit.pseudonym(NAME))
    accounts.close()
    store.close()


def test_a_server_that_runs_forgets_whom_another_process_erases(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    services = quick_services(tmp_path)
    services.accounts.residents.confirm('robot', [NAME, 'bob'], 'test')
    owner = logged_in(services)
    script = RobotScript('robot', (NAME, 'bob'), limits={NAME: {}})
    with served(services) as address, Page(address, owner) as page, FakeRobot(
            f'ws://{address}', script=script) as robot:
        robot.send(script.live({f'health/{NAME}/pulse_per_min': 60, 'health/bob/pulse_per_min': 70,
                                'agent/state': f'looks for {NAME.title()}', 'battery': 0.5}))
        robot.keep(script.observation(NAME, 'pulse_per_min', 60))
        robot.raise_alarm('a1', subject=NAME)
        robot.raise_alarm('a2', subject='bob', text=f'Bob: "call {NAME.upper()}"')
        assert run(['database', 'erase', NAME, '--yes', '--folder', str(tmp_path)]) == 0
        erased = page.next('state', people=[{'person': 'bob', 'robots': ['robot']}])
        while erased['alarms'] != [] and NAME in json.dumps(erased).lower():
            erased = page.next('state')
        state = services.hub.robots['robot']
        held = repr((state.people, state.ever, state.suggested, state.about, state.alarms,
                     state.signals.keys(), [each.value for each in state.signals.values()]))
        assert NAME not in held.lower()
        assert {'health/bob/pulse_per_min', 'battery'} <= state.signals.keys()
        assert list(state.alarms) == ['a2']
        # What the robot goes on sending about her is nobody's, and is set aside.
        robot.keep(script.observation(NAME, 'pulse_per_min', 61))
        assert services.store.observations(NAME) == []
    capsys.readouterr()


_LETTERS = strategies.text('anÄé', min_size=1, max_size=4)


@settings(max_examples=examples(200), deadline=None)
@given(name=_LETTERS, before=strategies.sampled_from(['', 'see ', 'bed_of_', '"', '\n']),
       after=strategies.sampled_from(['', ' lies', '_bed', 's Bett', "'s", '!']))
def test_a_name_is_found_as_a_word_in_each_case(name: str, before: str, after: str) -> None:
    found = PersonName(name)
    for each in (name, name.upper(), name.lower(), name.casefold(), name.title()):
        assert found.without(f'{before}{each}{after}').startswith(f'{before}{ERASED}')
        assert ERASED in found.without(json.dumps({'1': [f'{before}{each}{after}']}))
        # Cut in the middle, with escapes.
        assert ERASED in found.without(json.dumps({'1': f'{before}{each}{after}'})[:-1])


def test_other_names_stay() -> None:
    found = PersonName('anna')
    for text in ('hanna', 'annabel', 'Johanna lies', '{"person":"hanna","x":1.5}', 'ann'):
        assert found.without(text) == text
    assert PersonName('Anna Maria').without('by anna_maria, anna  MARIA') == (
        f'by {ERASED}, {ERASED}')
