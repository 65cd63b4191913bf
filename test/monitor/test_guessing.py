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

"""Somebody guesses passwords from elsewhere: who has the right one gets in all the same."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip('fastapi')
pytest.importorskip('sqlalchemy')
pytest.importorskip('argon2')
pytest.importorskip('httpx')

from accounts_app import Clock  # noqa: E402, I100
from accounts_app import Monitor  # noqa: E402
from accounts_app import monitor  # noqa: E402
from accounts_app import PASSWORD  # noqa: E402
from hypothesis import given  # noqa: E402
from hypothesis import settings  # noqa: E402
from hypothesis import strategies as st  # noqa: E402
from rt_robot_os.monitor.security.devices import ACCOUNTS_MOST  # noqa: E402
from rt_robot_os.monitor.security.devices import Devices  # noqa: E402
from rt_robot_os.monitor.security.limits import LockOut  # noqa: E402
from starlette.testclient import TestClient  # noqa: E402

ATTACKER = '10.0.0.66'
TABLET = '192.168.1.20'
OTHER_ADDRESS = '192.168.1.21'
RIGHT = {'name': 'carl', 'password': PASSWORD}
WRONG = {'name': 'carl', 'password': 'not the one at all'}


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Monitor]:
    with monitor(tmp_path) as found:
        found.user('carl')
        yield found


def log_in(browser: TestClient) -> int:
    return browser.post('/api/session', json=RIGHT).status_code


def guess(server: Monitor, address: str, seconds: int = 60) -> list[int]:
    """Type five wrong passwords a second; return the answers."""
    browser = server.client(address=address)
    found = []
    for _ in range(5 * seconds):
        found.append(browser.post('/api/session', json=WRONG).status_code)
        server.clock.forward(0.2)
    return found


def test_a_new_tablet_gets_in_while_somebody_guesses_from_another_address(
        server: Monitor) -> None:
    answers = guess(server, ATTACKER)
    assert 429 in answers and answers.count(401) <= 8
    assert log_in(server.client(address=TABLET)) == 200


def test_a_known_tablet_gets_in_after_a_restart_while_somebody_guesses(
        server: Monitor, tmp_path: Path) -> None:
    before = server.client(address=TABLET)
    assert log_in(before) == 200
    for number in range(20):
        guess(server, f'10.0.0.{number}', 1)
    server.restart(tmp_path)
    for number in range(20):
        guess(server, f'10.0.1.{number}', 1)
    # From many addresses the account is delayed for strangers, and for them alone.
    assert log_in(server.client(address='10.9.9.9')) == 429
    assert log_in(server.client(address=TABLET)) == 200
    moved = server.client(address=OTHER_ADDRESS)
    moved.cookies['device'] = before.cookies['device']
    assert log_in(moved) == 200


def test_a_known_tablet_gets_in_behind_the_same_address_as_who_guesses(server: Monitor) -> None:
    tablet = server.client(address=TABLET)
    assert log_in(tablet) == 200
    guess(server, TABLET)
    assert log_in(tablet) == 200


def test_a_restart_gives_no_more_guesses(server: Monitor, tmp_path: Path) -> None:
    for _ in range(6):
        guess(server, ATTACKER, 2)
        server.restart(tmp_path)
    refused = server.client(address=ATTACKER).post('/api/session', json=WRONG)
    assert refused.status_code == 429
    server.clock.forward(901)
    server.restart(tmp_path)
    assert log_in(server.client(address=ATTACKER)) == 200


def test_a_device_cookie_logs_nobody_in_and_has_its_own_delay(server: Monitor) -> None:
    tablet = server.client(address=TABLET)
    assert log_in(tablet) == 200
    thief = server.client(address=ATTACKER)
    thief.cookies['device'] = tablet.cookies['device']
    assert thief.get('/api/session').status_code == 401
    answers = [thief.post('/api/session', json=WRONG).status_code for _ in range(5)]
    assert answers == [401, 401, 429, 429, 429]
    server.user('olga')
    # For another account it is no known device.
    assert server.accounts.devices.number(tablet.cookies['device'], 'olga') == ''


def test_wrong_passwords_of_strangers_do_not_delay_a_change_of_password(server: Monitor) -> None:
    tablet = server.signed_in('carl')
    guess(server, '127.0.0.1')
    changed = tablet.post('/api/password', json={'old': PASSWORD, 'new': 'green table lamp'})
    assert changed.status_code == 200


def test_with_tls_the_device_cookie_is_for_this_host_and_over_tls_alone(server: Monitor) -> None:
    browser = server.client('https://monitor.local:8443')
    cookies = browser.post('/api/session', json=RIGHT).headers.get_list('set-cookie')
    found = next(each for each in cookies if each.startswith('__Host-device='))
    assert {'HttpOnly', 'Secure', 'SameSite=strict', 'Path=/'} <= {
        each.strip() for each in found.split(';')} and 'Domain' not in found
    assert 'carl' not in found


@settings(max_examples=100, deadline=None)
@given(st.text(max_size=500))
def test_a_cookie_that_was_made_up_is_of_no_device(cookie: str) -> None:
    devices = Devices(b'k' * 32)
    assert devices.number(cookie, 'carl') == ''
    assert devices.number(devices.add(cookie, 'carl'), 'carl') != ''


def test_the_tablet_of_a_ward_is_known_to_several_accounts() -> None:
    devices, cookie = Devices(b'k' * 32), ''
    names = [f'carer {number}' for number in range(ACCOUNTS_MOST + 1)]
    for name in (*names, names[-1]):
        cookie = devices.add(cookie, name)
    known = [name for name in names if devices.number(cookie, name)]
    assert known == names[1:]
    assert len({devices.number(cookie, name) for name in known}) == 1
    assert devices.number(cookie[:-1] + ('A' if cookie[-1] != 'A' else 'B'), names[-1]) == ''
    assert Devices(b'x' * 32).number(cookie, names[-1]) == ''


@pytest.mark.parametrize(('addresses', 'is_delayed'), [(1, False), (2, False), (20, True)])
def test_the_account_is_delayed_for_strangers_by_guessing_from_many_addresses_alone(
        addresses: int, is_delayed: bool) -> None:
    clock = Clock()
    found = LockOut(clock)
    for number in range(600):
        found.begin('carl', f'10.0.0.{number % addresses}')
        clock.forward(0.1)
    assert (found.begin('carl', '10.1.1.1') > 0) is is_delayed


def test_a_password_that_could_not_be_compared_is_not_a_wrong_one() -> None:
    found = LockOut(Clock())
    for _ in range(10):
        assert found.begin('carl', TABLET) == 0
        found.withdraw('carl', TABLET)
