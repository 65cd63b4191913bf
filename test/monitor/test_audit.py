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

"""The audit: each row is there, and whoever changes one is found out."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
import json
from pathlib import Path
import threading
from typing import Any

from hypothesis import given
from hypothesis import HealthCheck
from hypothesis import settings
from hypothesis import strategies as st
import pytest

pytest.importorskip('fastapi')
pytest.importorskip('sqlalchemy')
pytest.importorskip('argon2')
pytest.importorskip('httpx')

from accounts_app import Monitor  # noqa: E402, I100
from accounts_app import monitor  # noqa: E402
from rt_robot_os.base.errors import StartError  # noqa: E402
from rt_robot_os.base.errors import StoreError  # noqa: E402
from rt_robot_os.monitor.security import audit as module  # noqa: E402
from rt_robot_os.monitor.security.accounts import audit_key  # noqa: E402
from rt_robot_os.monitor.security.audit import Audit  # noqa: E402
from rt_robot_os.monitor.security.audit import Somebody  # noqa: E402
from rt_robot_os.monitor.security.roles import Role  # noqa: E402
from rt_robot_os.monitor.security.tables import audit as table  # noqa: E402
from rt_robot_os.monitor.security.tables import audit_head  # noqa: E402
from sqlalchemy import Connection  # noqa: E402
from sqlalchemy import select  # noqa: E402
from sqlalchemy.exc import IntegrityError  # noqa: E402

MARY = Somebody('mary', '10.0.0.1', 'id1', 'operator')


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Monitor]:
    with monitor(tmp_path) as found:
        yield found


def rows(server: Monitor, count: int) -> Audit:
    for number in range(count):
        server.accounts.audit.note(MARY, 'alarm.acknowledge', f'robot/{number}', reason='fall')
    return server.accounts.audit


def tamper(server: Monitor, change: Callable[[Connection], Any]) -> None:
    """Change the table as somebody who owns the database may."""
    with server.engine.begin() as connection:
        for name in ('audit_no_update', 'audit_no_delete'):
            connection.exec_driver_sql(f'DROP TRIGGER IF EXISTS {name}')
        change(connection)


def test_what_is_noted_without_waiting_stands_in_the_order_in_which_it_happened(
        server: Monitor, monkeypatch: pytest.MonkeyPatch) -> None:
    audit = server.accounts.audit
    write, is_on_disk = audit._write, threading.Event()

    def slow(row: dict[str, Any]) -> None:
        if row['action'] == 'drive.take_over':
            assert is_on_disk.wait(60.0)
        write(row)

    monkeypatch.setattr(audit, '_write', slow)
    for action in ('drive.take_over', 'drive.end', 'command.stop'):
        audit.note_soon(MARY, action, 'robot')
    assert audit.rows() == []
    is_on_disk.set()
    audit.close()
    audit.note_soon(MARY, 'voice.end', 'robot')  # by a connection that ends after the server
    assert [row['action'] for row in audit.rows()] == [
        'drive.take_over', 'drive.end', 'command.stop', 'voice.end']
    assert audit.verify().is_whole


def test_rows_come_back_as_they_were_and_in_order(server: Monitor) -> None:
    audit = rows(server, 3)
    found = audit.rows()
    assert [row['object'] for row in found] == ['robot/0', 'robot/1', 'robot/2']
    assert found[0] == {**found[0], 'seq': 1, 'name': 'mary', 'role': 'operator', 'actor': 'id1',
                        'address': '10.0.0.1', 'action': 'alarm.acknowledge',
                        'details': {'reason': 'fall'}, 't_ns': server.clock.ns}
    assert audit.verify().is_whole and audit.verify().rows == 3
    assert [row['seq'] for row in audit.rows(before=3, newest_first=True)] == [2, 1]
    assert audit.rows(name='bert') == [] and len(audit.rows(action='alarm.')) == 3


def test_the_database_itself_refuses_to_change_a_row(server: Monitor) -> None:
    rows(server, 1)
    for statement in (table.update().values(name='bert'), table.delete()):
        with pytest.raises(IntegrityError, match='never changed'):
            with server.engine.begin() as connection:
                connection.execute(statement)


def test_a_row_that_was_changed_is_found(server: Monitor) -> None:
    audit = rows(server, 4)
    right = dict(audit.rows()[1])
    for column, value in right.items():
        changed: Any = 5 if isinstance(value, int) else 'x'
        kept: Any = json.dumps(value) if column == 'details' else value
        if column != 'seq':
            tamper(server, lambda connection: connection.execute(
                table.update().where(table.c.seq == 2).values(**{column: changed})))
            assert any('row 2' in each for each in audit.verify().problems), column
            tamper(server, lambda connection: connection.execute(
                table.update().where(table.c.seq == 2).values(**{column: kept})))
            assert audit.verify().is_whole, column


def test_rows_that_were_removed_are_found_at_any_place(server: Monitor) -> None:
    audit = rows(server, 5)
    tamper(server, lambda connection: connection.execute(
        table.delete().where(table.c.seq.in_((2, 3)))))
    assert 'rows 2 to 3 are missing' in audit.verify().problems
    tamper(server, lambda connection: connection.execute(table.delete().where(table.c.seq == 1)))
    assert not audit.verify().is_whole
    tamper(server, lambda connection: connection.execute(table.delete()))
    assert 'ends with row 0, and its head says 5' in audit.verify().problems[0]


def test_rows_missing_at_the_end_are_found_even_with_a_head_made_to_fit(server: Monitor) -> None:
    audit = rows(server, 3)
    noted = audit.verify().head
    tamper(server, lambda connection: connection.execute(table.delete().where(table.c.seq == 3)))
    assert not audit.verify().is_whole
    last = audit.rows()[-1]
    tamper(server, lambda connection: connection.execute(audit_head.update().values(
        seq=2, mac=last['mac'])))
    assert audit.verify().problems == ('the seal of the head is wrong',)
    assert 'row 3, which was noted, is missing' in audit.verify(noted).problems


def test_rows_that_were_swapped_are_found(server: Monitor) -> None:
    audit = rows(server, 4)

    def swap(connection: Connection) -> None:
        for old, new in ((2, 99), (3, 2), (99, 3)):
            connection.execute(table.update().where(table.c.seq == old).values(seq=new))

    tamper(server, swap)
    assert not audit.verify().is_whole


def test_a_row_that_was_added_by_somebody_without_the_key_is_found(server: Monitor) -> None:
    audit = rows(server, 2)

    def add(connection: Connection) -> None:
        last = dict(connection.execute(select(table).where(table.c.seq == 2)).one()._mapping)
        connection.execute(table.insert().values(**{
            **last, 'seq': 3, 'previous': last['mac'], 'mac': 'f' * 64, 'name': 'bert'}))

    tamper(server, add)
    assert 'rows follow behind its head, 2' in audit.verify().problems
    tamper(server, lambda connection: connection.execute(audit_head.update().values(
        seq=3, mac='f' * 64)))
    assert 'row 3 was changed' in audit.verify().problems


def test_a_whole_chain_made_anew_without_the_key_is_found(server: Monitor) -> None:
    audit = rows(server, 2)
    found = audit.rows()
    tamper(server, lambda connection: (connection.execute(table.delete()),
                                       connection.execute(audit_head.update().values(
                                           seq=0, mac='', seal=''))))
    forged = Audit(server.engine, b'another key' * 4)
    for row in found:
        forged.note(Somebody('bert'), row['action'], row['object'])
    assert forged.verify().is_whole
    assert not audit.verify().is_whole


def test_two_writers_make_one_chain(server: Monitor, tmp_path: Path) -> None:
    other = Audit(server.engine, audit_key(tmp_path), server.clock)
    with ThreadPoolExecutor(4) as pool:
        for number in range(40):
            writer = (server.accounts.audit, other)[number % 2]
            pool.submit(writer.note, MARY, 'alarm.note', str(number))
    verdict = server.accounts.audit.verify()
    assert verdict.is_whole and verdict.rows == 40
    assert server.accounts.audit.waiting == other.waiting == 0


@settings(max_examples=20, deadline=None,
          suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.text(max_size=300), st.dictionaries(st.text(max_size=10), st.one_of(
    st.none(), st.integers(), st.floats(), st.text(max_size=100)), max_size=5))
def test_whatever_somebody_sends_is_kept_and_the_chain_stays_whole(
        server: Monitor, text: str, details: dict[str, Any]) -> None:
    details = {f'arg_{key}': value for key, value in details.items()}
    server.accounts.audit.note(Somebody(text, text, text, text), text, text, **details)
    verdict = server.accounts.audit.verify()
    assert verdict.is_whole, verdict.problems
    last = server.accounts.audit.rows(newest_first=True, limit=1)[0]
    json.dumps(last).encode()
    assert '\0' not in last['name'] and '\x1b' not in last['object']


def test_a_disk_that_is_full_holds_up_no_alarm_and_loses_no_row(
        server: Monitor, monkeypatch: pytest.MonkeyPatch) -> None:
    audit = rows(server, 1)
    with monkeypatch.context() as full:
        def refuse(*_: object) -> None:
            raise StoreError('disk full')

        full.setattr(audit, '_write', refuse)
        audit.note(MARY, 'command.stop', 'robot')
        assert audit.waiting == 1
        # What is read must be noted, or it is not read.
        with pytest.raises(StoreError):
            audit.read(MARY, 'health.read', 'anna')
        full.setattr(module, '_WAITING', 1)
        audit.note(MARY, 'command.stop', 'robot')
        assert audit.lost == 1
    audit.note(MARY, 'command.release', 'robot')
    assert [row['action'] for row in audit.rows()][1:] == [
        'command.stop', 'command.release']
    assert audit.verify().is_whole


def test_who_reads_the_same_again_leaves_one_row(server: Monitor) -> None:
    audit = server.accounts.audit
    for sign in ('pulse_per_min', 'spo2_percent') * 5:
        audit.read(MARY, 'health.read', 'anna', sign=sign)
        audit.read(MARY, 'health.read', 'bert', sign=sign)
    assert [row['object'] for row in audit.rows()] == ['anna', 'bert']


def test_the_key_is_for_its_owner_alone_and_made_once(tmp_path: Path) -> None:
    folder = tmp_path / 'new'
    with ThreadPoolExecutor(8) as pool:
        keys = set(pool.map(lambda _: audit_key(folder), range(16)))
    assert len(keys) == 1 and len(keys.pop()) == 32
    assert (folder / 'audit.key').stat().st_mode & 0o777 == 0o600
    assert [path.name for path in folder.iterdir()] == ['audit.key']
    (folder / 'audit.key').write_text('none')
    with pytest.raises(StartError, match='restore it'):
        audit_key(folder)


def test_the_audit_is_read_and_taken_away_by_who_may(server: Monitor) -> None:
    rows(server, 3)
    auditor = server.signed_in('adam', Role.ADMIN)
    found = auditor.get('/api/audit', params={'limit': 2, 'action': 'alarm.'}).json()
    assert [row['seq'] for row in found['rows']] == [3, 2]
    assert auditor.get('/api/audit/verify').json()['whole'] is True
    lines = auditor.get('/api/audit/export').text.splitlines()
    assert [json.loads(line)['action'] for line in lines][-1] == 'audit.export'
    assert auditor.get('/api/audit', params={'limit': 10**9}).status_code == 422
    assert auditor.get('/api/audit', params={'before': -1}).status_code == 422
    for role in (Role.VIEWER, Role.CARER, Role.OPERATOR):
        other = server.signed_in(role.value, role)
        for path in ('/api/audit', '/api/audit/verify', '/api/audit/export'):
            assert other.get(path).status_code == 403
