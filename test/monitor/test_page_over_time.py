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


"""The page over time: somebody signs in and out, the connection goes and comes back."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from typing import TYPE_CHECKING

import pytest

pytest.importorskip('playwright.sync_api')

from page_network import Network  # noqa: E402, I100
from playwright.sync_api import expect  # noqa: E402


if TYPE_CHECKING:
    from fake_robot import FakeRobot

SignedIn = Callable[..., Any]


def test_somebody_signs_in_and_out_everywhere(
        server: Any, robot: FakeRobot, opened: Any) -> None:
    pages = [opened.page(), opened.page()]
    for page in pages:
        page.goto(server.url)
        page.get_by_label('Name').fill(server.name)
        page.get_by_label('Password', exact=True).fill(server.password)
        page.get_by_role('button', name='Sign in').click()
        expect(page.locator('[data-person=anna]')).to_be_visible()
    here, there = pages
    here.evaluate('location.hash = "#/account"')
    here.get_by_role('button', name='Sign out everywhere').click()
    here.get_by_role('dialog').get_by_role('button', name='Sign out everywhere').click()
    for page in (here, there):
        expect(page.get_by_label('Password', exact=True)).to_be_visible()
        assert 'anna' not in page.content()


def test_a_lost_connection_is_shown_and_comes_back(
        server: Any, robot: FakeRobot, opened: Any) -> None:
    page = opened.page(server.cookie('carer', ('*',)))
    network = Network(page)
    page.goto(server.url)
    link = page.locator('.link')
    expect(link).to_have_text('Live')
    network.cut()
    expect(link).to_contain_text('No connection since')
    expect(page.locator('#say-later')).to_contain_text('No connection since')
    robot.raise_alarm('r1')
    network.is_up = True
    expect(link).to_have_text('Live')
    expect(page.locator('.strip')).to_contain_text('anna – Fall')
    expect(page.locator('#say-now')).to_contain_text('anna, Fall')


TRIES = """async () => {
  const {Live} = await import('/lib/live.js');
  window.tries = [];
  window.WebSocket = class {
    constructor() {
      window.tries.push(Date.now());
      setTimeout(() => this.onclose({code: 1006}), 10);
    }
  };
  new Live('/live').start();
}"""


def test_it_tries_again_at_least_each_two_seconds(server: Any, opened: Any) -> None:
    page = opened.page()
    page.clock.install()
    page.goto(f'{server.url}/messages/en/data.json')
    page.evaluate(TRIES)
    page.clock.run_for(60_000)
    tries = page.evaluate('window.tries')
    assert len(tries) > 30
    assert max(after - before for before, after in zip(tries, tries[1:])) <= 2000


def test_a_robot_that_is_away_is_told_and_its_data_are_old(
        robot: FakeRobot, signed_in: SignedIn) -> None:
    page = signed_in('carer')
    robot.live(agent__state='idle')
    card = page.locator('.robot')
    expect(card).to_contain_text('Idle: no emergency')
    robot.disconnect()
    expect(card).to_contain_text('Not connected')
    expect(card).to_contain_text('Last: Idle')
    expect(page.locator('[data-person=anna]')).to_contain_text('No data: not connected')
    robot.connect()
    expect(card.get_by_text('Connected', exact=True)).to_be_visible()
