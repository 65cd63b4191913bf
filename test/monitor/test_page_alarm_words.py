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

"""One alarm has the same words everywhere: who, what, where; and what is worst comes first."""

from __future__ import annotations

from collections.abc import Callable
import time
from typing import Any
from typing import TYPE_CHECKING

import pytest

pytest.importorskip('playwright.sync_api')

from fake_robot import FakeRobot  # noqa: E402, I100
from fake_robot import RobotScript  # noqa: E402
from live_signals import news2  # noqa: E402
from live_signals import signs  # noqa: E402
from monitor_server import let_robot_in  # noqa: E402
from page_layout import names_twice  # noqa: E402
from playwright.sync_api import expect  # noqa: E402

if TYPE_CHECKING:
    from conftest import Monitor

SignedIn = Callable[..., Any]
NODES = [{'id': 1, 'name': 'kitchen', 'x': 7.0, 'y': 2.0, 'z': 2.0, 'person': ''},
         {'id': 2, 'name': 'bedroom', 'x': 1.0, 'y': 6.0, 'z': 2.0, 'person': ''},
         {'id': 3, 'name': 'wrist', 'x': 7.0, 'y': 2.0, 'z': 1.0, 'person': 'anna'}]


@pytest.fixture
def robot(server: Monitor) -> Any:
    """Connect a robot that says which of its nodes is worn."""
    with FakeRobot(f'ws://{server.address}', script=RobotScript(
            'robot', ('anna', 'bob'), nodes=NODES)) as found:
        yield found
        for alarm in list(server.services.hub.robots['robot'].alarms):
            found.raise_alarm(alarm, event='resolved', state='resolved')


def place(room: str, age_s: float = 1.0) -> dict[str, Any]:
    return {'status': [{'level': 0, 'name': 'place', 'message': room, 'hardware_id': '',
                        'values': {'room': room, 'age_s': str(age_s)}}]}


def silent(robot: FakeRobot, alarm: str, person: str) -> None:
    robot.raise_alarm(alarm, subject=f'vital signs of {person}', level='technical',
                      kinds=['monitor_silent'], text=f'no vital signs of {person} arrive')


def test_alarms_of_two_people_stand_on_their_own_cards_with_names_of_their_own(
        robot: FakeRobot, signed_in: SignedIn) -> None:
    silent(robot, 'w1', 'anna')
    silent(robot, 'w2', 'bob')
    page = signed_in('carer')
    for person in ('anna', 'bob'):
        card = page.locator(f'[data-person={person}]')
        row = card.locator('.card-alarm')
        expect(row).to_have_count(1)
        expect(row).to_contain_text(f'Technical: vital signs of {person}')
        expect(card).not_to_contain_text('No alarm')
        button = row.get_by_role('button')
        expect(button).to_have_attribute('aria-label', (
            f'Acknowledge: vital signs of {person}, Monitoring silent, place not known'))
        button.click()
        expect(page.locator('#toasts')).to_contain_text(f'vital signs of {person}')
    assert [each['args']['text'].split()[1] for each in robot.commands] == ['w1', 'w2']
    expect(page.locator('.robot .card-alarm')).to_have_count(0)
    assert names_twice(page) == []


def test_what_somebody_wears_is_theirs_and_no_room(robot: FakeRobot, signed_in: SignedIn) -> None:
    page = signed_in('carer')
    row = page.locator('[data-person=anna] .card-alarm')
    robot.raise_alarm('w3', subject='wrist', node='wrist', level='technical', kinds=['sensor_off'],
                      text='it measures nothing')
    expect(row).to_contain_text('place not known')
    expect(row).to_contain_text('Technical: wrist')
    robot.live(health__anna__place_details=place('living'))
    expect(row).to_contain_text('living room')
    robot.live(health__anna__place_details=place('living', 300.0))
    expect(row).to_contain_text('last in living room')


@pytest.mark.parametrize(('alarm', 'where'), [
    ({'node': 'wrist'}, 'place not known'),
    ({'node': 'wrist', 'x': 1.5, 'y': 5.0}, 'near bedroom'),
    ({'node': 'kitchen'}, 'kitchen'),
    ({'subject': 'study', 'kinds': ['smoke'], 'node': 'study'}, 'study')])
def test_each_place_of_the_page_says_where_it_is(
        robot: FakeRobot, signed_in: SignedIn, alarm: dict[str, Any], where: str) -> None:
    robot.live(health__anna__place_details=place(''))
    # The server remembers the names of alarms.
    robot.raise_alarm(f'w4 {where}', **alarm)
    page = signed_in('carer', '#/alarms')
    expect(page.locator('.strip-more')).to_contain_text(where)
    expect(page.locator('.alarm-text')).to_contain_text(where)
    name = page.locator('.alarm-act button').get_attribute('aria-label')
    assert name.endswith(f', {where}')
    page.locator('.alarm-link').click()
    expect(page.locator('.alarm-head .facts')).to_contain_text(where)
    # What the time line has is not there a second time.
    expect(page.locator('.alarm-act button')).to_have_count(0)
    assert names_twice(page) == []


def test_two_alarms_of_the_same_words_are_named_apart(
        robot: FakeRobot, signed_in: SignedIn) -> None:
    for alarm in ('w5', 'w6'):
        robot.raise_alarm(alarm, subject='lift', level='technical', kinds=['heat'])
    page = signed_in('carer', '#/alarms')
    expect(page.locator('.alarm-act button')).to_have_count(2)
    assert names_twice(page) == []


def test_a_score_of_which_signs_are_missing_is_not_green(
        robot: FakeRobot, signed_in: SignedIn) -> None:
    page = signed_in('carer')
    score = news2('', 'Low')
    score['status'][0]['values'].update(missing='spo2_percent consciousness', at_least='1')
    robot.live(health__bob__signs=signs(pulse_per_min=72), health__bob__news2_details=score)
    card = page.locator('[data-person=bob]')
    expect(card.locator('.score')).to_contain_text('2 signs missing')
    expect(card.locator('.score')).to_have_class('score tone-none')
    # A total of which something is missing all the same is none.
    score['status'][0]['values']['total'] = '1'
    robot.live(health__bob__signs=signs(pulse_per_min=72), health__bob__news2_details=score)
    expect(card.locator('.score-number')).to_have_text('1')
    expect(card.locator('.badge').first).to_contain_text('risk not known')
    assert card.locator('.tone-ok').count() == 0


def test_the_robot_that_is_on_its_way_stands_before_an_idle_one(
        server: Monitor, robot: FakeRobot, signed_in: SignedIn) -> None:
    let_robot_in(server.services, 'attic')
    try:
        with FakeRobot(f'ws://{server.address}', script=RobotScript('attic', ('clara',))) as idle:
            page = signed_in('carer')
            cards = page.locator('.robot')
            idle.live(agent__state='idle', battery={'percentage': 0.15})
            robot.live(agent__state='idle', battery={'percentage': 0.9})
            expect(cards.first).to_contain_text('attic')  # its battery is low
            robot.raise_alarm('w7')
            robot.live(agent__state='approach anna: fall')
            expect(cards.first).to_contain_text('On its way')
    finally:
        server.services.accounts.robots.revoke('attic')
        server.services.hub.robots.pop('attic', None)


def test_long_ids_of_the_audit_are_short_and_whole_on_demand(
        server: Monitor, robot: FakeRobot, signed_in: SignedIn) -> None:
    from rt_robot_os.monitor.security.audit import Somebody
    session = f'{time.time_ns():032x}'
    server.services.accounts.audit.note(Somebody('vera', '127.0.0.1'), 'session.end', 'vera',
                                        session=session)
    page = signed_in('owner', '#/audit')
    cell = page.locator('tr', has_text='vera').first.locator('.audit-details')
    expect(cell).to_have_text(f'session: {session[:8]}…')
    cell.get_by_role('button').click()
    expect(cell).to_have_text(f'session: {session}')
