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

"""Every route says what it answers, and what it says neither loses a key nor adds one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('fastapi')

from fake_robot import FakeRobot  # noqa: E402, I100
from fake_robot import RobotScript  # noqa: E402
import httpx  # noqa: E402
from monitor_server import let_robot_in  # noqa: E402
from monitor_server import logged_in  # noqa: E402
from monitor_server import quick_services  # noqa: E402
from monitor_server import served  # noqa: E402
from processes import wait_until  # noqa: E402
from rt_robot_os.monitor.app import create_app  # noqa: E402

#: Routes that answer with a file or a stream.
FILES = {'/metrics', '/api/audit/export', '/api/media/{number}',
         '/api/people/{person}/export.csv', '/api/people/{person}/export.json'}


def schema_of(answer: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of an answer; of a list that of its items."""
    schema: dict[str, Any] = next(iter(answer['content'].values()))['schema']
    return schema['items'] if schema.get('type') == 'array' else schema


def test_every_route_but_files_and_streams_has_a_model_of_its_answer(tmp_path: Path) -> None:
    description = create_app(quick_services(tmp_path)).openapi()
    without = set()
    for path, methods in description['paths'].items():
        for method, operation in methods.items():
            answers = operation['responses']
            good, = [each for each in answers if each.startswith('2')]
            if path not in FILES:
                schema = schema_of(answers[good])
                model = description['components']['schemas'].get(
                    schema.get('$ref', '').rpartition('/')[2], {})
                if not model.get('properties'):
                    without.add((method, path))
            for refused in ('422', 'default'):
                assert schema_of(answers[refused]) == {'$ref': '#/components/schemas/ErrorAnswer'}
    assert without == set()
    assert FILES <= set(description['paths']) and len(description['paths']) > 30


def test_answers_have_every_key_and_no_other(tmp_path: Path) -> None:
    """The fixture of conftest.py compares each answer with what its function returned."""
    services = quick_services(tmp_path)
    let_robot_in(services, 'other')
    owner = logged_in(services)
    script = RobotScript(people=('anna',), cameras=['hall'], capabilities=['stop', 'drive'],
                         limits={'linear_m_s': 0.3, 'angular_rad_s': 0.8},
                         nodes=[{'id': 1, 'name': 'n', 'x': 1, 'y': 2.0, 'z': 0.5, 'person': ''}])
    with served(services) as address, FakeRobot(
            f'ws://{address}', script=script) as robot, httpx.Client(
                base_url=f'http://{address}',
                headers={**owner, 'Origin': f'http://{address}'}) as asked:
        robot.send(script.records(
            script.alarm('fall-1', x=1.5, y=2), script.observation('anna', 'pulse_per_min', 71),
            script.record('media', {'id': 'm1', 'alarm': 'fall-1', 'kind': 'picture', 'size': 3,
                                    'file': 'a.jpg', 'sha256': 'ab', 't_ns': 1})))
        wait_until(lambda: asked.get('/api/alarms').json(), 'the alarm')
        assert asked.post('/api/alarms/robot/fall-1/notes', json={'text': 'seen'}
                          ).status_code == 201
        user = asked.post('/api/users', json={'name': 'ben', 'role': 'viewer', 'people': ['*']})
        now_ns = asked.get('/api/status').json()['utc_ns']
        paths = [
            '/healthz', '/api/status', '/api/alarms', '/api/alarms/robot/fall-1', '/api/robots',
            '/api/robots/robot', '/api/people', '/api/media', '/api/residents', '/api/session',
            '/api/sessions', '/api/setup', '/api/users', '/api/tokens', '/api/audit',
            '/api/audit/verify', '/api/emergencies', f"/api/users/{user.json()['id']}/sessions",
            '/api/observations?person=anna', '/api/people/anna/latest',
            f'/api/people/anna/charts?sign=pulse_per_min&start={now_ns - 10**12}&end={now_ns}']
        found = {path: asked.get(path) for path in paths}
        assert {path: each.text for path, each in found.items() if each.status_code != 200} == {}
        shown, = found['/api/robots'].json()[:1]
        assert shown['nodes'][0]['x'] == 1 and 'call' not in shown
        alarm = found['/api/alarms/robot/fall-1'].json()
        assert [each['text'] for each in alarm['notes']] == ['seen'] and len(alarm['media']) == 1
        assert alarm['events'][0]['event'] == 'raised'
