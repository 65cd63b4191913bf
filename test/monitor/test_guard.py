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

"""What stands before each endpoint of the whole server: nothing may be open by an oversight."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import suppress
import re
from typing import Any
from urllib.parse import quote

import pytest

pytest.importorskip('fastapi')
pytest.importorskip('sqlalchemy')
pytest.importorskip('argon2')
pytest.importorskip('httpx')

from fake_robot import token_of  # noqa: E402, I100
from monitor_server import let_robot_in  # noqa: E402
from monitor_server import logged_in  # noqa: E402
from monitor_server import quick_services  # noqa: E402
from processes import wait_until  # noqa: E402
from rt_robot_os.monitor.app import create_app  # noqa: E402
from rt_robot_os.monitor.security.protection import BODY_BYTES  # noqa: E402
from rt_robot_os.monitor.security.roles import Permission  # noqa: E402
from rt_robot_os.monitor.security.roles import PERMISSIONS  # noqa: E402
from rt_robot_os.monitor.security.roles import Role  # noqa: E402
from rt_robot_os.monitor.services import Services  # noqa: E402
from starlette.routing import Mount  # noqa: E402
from starlette.testclient import TestClient  # noqa: E402
from starlette.websockets import WebSocketDisconnect  # noqa: E402

#: All that answers somebody who is not logged in; each line has its reason.
OPEN = {
    ('GET', '/healthz'),            # whether it runs, and nothing else
    ('GET', '/api/openapi.json'),   # what endpoints there are, which the package says as well
    ('GET', '/api/setup'),          # whether there is a first account yet
    ('POST', '/api/session'),       # to log in
    ('POST', '/api/setup'),         # by a one-time link
    ('POST', '/api/setup/check')}
BASE = 'http://localhost'
SOCKETS = 'ws://localhost'
#: Names that the tests put in the place of ids of robots, people, users, sessions.
SOMEBODY = 'anna'


@pytest.fixture(scope='module')
def services(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Services]:
    found = quick_services(tmp_path_factory.mktemp('guard'))
    yield found
    found.writer.close()
    found.accounts.close()
    found.store.close()


@pytest.fixture(scope='module')
def app(services: Services) -> Any:
    return create_app(services)


@pytest.fixture
def stranger(app: Any) -> TestClient:
    return TestClient(app, BASE, client=('127.0.0.1', 1), raise_server_exceptions=False)


def routes(app: Any) -> list[tuple[str, str]]:
    """Return method and path of each endpoint; a WebSocket's method is WS."""
    found = []
    waiting = list(app.routes)
    while waiting:
        each = waiting.pop()
        if hasattr(each, 'original_router'):
            waiting += each.original_router.routes
        elif getattr(each, 'methods', None):
            found += [(method, each.path) for method in each.methods - {'HEAD', 'OPTIONS'}]
        elif not isinstance(each, Mount):
            found.append(('WS', each.path))
    return sorted(found)


def filled(path: str, name: str = SOMEBODY) -> str:
    return re.sub(r'{\w+(:\w+)?}', quote(name, safe=''), path)


def ask(client: TestClient, method: str, path: str, **more: Any) -> Any:
    body = {'json': {}} if method in ('POST', 'PUT', 'PATCH') else {}
    return client.request(method, filled(path), **{**body, **more})


def test_every_endpoint_but_a_short_list_demands_a_session(app: Any, stranger: TestClient
                                                           ) -> None:
    found = routes(app)
    assert len(found) > 35
    assert OPEN <= set(found)
    for method, path in found:
        if method != 'WS' and (method, path) not in OPEN:
            answer = ask(stranger, method, path)
            assert answer.status_code == 401, (method, path, answer.status_code)
            assert answer.json()['detail']['reason'] == 'login'


def test_no_websocket_opens_without_a_session_or_a_token(app: Any, stranger: TestClient) -> None:
    found = [path for method, path in routes(app) if method == 'WS']
    assert {'/live', '/camera', '/robot/state', '/robot/media'} <= set(found)
    for path in found:
        for headers in ({}, {'cookie': 'session=made-up-made-up-made-up'},
                        {'authorization': 'Bearer made-up-made-up-made-up'}):
            with pytest.raises(WebSocketDisconnect):
                with stranger.websocket_connect(f'{SOCKETS}{path}?robot=robot', headers=headers):
                    pass  # pragma: no cover


def test_no_websocket_opens_from_the_page_of_another_site(app: Any, services: Services,
                                                          stranger: TestClient) -> None:
    opened: list[Any] = []
    cookie = logged_in(services, 'wendy')['Cookie']
    for path in (path for method, path in routes(app) if method == 'WS'
                 and not path.startswith('/robot/')):
        with suppress(CancelledError, WebSocketDisconnect):
            with stranger.websocket_connect(f'{SOCKETS}{path}?robot=robot', headers={
                    'cookie': cookie, 'origin': BASE}) as own:
                opened.append(own.accepted_subprotocol)
        for headers in ({'origin': 'https://evil.example'}, {'origin': 'null'},
                        {'origin': 'http://localhost:81'}, {'origin': 'https://localhost'},
                        {'origin': 'http://localhost.evil.example'},
                        {'sec-fetch-site': 'cross-site'}, {'sec-fetch-site': 'same-site'},
                        {'host': 'evil.example', 'origin': 'http://evil.example'}):
            with pytest.raises(WebSocketDisconnect):
                with stranger.websocket_connect(f'{SOCKETS}{path}?robot=robot', headers={
                        'cookie': cookie, **headers}):
                    pass  # pragma: no cover
    assert len(opened) >= 3  # it is the origin that is refused


def test_who_watches_what_is_live_is_noted_once(services: Services, stranger: TestClient) -> None:
    headers = {'cookie': logged_in(services, 'wanda', Role.VIEWER, ('anna',))['Cookie']}
    for _ in range(3):
        with suppress(CancelledError):
            with stranger.websocket_connect(f'{SOCKETS}/live', headers=headers) as live:
                live.receive_text()
    wait_until(lambda: not services.audit.waiting, 'the audit')  # written behind the connection
    rows = services.audit.rows(name='wanda')
    assert [(row['action'], row['object'], row['details']) for row in rows] == [
        ('socket.open', '/live', {'people': ['anna']})]


def test_no_browser_opens_the_connection_of_a_robot(services: Services, stranger: TestClient
                                                    ) -> None:
    cookie = logged_in(services, 'nora')['Cookie']
    for path in ('/robot/state', '/robot/media'):
        with pytest.raises(WebSocketDisconnect):
            with stranger.websocket_connect(SOCKETS + path, headers={
                    'cookie': cookie, 'origin': BASE}):
                pass  # pragma: no cover


@pytest.mark.parametrize('wrong', [
    {}, {'x-csrf-token': 'made up'}, {'x-csrf-token': ''},
    {'good': '1', 'origin': 'https://evil.example'}, {'good': '1', 'origin': 'null'},
    {'good': '1', 'sec-fetch-site': 'cross-site'}, {'good': '1', 'sec-fetch-site': 'same-site'},
    {'good': '1', 'host': 'evil.example', 'origin': 'http://evil.example'}])
def test_nothing_changes_at_the_wish_of_another_site(app: Any, services: Services,
                                                     stranger: TestClient, wrong: dict[str, str]
                                                     ) -> None:
    headers = logged_in(services, f'olga {abs(hash(str(wrong)))}')
    sent = {'cookie': headers['Cookie'], **wrong}
    if sent.pop('good', ''):
        sent['x-csrf-token'] = headers['X-CSRF-Token']
    for method, path in routes(app):
        if method not in ('GET', 'WS') and (method, path) not in OPEN:
            answer = ask(stranger, method, path, headers=sent)
            assert answer.status_code in (403, 421), (method, path, answer.text)
    assert services.accounts.sessions.find(headers['Cookie'].partition('=')[2]) is not None


def test_to_log_in_is_not_done_for_another_site_either(stranger: TestClient) -> None:
    login = {'name': 'mallory', 'password': 'seven wet umbrellas'}
    for method, path in sorted(OPEN):
        if method == 'POST':
            answer = stranger.post(path, json=login, headers={'origin': 'https://evil.example'})
            assert answer.status_code == 403, path
            form = stranger.post(path, data=login)
            assert form.status_code in (415, 422), path


def test_what_each_endpoint_needs_is_what_the_role_has(app: Any, services: Services) -> None:
    """Of each endpoint that asks for a permission: who does not have it is refused."""
    needs = {}
    waiting = list(app.routes)
    while waiting:
        each = waiting.pop()
        waiting += each.original_router.routes if hasattr(each, 'original_router') else []
        for one in getattr(getattr(each, 'dependant', None), 'dependencies', ()):
            permission = getattr(one.call, 'permission', None)
            if permission is not None and getattr(each, 'methods', None):
                needs[next(iter(each.methods)), each.path] = permission
    assert len(needs) > 20 and set(needs.values()) >= {
        Permission.SEE, Permission.HEALTH, Permission.ADMIN, Permission.AUDIT}
    for role in Role:
        client = TestClient(app, BASE, headers={**logged_in(services, f'role {role.value}', role),
                                                'origin': BASE})
        for (method, path), permission in needs.items():
            if permission not in PERMISSIONS[role]:
                answer = ask(client, method, path)
                assert answer.status_code == 403, (role, method, path, answer.status_code)


def test_a_person_who_is_not_granted_is_not_even_named(app: Any, services: Services) -> None:
    """Whatever takes an id answers alike for who is not granted and for who does not exist."""
    people = {'anna': 'the one', 'zoe': 'who is nobody'}
    services.store.add('robot', 'boot', [
        {'seq': 1, 'importance': 3, 'type': 'observation', 'utc_ns': 1_790_000_000_000_000_000,
         'content': {'person': 'anna', 'sign': 'pulse_per_min', 'value': 61.0, 'quality': 'good',
                     'source': 'wrist'}},
        {'seq': 2, 'importance': 0, 'type': 'alarm_event', 'utc_ns': 1_790_000_000_000_000_000,
         'content': {'seq': 2, 'alarm': '7', 'event': 'raised', 'state': 'raised',
                     'level': 'critical', 'subject': 'anna', 'kinds': ['fall'],
                     'text': 'anna lies in the hall', 'by': '', 'why': ''}}])
    client = TestClient(app, BASE, headers={
        **logged_in(services, 'bruno', Role.OPERATOR, ('bert',)), 'origin': BASE})
    granted = TestClient(app, BASE, headers={
        **logged_in(services, 'anton', Role.OPERATOR, ('anna',)), 'origin': BASE})
    assert '61' in granted.get('/api/observations?person=anna').text
    for method, path in routes(app):
        if method == 'GET' and path not in ('/api/openapi.json', '/healthz'):
            answers = {name: client.get(filled(path, name), params={
                'person': name, 'sign': 'pulse_per_min', 'start_ns': 0,
                'end_ns': 1_900_000_000_000_000_000, 'pixels': 100}) for name in people}
            assert answers['anna'].status_code == answers['zoe'].status_code, path
            for name, answer in answers.items():
                assert 'lies in the hall' not in answer.text, path
                assert '61.0' not in answer.text, path
                if name == 'zoe':
                    assert 'anna' not in answer.text, path
    for alarm in ('7', '8'):
        found = client.get(f'/api/alarms/robot/{alarm}')
        assert found.status_code == 404 and 'anna' not in found.text
        assert client.post(f'/api/alarms/robot/{alarm}/notes', json={'text': 'x'}
                           ).status_code == 404


def test_each_answer_has_the_headers_that_a_browser_is_told_by(app: Any, stranger: TestClient
                                                               ) -> None:
    for path in ('/', '/app.js', '/healthz', '/api/session', '/api/none', '/none'):
        headers = stranger.get(path).headers
        policy = headers['content-security-policy']
        assert "default-src 'none'" in policy and "frame-ancestors 'none'" in policy
        assert 'unsafe' not in policy and 'http' not in policy
        assert headers['x-content-type-options'] == 'nosniff'
        assert headers['referrer-policy'] == 'no-referrer'
        assert headers['x-frame-options'] == 'DENY'
        assert 'microphone=(self), camera=(self)' in headers['permissions-policy']
        assert 'geolocation=()' in headers['permissions-policy']
        assert 'server' not in headers and 'x-powered-by' not in headers
        assert ('no-store' in headers.get('cache-control', '')) == path.startswith('/api/')
        assert 'strict-transport-security' not in headers
    secure = TestClient(app, 'https://monitor.local:8443').get('/').headers
    assert secure['strict-transport-security'] == 'max-age=31536000'


def test_without_tls_the_server_answers_to_its_own_names_only(stranger: TestClient) -> None:
    """A site whose name was made to point to 127.0.0.1 gets nothing."""
    for host in ('evil.example', 'localhost.evil.example', '10.0.0.1', ''):
        assert stranger.get('/api/session', headers={'host': host}).status_code == 421, host
    for host in ('localhost', '127.0.0.1:8080', '[::1]:8080'):
        assert stranger.get('/api/session', headers={'host': host}).status_code == 401, host


@pytest.mark.parametrize('path', [
    '/../../../../etc/passwd', '/..%2f..%2f..%2fetc/passwd', '/%2e%2e/%2e%2e/app.py',
    '/views/..%2f..%2fapp.py', '/..%5c..%5capp.py', '//etc/passwd', '/%00', '/app.js%00.html',
    '/lib/../../security/guard.py', '/....//....//app.py', '/' + 'a' * 4000])
def test_files_beside_the_page_are_out_of_reach(stranger: TestClient, path: str) -> None:
    answer = stranger.get(path)
    assert answer.status_code in (400, 404), (path, answer.status_code)
    assert 'root:' not in answer.text and 'import' not in answer.text


def test_media_are_found_by_their_id_and_by_no_path(app: Any, services: Services) -> None:
    client = TestClient(app, BASE, headers={**logged_in(services, 'mia'), 'origin': BASE},
                        raise_server_exceptions=False)
    for path in ('..%2f..%2fmonitor.db', '%2fetc%2fpasswd', '.%00', 'monitor.db'):
        for folder in ('/api/media/', '/media/', '/maps/', '/api/robots/robot/map/'):
            answer = client.get(folder + path)
            assert answer.status_code in (400, 404, 422), (folder, path, answer.status_code)
            assert 'SQLite' not in answer.text and 'root:' not in answer.text


def test_a_body_that_is_too_long_is_not_even_read(app: Any, stranger: TestClient) -> None:
    said = stranger.post('/api/session', content=b'{}', headers={
        'content-length': str(BODY_BYTES + 1), 'content-type': 'application/json'})
    assert said.status_code == 413

    def endless() -> Iterator[bytes]:
        for _ in range(3 * BODY_BYTES // 65536):
            yield b'x' * 65536

    unsaid = stranger.post('/api/session', content=endless(), headers={
        'content-type': 'application/json'})
    assert unsaid.status_code == 413
    assert set(unsaid.json()['detail']) == {'text', 'remedy', 'codes'}


def test_bodies_that_are_no_json_are_told_so(stranger: TestClient) -> None:
    for body in (b'', b'{', b'\xff\xfe', b'[' * 100_000, b'{"name": NaN}', b'null'):
        answer = stranger.post('/api/session', content=body, headers={
            'content-type': 'application/json'})
        assert answer.status_code in (400, 422), (body[:10], answer.status_code)
        assert set(answer.json()['detail']) == {'text', 'remedy', 'codes'}


def test_a_robot_that_is_revoked_stays_out(services: Services, stranger: TestClient) -> None:
    let_robot_in(services, 'robot2')
    headers = {'authorization': f"Bearer {token_of('robot2')}"}
    with suppress(CancelledError):
        with stranger.websocket_connect(f'{SOCKETS}/robot/state', headers=headers) as robot:
            robot.send_text('{"kind":"beat","n":1}')
    assert services.accounts.robots.find(token_of('robot2')) is not None
    services.accounts.revoke_robot('robot2')
    with pytest.raises(WebSocketDisconnect):
        with stranger.websocket_connect(f'{SOCKETS}/robot/state', headers=headers):
            pass  # pragma: no cover
