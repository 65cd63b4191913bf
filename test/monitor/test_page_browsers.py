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

"""The page in browsers that are set in another way: locale, LANG=C, Android, forced colours."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from typing import TYPE_CHECKING

import pytest

pytest.importorskip('playwright.sync_api')

from live_signals import signs  # noqa: E402, I100
from playwright.sync_api import expect  # noqa: E402

if TYPE_CHECKING:
    from fake_robot import FakeRobot

SignedIn = Callable[..., Any]

LOCALES = """async (cases) => {
  const {localeOf} = await import('/lib/locale.js');
  return cases.map(([language, wanted]) => localeOf(language, wanted));
}"""
FORMATS = """async (locales) => {
  const {Format} = await import('/lib/format.js');
  const evening = new Date(2026, 0, 5, 19, 51, 7).getTime();
  return locales.map((locale) => {
    const format = new Format(locale);
    return [format.time(evening).split(',').pop().trim(), format.unit(37.25, '°C', 1),
      format.unit(97, '%'), format.percent(0.97), format.unit(0.5, 'm/s', 2),
      format.unit(NaN, 'm/s')].map((each) =>
      each.replaceAll('\\u00a0', '_').replaceAll('\\u202f', ' '));
  });
}"""


def test_dates_and_numbers_are_written_as_the_browser_is_set(server: Any, opened: Any) -> None:
    page = opened.page()
    page.goto(f'{server.url}/messages/en/data.json')
    assert page.evaluate(LOCALES, [
        ['en', ['en-GB', 'en-US']], ['en', ['de-DE', 'en-US']], ['en', ['de-AT']], ['en', ['en']],
        ['de', ['en-GB', 'en']], ['de', ['de-CH']], ['en', ['C']], ['en', ['en-US@posix']],
    ]) == ['en-GB', 'en-US', 'en-AT', 'en-GB', 'de-GB', 'de-CH', 'en-GB', 'en-US']
    assert page.evaluate(FORMATS, ['en-GB', 'en-US', 'de-DE']) == [
        ['19:51:07', '37.3_°C', '97%', '97%', '0.50_m/s', '–'],
        ['07:51:07 PM', '37.3_°C', '97%', '97%', '0.50_m/s', '–'],
        ['19:51:07', '37,3_°C', '97_%', '97_%', '0,50_m/s', '–']]


#: What Chromium reports with LANG=C; Intl throws at such a tag.
POSIX = """for (const [name, value] of Object.entries({language: 'en-US@posix',
  languages: ['en-US@posix']})) {
  Object.defineProperty(Navigator.prototype, name, {get: () => value, configurable: true});
}"""


def test_plots_are_drawn_with_lang_c(server: Any, robot: FakeRobot, opened: Any) -> None:
    page = opened.page(server.cookie('viewer', ('*',)))
    page.add_init_script(POSIX)
    page.goto(f'{server.url}/#/data/anna')
    expect(page.locator('.data-plot canvas').first).to_be_visible()


#: A browser of a phone: the constructor throws, a worker shows.
ANDROID = """
window.shown = [];
Object.defineProperty(document, 'hidden', {get: () => true, configurable: true});
window.Notification = class {
  constructor() {
    throw new TypeError('Illegal constructor');
  }
  static get permission() {
    return 'granted';
  }
  static async requestPermission() {
    return 'granted';
  }
};
"""
#: One with a worker that is active.
WORKER = """
const worker = {active: {}, showNotification: async (title, options) => window.shown.push([
  title, options.data.hash]), getNotifications: async () => []};
Object.defineProperty(navigator, 'serviceWorker', {value: {register: async () => worker,
  ready: Promise.resolve(worker), getRegistration: async () => worker,
  addEventListener: () => {}}});
"""
NO_WORKER = "Object.defineProperty(navigator, 'serviceWorker', {value: undefined});"


def test_notifications_of_a_phone_are_shown_by_a_worker(
        server: Any, robot: FakeRobot, opened: Any) -> None:
    page = opened.page(server.cookie('carer', ('*',)))
    for script in (ANDROID, WORKER, 'localStorage.setItem("notify", "on")'):
        page.add_init_script(script)
    page.goto(server.url)
    expect(page.locator('.strip')).to_contain_text('No open alarms')
    robot.raise_alarm('n1')
    page.wait_for_function('window.shown.length')
    assert page.evaluate('window.shown') == [['Critical: anna', '#/alarms/robot/n1']]


def test_a_browser_that_shows_no_notifications_is_named(
        server: Any, robot: FakeRobot, opened: Any) -> None:
    page = opened.page(server.cookie('carer', ('*',)))
    for script in (ANDROID, NO_WORKER, 'localStorage.setItem("notify", "on")'):
        page.add_init_script(script)
    page.goto(server.url)
    expect(page.locator('.strip')).to_contain_text('No open alarms')
    robot.raise_alarm('n2')  # an exception would be a complaint of the page
    expect(page.locator('.strip')).to_contain_text('Critical: anna')
    page.get_by_role('button', name='Account and settings').click()
    page.get_by_role('switch', name='Notifications').click()
    page.get_by_role('switch', name='Notifications').click()
    expect(page.get_by_role('dialog')).to_contain_text('shows no notifications of this page')


def test_the_worker_opens_the_view_of_a_notification(server: Any, opened: Any) -> None:
    page = opened.page()
    page.goto(server.url)
    page.get_by_label('Password', exact=True).wait_for()
    page.evaluate("""async () => {
      await navigator.serviceWorker.register('/notification_worker.js');
      await navigator.serviceWorker.ready;
      navigator.serviceWorker.dispatchEvent(new MessageEvent('message',
        {data: {kind: 'go', hash: '#/alarms'}}));
    }""")
    assert page.evaluate('location.hash') == '#/alarms'


#: Backgrounds of what is found, and of the colours of the system.
COLOURS = """([found, ...system]) => {
  const of = (each) => getComputedStyle(each).backgroundColor;
  const probe = document.body.appendChild(document.createElement('span'));
  probe.style.forcedColorAdjust = 'none';
  const known = system.map((name) => {
    probe.style.backgroundColor = name;
    return of(probe);
  });
  probe.remove();
  return [[...document.querySelectorAll(found)].map(of), ...known];
}"""


def test_forced_colours_keep_the_battery_and_the_chosen_range(
        robot: FakeRobot, signed_in: SignedIn) -> None:
    page = signed_in('viewer', forced_colors='active')
    robot.live(battery={'percentage': 0.8}, health__anna__signs=signs(pulse_per_min=72))
    expect(page.locator('.robot')).to_contain_text('80%')
    (level,), text, ground = page.evaluate(COLOURS, ['.battery-level', 'CanvasText', 'Canvas'])
    assert level == text != ground
    page.evaluate('location.hash = "#/data/anna"')
    page.get_by_role('button', name='1 hour', exact=True).click()
    for pressed, is_chosen in (('true', True), ('false', False)):
        found, chosen = page.evaluate(COLOURS, [
            f'.data-ranges [aria-pressed={pressed}]', 'Highlight'])
        assert found and {each == chosen for each in found} == {is_chosen}


TWICE = """async () => {
  const {Words} = await import('/lib/i18n.js');
  const words = new Words();
  await words.use('de');
  words.load('login');
  await words.load('login');
  return words.say('login.title');
}"""


def test_who_asks_second_for_words_waits_for_them_as_well(server: Any, opened: Any) -> None:
    page = opened.page()
    page.goto(f'{server.url}/messages/en/data.json')
    assert page.evaluate(TWICE) == 'Anmelden'


def test_nothing_that_was_said_is_left_after_signing_out(
        robot: FakeRobot, signed_in: SignedIn) -> None:
    page = signed_in('carer', people=('anna', 'bob'))
    robot.raise_alarm('s1')
    expect(page.locator('#say-now')).to_contain_text('anna, Fall')
    page.get_by_role('button', name='Account and settings').click()
    page.get_by_role('button', name='Sign out').click()
    expect(page.get_by_label('Password', exact=True)).to_be_visible()
    assert 'anna' not in page.content()
