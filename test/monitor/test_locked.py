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

"""A session that was left untouched: what it still does, and how the password opens it again."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
import sqlite3
import time
from typing import Any
from uuid import uuid4

from accounts_app import PASSWORD
from accounts_app import QUICK
from fake_robot import FakeRobot
from fake_robot import RobotScript
from monitor_server import ask
from monitor_server import lock_sessions
from monitor_server import logged_in
from monitor_server import quick_services
from monitor_server import served
from processes import wait_until
import pytest
from rt_robot_os.monitor.security.passwords import Passwords
from rt_robot_os.monitor.security.roles import Role
from rt_robot_os.monitor.security.sessions import SECOND_NS
from rt_robot_os.monitor.security.tables import sessions
from rt_robot_os.monitor.server import DATABASE
from rt_robot_os.monitor.services import Services
from sqlalchemy import select
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

STOP = {'do': 'stop', 'args': {}}
COMMANDS = '/api/robots/robot/commands'


@pytest.fixture(scope='module')
def services(tmp_path_factory: pytest.TempPathFactory) -> Services:
    found = quick_services(tmp_path_factory.mktemp('monitor'), command_s=60.0)
    found.accounts.passwords.close()
    found.accounts.passwords = Passwords(QUICK)
    return found


@pytest.fixture(scope='module')
def address(services: Services) -> Iterator[str]:
    with served(services) as found:
        yield found


@pytest.fixture
def robot(address: str) -> Iterator[FakeRobot]:
    with FakeRobot(f'ws://{address}', script=RobotScript(people=('anna',))) as found:
        yield found


@pytest.fixture
def carer(services: Services) -> dict[str, str]:
    """Return the headers of a carer of this test whose session is locked."""
    name = f'carla {uuid4().hex}'
    found = logged_in(services, name, Role.CARER)
    user = services.accounts.users.find(name)
    services.accounts.users.set_password(user.id, services.accounts.passwords.hash(PASSWORD))
    lock_sessions(services)
    return found


def acknowledge(alarm: str) -> dict[str, Any]:
    return {'do': 'alarm', 'args': {'verb': 'acknowledge', 'alarm': alarm}}


def test_a_locked_session_stops_the_robot_and_the_audit_says_that_it_was_locked(
        address: str, services: Services, robot: FakeRobot, carer: dict[str, str]) -> None:
    assert ask(address, carer, 'POST', COMMANDS, STOP) == (200, {'ok': True, 'text': 'done'})
    assert [each['do'] for each in robot.commands] == ['stop']
    wait_until(lambda: [row['details'].get('locked') for row in services.audit.all_rows()
                        if row['action'] == 'command.stop'] == [True], 'it is in the audit')
    # To stop opens nothing.
    assert ask(address, carer, 'GET', '/api/session')[1]['locked'] is True


@pytest.mark.parametrize('command', [
    acknowledge('k1'), {'do': 'say', 'args': {'text': 'hello'}}, {'do': 'snapshot', 'args': {}}])
def test_what_is_done_in_somebodys_name_asks_for_the_password(
        address: str, robot: FakeRobot, carer: dict[str, str], command: dict[str, Any]) -> None:
    robot.raise_alarm('k1')
    status, said = ask(address, carer, 'POST', COMMANDS, command)
    assert (status, said['reason']) == (401, 'locked') and 'password' in said['remedy']
    assert robot.commands == []


def test_what_the_role_does_not_allow_is_refused_by_the_role_also_while_locked(
        address: str, robot: FakeRobot, carer: dict[str, str]) -> None:
    status, said = ask(address, carer, 'POST', COMMANDS, {'do': 'goal', 'args': {'x': 1, 'y': 2}})
    assert status == 403 and 'reason' not in said


def test_the_password_opens_the_same_session_and_then_an_alarm_is_acknowledged(
        address: str, services: Services, robot: FakeRobot, carer: dict[str, str]) -> None:
    robot.raise_alarm('k2')
    found = ask(address, carer, 'GET', '/api/session')[1]
    assert found['permissions'] == ['health', 'see']
    assert {'acknowledge', 'talk', 'camera'} < set(found['role_permissions'])
    status, said = ask(address, carer, 'POST', '/api/session/unlock', {'password': 'not it'})
    assert (status, said['reason']) == (403, 'password')
    assert ask(address, carer, 'GET', '/api/session')[1]['locked'] is True
    status, opened = ask(address, carer, 'POST', '/api/session/unlock', {'password': PASSWORD})
    assert status == 200 and opened['locked'] is False
    assert (opened['id'], opened['expires_ns']) == (found['id'], found['expires_ns'])
    assert ask(address, carer, 'POST', COMMANDS, acknowledge('k2'))[0] == 200
    assert [each['do'] for each in robot.commands] == ['alarm']
    wait_until(lambda: [row['action'] for row in services.audit.all_rows()
                        if row['name'] == opened['user'] and 'unlock' in row['action']]
               == ['session.unlock_refused', 'session.unlock'], 'both are in the audit')


def test_the_password_opens_it_also_while_the_database_cannot_be_written(
        address: str, services: Services, robot: FakeRobot, carer: dict[str, str]) -> None:
    robot.raise_alarm('k3')
    assert ask(address, carer, 'GET', '/api/session')[1]['locked'] is True
    with closing(sqlite3.connect(services.settings.where / DATABASE)) as other:
        other.execute('BEGIN IMMEDIATE')
        status, opened = ask(address, carer, 'POST', '/api/session/unlock',
                             {'password': PASSWORD})
        assert (status, opened['locked']) == (200, False)
        assert ask(address, carer, 'POST', COMMANDS, acknowledge('k3'))[0] == 200
        assert [each['do'] for each in robot.commands] == ['alarm']

    def stored_ns() -> int:
        with services.store.reading() as connection:
            found: int = connection.execute(select(sessions.c.seen_ns).where(
                sessions.c.id == opened['id'])).scalar_one()
            return found

    wait_until(lambda: time.time_ns() - stored_ns() < 300 * SECOND_NS, 'it is stored')


def test_who_guesses_at_a_locked_session_waits_longer_and_longer(
        address: str, carer: dict[str, str]) -> None:
    found = [ask(address, carer, 'POST', '/api/session/unlock', {'password': f'guess {number}'})[0]
             for number in range(4)]
    assert found == [403, 403, 429, 429]


def test_another_sites_page_unlocks_nothing(address: str, carer: dict[str, str]) -> None:
    headers = {**carer, 'X-CSRF-Token': 'x'}
    status, _ = ask(address, headers, 'POST', '/api/session/unlock', {'password': PASSWORD})
    assert status == 403
    assert ask(address, carer, 'GET', '/api/session')[1]['locked'] is True


def test_a_locked_session_opens_no_camera(address: str, carer: dict[str, str]) -> None:
    with pytest.raises(InvalidStatus), connect(
            f'ws://{address}/camera', additional_headers=carer, proxy=None,
            origin=f'http://{address}'):
        pass
