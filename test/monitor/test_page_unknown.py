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

"""What the page shows when it knows nothing: unknown is never good news, and it sounds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from typing import TYPE_CHECKING

import pytest

pytest.importorskip('playwright.sync_api')

from live_signals import news2  # noqa: E402, I100
from live_signals import NODES  # noqa: E402
from live_signals import signs  # noqa: E402
from page_network import Network  # noqa: E402
from playwright.sync_api import expect  # noqa: E402

if TYPE_CHECKING:
    from fake_robot import FakeRobot

SignedIn = Callable[..., Any]
#: Notes each tone that the page would play.
LISTEN = """
window.tones = [];
const make = AudioContext.prototype.createOscillator;
AudioContext.prototype.createOscillator = function created() {
  const made = make.call(this);
  const start = made.start.bind(made);
  made.start = (at) => {
    window.tones.push(made.frequency.value);
    start(at);
  };
  return made;
};
"""


@pytest.fixture
def shown(server: Any, robot: FakeRobot, opened: Any) -> Callable[..., tuple[Any, Network]]:
    """Give a function that opens a view on a robot that is well, with its own clock."""
    def open_page(view: str = 'overview', sound: bool = False) -> tuple[Any, Network]:
        page = opened.page(server.cookie('owner', ('*',)))
        network = Network(page)
        page.clock.install()
        page.add_init_script(LISTEN)
        if sound:
            page.add_init_script('localStorage.setItem("sound", "on")')
        page.goto(f'{server.url}/#/{view}')
        page.locator('.view').wait_for()
        robot.live(health__anna__signs=signs(pulse_per_min=72),
                   health__anna__news2_details=news2(0, 'Low'), agent__state='idle',
                   battery={'percentage': 0.8}, pose={'x': 1.0, 'y': 1.0, 'yaw': 0.0},
                   wsn__nodes=NODES)
        expect(page.locator('.strip')).to_have_class('strip strip-calm')
        return page, network
    return open_page


def test_a_server_that_says_nothing_more_is_no_good_news(
        shown: Callable[..., tuple[Any, Network]]) -> None:
    page, network = shown()
    card, robot = page.locator('[data-person=anna]'), page.locator('.robot')
    expect(card).to_contain_text('No alarm, low risk')
    expect(robot.locator('.badge')).to_have_class('badge tone-ok')
    expect(robot).to_contain_text('80%')
    network.freeze()
    page.clock.run_for(8000)
    strip = page.locator('.strip')
    expect(strip).to_have_class('strip strip-outage')
    expect(strip).to_contain_text('Alarms unknown')
    expect(strip).to_contain_text('No answer from the server since')
    expect(strip).not_to_contain_text('No open alarms')
    expect(page.locator('.link')).to_contain_text('No connection since')
    expect(card).to_contain_text('No data: not connected')
    expect(card.locator('.score')).to_have_class('score tone-none')
    expect(robot.locator('.badge')).to_have_class('badge tone-stale')
    expect(robot).to_contain_text('last: 80%')
    expect(page.locator('.view')).to_contain_text('1 robot, connection not known')
    expect(page).to_have_title('Alarms unknown – Overview – Monitor')
    assert 'icon_unknown' in page.locator('#icon').get_attribute('href')
    assert page.locator('.view .tone-ok, .strip-calm, .link-live').count() == 0


def test_it_sounds_until_it_is_silenced_and_again_the_next_time(
        shown: Callable[..., tuple[Any, Network]]) -> None:
    page, network = shown(sound=True)
    page.get_by_role('heading', level=1).click()
    expect(page.get_by_role('button', name='Sound of alarms')).to_have_attribute(
        'aria-pressed', 'true')

    def tones() -> list[float]:
        found: list[float] = page.evaluate('window.tones')
        return found

    assert tones() == []
    network.freeze()
    page.clock.run_for(14_000)
    assert tones()[:3] == [440, 330, 262]
    expect(page.locator('#say-now')).to_contain_text('Alarms unknown')
    page.clock.run_for(21_000)
    assert len(tones()) >= 6
    page.locator('.strip').get_by_role('button', name='Silence').click()
    heard = len(tones())
    page.clock.run_for(60_000)
    assert len(tones()) == heard
    expect(page.locator('.strip')).to_contain_text('Alarms unknown')
    network.is_frozen = False
    page.clock.run_for(4000)
    expect(page.locator('.strip')).to_have_class('strip strip-calm')
    network.freeze()
    page.clock.run_for(14_000)
    assert len(tones()) > heard


def test_an_alarm_that_was_open_stays_loud_and_says_that_it_is_of_the_past(
        robot: FakeRobot, shown: Callable[..., tuple[Any, Network]]) -> None:
    page, network = shown()
    robot.raise_alarm('u1')
    strip = page.locator('.strip')
    expect(strip).to_contain_text('Critical: anna – Fall')
    network.freeze()
    page.clock.run_for(8000)
    expect(strip).to_contain_text('Critical: anna – Fall')
    expect(strip).to_contain_text('No answer from the server since')
    expect(page).to_have_title('(1) anna: Fall – Alarms unknown')


def test_no_list_is_calm_while_it_cannot_be_known(
        shown: Callable[..., tuple[Any, Network]]) -> None:
    page, network = shown('alarms')
    page.get_by_role('button', name='Open', exact=True).click()
    view = page.locator('.view')
    expect(view.locator('.notice-calm')).to_be_visible()
    network.freeze()
    page.clock.run_for(8000)
    expect(view.locator('.notice-calm')).to_have_count(0)
    expect(view).to_contain_text('Open alarms unknown')
    expect(view).to_contain_text('No answer from the server since')


def test_nodes_and_places_are_shown_as_of_the_past(
        shown: Callable[..., tuple[Any, Network]]) -> None:
    page, network = shown('network')
    row = page.locator('tbody tr').filter(has=page.get_by_role('rowheader', name='sink'))
    expect(row.locator('.badge')).to_have_class('badge tone-accent')
    page.evaluate('location.hash = "#/position"')
    place = page.locator('.position-robot .position-item')
    expect(place).to_be_visible()
    expect(place).not_to_have_class('position-item is-stale')
    network.freeze()
    page.clock.run_for(8000)
    expect(place).to_have_class('position-item is-stale')
    page.evaluate('location.hash = "#/network"')
    page.clock.run_for(1000)
    expect(row.locator('.badge')).to_have_class('badge tone-stale')
    assert page.locator('tbody .tone-ok, tbody .tone-accent').count() == 0


def test_a_robot_that_is_away_is_no_good_news_either(
        robot: FakeRobot, signed_in: SignedIn) -> None:
    page = signed_in('carer', '#/network')
    strip = page.locator('.strip')
    expect(strip).to_contain_text('No open alarms')
    robot.disconnect()
    expect(strip).to_have_class('strip strip-outage')
    expect(strip).to_contain_text('Alarms unknown')
    expect(strip).to_contain_text('0 of 1 robot connected')
    expect(page).to_have_title('Alarms unknown – Network – Monitor')
    robot.connect()
    expect(strip).to_have_class('strip strip-calm')
    expect(page).to_have_title('Network – Monitor')


def test_who_wants_to_drive_is_not_told_what_the_robot_did_before(
        robot: FakeRobot, signed_in: SignedIn) -> None:
    page = signed_in('owner', '#/drive/robot')
    robot.live(speed={'linear_m_s': 0.42, 'angular_rad_s': 0.0}, stop_reason='', steering='')
    facts = page.locator('.drive-facts')
    expect(facts).to_contain_text('0.42 m/s')
    robot.disconnect()
    expect(facts).not_to_contain_text('0.42')
    robot.connect()


ROBOTS = """async () => {
  const {outageOf, outageWords, Silence} = await import('/lib/outage.js');
  localStorage.clear();
  const robot = (id, connected, seenS, silent = false) => ({id, connected, silent,
    last_seen_ns: (1000 - seenS) * 1e9});
  const state = (...robots) => ({isKnown: true, isCurrent: true, server: {storing: true},
    live: {}, nowNs: () => 1000 * 1e9, robots: new Map(robots.map((each) => [each.id, each]))});
  const silence = new Silence();
  const of = (now) => {
    const outage = outageOf(now);
    silence.update(now);
    return [outage?.kind ?? null, (outage?.away || []).map((each) => each.id).join(),
      silence.sounds(outage)];
  };
  const words = (now) => outageWords(outageOf(now), {state: now, format: {time: String},
    t: (key, values) => [key, values?.names].filter(Boolean).join(' ')}).title;
  const up = robot('a', true, 0);
  const away = robot('b', false, 61);
  const found = {
    well: of(state(up)), none: of(state()), short: of(state(up, robot('b', false, 59))),
    long: of(state(up, away)), silent: of(state(robot('a', true, 61, true))),
    retired: of(state(up, {...away, retired: true})), words: words(state(up, away)),
    storing: of({...state(up), server: {storing: false}}),
    server: [9000, 11000].map((ageMs) => silence.sounds({kind: 'server', ageMs, away: []}))};
  silence.silence(outageOf(state(up, away)));
  found.silenced = of(state(up, away));
  // Also after a reload; another robot that goes away sounds.
  found.reloaded = new Silence().sounds(outageOf(state(up, away)));
  found.other = of(state(robot('a', false, 61), away));
  of(state(up, robot('b', true, 0)));
  found.again = of(state(up, away));
  return found;
}"""


def test_which_robots_are_away_and_when_that_sounds(server: Any, opened: Any) -> None:
    page = opened.page()
    page.goto(f'{server.url}/messages/en/data.json')
    assert page.evaluate(ROBOTS) == {
        'well': [None, '', False], 'none': ['none', '', False], 'short': ['robots', 'b', False],
        'long': ['robots', 'b', True], 'silent': ['robots', 'a', True],
        'retired': [None, '', False], 'words': 'shell.unknown_alarms_of b',
        'storing': ['storing', '', False], 'server': [False, True],
        'silenced': ['robots', 'b', False], 'reloaded': False, 'other': ['robots', 'a,b', True],
        'again': ['robots', 'b', True]}


@pytest.mark.parametrize(('score', 'said'), [
    (news2(3, 'Low-medium'), 'Low to medium risk by NEWS2'),
    (news2('', ''), 'No alarm, risk not known')])
def test_a_risk_that_is_not_low_or_not_known_is_not_green(
        robot: FakeRobot, signed_in: SignedIn, score: Any, said: str) -> None:
    page = signed_in('carer')
    robot.live(health__bob__signs=signs(pulse_per_min=72), health__bob__news2_details=score)
    badge = page.locator('[data-person=bob] .badge').first
    expect(badge).to_contain_text(said)
    expect(badge).not_to_have_class('badge tone-ok')
