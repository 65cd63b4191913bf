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

"""A robot's token writes about the people whom an administrator confirmed, and about no other."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import time
from typing import Any

from fake_robot import FakeRobot
from fake_robot import RobotScript
from fake_robot import token_of
import httpx
from monitor_server import let_robot_in
from monitor_server import logged_in
from monitor_server import Page
from monitor_server import quick_services
from monitor_server import served
import pytest
from rt_robot_os.monitor.command import run
from rt_robot_os.monitor.security.roles import Role
from rt_robot_os.monitor.security.tables import robot_accounts
from rt_robot_os.monitor.security.tokens import kept
from rt_robot_os.monitor.server import make_services
from rt_robot_os.monitor.services import Services

#: For what comes within a second of the server's own; the machine may be busy.
_PATIENCE_S = 30.0


@pytest.fixture
def services(tmp_path: Path) -> Services:
    """Make a server where robot lives with anna, and other with bob."""
    found = quick_services(tmp_path)
    let_robot_in(found, 'other')
    found.accounts.residents.confirm('robot', ['anna'], 'test')
    found.accounts.residents.confirm('other', ['bob'], 'test')
    return found


@pytest.fixture
def address(services: Services) -> Iterator[str]:
    """Serve it."""
    with served(services) as found:
        yield found


def robot(address: str, name: str, *people: str) -> FakeRobot:
    return FakeRobot(f'ws://{address}', script=RobotScript(name, people))


def asked(address: str, headers: dict[str, str], method: str, path: str, **more: Any) -> Any:
    answer = httpx.request(method, f'http://{address}/api/{path}', headers={
        **headers, 'Origin': f'http://{address}'}, timeout=60.0, **more)
    assert answer.status_code == 200, answer.text
    return answer.json()


def values(services: Services, person: str) -> list[float]:
    return [each['value'] for each in services.store.observations(person)]


def wait_until(condition: Any) -> None:
    end = time.monotonic() + _PATIENCE_S
    while not condition():
        assert time.monotonic() < end, 'it never came about'
        time.sleep(0.02)


def test_a_robot_writes_nothing_about_a_person_who_lives_with_another(
        services: Services, address: str) -> None:
    carer = logged_in(services, 'carl', Role.CARER, ('anna',))
    both = logged_in(services, 'bea', Role.CARER, ('anna', 'bob'))
    with Page(address, carer) as page, Page(address, both) as of_both:
        page.next('state')
        of_both.next('state')
        of_both.say(kind='watch', id='w', robot=None, signals=['*'])
        # The hello names her, which is all it took.
        with robot(address, 'other', 'bob', 'anna') as forger, robot(
                address, 'robot', 'anna') as real:
            forger.live(health__anna__pulse_per_min=222, health__bob__pulse_per_min=70)
            signals = of_both.next('signals', robot='other')['signals']
            forger.keep(forger.script.observation('anna', 'pulse_per_min', 222),
                        forger.script.observation('bob', 'pulse_per_min', 70),
                        forger.script.record('place', {'person': 'anna', 'x': 1, 'y': 1}))
            forger.raise_alarm('forged', subject='anna')
            real.raise_alarm('true', subject='anna')
            alarm = page.next('alarm')
            # The alarm itself is never held back: it is one of the robot that sent it.
            forged = of_both.next('alarm', robot='other')
    assert (alarm['id'], alarm['robot']) == ('true', 'robot')
    assert (forged['id'], forged['subject']) == ('forged', '')
    assert [name for name in signals if name.startswith('health/')] == [
        'health/bob/pulse_per_min']
    assert (values(services, 'anna'), values(services, 'bob')) == ([], [70])
    assert services.store.places('anna', 0, 1 << 62) == []
    assert [each['id'] for each in services.store.alarms(people=frozenset({'anna'}))] == ['true']
    counts = services.hub.robots['other'].counts
    assert (counts['records_unconfirmed'], counts['alarms_unconfirmed']) == (2, 1)
    assert [each['robots'] for each in asked(address, both, 'GET', 'people')] == [
        ['robot'], ['other']]


def test_what_came_before_an_administrator_confirmed_is_filed_then(
        services: Services, address: str) -> None:
    let_robot_in(services, 'new')
    services.accounts.residents.confirm('new', [], 'test')
    owner = logged_in(services)
    with robot(address, 'new', 'cleo') as new:
        new.keep(new.script.observation('cleo', 'pulse_per_min', 61),
                 new.script.record('place', {'person': 'cleo', 'x': 1, 'y': 2, 'room': 'hall'}))
        assert values(services, 'cleo') == []
        found = {each['id']: each for each in asked(address, owner, 'GET', 'residents')}
        assert (found['new']['people'], found['new']['suggested']) == ([], ['cleo'])
        assert asked(address, owner, 'PUT', 'residents/new', json={'people': ['cleo']}) == {
            'people': ['cleo']}
        assert values(services, 'cleo') == [61]
        assert services.store.places('cleo', 0, 1 << 62)[0]['room'] == 'hall'
        assert services.store.unknown() == []
        wait_until(lambda: services.hub.robots['new'].people == {'cleo'})
        new.keep(new.script.observation('cleo', 'pulse_per_min', 62))
    assert values(services, 'cleo') == [61, 62]
    assert ('robot.residents', 'new') in [
        (row['action'], row['object']) for row in services.audit.all_rows()]


def test_the_command_line_confirms_while_the_server_runs(
        services: Services, address: str, capsys: pytest.CaptureFixture[str]) -> None:
    where = ['--folder', str(services.settings.where)]
    assert run(['robot', 'add', 'late', '--people', 'dora', *where]) == 0
    token = capsys.readouterr().out.strip()
    with FakeRobot(f'ws://{address}', token, RobotScript('late', ('dora', 'emil'))) as late:
        late.keep(late.script.observation('dora', 'pulse_per_min', 60),
                  late.script.observation('emil', 'pulse_per_min', 80))
        assert (values(services, 'dora'), values(services, 'emil')) == ([60], [])
        assert run(['robot', 'people', 'late', *where]) == 0
        assert 'dora; it also names emil' in capsys.readouterr().out
        assert run(['robot', 'people', 'late', 'dora', 'emil', *where]) == 0
        wait_until(lambda: values(services, 'emil') == [80])
        assert run(['robot', 'people', 'late', '--nobody', *where]) == 0
        late_id = next(each['id'] for each in services.accounts.robots.all()
                       if each['name'] == 'late')
        wait_until(lambda: services.hub.robots[late_id].people == frozenset())


def test_a_robot_whose_people_are_not_confirmed_is_shown_to_those_who_see_everybody(
        services: Services, address: str) -> None:
    services.accounts.robots.add('new')
    with services.store.writing() as connection:
        connection.execute(robot_accounts.update().where(robot_accounts.c.name == 'new').values(
            id='new', token=kept(token_of('new'))))
    carer = logged_in(services, 'carl', Role.CARER, ('anna',))
    owner = logged_in(services)
    with robot(address, 'new', 'anna') as new:
        new.raise_alarm('a1', subject='anna')
        assert [each['id'] for each in asked(address, carer, 'GET', 'robots')] == []
        assert 'new' in [each['id'] for each in asked(address, owner, 'GET', 'robots')]
        assert [each['id'] for each in asked(address, owner, 'GET', 'alarms')] == ['a1']
        assert asked(address, carer, 'GET', 'alarms') == []


def test_the_first_hello_decides_once_where_the_server_starts_the_gateway(
        services: Services, address: str) -> None:
    let_robot_in(services, 'flat')  # as the demonstration does
    with robot(address, 'flat', 'carl'):
        pass
    with robot(address, 'flat', 'carl', 'anna') as flat:
        flat.keep(flat.script.observation('anna', 'pulse_per_min', 222))
    assert services.hub.robots['flat'].people == {'carl'}
    assert values(services, 'anna') == []


def test_what_is_confirmed_outlasts_the_server(services: Services, tmp_path: Path) -> None:
    services.writer.close()
    services.accounts.close()
    services.store.close()
    again = make_services(services.settings)
    assert {name: each.people for name, each in again.hub.robots.items()} == {
        'robot': {'anna'}, 'other': {'bob'}}
    again.writer.close()
    again.accounts.close()
    again.store.close()


@pytest.mark.parametrize('person', ['', '*', 'a' * 121, 'a\nb'])
def test_a_name_that_cannot_be_a_person_is_refused(services: Services, person: str) -> None:
    with pytest.raises(ValueError, match='give the name by which the robot knows them'):
        services.accounts.residents.confirm('robot', [person], 'test')
    assert services.accounts.residents.all()['robot'].people == {'anna'}
