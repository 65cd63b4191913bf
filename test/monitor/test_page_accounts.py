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

"""Accounts in a real browser: invited, set up, locked, with a new password."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

pytest.importorskip('playwright')

SignedIn = Callable[..., Any]
PASSWORD = 'seven wet umbrellas'
OTHER = 'green table lamp'


def test_somebody_is_invited_and_chooses_a_password_once(
        server: Any, opened: Any, signed_in: SignedIn) -> None:
    admin = signed_in('admin', '#/admin', people=())
    admin.get_by_role('button', name='Add a user').click()
    form = admin.get_by_role('dialog')
    form.get_by_label('Name').fill('gina')
    form.get_by_label('May see').fill('anna\nbob')
    form.get_by_role('button', name='Add').click()
    link = admin.get_by_role('textbox', name='Link for gina').input_value()
    assert link.startswith(f'{server.url}/#/setup/')
    guest = opened.page()
    guest.goto(link)
    guest.get_by_label('New password').fill(PASSWORD)
    guest.get_by_label('Once more').fill(OTHER)
    guest.get_by_text('The two differ.').wait_for()
    guest.get_by_label('Once more').fill(PASSWORD)
    # Whoever goes back, or looks at the address, does not find the link.
    assert guest.evaluate('location.hash') == '#/setup'
    guest.get_by_role('button', name='Begin').click()
    guest.locator('.rail').wait_for()
    again = opened.page()
    again.goto(link)
    again.get_by_text('This link works no more').wait_for()


def test_a_password_is_changed_and_the_page_stays(server: Any, opened: Any) -> None:
    accounts = server.services.accounts
    from rt_robot_os.monitor.security.roles import Role
    accounts.users.add('petra', Role.CARER, ('anna',), 'test', accounts.passwords.hash(PASSWORD))
    page = opened.page()
    page.goto(server.url)
    for password, begins in ((OTHER, False), (PASSWORD, True)):
        page.get_by_label('Name').fill('petra')
        page.get_by_label('Password', exact=True).fill(password)
        page.get_by_role('button', name='Sign in').click()
        page.locator('.rail').wait_for() if begins else page.get_by_text(
            'Name or password is wrong').wait_for()
    page.goto(f'{server.url}/#/account')
    page.get_by_label('Present password').fill(PASSWORD)
    page.get_by_label('New password').fill(OTHER)
    page.get_by_label('Once more').fill(OTHER)
    page.get_by_role('button', name='Change the password').click()
    page.get_by_text('The password is changed').wait_for()
    page.goto(f'{server.url}/#/overview')
    page.locator('.rail').wait_for()
    user = accounts.users.find('petra')
    assert accounts.passwords.matches(user.password, OTHER)
    assert len(accounts.sessions.of(user.id)) == 1
