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

"""A stop, an acknowledgement, live data and robots need no database that answers."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from collections.abc import Iterator
from contextlib import closing
from contextlib import contextmanager
import http.client
import json
from pathlib import Path
import sqlite3
import threading
from typing import Any

import databases
from fake_robot import FakeRobot
from fake_robot import RobotScript
from monitor_server import let_robot_in
from monitor_server import logged_in
from monitor_server import Page
from monitor_server import quick_services
from monitor_server import served
from processes import wait_until
import pytest
from rt_robot_os.base.errors import StoreError
from rt_robot_os.monitor.security.outage import Memory
from rt_robot_os.monitor.security.outage import Questions
from rt_robot_os.monitor.security.tables import sessions
from rt_robot_os.monitor.server import DATABASE
from rt_robot_os.monitor.services import Services
from sqlalchemy import event

Outage = Callable[[Services], Any]


@pytest.fixture(scope='module')
def all_databases(tmp_path_factory: pytest.TempPathFactory) -> Iterator[databases.Databases]:
    with databases.lazily() as server:
        yield databases.Databases(tmp_path_factory.mktemp('databases'), server)


def ask(address: str, headers: dict[str, str], method: str, path: str, content: Any = None
        ) -> tuple[int, Any]:
    with closing(http.client.HTTPConnection(address, timeout=60)) as connection:
        connection.request(method, path, json.dumps(content), {
            **headers, 'Content-Type': 'application/json', 'Origin': f'http://{address}'})
        found = connection.getresponse()
        return found.status, json.loads(found.read())


@contextmanager
def locked(services: Services) -> Iterator[None]:
    """Hold the lock of writers, as a backup program may."""
    with closing(sqlite3.connect(services.settings.where / DATABASE)) as connection:
        connection.isolation_level = None
        connection.execute('BEGIN IMMEDIATE')
        yield


@contextmanager
def full(services: Services) -> Iterator[None]:
    """Let the file of the database not grow."""
    def limit(connection: Any, *_: Any) -> None:
        connection.execute(f'PRAGMA max_page_count = {pages}')

    pages = 1  # that is: as many as it has
    event.listen(services.store.engine, 'checkout', limit)
    services.store.engine.dispose()
    yield
    pages = 1 << 30


@contextmanager
def read_only(services: Services) -> Iterator[None]:
    """Let nothing be written, as a file system after an error of its disk."""
    def limit(connection: Any, *_: Any) -> None:
        connection.execute(f'PRAGMA query_only = {is_on}')

    is_on = 1
    event.listen(services.store.engine, 'checkout', limit)
    yield
    is_on = 0


@contextmanager
def hung(services: Services) -> Iterator[None]:
    """Let every question about accounts wait."""
    import psycopg
    url = services.store.engine.url.set(drivername='postgresql')
    with psycopg.connect(url.render_as_string(hide_password=False)) as connection:
        connection.execute('LOCK TABLE sessions, robot_accounts, audit, robots, users')
        yield


def stop_and_acknowledge(address: str, me: dict[str, str], robot: FakeRobot) -> None:
    path = '/api/robots/robot/commands'
    assert ask(address, me, 'POST', path, {'do': 'stop'}) == (200, {'ok': True, 'text': 'done'})
    assert ask(address, me, 'POST', path, {'do': 'alarm', 'args': {
        'verb': 'acknowledge', 'alarm': '1'}})[0] == 200
    assert [each['do'] for each in robot.commands[-2:]] == ['stop', 'alarm']


def all_works_during(outage: Outage, services: Services) -> None:
    let_robot_in(services, 'late')
    services.accounts.robots.tokens()  # as the server does once a second
    me = logged_in(services)
    with served(services) as address:
        url = f'ws://{address}'
        with FakeRobot(url) as robot:
            robot.raise_alarm('1')
            assert ask(address, me, 'GET', '/api/session')[0] == 200
            with services.store.writing() as connection:
                connection.execute(sessions.update().values(
                    seen_ns=sessions.c.seen_ns - 60 * 10 ** 9))
            services.accounts.sessions.find(me['Cookie'].partition('=')[2])
            with outage(services):
                stop_and_acknowledge(address, me, robot)
                robot.disconnect()
                robot.connect()
                with Page(address, me) as page, FakeRobot(url, script=RobotScript('late')):
                    alarms = page.next('state')['alarms']
                    assert [each['id'] for each in alarms] == ['1']
                    robot.send(robot.script.records(robot.script.alarm('2', why='x' * 30_000)))
                    assert page.next('alarm')['id'] == '2'
                stop_and_acknowledge(address, me, robot)
                if outage is not hung:  # which says nothing, not even that
                    wait_until(lambda: services.writer.failures, 'an attempt to store that fails')
            wanted = ['command.stop', 'answer.stop', 'command.alarm', 'answer.alarm']
            wait_until(lambda: [row['action'] for row in services.audit.rows() if row[
                'action'].startswith(('command.', 'answer.'))] == 2 * wanted,
                'what was done to be in the audit')
            wait_until(lambda: '2' in {each['id'] for each in services.store.alarms(people=None)},
                       'the alarm to be stored')
            assert services.audit.verify().is_whole
            assert {'robot', 'late'} <= {each['id'] for each in services.store.robots()}


@pytest.mark.parametrize('outage', [locked, full, read_only])
def test_all_works_while_the_file_cannot_be_written(tmp_path: Path, outage: Outage) -> None:
    all_works_during(outage, quick_services(tmp_path))


@pytest.mark.parametrize('is_stopped', [True, False])
def test_all_works_while_postgresql_is_stopped_or_does_not_answer(
        tmp_path: Path, all_databases: databases.Databases, is_stopped: bool) -> None:
    url = all_databases.fresh('postgresql')
    services = quick_services(tmp_path, database=url)
    all_works_during((lambda _: all_databases.away(url)) if is_stopped else hung, services)


def test_whom_the_server_does_not_know_is_asked_to_come_again(
        tmp_path: Path, all_databases: databases.Databases) -> None:
    url = all_databases.fresh('postgresql')
    services = quick_services(tmp_path, database=url)
    me = logged_in(services)
    with served(services) as address, all_databases.away(url):
        status, answer = ask(address, me, 'GET', '/api/robots')
        assert status == 503 and 'database' in answer['detail']['text']


def test_a_session_that_was_ended_is_not_remembered(tmp_path: Path) -> None:
    services = quick_services(tmp_path)
    secret = logged_in(services)['Cookie'].partition('=')[2]
    known = services.accounts.sessions
    session = known.find(secret)
    assert session is not None and known.remembered(secret) == session
    services.accounts.end_sessions(session=session.id)
    assert known.remembered(secret) is None


def test_a_token_that_was_revoked_is_not_remembered(tmp_path: Path) -> None:
    robots = quick_services(tmp_path).accounts.robots
    robot, token = robots.add('flat7')
    robots.tokens()
    assert robots.remembered(token) == robot
    robots.revoke('flat7')
    assert robots.remembered(token) is None


def test_answers_count_for_a_time_and_are_bounded() -> None:
    now_s = 0.0
    memory: Memory[int] = Memory(10.0, 2, lambda: now_s)
    for number, key in enumerate('abc'):
        memory.store(key, number)
    now_s = 10.0
    assert [memory.find(key) for key in 'abcd'] == [None, 1, 2, None]
    memory.forget(lambda key, value: key == 'b')
    assert memory.find('b') is None
    now_s = 10.1
    assert memory.find('c') is None


def test_while_one_question_hangs_the_next_ones_do_not_wait(
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('rt_robot_os.monitor.security.outage.PATIENCE_S', 0.01)
    questions, answers = Questions(), threading.Event()
    asked: list[int] = []

    def question() -> str:
        asked.append(1)
        answers.wait()
        return 'database'

    async def scenario() -> None:
        assert await questions.ask(question, lambda: 'memory') == 'memory'
        for _ in range(1000):
            assert await questions.ask(question, lambda: 'memory') == 'memory'
        assert len(asked) < 10
        unknown = asyncio.ensure_future(questions.ask(question, lambda: None))
        await asyncio.sleep(0.05)
        monkeypatch.setattr('rt_robot_os.monitor.security.outage.PATIENCE_S', 60.0)
        answers.set()
        assert await unknown == 'database'
        assert await questions.ask(question, lambda: 'memory') == 'database'

        def away() -> str:
            raise StoreError('away')
        assert await questions.ask(away, lambda: 'memory') == 'memory'
        with pytest.raises(StoreError, match='away'):
            await questions.ask(away, lambda: None)

    asyncio.run(scenario())
    questions.close()
