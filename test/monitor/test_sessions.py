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

"""Sessions: who gets in, what stays out, and when it ends."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip('fastapi')
pytest.importorskip('sqlalchemy')
pytest.importorskip('argon2')
pytest.importorskip('httpx')

from accounts_app import BASE  # noqa: E402, I100
from accounts_app import Monitor  # noqa: E402
from accounts_app import monitor  # noqa: E402
from accounts_app import PASSWORD  # noqa: E402
from rt_robot_os.monitor.security.roles import Role  # noqa: E402


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Monitor]:
    with monitor(tmp_path) as found:
        yield found


def test_the_first_account_is_made_by_a_link_that_works_once(server: Monitor) -> None:
    link = server.accounts.setup_link(BASE)
    assert link is not None and link.startswith(f'{BASE}/#/setup/')
    token = link.rpartition('/')[2]
    browser = server.client()
    assert browser.get('/api/setup').json() == {'needed': True}
    form = {'token': token, 'name': 'Mary', 'password': PASSWORD}
    assert browser.post('/api/setup', json=form).json()['role'] == 'owner'
    assert browser.get('/api/session').json()['user'] == 'Mary'
    again = server.client().post('/api/setup', json={**form, 'name': 'Mallory'})
    assert again.status_code == 404
    assert [user.name for user in server.accounts.users.all()] == ['Mary']
    assert server.accounts.setup_link(BASE) is None


def test_a_session_begins_with_a_cookie_and_ends_with_it(server: Monitor) -> None:
    browser = server.signed_in('carl', Role.CARER, people=('anna',))
    found = browser.get('/api/session').json()
    assert found['role'] == 'carer' and found['people'] == ['anna']
    assert 'acknowledge' in found['permissions'] and 'drive' not in found['permissions']
    stolen = browser.cookies['session']
    assert browser.delete('/api/session').json() == {'ended': 1}
    thief = server.client()
    thief.cookies['session'] = stolen
    assert thief.get('/api/session').status_code == 401
