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
import json
from pathlib import Path
import secrets

import pytest

pytest.importorskip('fastapi')
pytest.importorskip('sqlalchemy')
pytest.importorskip('argon2')
pytest.importorskip('httpx')

from accounts_app import BASE  # noqa: E402, I100
from accounts_app import Monitor  # noqa: E402
from accounts_app import monitor  # noqa: E402
from accounts_app import PASSWORD  # noqa: E402
from rt_robot_os.monitor.security.accounts import Revoked  # noqa: E402
from rt_robot_os.monitor.security.roles import Role  # noqa: E402

OTHER = 'green table lamp'


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


def test_a_link_for_the_first_account_is_void_after_a_day_and_when_a_new_one_is_made(
        server: Monitor) -> None:
    form = {'name': 'Mary', 'password': PASSWORD}
    tokens = [str(server.accounts.setup_link(BASE)).rpartition('/')[2] for _ in range(2)]
    assert server.client().post('/api/setup', json={**form, 'token': tokens[0]}
                                ).status_code == 404
    server.clock.forward(24 * 3600 + 1)
    assert server.client().post('/api/setup', json={**form, 'token': tokens[1]}
                                ).status_code == 404
    assert server.accounts.users.all() == []


def test_the_link_for_the_first_account_is_void_when_there_is_one_by_the_console(
        server: Monitor) -> None:
    token = str(server.accounts.setup_link(BASE)).rpartition('/')[2]
    server.user('mary', Role.OWNER)
    form = {'token': token, 'name': 'mallory', 'password': PASSWORD}
    assert server.client().post('/api/setup/check', json={'token': token}).status_code == 404
    assert server.client().post('/api/setup', json=form).status_code == 404
    assert server.accounts.invitations.use(token, 'mallory', 'h', Role.OWNER) is None
    assert [user.name for user in server.accounts.users.all()] == ['mary']


def test_a_link_whose_form_is_refused_stays_good(server: Monitor) -> None:
    token = str(server.accounts.setup_link(BASE)).rpartition('/')[2]
    browser = server.client()
    for wrong in ({'password': 'short'}, {'name': '<b>'}, {'role': 'viewer'}, {'role': 'king'}):
        form = {'token': token, 'name': 'Mary', 'password': PASSWORD, **wrong}
        answer = browser.post('/api/setup', json=form)
        assert answer.status_code == 422, wrong
        assert set(answer.json()['detail']) == {'text', 'remedy'}
    assert browser.post('/api/setup', json={
        'token': token, 'name': 'Mary', 'password': PASSWORD}).status_code == 200


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


def test_the_database_has_no_cookie_no_token_and_no_link(server: Monitor, tmp_path: Path) -> None:
    browser = server.signed_in('carl', Role.CARER)
    user = server.accounts.users.find('carl')
    assert user is not None
    link = server.accounts.invitations.make(user.id)
    _, token = server.accounts.robots.add('r1')
    content = b''.join(path.read_bytes() for path in tmp_path.glob('monitor.db*'))
    assert b'carl' in content
    for secret in (browser.cookies['session'], link, token, PASSWORD):
        assert secret.encode() not in content


def test_cookies_that_were_made_up_or_changed_are_none(server: Monitor) -> None:
    good = server.signed_in('carl', Role.CARER).cookies['session']
    user = server.accounts.users.find('carl')
    assert user is not None
    session = server.accounts.sessions.of()[0]['id']
    forged = (good[:-1] + ('A' if good[-1] != 'A' else 'B'), good.swapcase(), good + 'A',
              secrets.token_urlsafe(32), session, user.id, '', 'x' * 5000, "' OR 1=1 --",
              'null', '../../etc/passwd')
    for cookie in forged:
        thief = server.client()
        thief.cookies['session'] = cookie
        assert thief.get('/api/session').status_code == 401, cookie[:50]


def test_a_cookie_from_before_the_login_is_not_taken_over(server: Monitor) -> None:
    """Somebody who plants a cookie must not share the session of who then logs in."""
    server.user('carl')
    planted = secrets.token_urlsafe(32)
    browser = server.client()
    browser.cookies['session'] = planted
    answer = browser.post('/api/session', json={'name': 'carl', 'password': PASSWORD})
    assert planted not in answer.headers['set-cookie']
    thief = server.client()
    thief.cookies['session'] = planted
    assert thief.get('/api/session').status_code == 401


def test_to_log_in_anew_ends_the_session_that_the_browser_had(server: Monitor) -> None:
    browser = server.signed_in('carl', Role.CARER)
    before = browser.cookies['session']
    browser.post('/api/session', json={'name': 'carl', 'password': PASSWORD})
    assert browser.cookies['session'] != before
    assert len(server.accounts.sessions.of()) == 1


def test_the_cookie_is_for_this_host_alone(server: Monitor) -> None:
    server.user('carl')
    login = {'name': 'carl', 'password': PASSWORD}
    plain = server.client().post('/api/session', json=login).headers['set-cookie']
    secure = server.client('https://monitor.local:8443').post('/api/session', json=login
                                                              ).headers['set-cookie']
    assert plain.startswith('session=') and secure.startswith('__Host-session=')
    for cookie in (plain, secure):
        assert 'HttpOnly' in cookie and 'SameSite=strict' in cookie and 'Path=/' in cookie
        assert 'Domain' not in cookie
    assert 'Secure' in secure


def test_with_tls_a_cookie_without_the_prefix_is_none(server: Monitor) -> None:
    good = server.signed_in('carl', Role.CARER).cookies['session']
    browser = server.client('https://monitor.local:8443')
    browser.cookies['session'] = good
    assert browser.get('/api/session').status_code == 401


def test_a_session_ends_for_good_after_twelve_hours(server: Monitor) -> None:
    browser = server.signed_in('vera', Role.VIEWER)
    for _ in range(11):
        server.clock.forward(3600)
        assert browser.get('/api/session').status_code == 200
    server.clock.forward(3600)
    assert browser.get('/api/session').status_code == 401


def test_an_untouched_session_keeps_alarms_in_sight_and_changes_nothing(server: Monitor) -> None:
    browser = server.signed_in('olga', Role.OWNER)
    server.clock.forward(899)
    assert browser.get('/api/users').status_code == 200
    server.clock.forward(899)
    assert browser.get('/api/users', headers={'x-background': '1'}).status_code == 200
    server.clock.forward(2)
    found = browser.get('/api/session').json()
    assert found['locked'] is True and found['permissions'] == ['health', 'see']
    refused = browser.get('/api/users')
    assert refused.status_code == 401 and refused.json()['detail']['reason'] == 'locked'
    # To ask does not open it again; the password does.
    assert browser.get('/api/session').json()['locked'] is True
    again = browser.post('/api/session', json={'name': 'olga', 'password': PASSWORD})
    assert again.json()['locked'] is False and 'admin' in again.json()['permissions']


def test_a_locked_session_breaks_no_glass(server: Monitor) -> None:
    browser = server.signed_in('carl', Role.CARER, people=())
    server.clock.forward(901)
    answer = browser.post('/api/session/emergency', json={
        'person': 'anna', 'reason': 'she calls for help'})
    assert answer.status_code == 401


def test_a_new_password_ends_all_other_sessions(server: Monitor) -> None:
    here = server.signed_in('carl', Role.CARER)
    there = server.signed_in('carl')
    wrong = here.post('/api/password', json={'old': 'wrong wrong wrong', 'new': OTHER})
    assert wrong.status_code == 403
    before = here.cookies['session']
    assert here.post('/api/password', json={'old': PASSWORD, 'new': OTHER}).status_code == 200
    assert here.get('/api/session').status_code == 200
    assert here.cookies['session'] != before
    assert there.get('/api/session').status_code == 401
    assert server.client().post('/api/session', json={
        'name': 'carl', 'password': PASSWORD}).status_code == 401


def test_log_out_everywhere_ends_each_session_and_tells_its_connections(server: Monitor) -> None:
    told: list[Revoked] = []
    server.accounts.on_revoked(told.append)
    server.user('carl')
    browsers = [server.signed_in('carl') for _ in range(3)]
    assert browsers[0].delete('/api/sessions').json() == {'ended': 3}
    assert {each.code for each in told} == {4401} and len(told) == 3
    assert {each.get('/api/session').status_code for each in browsers} == {401}


def test_one_ends_only_sessions_of_ones_own(server: Monitor) -> None:
    mine = server.signed_in('carl', Role.CARER)
    other = server.signed_in('vera', Role.VIEWER)
    theirs = other.get('/api/sessions').json()[0]['id']
    assert mine.delete(f'/api/sessions/{theirs}').status_code == 404
    assert other.get('/api/session').status_code == 200
    assert len(mine.get('/api/sessions').json()) == 1


def test_what_another_process_ends_is_noted_by_the_one_that_looks(server: Monitor) -> None:
    told: list[Revoked] = []
    server.accounts.on_revoked(told.append)
    browser = server.signed_in('carl', Role.CARER)
    session = server.accounts.sessions.find(browser.cookies['session'])
    assert session is not None
    server.accounts.follow(session)
    robot, token = server.accounts.robots.add('r1')
    server.accounts.follow_robot(robot.id, 'another token')
    server.accounts.look()
    assert [(each.kind, each.id) for each in told] == [('robot', robot.id)]
    server.accounts.users.change(session.user, 'test', people=['bert'])
    server.accounts.look()
    assert (told[-1].kind, told[-1].code) == ('session', 4403)
    server.accounts.follow(session)
    server.accounts.sessions.end(session.id)
    server.accounts.look()
    assert (told[-1].id, told[-1].code) == (session.id, 4401)
    assert not server.accounts.alive(session.id)


def test_the_oldest_session_gives_way(server: Monitor) -> None:
    first = server.signed_in('carl', Role.CARER)
    for _ in range(20):
        server.clock.forward(1)
        server.signed_in('carl')
    assert len(server.accounts.sessions.of()) == 20
    assert first.get('/api/session').status_code == 401


def test_access_in_an_emergency_is_short_and_flagged_and_seen_by_admins(server: Monitor) -> None:
    carer = server.signed_in('carl', Role.CARER, people=('bert',))
    reason = 'anna fell and nobody is there'
    short = carer.post('/api/session/emergency', json={'person': 'anna', 'reason': 'fall'})
    assert short.status_code == 422
    assert carer.post('/api/session/emergency', json={
        'person': 'anna', 'reason': reason}).status_code == 200
    # The pages of admins are told at once, and nobody else's.
    assert [json.loads(text)['person'] for text in server.told['adam']] == ['anna']
    assert server.told['vera'] == []
    assert carer.get('/api/session').json()['people'] == ['anna', 'bert']
    # For this session alone.
    assert server.signed_in('carl').get('/api/session').json()['people'] == ['bert']
    row = next(row for row in server.accounts.audit.all_rows()
               if row['action'] == 'emergency.begin')
    assert row['details']['reason'] == reason and row['details']['flag'] == 'emergency'
    admin = server.signed_in('adam', Role.ADMIN, people=())
    shown = admin.get('/api/emergencies').json()[0]
    assert (shown['name'], shown['person'], shown['is_open']) == ('carl', 'anna', True)
    server.clock.forward(1801)
    server.signed_in('carl')
    assert carer.get('/api/session').json()['people'] == ['bert']


def test_an_admin_has_health_data_in_an_emergency_only(server: Monitor) -> None:
    admin = server.signed_in('adam', Role.ADMIN, people=())
    assert 'health' not in admin.get('/api/session').json()['permissions']
    admin.post('/api/session/emergency', json={'person': 'anna', 'reason': 'she calls for help'})
    found = admin.get('/api/session').json()
    assert 'health' in found['permissions'] and found['people'] == ['anna']
    admin.delete('/api/session/emergency')
    assert 'health' not in admin.get('/api/session').json()['permissions']


def test_a_viewer_has_no_access_in_emergencies(server: Monitor) -> None:
    viewer = server.signed_in('vera', Role.VIEWER, people=())
    answer = viewer.post('/api/session/emergency', json={
        'person': 'anna', 'reason': 'she calls for help'})
    assert answer.status_code == 403


def test_bodies_hold_what_is_expected_and_nothing_more(server: Monitor) -> None:
    browser = server.signed_in('carl', Role.CARER)
    wrong = (
        ('/api/session', {'name': 'carl', 'password': PASSWORD, 'role': 'admin'}),
        ('/api/session', {'name': 'carl'}), ('/api/session', ['carl', PASSWORD]),
        ('/api/session', {'name': {'$ne': ''}, 'password': PASSWORD}),
        ('/api/session', {'name': 'carl', 'password': 'x' * 300}),
        ('/api/password', {'old': PASSWORD, 'new': OTHER, 'user': 'adam'}),
        ('/api/session/emergency', {'person': 'anna', 'reason': 'r' * 20, 'ends_ns': 1 << 62}))
    for path, body in wrong:
        assert browser.post(path, content=json.dumps(body), headers={
            'content-type': 'application/json'}).status_code == 422, body
    form = browser.post('/api/session', data={'name': 'carl', 'password': PASSWORD})
    assert form.status_code in (415, 422)
    assert browser.get('/api/session').json()['role'] == 'carer'
