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

"""A page that was left untouched: an alarm is answered in one step, the robot stopped without."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from typing import TYPE_CHECKING
from uuid import uuid4

import pytest

pytest.importorskip('playwright.sync_api')

from playwright.sync_api import expect  # noqa: E402, I100

if TYPE_CHECKING:
    from fake_robot import FakeRobot

PASSWORD = 'seven wet umbrellas'
Locked = Callable[..., Any]


@pytest.fixture
def locked(server: Any, robot: FakeRobot, opened: Any) -> Locked:
    """Give a function that opens a view for a carer, and then locks the session."""
    from monitor_server import lock_sessions
    from rt_robot_os.monitor.security.roles import Role
    accounts = server.services.accounts

    def open_page(view: str = '', **options: Any) -> Any:
        user = accounts.users.add(f'carla {uuid4().hex}', Role.CARER, ('*',), 'test',
                                  accounts.passwords.hash(PASSWORD))
        _, secret = accounts.sessions.begin(user.id, '127.0.0.1', 'test')
        page = opened.page(secret, **options)
        page.goto(f'{server.url}/{view}')
        page.locator('.view').wait_for()
        expect(page.locator('.locked-mark')).to_be_hidden()
        lock_sessions(server.services, user.id)
        return page
    return open_page


def test_an_alarm_is_acknowledged_with_the_password_in_place(
        robot: FakeRobot, locked: Locked) -> None:
    page = locked()
    # The page says so by itself.
    expect(page.locator('.locked-mark')).to_be_visible()
    robot.raise_alarm('k1')
    page.locator('.strip').get_by_role('button', name='Acknowledge').click()
    dialog = page.get_by_role('dialog')
    expect(dialog.get_by_label('Password')).to_be_focused()
    page.keyboard.type('not the one at all')
    page.keyboard.press('Enter')
    expect(dialog).to_contain_text('password is wrong')
    assert robot.commands == []
    page.keyboard.type(PASSWORD)
    page.keyboard.press('Enter')
    expect(page.locator('#toasts')).to_contain_text('Acknowledged')
    assert [each['args']['text'].split()[:2] for each in robot.commands] == [['acknowledge', 'k1']]
    expect(page.locator('.locked-mark')).to_be_hidden()
    expect(page.get_by_role('heading', level=1)).to_have_text('Overview')


def test_after_a_reload_all_that_the_role_may_do_is_there_and_stop_asks_for_nothing(
        robot: FakeRobot, locked: Locked) -> None:
    robot.raise_alarm('k2')
    page = locked()
    page.reload()
    expect(page.locator('.locked-mark')).to_have_attribute('title', 'Not used for a while: Stop '
                                                           'still works, everything else asks for '
                                                           'the password')
    expect(page.locator('.strip').get_by_role('button', name='Acknowledge')).to_be_visible()
    page.get_by_role('banner').get_by_role('button', name='Stop').click()
    expect(page.locator('#toasts')).to_contain_text('robot has been stopped')
    page.keyboard.press('F8')
    expect(page.locator('.toast', has_text='robot has been stopped')).to_have_count(2)
    assert [each['do'] for each in robot.commands] == ['stop', 'stop']
    expect(page.locator('.locked-mark')).to_be_visible()


def test_the_question_for_the_password_is_in_nobodys_way(
        robot: FakeRobot, locked: Locked) -> None:
    robot.raise_alarm('k3')
    page = locked('#/alarms/robot/k3')
    page.locator('.alarm-actions').get_by_role('button', name='Acknowledge').click()
    page.get_by_role('dialog').get_by_role('button', name='Stop').click()
    expect(page.locator('#toasts')).to_contain_text('robot has been stopped')
    expect(page.locator('#toasts')).to_contain_text('Not done: the password was not typed')
    assert [each['do'] for each in robot.commands] == ['stop']


def test_a_view_that_needs_more_says_so_and_opens_when_unlocked(
        robot: FakeRobot, locked: Locked) -> None:
    page = locked('#/camera')
    expect(page.locator('main')).to_contain_text('This session is locked')
    page.locator('main').get_by_role('button', name='Unlock').click()
    page.get_by_role('dialog').get_by_label('Password').fill(PASSWORD)
    page.keyboard.press('Enter')
    expect(page.locator('.view-camera')).to_be_visible()


def test_one_window_unlocks_the_other_and_does_nothing_there(
        server: Any, robot: FakeRobot, locked: Locked) -> None:
    robot.raise_alarm('k4')
    here = locked()
    there = here.context.new_page()
    there.goto(server.url)
    there.locator('.strip').get_by_role('button', name='Acknowledge').click()
    here.locator('.locked-mark').click()
    here.get_by_role('dialog').get_by_label('Password').fill(PASSWORD)
    here.keyboard.press('Enter')
    for page in (here, there):
        expect(page.locator('.locked-mark')).to_be_hidden()
        expect(page.get_by_role('dialog')).to_have_count(0)
    expect(there.locator('#toasts')).to_contain_text('Not done: the password was not typed')
    assert robot.commands == []
