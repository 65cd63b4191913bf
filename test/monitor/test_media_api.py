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

"""Pictures and clips as they are served: to whom, as what, in ranges, noted."""

from __future__ import annotations

from collections.abc import Iterator
import hashlib
from pathlib import Path
from typing import Any

from fake_robot import RobotScript
from monitor_server import logged_in
from monitor_server import quick_services
import pytest
from rt_robot_os.monitor.app import create_app
from rt_robot_os.monitor.live.robot_state import RobotState
from rt_robot_os.monitor.media_store import Offered
from rt_robot_os.monitor.security.roles import Role
from starlette.testclient import TestClient

PICTURE = b'\xff\xd8\xff\xe0' + bytes(range(256)) * 20
BASE = 'http://localhost'


class World:
    """A server with media of two people."""

    def __init__(self, folder: Path) -> None:
        self.services = quick_services(folder)
        self.app = create_app(self.services)
        self.script = RobotScript('robot', ('anna', 'bob'))
        self.services.hub.robots['robot'] = RobotState(
            'robot', 'robot', people=frozenset({'anna', 'bob'}))
        self.numbers = {alarm: self.add(alarm, subject) for alarm, subject in (
            ('a1', 'anna'), ('b1', 'bob'), ('s1', 'kitchen'))}
        self.services.store.add('robot', 'boot', [self.script.record('media', self.facts('gone'))])

    def facts(self, alarm: str) -> dict[str, Any]:
        content = PICTURE + alarm.encode()
        return {'id': f'id-{alarm}', 'alarm': alarm, 'kind': 'picture', 'file': 'p.jpg',
                'sha256': hashlib.sha256(content).hexdigest(), 'size': len(content),
                'width': 640, 'height': 480, 't_ns': 7}

    def add(self, alarm: str, subject: str) -> int:
        store, content = self.services.store, PICTURE + alarm.encode()
        facts = self.facts(alarm)
        store.add('robot', 'boot', [self.script.alarm(alarm, subject=subject),
                                    self.script.record('media', facts)])
        self.services.media.files.add('robot', Offered(facts['sha256'], len(content)), 0, content)
        return int(store.media_by_name('robot', facts['id'])['id'])

    def client(self, name: str, role: Role, people: tuple[str, ...]) -> TestClient:
        return TestClient(self.app, BASE, client=('127.0.0.1', 5000), headers={
            **logged_in(self.services, name, role, people), 'origin': BASE})


@pytest.fixture(scope='module')
def world(tmp_path_factory: pytest.TempPathFactory) -> Iterator[World]:
    found = World(tmp_path_factory.mktemp('media'))
    yield found
    found.services.store.close()


@pytest.fixture(scope='module')
def carer(world: World) -> TestClient:
    return world.client('carl', Role.CARER, ('*',))


def test_a_picture_is_served_as_what_it_is_and_nothing_else(world: World, carer: TestClient
                                                            ) -> None:
    answer = carer.get(f"/api/media/{world.numbers['a1']}")
    assert (answer.status_code, answer.content) == (200, PICTURE + b'a1')
    assert answer.headers['content-type'] == 'image/jpeg'
    assert answer.headers['x-content-type-options'] == 'nosniff'
    assert 'no-store' in answer.headers['cache-control']
    assert 'sandbox' in answer.headers['content-security-policy']
    rows = world.services.audit.all_rows()
    assert any((row['name'], row['action'], row['object']) == ('carl', 'media.read', 'robot/a1')
               for row in rows)


def test_a_range_of_it_is_served(world: World, carer: TestClient) -> None:
    answer = carer.get(f"/api/media/{world.numbers['a1']}", headers={'Range': 'bytes=4-9'})
    assert (answer.status_code, answer.content) == (206, PICTURE[4:10])
    answer = carer.get(f"/api/media/{world.numbers['a1']}", headers={'Range': 'bytes=99999-'})
    assert answer.status_code == 416


def test_what_has_not_come_is_named_and_not_served(world: World, carer: TestClient) -> None:
    found = {each['alarm']: each for each in carer.get('/api/media?robot=robot').json()}
    assert [found[alarm]['here'] for alarm in ('a1', 'b1', 's1', 'gone')] == [
        True, True, True, False]
    assert not {'sha256', 'path', 'file'} & set(found['a1'])
    answer = carer.get(f"/api/media/{found['gone']['id']}")
    assert (answer.status_code, 'not here' in answer.json()['detail']['text']) == (409, True)


def test_somebody_sees_pictures_of_those_who_are_granted_and_hears_of_no_other(
        world: World) -> None:
    mary = world.client('mary', Role.CARER, ('anna',))
    assert {each['subject'] for each in mary.get('/api/media').json()} == {'anna'}
    assert mary.get(f"/api/media/{world.numbers['a1']}").status_code == 200
    for alarm in ('b1', 's1'):  # smoke shows whoever is there
        hidden = mary.get(f'/api/media/{world.numbers[alarm]}')
        unknown = mary.get('/api/media/999999')
        assert (hidden.status_code, hidden.json()) == (404, unknown.json())
    assert mary.get('/api/media?alarm=b1').json() == []


def test_who_has_no_permission_for_cameras_gets_none(world: World) -> None:
    viewer = world.client('vera', Role.VIEWER, ('*',))
    assert viewer.get('/api/media').status_code == 403
    assert viewer.get(f"/api/media/{world.numbers['a1']}").status_code == 403
    nobody = TestClient(world.app, BASE, client=('127.0.0.1', 5001))
    assert nobody.get(f"/api/media/{world.numbers['a1']}").status_code == 401


@pytest.mark.parametrize('odd', ['-1', '0', 'x', '1e3', '99999999999999999999999', '..%2f..%2fetc',
                                 '1;drop', '%00'])
def test_odd_numbers_are_a_clear_answer(carer: TestClient, odd: str) -> None:
    answer = carer.get(f'/api/media/{odd}')
    assert answer.status_code in (404, 422)
    assert answer.json()['detail']['text']
