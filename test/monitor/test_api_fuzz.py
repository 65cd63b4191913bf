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

"""
Every endpoint of the server takes whatever is sent to it, and answers with what helps.

The endpoints are those of its own OpenAPI description, so that a new one is tried with no further
word. Values are those that its schema asks for, mixed with what no schema would.
"""

from __future__ import annotations

from collections.abc import Iterator
import json
from pathlib import Path
from typing import Any

from accounts_app import QUICK
from asgi_client import request
from asgi_client import Response
from broad import examples
from households import confirm
from hypothesis import given
from hypothesis import HealthCheck
from hypothesis import settings
from hypothesis import strategies
from monitor_server import quick_services
import pytest
from rt_robot_os.monitor.app import create_app
from rt_robot_os.monitor.security.accounts import Accounts
from rt_robot_os.monitor.security.roles import Role
from rt_robot_os.monitor.security.tokens import csrf_token
from rt_robot_os.monitor.services import Services

ODD = strategies.sampled_from([
    '', ' ', '0', '-1', 'null', '../../etc/passwd', '%2e%2e', "'; drop table users; --", '*',
    '\x00', '‮', 'é', '1e999', str(1 << 64), 'x' * 3000, '[]', 'anna', 'bob', 'robot', 'a1'])
NUMBERS = strategies.integers() | strategies.floats() | strategies.sampled_from(
    [0, 1, -1, 1 << 31, 1 << 63, (1 << 63) - 1, 1 << 80])
JUNK = strategies.recursive(
    strategies.none() | strategies.booleans() | ODD | NUMBERS,
    lambda inner: strategies.lists(inner, max_size=3) | strategies.dictionaries(
        strategies.text(max_size=5), inner, max_size=3), max_leaves=6)


@pytest.fixture(scope='module')
def services(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Services]:
    folder: Path = tmp_path_factory.mktemp('monitor')
    found = quick_services(folder)
    found.accounts.close()
    found.accounts = Accounts.open(found.store.engine, folder, hasher=QUICK)
    found.audit = found.accounts.audit
    found.hub.remember([{'id': 'robot', 'people': ['anna']}, {'id': 'other', 'people': ['bob']}],
                       [])
    confirm(found.store, 'robot', 'anna')
    found.store.hello('robot', 'b', name='robot')
    confirm(found.store, 'other', 'bob')
    found.store.hello('other', 'b', name='other')
    for robot, person in (('robot', 'anna'), ('other', 'bob')):
        found.store.add(robot, 'b', [
            {'seq': 1, 'importance': 0, 'type': 'alarm_event', 'utc_ns': 1_700_000_000 * 10 ** 9,
             'content': {'alarm': 'a1', 'seq': 1, 'event': 'raised', 'state': 'raised',
                         'level': 'critical', 'subject': person, 'kinds': ['fall'],
                         'text': f'{person} lies in the hall', 't_ns': 1}}])
    yield found
    found.writer.close()
    found.accounts.close()
    found.store.close()


@pytest.fixture(scope='module')
def app(services: Services) -> Any:
    return create_app(services)


class Sessions:
    """Who may do everything, and who may see one of two people; each time in a new session."""

    def __init__(self, services: Services) -> None:
        self._accounts = services.accounts
        for name, role, people in (('owner', Role.OWNER, '*'), ('anna', Role.OPERATOR, 'anna')):
            services.accounts.users.add(name, role, (people,), 'test', 'no password')

    def headers(self, name: str) -> dict[str, str]:
        """Return the headers of a browser."""
        user = self._accounts.users.find(name)
        _, secret = self._accounts.sessions.begin(user.id, '127.0.0.1', 'test')
        return {'Cookie': f'session={secret}', 'X-CSRF-Token': csrf_token(secret)}


@pytest.fixture(scope='module')
def sessions(services: Services) -> Sessions:
    return Sessions(services)


def operations(app: Any) -> list[tuple[str, str, dict[str, Any]]]:
    """Return method, path and description of each endpoint."""
    return [(method.upper(), path, operation)
            for path, methods in app.openapi()['paths'].items()
            for method, operation in methods.items()]


def by_schema(app: Any, schema: dict[str, Any], depth: int = 0) -> strategies.SearchStrategy[Any]:
    """Return values that a schema asks for, or nearly."""
    if '$ref' in schema:
        name = schema['$ref'].rpartition('/')[2]
        return by_schema(app, app.openapi()['components']['schemas'][name], depth)
    for key in ('anyOf', 'oneOf'):
        if key in schema:
            return strategies.one_of([by_schema(app, each, depth) for each in schema[key]])
    if 'enum' in schema or 'const' in schema:
        return strategies.sampled_from(schema.get('enum', [schema.get('const')]))
    kind = schema.get('type')
    if kind == 'object' and depth < 3:
        return strategies.fixed_dictionaries({}, optional={
            name: by_schema(app, each, depth + 1) | JUNK
            for name, each in schema.get('properties', {}).items()})
    return {'string': ODD | strategies.text(max_size=20), 'integer': NUMBERS, 'number': NUMBERS,
            'boolean': strategies.booleans(), 'array': strategies.lists(JUNK, max_size=3),
            'null': strategies.none()}.get(str(kind), JUNK)


def check(method: str, path: str, found: Response) -> None:
    """Check what every answer must be."""
    told = f'{method} {path}: {found.status} {found.body[:300]!r}'
    assert found.status < 500 or found.status in (502, 503, 504), told
    assert 'content-security-policy' in found.headers, told
    if found.status >= 400:
        detail = found.json()['detail']
        assert detail['text'] and detail['remedy'], told


@settings(max_examples=examples(150), deadline=None, suppress_health_check=list(HealthCheck))
@given(data=strategies.data())
def test_no_input_is_too_much(app: Any, sessions: Sessions,
                              data: strategies.DataObject) -> None:
    method, path, operation = data.draw(strategies.sampled_from(operations(app)))
    query, filled = {}, path
    for each in operation.get('parameters', ()):
        value = data.draw(by_schema(app, each['schema']) | ODD)
        if each['in'] == 'path':
            filled = filled.replace(f"{{{each['name']}}}", str(value) or 'x')
        elif data.draw(strategies.booleans()):
            query[each['name']] = value
    content = None
    if 'requestBody' in operation:
        schema = next(iter(operation['requestBody']['content'].values()))['schema']
        content = data.draw(by_schema(app, schema) | JUNK)
    name = data.draw(strategies.sampled_from(['owner', 'anna']))
    found = request(app, method, filled, sessions.headers(name), query, content)
    check(method, filled, found)
    if name == 'anna' and 'bob' not in repr((filled, query, content)):
        assert b'bob' not in found.body, f'{method} {filled}: {found.body[:300]!r}'


def test_without_a_session_there_is_nothing(app: Any) -> None:
    public = {'/healthz', '/api/session', '/api/session/setup'}
    for method, path, operation in operations(app):
        filled = path.replace('{robot}', 'robot').replace('{alarm}', 'a1').replace(
            '{person}', 'anna').replace('{', '').replace('}', '')
        for cookie in ({}, {'cookie': f'session={"x" * 43}'},
                       {'cookie': f'session={"x" * 43}', 'x-csrf-token': 'y' * 64}):
            found = request(app, method, filled, cookie, content={})
            check(method, filled, found)
            if path not in public and not path.startswith('/api/setup'):
                assert found.status in (401, 403, 422), f'{method} {path}: {found.status}'
                assert b'anna' not in found.body


@pytest.mark.parametrize('raw', [b'{', b'\xff\xfe', b'[' * 100_000, b'{"do":NaN}', b'null'])
def test_a_body_that_is_no_json_is_told(app: Any, sessions: Sessions,
                                        raw: bytes) -> None:
    found = request(app, 'POST', '/api/robots/robot/commands', sessions.headers('owner'), raw=raw)
    check('POST', 'commands', found)
    assert found.status in (400, 422)


def test_a_body_that_is_too_long_is_refused(app: Any, sessions: Sessions
                                            ) -> None:
    raw = json.dumps({'do': 'say', 'args': {'text': 'x' * (2 << 20)}}).encode()
    found = request(app, 'POST', '/api/robots/robot/commands', sessions.headers('owner'), raw=raw)
    check('POST', 'commands', found)
    assert found.status == 413
