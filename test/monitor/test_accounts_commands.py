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

"""Accounts by the command line and by admins in the browser."""

from __future__ import annotations

from collections.abc import Iterator
import io
import json
from pathlib import Path
import stat

import pytest

pytest.importorskip('fastapi')
pytest.importorskip('sqlalchemy')
pytest.importorskip('argon2')
pytest.importorskip('httpx')

from accounts_app import empty_database  # noqa: E402, I100
from accounts_app import Monitor  # noqa: E402
from accounts_app import monitor  # noqa: E402
from accounts_app import PASSWORD  # noqa: E402
from accounts_app import QUICK  # noqa: E402
from rt_robot_os.base.errors import StartError  # noqa: E402
from rt_robot_os.monitor.command import run  # noqa: E402
from rt_robot_os.monitor.security import passwords  # noqa: E402
from rt_robot_os.monitor.security.accounts import Revoked  # noqa: E402
from rt_robot_os.monitor.security.roles import Role  # noqa: E402


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Monitor]:
    with monitor(tmp_path) as found:
        yield found


class Console:
    """Runs commands on a folder."""

    def __init__(self, folder: Path, patch: pytest.MonkeyPatch,
                 capture: pytest.CaptureFixture[str]) -> None:
        """Use this folder."""
        self._folder = folder
        self._patch = patch
        self._capture = capture
        (folder / 'monitor.db').write_bytes(empty_database())

    def __call__(self, *words: str, typed: str = '') -> tuple[int, str]:
        """Run it; give its exit code and what it printed."""
        self._patch.setattr('sys.stdin', io.StringIO(typed))
        code = run([*words[:2], '--folder', str(self._folder), *words[2:]])
        found = self._capture.readouterr()
        return code, found.out + found.err


@pytest.fixture
def console(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
            capsys: pytest.CaptureFixture[str]) -> Console:
    monkeypatch.setattr(passwords, 'PasswordHasher', lambda **_: QUICK)
    return Console(tmp_path, monkeypatch, capsys)


def test_users_are_added_changed_and_kept_out(console: Console) -> None:
    assert console('user', 'list')[1].startswith('no users')
    code, out = console('user', 'add', 'Mary', '--role', 'owner', '--people', '*',
                        typed=f'{PASSWORD}\n')
    assert code == 0 and PASSWORD not in out
    code, out = console('user', 'add', 'mary', typed=f'{PASSWORD}\n')
    assert code == 2 and 'exists' in out
    assert console('user', 'add', 'bob', typed='short\n')[0] == 2
    code, out = console('user', 'add', 'bob', '--role', 'carer', '--link', 'https://m.local:8443')
    assert code == 0 and 'https://m.local:8443/#/setup/' in out
    assert console('user', 'grant', 'bob', 'anna', 'bert')[0] == 0
    assert console('user', 'role', 'bob', 'operator')[0] == 0
    users = json.loads(console('user', 'list', '--json')[1])
    assert [(user['name'], user['role'], user['people']) for user in users] == [
        ('bob', 'operator', ['anna', 'bert']), ('Mary', 'owner', ['*'])]
    assert console('user', 'disable', 'bob')[0] == 0
    code, out = console('user', 'disable', 'mary')
    assert code == 2 and 'no administrator of the monitor' in out
    assert console('user', 'password', 'nobody', typed=f'{PASSWORD}\n')[0] == 2
    code, out = console('audit', 'verify')
    assert code == 0 and 'the chain is intact' in out


def test_a_robot_has_a_token_that_is_shown_once(console: Console, tmp_path: Path) -> None:
    code, token = console('robot', 'add', 'r1')
    assert code == 0 and len(token.strip()) == 43
    assert console('robot', 'add', 'r1')[0] == 2
    assert token.strip() not in console('robot', 'list', '--json')[1]
    assert console('robot', 'revoke', 'r1')[0] == 0
    file = tmp_path / 'token'
    assert console('robot', 'add', 'r1', '--token-file', str(file))[0] == 0
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert file.read_text() != token
    robots = json.loads(console('robot', 'list', '--json')[1])
    assert len(robots) == 1 and robots[0]['revoked_ns'] is None
    assert console('robot', 'revoke', 'r9')[0] == 2


def test_a_broken_chain_is_the_exit_code(console: Console, tmp_path: Path) -> None:
    console('robot', 'add', 'r1')
    head = console('audit', 'verify')[1].split()[3]
    assert console('audit', 'verify', '--noted', head)[0] == 0
    assert console('audit', 'verify', '--noted', 'nonsense')[0] == 2
    assert json.loads(console('audit', 'export')[1])['action'] == 'robot.add'
    assert console('audit', 'verify', '--noted', f'1:{"0" * 64}')[0] == 1
    (tmp_path / 'audit.key').write_text('00' * 32)
    with pytest.raises(StartError, match='is not the one'):  # which is exit code 1 as well
        console('audit', 'verify')


def test_certificates_are_made_and_renewed(console: Console, tmp_path: Path) -> None:
    code, out = console('certificate', 'make', '--name', 'monitor.local')
    assert code == 0 and 'Install' in out and 'fingerprint' in out
    assert 'the tablets need no installation' in console('certificate', 'make')[1]
    assert console('certificate', 'check')[0] == 0
    assert console('certificate', 'make', '--days', '5')[0] == 0
    assert console('certificate', 'check')[0] == 1


def test_an_admin_invites_and_the_invitation_works_once(server: Monitor) -> None:
    admin = server.signed_in('adam', Role.ADMIN, people=())
    made = admin.post('/api/users', json={'name': 'carl', 'role': 'carer', 'people': ['anna']})
    assert made.status_code == 201 and made.json()['has_password'] is False
    guest = server.client()
    checked = guest.post('/api/setup/check', json={'token': made.json()['token']}).json()
    assert (checked['first'], checked['name'], checked['role']) == (False, 'carl', 'carer')
    form = {'token': made.json()['token'], 'password': PASSWORD, 'name': 'eve', 'role': 'owner'}
    found = guest.post('/api/setup', json=form).json()
    # Neither name nor role are the guest's to choose.
    assert (found['user'], found['role'], found['people']) == ('carl', 'carer', ['anna'])
    assert server.client().post('/api/setup', json=form).status_code == 404
    assert server.client().post('/api/setup/check', json={'token': form['token']}
                                ).status_code == 404


def test_a_new_link_voids_the_one_before_and_a_used_one_ends_sessions(server: Monitor) -> None:
    admin = server.signed_in('adam', Role.ADMIN)
    carl = server.signed_in('carl', Role.CARER)
    user = server.accounts.users.find('carl')
    assert user is not None
    links = [admin.post(f'/api/users/{user.id}/invitation').json()['token'] for _ in range(2)]
    assert carl.get('/api/session').status_code == 200
    form = {'password': 'green table lamp'}
    assert server.client().post('/api/setup', json={**form, 'token': links[0]}
                                ).status_code == 404
    assert server.client().post('/api/setup', json={**form, 'token': links[1]}
                                ).status_code == 200
    assert carl.get('/api/session').status_code == 401
    late = admin.post(f'/api/users/{user.id}/invitation').json()['token']
    server.clock.forward(72 * 3600 + 1)
    assert server.client().post('/api/setup', json={**form, 'token': late}).status_code == 404


def test_a_link_of_who_was_kept_out_is_void(server: Monitor) -> None:
    admin = server.signed_in('adam', Role.ADMIN)
    made = admin.post('/api/users', json={'name': 'carl', 'role': 'carer'}).json()
    assert admin.patch(f"/api/users/{made['id']}", json={'disabled': True}).status_code == 200
    assert admin.post(f"/api/users/{made['id']}/invitation").status_code == 422
    assert server.client().post('/api/setup', json={
        'token': made['token'], 'password': PASSWORD}).status_code == 404


def test_who_gets_another_role_or_is_kept_out_has_no_session_left(server: Monitor) -> None:
    told: list[Revoked] = []
    server.accounts.on_revoked(told.append)
    admin = server.signed_in('adam', Role.ADMIN)
    carl = server.signed_in('carl', Role.CARER, people=('anna',))
    user = server.accounts.users.find('carl')
    assert user is not None
    path = f'/api/users/{user.id}'
    assert admin.patch(path, json={'people': ['bert']}).json()['people'] == ['bert']
    assert carl.get('/api/session').json()['people'] == ['bert']
    assert [each.code for each in told] == [4403]
    assert admin.patch(path, json={'role': 'operator'}).status_code == 200
    assert carl.get('/api/session').status_code == 401
    assert told[-1].code == 4401
    carl = server.signed_in('carl')
    assert admin.patch(path, json={'disabled': True}).json()['disabled'] is True
    assert carl.get('/api/session').status_code == 401
    assert server.client().post('/api/session', json={
        'name': 'carl', 'password': PASSWORD}).status_code == 401
    assert ('adam', 'user.change', 'carl') in server.audited()


def test_an_admin_sees_and_ends_sessions(server: Monitor) -> None:
    admin = server.signed_in('adam', Role.ADMIN)
    carl, again = server.signed_in('carl', Role.CARER), server.signed_in('carl')
    user = server.accounts.users.find('carl')
    assert user is not None
    path = f'/api/users/{user.id}/sessions'
    found = admin.get(path).json()
    assert len(found) == 2 and 'token' not in found[0]
    mine = admin.get('/api/sessions').json()[0]['id']
    assert admin.delete(f'{path}/{mine}').status_code == 404  # not one of theirs
    assert admin.delete(f"{path}/{found[0]['id']}").json() == {'ended': 1}
    assert admin.delete(path).json() == {'ended': 1}
    assert {carl.get('/api/session').status_code, again.get('/api/session').status_code} == {401}


def test_nothing_but_what_is_meant_is_changed(server: Monitor) -> None:
    admin = server.signed_in('adam', Role.ADMIN)
    server.user('carl')
    user = server.accounts.users.find('carl')
    assert user is not None
    for body in ({'password': 'x'}, {'id': 'x'}, {'name': 'x'}, {'created_ns': 1},
                 {'role': 'king'}, {'role': 1}, {'people': 'anna'}, {'people': ['a*']},
                 {'people': ['']}, {'people': ['x' * 200]}, {'people': ['a'] * 501},
                 {'disabled': 'no'}):
        answer = admin.patch(f'/api/users/{user.id}', json=body)
        assert answer.status_code == 422, body
    assert server.accounts.users.find('carl') == user


def test_the_last_who_administers_stays(server: Monitor) -> None:
    admin = server.signed_in('adam', Role.ADMIN)
    me = server.accounts.users.find('adam')
    assert me is not None
    # Who was invited and has not come is nobody yet.
    admin.post('/api/users', json={'name': 'eve', 'role': 'owner'})
    for body in ({'role': 'viewer'}, {'disabled': True}):
        answer = admin.patch(f'/api/users/{me.id}', json=body)
        assert answer.status_code == 422 and 'no administrator of the monitor' in answer.text
    assert admin.get('/api/session').json()['role'] == 'admin'


def test_names_that_are_none_or_look_like_another_are_refused(server: Monitor) -> None:
    admin = server.signed_in('adam', Role.ADMIN)
    server.user('carl')
    for name in ('', ' ', 'x' * 65, '<script>', 'a\x00b', '../x', 'a\u202eb', 'carl', 'CARL',
                 'Ｃａｒｌ'):
        answer = admin.post('/api/users', json={'name': name, 'role': 'carer'})
        assert answer.status_code == 422, name


def test_robots_are_let_in_and_kept_out_by_admins(server: Monitor) -> None:
    told: list[Revoked] = []
    server.accounts.on_revoked(told.append)
    admin = server.signed_in('adam', Role.ADMIN)
    made = admin.post('/api/tokens', json={'name': 'r1'}).json()
    assert server.accounts.robots.find(made['token']) is not None
    assert 'token' not in admin.get('/api/tokens').json()[0]
    assert admin.post('/api/tokens', json={'name': 'r1'}).status_code == 422
    assert admin.post('/api/tokens', json={'name': '../r'}).status_code == 422
    assert admin.delete(f"/api/tokens/{made['id']}").status_code == 200
    assert (told[-1].kind, told[-1].id, told[-1].code) == ('robot', made['id'], 4401)
    assert server.accounts.robots.find(made['token']) is None
    assert admin.delete(f"/api/tokens/{made['id']}").status_code == 404
