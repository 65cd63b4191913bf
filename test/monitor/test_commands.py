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

"""What people tell robots to do: checked, said in their name, done once, answered, noted."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import threading
from typing import Any
from urllib.parse import quote

from fake_robot import FakeRobot
from fake_robot import RobotScript
from monitor_server import ask
from monitor_server import logged_in
from monitor_server import quick_services
from monitor_server import served
from processes import wait_until
import pytest
from rt_robot_os.monitor.security.roles import Role
from rt_robot_os.monitor.services import Services


@pytest.fixture(scope='module')
def services(tmp_path_factory: pytest.TempPathFactory) -> Services:
    return quick_services(tmp_path_factory.mktemp('monitor'), command_s=60.0)


@pytest.fixture(scope='module')
def address(services: Services) -> Iterator[str]:
    with served(services) as found:
        yield found


@pytest.fixture(scope='module')
def users(services: Services) -> dict[str, dict[str, str]]:
    """Return the headers of browsers."""
    return {'operator': logged_in(services, 'otto of night', Role.OPERATOR),
            'carer': logged_in(services, 'carla', Role.CARER, ('anna',)),
            'viewer': logged_in(services, 'vera', Role.VIEWER),
            'stranger': logged_in(services, 'stan', Role.OPERATOR, ('zoe',))}


@pytest.fixture
def robot(address: str) -> Iterator[FakeRobot]:
    with FakeRobot(f'ws://{address}', script=RobotScript(people=('anna', 'bob'))) as found:
        yield found


def command(address: str, headers: dict[str, str], do: str, key: str = '', **args: Any
            ) -> tuple[int, Any]:
    """Have the robot do something."""
    return ask(address, headers, 'POST', '/api/robots/robot/commands',
               {'do': do, 'args': args, 'key': key})


def test_an_alarm_is_acknowledged_in_the_name_of_who_is_logged_in(
        address: str, users: dict[str, dict[str, str]], robot: FakeRobot, services: Services
) -> None:
    robot.raise_alarm('7')
    assert command(address, users['carer'], 'alarm', verb='acknowledge', alarm='7',
                   reason='on my way\nby eve') == (200, {'ok': True, 'text': 'done'})
    found = robot.commands[-1]
    assert found['args'] == {'text': 'acknowledge 7 by carla on my way by eve'}
    assert found['by'] == 'carla'
    command(address, users['operator'], 'alarm', verb='resolve', alarm='7')
    assert robot.commands[-1]['args'] == {'text': 'resolve 7 by otto_of_night'}
    # It is noted beside it, so that no audit holds up a command.
    wait_until(lambda: ('carla', 'command.alarm') in [
        (row['name'], row['action']) for row in services.audit.all_rows()], 'it is in the audit')


@pytest.mark.parametrize(('who', 'do', 'args', 'status'), [
    ('viewer', 'alarm', {'verb': 'acknowledge', 'alarm': 'c1'}, 403),
    ('viewer', 'stop', {}, 403), ('carer', 'stop', {}, 200), ('operator', 'stop', {}, 200),
    ('carer', 'release', {}, 403), ('operator', 'release', {}, 200),
    ('carer', 'goal', {'x': 1, 'y': 2}, 403), ('operator', 'goal', {'x': 1, 'y': 2}, 200),
    ('operator', 'goal', {'x': 1}, 422), ('operator', 'goal', {'x': 1e9, 'y': 2}, 422),
    ('operator', 'goal', {'x': True, 'y': 2}, 422), ('operator', 'cancel', {}, 200),
    ('operator', 'agent', {'text': 'return'}, 200), ('operator', 'agent', {}, 422),
    ('carer', 'say', {'text': 'I come'}, 200), ('carer', 'say', {'text': ' \n'}, 422),
    ('carer', 'say', {'text': 'x' * 500}, 422), ('operator', 'fly', {}, 422),
    # A camera sees Bob, too, whom the carer may not see.
    ('carer', 'snapshot', {}, 403), ('operator', 'snapshot', {}, 200),
    ('carer', 'alarm', {'verb': 'acknowledge', 'alarm': 'all'}, 404),
    ('carer', 'alarm', {'verb': 'acknowledge', 'alarm': 'c2'}, 404),
    ('carer', 'alarm', {'verb': 'format', 'alarm': 'c1'}, 422),
    ('stranger', 'stop', {}, 404)])
def test_each_command_needs_what_it_needs(
        address: str, users: dict[str, dict[str, str]], robot: FakeRobot, who: str, do: str,
        args: dict[str, Any], status: int) -> None:
    robot.raise_alarm('c1')
    robot.raise_alarm('c2', subject='bob')
    before = len(robot.commands)
    found, answer = command(address, users[who], do, **args)
    assert found == status, answer
    assert len(robot.commands) == before + (status == 200)
    if status != 200:
        assert answer['text'] and answer['remedy']


def test_a_command_that_comes_again_is_done_once(
        address: str, users: dict[str, dict[str, str]], robot: FakeRobot) -> None:
    answers = [command(address, users['operator'], 'goal', key='k1', x=1, y=2)
               for _ in range(3)]
    assert answers == [(200, {'ok': True, 'text': 'done'})] * 3
    assert len(robot.commands) == 1
    command(address, users['operator'], 'goal', key='k2', x=1, y=2)
    assert len(robot.commands) == 2


def test_what_a_robot_refuses_is_said(address: str, users: dict[str, dict[str, str]]) -> None:
    with FakeRobot(f'ws://{address}', answer=lambda each: (False, 'there is a wall')):
        assert command(address, users['operator'], 'goal', x=1, y=2) == (
            200, {'ok': False, 'text': 'there is a wall'})


def test_that_a_robot_does_not_answer_or_is_away_is_said(tmp_path: Path) -> None:
    services = quick_services(tmp_path, command_s=0.1)
    awake = threading.Event()
    with served(services) as address:
        operator = logged_in(services, 'otto', Role.OPERATOR)
        with FakeRobot(f'ws://{address}', answer=lambda each: (awake.wait(60), 'late')):
            status, said = command(address, operator, 'stop')
            assert status == 504 and 'has not answered' in said['text']
            awake.set()
        status, said = command(address, operator, 'stop')
        assert status == 409 and 'not connected' in said['text']


def test_lists_have_what_one_may_see_and_a_note_stays(
        address: str, users: dict[str, dict[str, str]], robot: FakeRobot) -> None:
    robot.raise_alarm('l1')
    robot.raise_alarm('l2', subject='bob')
    carer = users['carer']
    assert [each['id'] for each in ask(address, carer, 'GET', '/api/robots')[1]] == ['robot']
    assert [each['person'] for each in ask(address, carer, 'GET', '/api/people')[1]] == ['anna']
    found = [each['id'] for each in ask(address, carer, 'GET', '/api/alarms?open=true')[1]]
    assert 'l1' in found and 'l2' not in found
    assert ask(address, carer, 'GET', '/api/alarms/robot/l2')[0] == 404
    assert ask(address, carer, 'POST', '/api/alarms/robot/l2/notes', {'text': 'x'})[0] == 404
    assert ask(address, carer, 'POST', '/api/alarms/robot/l1/notes', {'text': 'fed'})[0] == 201
    # Two carers may be of one mind, yet each withdraws only what is theirs.
    status, added = ask(address, carer, 'POST', '/api/alarms/robot/l1/notes', {'text': 'oops'})
    note = f'/api/alarms/robot/l1/notes/{added["id"]}'
    assert ask(address, users['operator'], 'DELETE', note)[0] == 404
    assert ask(address, carer, 'DELETE', note.replace('l1', 'l2'))[0] == 404
    assert ask(address, carer, 'DELETE', note) == (200, {'ok': True})
    assert ask(address, carer, 'DELETE', note)[0] == 404
    robot.raise_alarm('l/3')
    slash = '/api/alarms/robot/l%2F3/notes'
    added = ask(address, carer, 'POST', slash, {'text': 'oops'})[1]
    assert ask(address, carer, 'DELETE', f'{slash}/{added["id"]}')[0] == 200
    alarm = ask(address, carer, 'GET', '/api/alarms/robot/l1')[1]
    assert [(each['by'], each['text']) for each in alarm['notes']] == [('carla', 'fed')]
    assert ask(address, carer, 'GET', '/api/observations?person=bob')[0] == 404
    assert ask(address, carer, 'GET', '/api/observations?person=anna')[0] == 200
    assert ask(address, users['stranger'], 'GET', '/api/robots')[1] == []
    assert ask(address, users['stranger'], 'GET', '/api/robots/robot')[0] == 404
    assert ask(address, carer, 'GET', '/api/status')[1]['storing']['ok'] is True
    assert ask(address, carer, 'GET', '/metrics')[0] == 403


def test_another_sites_page_cannot_command(
        address: str, users: dict[str, dict[str, str]], robot: FakeRobot) -> None:
    operator = users['operator']
    for wrong in ({**operator, 'X-CSRF-Token': 'x'}, {'Cookie': operator['Cookie']}, {}):
        assert command(address, wrong, 'stop')[0] in (401, 403)
    assert robot.commands == []


def test_an_alarm_and_a_person_whose_names_have_slashes_are_found(
        address: str, users: dict[str, dict[str, str]], services: Services) -> None:
    operator = users['operator']
    alarm, person = 'flat/7/fall', 'anna/maria'
    services.accounts.residents.confirm('robot', ['anna', 'bob', person], 'test')
    with FakeRobot(f'ws://{address}', script=RobotScript(people=('anna', person))) as robot:
        robot.raise_alarm(alarm, subject='anna')
        robot.keep(robot.script.observation(person, 'pulse_per_min', 61.0))
    path = f'/api/alarms/robot/{quote(alarm, safe="")}'
    status, found = ask(address, operator, 'GET', path)
    assert (status, found['id']) == (200, alarm)
    assert ask(address, operator, 'POST', f'{path}/notes', {'text': 'seen'})[0] == 201
    notes = ask(address, operator, 'GET', path)[1]['notes']
    assert [each['text'] for each in notes] == ['seen']
    assert ask(address, operator, 'GET', f'{path}/notes')[0] == 404
    latest = f'/api/people/{quote(person, safe="")}/latest'
    olga = logged_in(services, 'olga')
    wait_until(lambda: ask(address, olga, 'GET', latest)[1], 'the value')
    status, values = ask(address, olga, 'GET', latest)
    assert (status, [each['value'] for each in values]) == (200, [61.0])
