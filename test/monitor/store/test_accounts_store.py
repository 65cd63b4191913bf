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

"""Accounts and the audit are the same on both databases."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import pytest

pytest.importorskip('argon2')

from accounts_app import QUICK  # noqa: E402, I100
from rt_robot_os.monitor.security.accounts import Accounts  # noqa: E402
from rt_robot_os.monitor.security.audit import Audit  # noqa: E402
from rt_robot_os.monitor.security.audit import CONSOLE  # noqa: E402
from rt_robot_os.monitor.security.roles import Role  # noqa: E402
from rt_robot_os.monitor.security.tables import audit as table  # noqa: E402
from rt_robot_os.monitor.security.users import AccountError  # noqa: E402
from rt_robot_os.monitor.store.store import Store  # noqa: E402
from sqlalchemy.exc import DBAPIError  # noqa: E402

KEY = b'k' * 32


def test_users_sessions_links_and_robots_are_kept(store: Store) -> None:
    accounts = Accounts(store.engine, KEY, hasher=QUICK)
    link = accounts.invitations.make(None)
    owner = accounts.invitations.use(link, 'Mary', accounts.passwords.hash('p'), Role.OWNER)
    assert owner is not None and owner.people is None
    assert accounts.invitations.use(link, 'Eve', 'h', Role.OWNER) is None
    carl = accounts.users.add('carl', Role.CARER, ('anna', 'bert'), 'mary')
    with pytest.raises(AccountError, match='exists'):
        accounts.users.add('CARL', Role.CARER, (), 'mary')
    assert [user.name for user in accounts.users.all()] == ['carl', 'Mary']
    session, secret = accounts.sessions.begin(carl.id, '10.0.0.1', 'a browser')
    accounts.emergencies.begin(carl.id, session, 'zoe', 'she calls for help')
    found = accounts.sessions.find(secret)
    assert found is not None and found.people == {'anna', 'bert', 'zoe'}
    assert accounts.emergencies.all()[0]['is_open']
    assert accounts.end_sessions(user=carl.id) == 1 and accounts.sessions.find(secret) is None
    assert not accounts.emergencies.all()[0]['is_open']
    with pytest.raises(AccountError, match='no administrator of the monitor'):
        accounts.users.change(owner.id, 'mary', is_disabled=True)
    robot, token = accounts.robots.add('r1')
    assert accounts.robots.find(token) == robot
    accounts.revoke_robot('r1')
    assert accounts.robots.find(token) is None
    assert accounts.robots.add('r1')[0] == robot
    accounts.close()


def test_one_link_makes_one_account_whoever_comes_at_the_same_time(store: Store) -> None:
    accounts = Accounts(store.engine, KEY, hasher=QUICK)
    link = accounts.invitations.make(None)
    with ThreadPoolExecutor(6) as pool:
        made = list(pool.map(lambda number: accounts.invitations.use(
            link, f'user{number}', 'h', Role.OWNER), range(6)))
    assert len([each for each in made if each is not None]) == 1
    assert len(accounts.users.all()) == 1
    accounts.close()


def test_the_chain_of_two_writers_is_whole_and_rows_stay_as_they_are(store: Store) -> None:
    writers = [Audit(store.engine, KEY) for _ in range(2)]
    with ThreadPoolExecutor(4) as pool:
        for number in range(30):
            pool.submit(writers[number % 2].note, CONSOLE, 'test', f'{number} \0 \x1b ä')
    verdict = writers[0].verify()
    assert verdict.is_whole and verdict.rows == 30
    for statement in (table.update().values(name='bert'), table.delete()):
        with pytest.raises(DBAPIError, match='never changed'):
            with store.engine.begin() as connection:
                connection.execute(statement)
