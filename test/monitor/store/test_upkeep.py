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

"""To check, copy and thin a database, and to erase a person, by the program as well."""

from __future__ import annotations

import json
import os
from pathlib import Path
import sqlite3
import stat
import threading
from typing import Any

import databases
from households import confirm
import pytest
from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.base.errors import StoreError
from rt_robot_os.monitor.command import run
from rt_robot_os.monitor.store.housekeeping import Housekeeping
from rt_robot_os.monitor.store.store import Store
from rt_robot_os.monitor.store.upkeep import backup
from rt_robot_os.monitor.store.upkeep import check
from rt_robot_os.monitor.store.upkeep import status
from sqlalchemy import inspect
from sqlalchemy import text

NOW_NS = 1_800_000_000_000_000_000
S = 1_000_000_000


def record(seq: int, kind: str, /, **content: Any) -> dict[str, Any]:
    return {'seq': seq, 'importance': 3, 'type': kind, 'utc_ns': NOW_NS - seq * S,
            'content': content}


def alarm(seq: int, name: str, subject: str, words: str) -> dict[str, Any]:
    return record(seq, 'alarm_event', **{
        'seq': seq, 'alarm': name, 'event': 'raised', 'state': 'raised', 'level': 'urgent',
        'subject': subject, 'kinds': ['fall'], 'text': words, 'by': 'anna'})


def fill(store: Store) -> None:
    """Let the store know anna, Hanna and ben."""
    confirm(store, 'r1', 'anna', 'hanna', 'ben')
    store.hello('r1', 'b1',
                details={'people': ['anna', 'ben'], 'limits': {'anna': {}}})
    store.add('r1', 'b1', [
        *(record(seq, 'observation', person=person, sign='pulse_per_min', value=60, quality='good',
                 source=f'bed_of_{person}')
          for seq, person in enumerate(['anna', 'hanna', 'ben'] * 5)),
        record(20, 'place', person='anna', x=1, y=1, room='hall'),
        alarm(21, '1', 'anna', 'anna lies'), alarm(22, '2', 'kitchen', 'smoke, says Anna or anna'),
        record(23, 'media', id='m1', alarm='1', kind='picture', sha256='aa' * 32, size=3),
        record(24, 'media', id='m2', alarm='1', kind='picture', sha256='bb' * 32, size=3),
        record(25, 'media', id='m3', alarm='2', kind='picture', sha256='bb' * 32, size=3),
        record(26, 'transition', to='ask', words='Are you all right, anna?', anna='here'),
        record(27, 'hologram', person='anna')])
    store.add_note('r1', '2', 'mary', 'anna was with hanna')
    store.roll_up()


def everything(store: Store) -> str:
    """Return all rows of all tables as one text."""
    with store.reading() as connection:
        return '\n'.join(str(row) for name in inspect(connection).get_table_names()
                         for row in connection.execute(text(f'SELECT * FROM {name}')))


def test_nothing_is_left_of_a_person_who_is_erased_and_all_of_the_others(store: Store) -> None:
    fill(store)
    assert 'anna' in everything(store).replace('hanna', '')
    erased = store.erase('anna')
    assert {name: count for name, count in erased.rows.items() if count} == {
        'observations': 5, 'places': 1, 'alarms': 1, 'media': 2, 'people': 1,
        'unknown': 1}
    # The other picture is also that of an alarm that stays.
    assert erased.files == [('r1', 'aa' * 32)]
    left = everything(store)
    assert 'anna' not in left.replace('hanna', '')
    assert left.count('hanna') > 5 and '(erased)' in left
    assert [each['person'] for each in store.latest()] == ['ben', 'hanna']
    assert check(store) == []
    # What comes again of before does not come back, and what is new is kept.
    assert store.add('r1', 'b1', [record(0, 'observation', person='anna', sign='pulse_per_min',
                                         value=60, quality='good')]) == 0
    assert store.add('r1', 'b1', [record(40, 'observation', person='anna', sign='pulse_per_min',
                                         value=60, quality='good')]) == 1
    assert len(store.observations('anna')) == 1


def test_another_process_may_erase_somebody_while_records_come(url: str) -> None:
    stores = [Store.open(url, lambda: NOW_NS) for _ in range(2)]
    fill(stores[0])
    stores[1].erase('anna')
    assert stores[0].add('r1', 'b1', [record(
        50, 'observation', person='anna', sign='pulse_per_min', value=60, quality='good')]) == 1
    assert len(stores[1].observations('anna')) == 1
    for store in stores:
        store.close()


def test_damage_is_found(store: Store) -> None:
    fill(store)
    assert check(store) == []
    with store.writing() as connection:
        connection.execute(text('UPDATE minutes SET low = high + 1'))
        connection.execute(text("UPDATE alarms SET last_seq = 0 WHERE alarm = '1'"))
    assert [line.partition(' ')[2] for line in check(store)] == [
        'alarms older than their newest event', 'minutes that are invalid']


def test_a_copy_made_while_it_is_in_use_is_whole(
        store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if found := databases.program_folders():
        # Its own pg_dump: an older one refuses.
        monkeypatch.setenv('PATH', f'{found[0]}:{os.environ["PATH"]}')
    fill(store)
    copy = tmp_path / 'copy'
    backup(store, copy)
    assert stat.S_IMODE(copy.stat().st_mode) == 0o600
    with pytest.raises(StoreError, match='exists'):
        backup(store, copy)
    if store.engine.dialect.name == 'sqlite':
        other = Store.open(str(copy))
        assert everything(other) == everything(store)
        other.close()
    else:
        assert copy.read_bytes().startswith(b'PGDMP')


def test_a_full_disk_leaves_no_half_copy(
        all_databases: databases.Databases, tmp_path: Path) -> None:
    store = Store.open(all_databases.fresh('sqlite'))
    with pytest.raises(StoreError, match='backup'):
        backup(store, tmp_path / 'nowhere' / 'copy')
    assert status(store)['rows']['observations'] == 0
    store.close()


def test_housekeeping_goes_on_after_the_database_was_away() -> None:
    done = threading.Event()
    answers: list[Any] = [{'observations': 3}, StoreError('away'), {'minutes': 4}]

    def thin() -> dict[str, int]:
        answer = answers.pop(0)
        if not answers:
            done.set()
            answers.append({})
        if isinstance(answer, StoreError):
            raise answer
        return dict(answer)

    keeping = Housekeeping(thin, first_s=0.0, period_s=0.001)
    assert done.wait(30)
    keeping.close()
    assert (keeping.thinned, keeping.fault) == (7, '')


def test_the_program_shows_checks_copies_and_erases(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    where = ['--folder', str(tmp_path)]

    def said(*words: str, code: int = 0) -> str:
        assert run(['database', *words, *where]) == code
        captured = capsys.readouterr()
        return captured.out + captured.err

    assert 'there is no database' in said('status', code=2)
    store = Store.open(str(tmp_path / 'monitor.db'), lambda: NOW_NS)
    fill(store)
    store.close()
    found = json.loads(said('status'))
    assert found['rows']['observations'] == 15 and found['version'] == found['newest_version']
    assert said('check') == 'no damage found\n'
    assert 'copy.db: ' in said('backup', str(tmp_path / 'copy.db'))
    assert '"hologram"' in said('aside')
    assert '--yes' in said('erase', 'anna', code=2)
    assert json.loads(said('erase', 'anna', '--yes'))['rows']['observations'] == 5
    assert '--yes' in said('downgrade', '0001', code=2)
    assert said('downgrade', '0001', '--yes') == '0001\n'
    assert 'monitor database upgrade' in said('check', code=2)
    assert said('upgrade') == f'{found["newest_version"]}\n'
    with sqlite3.connect(tmp_path / 'monitor.db') as connection:
        connection.execute('UPDATE minutes SET count = 0')
    connection.close()
    assert 'minutes that are invalid' in said('check', code=1)
    with pytest.raises(RtRobotError, match='exists'):
        run(['database', 'backup', str(tmp_path / 'copy.db'), *where])
