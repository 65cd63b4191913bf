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

"""Passwords: which are taken, how they are kept, and what happens to those who guess."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from pathlib import Path
import threading
from typing import Any

from argon2 import PasswordHasher
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest

pytest.importorskip('fastapi')
pytest.importorskip('sqlalchemy')
pytest.importorskip('argon2')
pytest.importorskip('httpx')

from accounts_app import Clock  # noqa: E402, I100
from accounts_app import Monitor  # noqa: E402
from accounts_app import monitor  # noqa: E402
from accounts_app import PASSWORD  # noqa: E402
from accounts_app import QUICK  # noqa: E402
from accounts_app import SECOND_NS  # noqa: E402
from rt_robot_os.monitor.security import passwords  # noqa: E402
from rt_robot_os.monitor.security.limits import LockOut  # noqa: E402
from rt_robot_os.monitor.security.limits import network_of  # noqa: E402
from rt_robot_os.monitor.security.limits import Rate  # noqa: E402
from rt_robot_os.monitor.security.passwords import BusyError  # noqa: E402
from rt_robot_os.monitor.security.passwords import check_rules  # noqa: E402
from rt_robot_os.monitor.security.passwords import Passwords  # noqa: E402
from rt_robot_os.monitor.security.roles import Role  # noqa: E402

WRONG = 'not the one at all'
KEPT = Passwords(QUICK)


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Monitor]:
    with monitor(tmp_path) as found:
        yield found


@pytest.mark.parametrize('password', [
    'short', 'elevenchars', 'password1234', 'Password2026!', '123456789012', 'aaaaaaaaaaaa',
    'qwertyuiop123', 'margarete123', 'x' * 129, 'passwordpassword', '            '])
def test_what_is_tried_first_is_refused(password: str) -> None:
    with pytest.raises(ValueError, match='password'):
        check_rules(password, 'Margarete')


@pytest.mark.parametrize('password', [
    PASSWORD, 'nur kleine buchstaben', 'ein Wörtchen äöü', '密码密码密码很长很好一二三', 'x9' * 32 + 'abc'])
def test_no_kind_of_letter_is_demanded_or_forbidden(password: str) -> None:
    check_rules(password, 'mary')


@settings(max_examples=50, deadline=None)
@given(st.text(max_size=60), st.text(max_size=60))
def test_a_password_is_right_and_no_other_is(one: str, other: str) -> None:
    stored = KEPT.hash(one)
    assert KEPT.matches(stored, one)
    if passwords._normal(one) != passwords._normal(other):
        assert not KEPT.matches(stored, other)


def test_the_default_is_the_second_choice_of_rfc_9106() -> None:
    kept = Passwords()
    assert kept._nobody.startswith('$argon2id$v=19$m=65536,t=3,p=4$')
    kept.close()


def test_a_hash_by_older_parameters_is_renewed_at_the_next_login(server: Monitor) -> None:
    older = PasswordHasher(time_cost=1, memory_cost=16, parallelism=1).hash(PASSWORD)
    server.accounts.users.add('carl', Role.CARER, (), 'test', older)
    server.signed_in('carl')
    user = server.accounts.users.find('carl')
    assert user is not None and user.password != older
    assert not server.accounts.passwords.is_old(user.password)
    server.signed_in('carl')


def test_only_a_few_are_compared_at_once_and_only_so_many_wait() -> None:
    """A thousand logins at once take no more memory than two."""
    begun = threading.Semaphore(0)
    go_on = threading.Event()
    most = [0]

    class Slow:
        def hash(self, password: str) -> str:  # noqa: A003
            return 'h'

        def verify(self, stored: str, password: str) -> bool:
            most[0] += 1
            begun.release()
            go_on.wait(60)
            return True

    async def run() -> None:
        kept = Passwords(Slow())  # type: ignore[arg-type]
        tasks = [asyncio.create_task(kept.matches_soon('h', 'p'))
                 for _ in range(passwords.PARALLEL + passwords.WAITING)]
        await asyncio.sleep(0)
        for _ in range(passwords.PARALLEL):
            await asyncio.to_thread(begun.acquire)
        with pytest.raises(BusyError):
            await kept.matches_soon('h', 'p')
        assert most[0] == passwords.PARALLEL
        go_on.set()
        assert all(await asyncio.gather(*tasks))
        kept.close()

    asyncio.run(run())


def test_who_does_not_exist_is_compared_and_answered_like_who_does(server: Monitor) -> None:
    """No user is found out by the answer, nor by the work that is done for it."""
    server.user('carl')
    disabled = server.user('dora')
    server.accounts.users.change(disabled.id, 'test', is_disabled=True)
    server.accounts.users.add('ivan', Role.CARER, (), 'test')
    compared: list[str] = []
    real = server.accounts.passwords._hasher

    class Seen:
        def verify(self, stored: str, password: str) -> bool:
            compared.append(stored.rpartition('$')[0].rpartition('$')[0])
            return real.verify(stored, password)

    hasher: Any = Seen()
    server.accounts.passwords._hasher = hasher
    answers = []
    for name, password in (('carl', WRONG), ('nobody', WRONG), ('dora', PASSWORD),
                           ('dora', WRONG), ('ivan', ''), ('ivan', WRONG)):
        server.clock.forward(3600)
        answer = server.client().post('/api/session', json={'name': name, 'password': password})
        answers.append((answer.status_code, answer.content))
    assert len(set(answers)) == 1 and answers[0][0] == 401
    assert len(compared) == 6 and len(set(compared)) == 1
    assert server.accounts.sessions.of() == []


def test_who_guesses_waits_longer_and_longer_and_never_for_ever(server: Monitor) -> None:
    server.user('carl')
    waits = []
    for _ in range(9):
        browser = server.client()
        answer = browser.post('/api/session', json={'name': 'carl', 'password': WRONG})
        while answer.status_code == 429:
            # Nor is the right password tried while one waits: that would make it no wait.
            assert browser.post('/api/session', json={
                'name': 'carl', 'password': PASSWORD}).status_code == 429
            waits.append(int(answer.headers['retry-after']))
            server.clock.forward(waits[-1])
            answer = browser.post('/api/session', json={'name': 'carl', 'password': WRONG})
        assert answer.status_code == 401
    assert waits == sorted(waits) and waits[0] <= 2 and max(waits) <= 61 and len(waits) == 7
    server.clock.forward(61)
    server.signed_in('carl')


def test_names_that_do_not_exist_are_delayed_alike(server: Monitor) -> None:
    server.user('carl')
    found = []
    for name in ('carl', 'nobody'):
        server.clock.forward(3600)
        found.append([server.client().post('/api/session', json={
            'name': name, 'password': WRONG}).status_code for _ in range(4)])
    assert found[0] == found[1] == [401, 401, 429, 429]


def test_a_stranger_who_guesses_keeps_nobody_out() -> None:
    """The account is delayed for strangers; who came from his tablet before is not."""
    clock = Clock()
    found = LockOut(clock)
    assert found.begin('carl', '192.168.1.20') == 0
    found.succeed('carl', '192.168.1.20')
    for number in range(40):
        while wait := found.begin('carl', f'10.0.0.{number}'):
            clock.forward(wait + 0.001)
    assert found.begin('carl', '10.1.1.1') > 30
    assert found.begin('carl', '192.168.1.20') == 0


def test_one_address_that_tries_many_names_is_delayed() -> None:
    clock = Clock()
    found = LockOut(clock)
    assert [found.begin(f'user{number}', '10.0.0.1') > 0 for number in range(4)] == [
        False, False, True, True]
    assert found.begin('user9', '10.0.0.2') == 0


def test_to_log_in_to_ones_own_account_gives_no_more_guesses_at_others() -> None:
    clock = Clock()
    found = LockOut(clock)
    waits = []
    for number in range(12):
        waits.append(found.begin(f'user{number}', '10.0.0.1'))
        clock.forward(waits[-1])
        if waits[-1]:
            found.begin(f'user{number}', '10.0.0.1')
        found.begin('mallory', '10.0.0.1')
        found.succeed('mallory', '10.0.0.1')
    assert max(waits) > 30


def test_an_address_is_what_one_subscriber_has() -> None:
    assert network_of('2001:db8:1:2:3:4:5:6') == network_of('2001:db8:1:2::1')
    assert network_of('2001:db8:1:2::1') != network_of('2001:db8:1:3::1')
    assert network_of('::ffff:10.0.0.1') == network_of('10.0.0.1') != network_of('10.0.0.2')
    assert network_of('testclient') == 'testclient'


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.sampled_from('abc'), st.sampled_from(('10.0.0.1', '10.0.0.2')),
                          st.booleans(), st.floats(0, 100)), max_size=60))
def test_the_wait_is_never_longer_than_a_minute(steps: list[tuple[str, str, bool, float]]) -> None:
    clock = Clock()
    found = LockOut(clock)
    for account, address, is_right, passes in steps:
        clock.forward(passes)
        wait = found.begin(account, address)
        assert 0 <= wait <= 60
        clock.forward(wait)
        assert found.begin(account, address) == 0 or wait == 0
        if is_right:
            found.succeed(account, address)
            assert found.begin(account, address) == 0


def test_a_bucket_gives_what_it_has_and_fills_again() -> None:
    clock = Clock()
    rate = Rate(10.0, 5, clock)
    assert [rate.take('a') > 0 for _ in range(7)] == [False] * 5 + [True] * 2
    assert rate.take('b') == 0 and rate.refused == 2
    clock.ns += SECOND_NS // 10
    assert rate.take('a') == 0 and rate.take('a') > 0
    for number in range(20_000):
        rate.take(str(number))
    assert len(rate._buckets) <= 10_000
