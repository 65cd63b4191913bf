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

"""Texts of server and robot, as a German reads them; what the page has no words for is marked."""

from __future__ import annotations

from collections.abc import Callable
import re
from typing import Any
from typing import TYPE_CHECKING

import pytest

pytest.importorskip('playwright.sync_api')

from playwright.sync_api import expect  # noqa: E402, I100

if TYPE_CHECKING:
    from fake_robot import FakeRobot

SignedIn = Callable[..., Any]
FALL = ('anna has fallen: an impact of 3.4 g, then turned by 86 degrees and lying '
        '(confidence 0.83, high)')


def test_the_robot_is_read_in_german(robot: FakeRobot, signed_in: SignedIn) -> None:
    page = signed_in('carer', '#/overview', locale='de-DE')
    robot.live(agent__state='approach anna: fall, at wrist', battery={'percentage': 0.5},
               stop_reason='scan: obstacle 0.21 m before the robot, at -12 degrees')
    card = page.locator('.robot')
    expect(card.locator('.robot-doing')).to_have_text('Unterwegs: anna – Sturz, wrist')
    expect(card).to_contain_text('Hindernis 0,21 m voraus (gesehen von scan, bei -12°)')
    expect(card).to_contain_text(re.compile(r'50\s%'))
    expect(card.locator('[lang=en]')).to_have_count(0)
    robot.live(agent__state='dances on the table')
    expect(card.locator('.robot-doing[lang=en]')).to_have_text('dances on the table')


def test_an_alarm_and_its_events_are_read_in_german(
        robot: FakeRobot, signed_in: SignedIn) -> None:
    robot.raise_alarm('g1', text=FALL)
    robot.raise_alarm('g1', event='unacknowledged', why='mary acknowledged it 15 min ago, and it '
                      'is not resolved', text=FALL)
    robot.raise_alarm('g1', event='failed', why='operator: no report', text=FALL)
    robot.raise_alarm('g1', event='noted', why='robot is 1.0 m from anna, picture, no sound',
                      text=FALL)
    page = signed_in('carer', '#/alarms/robot/g1', locale='de-DE')
    fall = 'anna ist gestürzt: ein Stoß von 3,4 g, um 86° gedreht, und liegt (Sicherheit 0,83)'
    expect(page.locator('.strip')).to_contain_text(fall)
    expect(page.locator('.alarm-head')).to_contain_text(fall)
    line = page.locator('.timeline')
    expect(line).to_contain_text('mary hat vor 15 min quittiert, und er ist nicht erledigt')
    expect(line).to_contain_text('Bedienung: keine Rückmeldung')
    expect(line).to_contain_text('Der Roboter ist 1 m von anna: Bild, kein Ton')
    expect(page.locator('.alarm-pane [lang=en]')).to_have_count(0)
    robot.raise_alarm('g1', event='cause', why='help: she called', text='Own words of a rule')
    expect(line.locator('[lang=en]')).to_have_text('Hilferuf: she called')
    expect(page.locator('.alarm-head [lang=en]')).to_have_text('Own words of a rule')


def test_a_code_of_a_newer_robot_leaves_its_text(robot: FakeRobot, signed_in: SignedIn) -> None:
    robot.raise_alarm('g2', text='anna has fallen on the moon', codes={'text': {
        'code': 'fall_on_the_moon', 'args': {'person': 'anna'}}})
    page = signed_in('carer', '#/alarms/robot/g2', locale='de-DE')
    expect(page.locator('.alarm-head [lang=en]')).to_have_text('anna has fallen on the moon')


def test_refusals_are_read_in_german(robot: FakeRobot, signed_in: SignedIn) -> None:
    robot.raise_alarm('g3')
    robot._answer = lambda command: (False, 'alarm g3 is raised already')
    page = signed_in('carer', '#/alarms/robot/g3', locale='de-DE')
    act = page.locator('.alarm-actions').get_by_role('button', name='Quittieren')
    act.click()
    toast = page.locator('#toasts')
    expect(toast).to_contain_text('Dieser Alarm ist kein Verdacht mehr')
    expect(toast.locator('[lang=en]')).to_have_count(0)
    robot._answer = lambda command: (False, 'the gears are full of jam')
    act.click()
    expect(toast.locator('[lang=en]')).to_have_text('the gears are full of jam')


def test_people_who_are_not_granted_are_in_no_argument_of_a_code(
        robot: FakeRobot, signed_in: SignedIn) -> None:
    page = signed_in('carer', people=('bob',))
    frames: list[str] = []
    page.on('websocket', lambda socket: socket.on('framereceived', lambda text: frames.append(
        str(text))))
    page.reload()
    page.locator('.robot').wait_for()
    robot.live(agent__state='approach anna: fall, at wrist')
    expect(page.locator('.robot-doing')).to_contain_text('On its way')
    assert any('agent_approach' in each for each in frames)
    assert not any('anna' in each for each in frames)


def test_actions_of_the_audit_are_read_in_german(server: Any, signed_in: SignedIn) -> None:
    page = signed_in('owner', '#/audit', locale='de-DE')
    expect(page.locator('.audit-table')).to_contain_text('Live-Verbindung geöffnet')
