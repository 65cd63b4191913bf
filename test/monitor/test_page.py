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


"""The page in a real browser: who signs in, what they see, what they may do about alarms."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from typing import TYPE_CHECKING

import pytest

pytest.importorskip('playwright.sync_api')

from live_signals import news2  # noqa: E402, I100
from live_signals import signs  # noqa: E402
from playwright.sync_api import expect  # noqa: E402
from processes import wait_until  # noqa: E402

if TYPE_CHECKING:
    from fake_robot import FakeRobot

SignedIn = Callable[..., Any]
STRIP = '.strip'


def test_live_data_are_shown_in_words(robot: FakeRobot, signed_in: SignedIn) -> None:
    page = signed_in('viewer')
    card = page.locator('[data-person=anna]')
    expect(card).to_be_visible()
    robot.live(health__anna__signs=signs(pulse_per_min=112, spo2_percent=93),
               health__anna__news2_details=news2(7, 'High'), agent__state='idle',
               battery={'percentage': 0.16})
    expect(card.locator('.sign', has_text='Pulse')).to_contain_text('112')
    expect(card.locator('.score')).to_contain_text('7')
    expect(card.locator('.score')).to_contain_text('risk high')
    expect(card).to_contain_text('High risk by NEWS2')
    robot_card = page.locator('.robot', has_text='robot')
    expect(robot_card).to_contain_text('Idle: no emergency')
    expect(robot_card).to_contain_text('16%, low')


def test_an_alarm_comes_and_is_acknowledged(robot: FakeRobot, signed_in: SignedIn) -> None:
    page = signed_in('carer', '#/network')
    expect(page.locator(STRIP)).to_contain_text('No open alarms')
    robot.raise_alarm('a1')
    expect(page.locator(STRIP)).to_contain_text('Critical: anna – Fall')
    expect(page).to_have_title('(1) anna: Fall')
    expect(page.locator('#say-now')).to_contain_text('anna, Fall')
    page.locator(STRIP).get_by_role('button', name='Acknowledge').click()
    expect(page.locator('#toasts')).to_contain_text('Acknowledged')
    assert [(each['do'], each['args']['text'], each['by']) for each in robot.commands] == [
        ('alarm', 'acknowledge a1 by carer-all', 'carer-all')]
    robot.raise_alarm('a1', event='acknowledged', state='acknowledged', by='carer-all')
    expect(page.locator(STRIP)).to_contain_text('Acknowledged (carer-all)')
    expect(page).not_to_have_title('(1) anna: Fall')


def test_a_note_is_stored_at_once_and_can_be_withdrawn(
        robot: FakeRobot, signed_in: SignedIn) -> None:
    robot.raise_alarm('a2')
    page = signed_in('carer', '#/alarms/robot/a2')
    line = page.locator('.timeline')
    expect(line).to_contain_text('Raised')
    for text in ('not this', 'I am on my way'):
        page.get_by_role('textbox', name='Note').fill(text)
        page.get_by_role('button', name='Add note').click()
        expect(line).to_contain_text(text)
        if text == 'not this':
            page.get_by_role('button', name='Undo').click()
            expect(page.locator('#toasts')).to_contain_text('Note withdrawn')
    expect(line).to_contain_text('I am on my way')
    expect(line).not_to_contain_text('not this')


def test_a_note_stays_when_the_page_is_left_in_the_same_moment(
        server: Any, robot: FakeRobot, signed_in: SignedIn) -> None:
    robot.raise_alarm('a7')
    page = signed_in('carer', '#/alarms/robot/a7')
    page.get_by_role('textbox', name='Note').fill('she is well')
    # The click and the way out are one task: nothing has been sent when the page goes.
    page.evaluate("""() => {
        document.querySelector('.note-form button').click();
        location.href = 'about:blank';
    }""")
    page.wait_for_url('about:blank')
    page.context.close()
    wait_until(lambda: [each['text'] for each in server.services.store.alarm(
        'robot', 'a7')['notes']] == ['she is well'], 'the note is stored')


def test_a_note_that_cannot_be_stored_stays_where_it_was_written(
        robot: FakeRobot, signed_in: SignedIn) -> None:
    robot.raise_alarm('a8')
    page = signed_in('carer', '#/alarms/robot/a8')
    page.route('**/notes', lambda route: route.abort())
    note = page.get_by_role('textbox', name='Note')
    note.fill('she is well')
    page.get_by_role('button', name='Add note').click()
    expect(page.locator('#toasts')).to_contain_text('The server does not answer')
    expect(note).to_have_value('she is well')


def test_what_only_a_carer_may_do_is_not_there_for_a_viewer(
        robot: FakeRobot, signed_in: SignedIn) -> None:
    robot.raise_alarm('a3')
    page = signed_in('viewer', '#/alarms/robot/a3')
    expect(page.locator('.alarm-title')).to_contain_text('Fall')
    for name in ('Acknowledge', 'Resolve', 'Tell the next', 'Add note', 'Stop'):
        expect(page.get_by_role('button', name=name)).to_have_count(0)
    expect(page.get_by_role('link', name='Drive')).to_have_count(0)
    page.evaluate('location.hash = "#/drive"')
    expect(page.get_by_role('heading', level=1)).to_have_text('Overview')


def test_people_who_are_not_granted_are_not_named(robot: FakeRobot, signed_in: SignedIn) -> None:
    robot.raise_alarm('a4')
    page = signed_in('carer', people=('bob',))
    expect(page.locator('[data-person=bob]')).to_be_visible()
    expect(page.locator(STRIP)).to_contain_text('No open alarms')
    assert 'anna' not in page.content()


def tab_to(page: Any, wanted: Any) -> None:
    """Go by keys to something that is to be seen."""
    expect(wanted).to_be_visible()
    for _ in range(40):
        page.keyboard.press('Tab')
        if wanted.evaluate('each => each === document.activeElement'):
            return
    pytest.fail(f'no Tab leads to {wanted}')


def test_alarms_are_acknowledged_and_the_robot_stopped_by_keys(
        robot: FakeRobot, signed_in: SignedIn) -> None:
    robot.raise_alarm('a5')
    page = signed_in('carer')
    page.keyboard.press('F9')
    expect(page.get_by_role('heading', level=1)).to_have_text('Alarms')
    tab_to(page, page.locator('.view-alarms').get_by_role('button', name='Acknowledge'))
    page.keyboard.press('Enter')
    expect(page.locator('#toasts')).to_contain_text('Acknowledged')
    page.keyboard.press('F8')
    expect(page.locator('#toasts')).to_contain_text('robot has been stopped')
    expect(page.locator('#say-now')).to_contain_text('has been stopped')
    assert [each['do'] for each in robot.commands] == ['alarm', 'stop']


LEAVE = """() => new Promise((done) => {
  addEventListener('hashchange', () => {
    document.querySelector('.view-overview a').focus();
    done();
  }, {once: true});
  location.hash = '#/network';
})"""


def test_the_keys_are_at_the_beginning_of_a_view_that_comes_while_they_are_in_the_last_one(
        robot: FakeRobot, signed_in: SignedIn) -> None:
    page = signed_in('viewer')
    page.locator('.view-overview a').first.wait_for()
    page.evaluate(LEAVE)
    expect(page.locator('.view-network')).to_be_visible()
    expect(page.locator('main')).to_be_focused()


def test_what_the_robot_refuses_is_said(robot: FakeRobot, signed_in: SignedIn) -> None:
    robot.raise_alarm('a6')
    robot._answer = lambda command: (False, 'alarm a6 is nobody of mine')
    page = signed_in('carer', '#/alarms/robot/a6')
    page.locator('.alarm-actions').get_by_role('button', name='Acknowledge').click()
    expect(page.locator('#toasts')).to_contain_text('nobody of mine')


def test_language_and_theme_are_switched_and_kept(
        robot: FakeRobot, signed_in: SignedIn) -> None:
    page = signed_in('viewer')
    page.get_by_role('button', name='Account and settings').click()
    page.get_by_role('button', name='Dark').click()
    page.get_by_label('Language').select_option('de')
    expect(page.get_by_role('heading', level=1)).to_have_text('Übersicht')
    expect(page.locator('html')).to_have_attribute('lang', 'de')
    page.reload()
    expect(page.locator('html')).to_have_attribute('data-theme', 'dark')
    expect(page.get_by_role('heading', level=1)).to_have_text('Übersicht')


def test_the_sound_says_that_it_waits_for_a_touch(
        robot: FakeRobot, signed_in: SignedIn) -> None:
    page = signed_in('viewer')
    page.evaluate('localStorage.setItem("sound", "on")')
    page.reload()
    sound = page.get_by_role('button', name='Sound of alarms')
    expect(sound).to_have_attribute('title', 'Wanted, but the browser plays nothing before you '
                                    'have touched the page: tap anywhere.')
    page.get_by_role('heading', level=1).click()
    expect(sound).to_have_attribute('aria-pressed', 'true')
