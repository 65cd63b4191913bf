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


"""The data view in a real browser: time, gaps, zones, live values, history, alarms."""

from __future__ import annotations

from collections.abc import Callable
import re
import time
from typing import Any
from typing import TYPE_CHECKING

import pytest

pytest.importorskip('playwright.sync_api')

from playwright.sync_api import expect  # noqa: E402, I100
from rt_robot_os.features.health.assessment.news2 import score  # noqa: E402

if TYPE_CHECKING:
    from fake_robot import FakeRobot

SignedIn = Callable[..., Any]
NS_PER_S = 1_000_000_000
PULSE = 'pulse_per_min'
VIEW = "document.querySelector('.view-data').dataView"
REQUESTS = f'() => {VIEW}.history.requests'
BUCKET = f"() => {VIEW}.rows.get('pulse_per_min').columns.bucketMs"
COUNTED = re.compile(r'Pulse: mean 72\s/min, from 70 to 74, .*gaps: 1')
LAST = re.compile('to 123, last 123; gaps: 1')
DAY = re.compile('gaps: [2-4]')


@pytest.fixture
def modules(server: Any, opened: Any) -> Any:
    """Open a page that has nothing of its own, and may load the modules of the monitor's."""
    page = opened.page()
    page.goto(f'{server.url}/messages/en/data.json')
    return page


def keep_pulse(robot: FakeRobot, ages_s: list[float], value: float = 70.0) -> None:
    """Have the server store values of so long ago."""
    now_ns = time.time_ns()
    robot.keep(*({**robot.script.record('observation', {
        'person': 'anna', 'sign': PULSE, 'value': value + index % 5, 'quality': 'good',
        'source': 'wrist'}), 'utc_ns': now_ns - int(age_s * NS_PER_S)}
        for index, age_s in enumerate(ages_s)))


TIMES = """async () => {
  const {Timeline, LEAST_MS, MOST_MS} = await import('/views/data/timeline.js');
  let seed = 1;
  const random = () => (seed = (seed * 16807) % 2147483647) / 2147483647;
  const found = {moved: 0, beyond: 0, spans: [], follows: []};
  for (let i = 0; i < 500; i += 1) {
    const now = 1.8e12;
    const line = new Timeline(() => now, Math.exp(Math.log(LEAST_MS)
      + random() * Math.log(MOST_MS / LEAST_MS)));
    line.pan(-5 * random());
    const part = random() * 0.9;
    const at = line.start + part * line.span;
    line.zoom(Math.exp(4 * random() - 2), at);
    const isWhole = line.span > LEAST_MS && line.span < MOST_MS;
    if (isWhole && !line.follows) {
      found.moved = Math.max(found.moved, Math.abs((at - line.start) / line.span - part));
    }
    found.beyond = Math.max(found.beyond, line.end - now - 0.0201 * line.span);
    found.spans.push(line.span);
  }
  found.least = Math.min(...found.spans) >= LEAST_MS;
  found.most = Math.max(...found.spans) <= MOST_MS;
  let now = 1e12;
  const line = new Timeline(() => now, 60_000);
  now += 10; found.follows.push(line.tick(1000));
  now += 90; found.follows.push(line.tick(1000), line.end > now);
  line.pan(-0.5); now += 1e6; found.follows.push(line.tick(1000), line.follows);
  line.follow(); found.follows.push(line.end > now, line.span === 60_000);
  delete found.spans;
  return found;
}"""


def test_a_zoom_keeps_the_time_at_the_cursor_between_a_second_and_a_year(
        modules: Any) -> None:
    found = modules.evaluate(TIMES)
    assert found['moved'] < 1e-3
    assert found['beyond'] <= 0
    assert found['least'] and found['most']
    assert found['follows'] == [False, True, True, False, False, True, True]


COLUMNS = """async () => {
  const {Columns} = await import('/views/data/columns.js');
  const made = new Columns(64);
  const chart = (t) => ({t, low: t.map(() => 60), mean: t.map(() => 70), high: t.map(() => 80),
                         count: t.map(() => 1)});
  const how = {bucketMs: 0, longestGapMs: 120_000, isNow: true};
  const joined = () => Array.from({length: made.length}, (_, i) => made.isJoined(i));
  const found = {};
  // Recorded each minute, with one that is missing; then live each second, with three missing.
  made.replace(chart([0, 60_000, 240_000, 300_000]), how);
  for (const t of [301_000, 302_000, 303_000, 307_000, 308_000]) made.append(t, 71);
  found.joined = joined();
  found.again = made.append(308_000, 99);
  // The same stretch again, longer: what is live and newer stays, in its place.
  made.replace(chart([0, 60_000, 240_000, 300_000, 303_000]), how);
  found.times = Array.from(made.t.subarray(0, made.length));
  // A history that ends in the past has nothing to do with what is live.
  made.replace(chart([0, 60_000]), {...how, isNow: false});
  found.past = made.length;
  // What is finer than a pixel becomes one value: lowest, mean, highest.
  made.clear();
  made.replace(chart([0]), {...how, bucketMs: 1000});
  [[1000, 60], [1200, 90], [1400, 75]].forEach(([t, value]) => made.append(t, value));
  found.folded = [made.length, made.low[1], made.mean[1], made.high[1], made.count[1]];
  found.summary = made.summary(1000, 2000);
  // Full: the oldest give way, nothing grows.
  made.clear();
  for (let t = 0; t < 200; t += 1) made.append(t * 2000, t);
  found.full = [made.length <= 64, made.mean[made.length - 1], made.dropped > 0,
                made.t.length];
  found.sorted = made.t.subarray(0, made.length).every((t, i, all) => !i || all[i - 1] < t);
  return found;
}"""


def test_a_gap_stays_a_gap_and_what_is_live_goes_on_from_the_history(
        modules: Any) -> None:
    found = modules.evaluate(COLUMNS)
    assert found['joined'] == [False, True, False, True, True, True, True, False, True]
    assert found['again'] is False
    assert found['times'] == [0, 60_000, 240_000, 300_000, 303_000, 307_000, 308_000]
    assert found['past'] == 2
    assert found['folded'] == [2, 60, 75, 90, 3]
    assert found['summary'] == {'low': 60, 'mean': 75, 'high': 90, 'count': 3, 'last': 75,
                                't': 1000}
    assert found['full'] == [True, 199, True, 64]
    assert found['sorted']


ZONES = """async (signs) => {
  const {newsZones} = await import('/views/data/signs.js');
  const found = {};
  for (const [sign, values, how] of signs) {
    const zones = newsZones(sign, how);
    found[`${sign} ${how.scale} ${how.oxygen}`] = values.map((value) => {
      const zone = zones.find(({low, high}) => value >= low && value < high);
      return zone ? zone.points : 0;
    });
  }
  return found;
}"""


def test_the_zones_are_those_of_the_chart_that_the_robot_scores_by(
        modules: Any) -> None:
    asked = []
    for sign, low, high, step in ((PULSE, 20, 180, 1), ('respiration_per_min', 4, 40, 1),
                                  ('systolic_mmhg', 60, 250, 1), ('spo2_percent', 70, 100, 1),
                                  ('body_temperature', 330, 420, 10)):
        values = [each / step for each in range(low, high + 1)]
        for scale, oxygen in ((1, False), (2, False), (2, True)):
            asked.append([sign, values, {'scale': scale, 'oxygen': oxygen}])
    found = modules.evaluate(ZONES, asked)
    for sign, values, how in asked:
        expected = [points_of(sign, value, how['scale'], how['oxygen']) for value in values]
        key = f"{sign} {how['scale']} {str(how['oxygen']).lower()}"
        assert found[key] == expected, key


def points_of(sign: str, value: float, scale: int, oxygen: bool) -> int:
    """Return what the robot's chart gives for a value."""
    return score({sign: value, 'oxygen_l_per_min': 2.0 if oxygen else 0.0}, scale).scores[sign]


AXIS = """async () => {
  const {timeLabels, timeText} = await import('/views/data/axis.js');
  const at = Date.UTC(2026, 2, 31, 23, 0);
  const labels = (language, step) => timeLabels(language, 'Europe/Berlin')(
    [0, 1, 2].map((i) => at + i * step), step);
  return [labels('en-GB', 3.6e6), labels('de', 3.6e6), labels('de', 250),
          labels('en-GB', 31 * 864e5),
          timeText(at, 365 * 864e5, 'de', 'Europe/Berlin')];
}"""


def test_the_time_axis_speaks_the_language_of_the_page_in_24_hours(
        modules: Any) -> None:
    assert modules.evaluate(AXIS) == [
        ['01:00\n1 Apr', '02:00', '03:00'], ['01:00\n1. Apr.', '02:00', '03:00'],
        ['01:00:00,00\n1. Apr.', '01:00:00,25', '01:00:00,50'],
        ['Apr\n2026', 'May', 'Jun'], '1. Apr. 2026, 01:00']


def test_history_and_live_values_are_one_line_with_its_gap(
        robot: FakeRobot, signed_in: SignedIn) -> None:
    keep_pulse(robot, [3600 * 20, 3600 * 19.9, *(age for age in range(590, 400, -2)),
                       *(age for age in range(200, 10, -2))])
    page = signed_in('viewer', '#/data/anna')
    row = page.locator('section[data-sign=pulse_per_min]')
    page.wait_for_function(f"() => {VIEW}.rows.get('pulse_per_min').columns.length > 150")
    plot = row.locator('.data-plot')
    expect(plot).to_have_attribute('aria-label', COUNTED)
    requests = page.evaluate(REQUESTS)
    robot.live(health__anna__pulse_per_min=123.0)
    expect(row.locator('.data-value')).to_have_text('123')
    expect(plot).to_have_attribute('aria-label', LAST)
    assert page.evaluate(REQUESTS) == requests
    keep_pulse(robot, [0], 123.0)
    coarse = page.evaluate(BUCKET)
    page.get_by_role('button', name='1 day').click()
    page.wait_for_function(f'before => ({BUCKET})() > 50 * before', arg=coarse)
    expect(plot).to_have_attribute('aria-label', DAY)
    page.get_by_role('button', name='Table').click()
    # The newest first; of an hour that has just begun there may be no value yet.
    expect(page.locator('.data-table tbody tr:has(td.number)').first).to_contain_text('123')


ZONE_WORDS = f'() => {VIEW}.rows.get("pulse_per_min").plot.zones.map(({{text}}) => text)'
BAD = f'() => {VIEW}.rows.get("pulse_per_min").quality.marks.map(({{quality}}) => quality)'


def test_own_limits_and_bad_values_are_marked_in_words(
        robot: FakeRobot, signed_in: SignedIn) -> None:
    robot.keep(*({**robot.script.record('observation', {
        'person': 'bob', 'sign': PULSE, 'value': value, 'quality': quality, 'source': 'wrist'}),
        'utc_ns': time.time_ns() - age_s * NS_PER_S} for age_s, value, quality in (
            (300, 70.0, 'good'), (200, None, 'off'), (100, 71.0, 'good'), (50, 90.0, 'suspect'))))
    robot.live(health__bob__news2_details={'status': [{'name': 'bob/news2', 'values': {
        'spo2_scale': '1', 'limits': 'pulse_per_min > 120 for 60 s clear 110 level urgent; '
        'spo2_percent falling 4 in 10 min'}}]})
    page = signed_in('viewer', '#/data/bob', locale='de')
    page.wait_for_function(f"() => ({ZONE_WORDS})().includes('eigene Grenze > 120, Dringend')")
    page.wait_for_function(f"() => ({BAD})().join() === 'off,suspect'")


CUTS = f'() => {VIEW}.rows.get("pulse_per_min").plot.cuts'


def test_a_lost_robot_is_marked_until_it_is_back_and_its_records_are_asked_for(
        robot: FakeRobot, signed_in: SignedIn) -> None:
    page = signed_in('viewer', '#/data/anna')
    page.wait_for_function(f'() => {VIEW}.history.requests > 0')
    before = page.evaluate(REQUESTS)
    robot.disconnect()
    page.wait_for_function(f'() => ({CUTS})().some(({{to}}) => to === null)')
    robot.connect()
    page.wait_for_function(f'() => ({CUTS})().length && ({CUTS})().every(({{from, to}}) => '
                           'to >= from)')
    page.wait_for_function(f'before => ({REQUESTS})() > before', arg=before)


QUALITY = """async () => {
  const {Quality} = await import('/views/data/readings.js');
  const made = new Quality();
  [[10, 'good'], [20, 'off'], [30, 'off'], [40, 'good'], [50, 'stale']].forEach(
    ([t, quality]) => made.at(t, quality));
  const live = made.marks.map(({from, to, quality}) => [from, to, quality]);
  made.replace([{from: 0, to: 5, quality: 'suspect'}, {from: 20, to: 40, quality: 'off'},
                {from: 50, to: null, quality: 'stale'}]);
  const both = made.marks.map(({from, to, quality}) => [from, to, quality]);
  made.at(60, 'good');
  made.replace([]);
  return [live, both, made.marks.length];
}"""


def test_stretches_of_bad_values_are_the_same_live_and_from_the_server(modules: Any) -> None:
    live, both, left = modules.evaluate(QUALITY)
    assert live == [[20, 40, 'off'], [50, None, 'stale']]
    assert both == [[0, 5, 'suspect'], *live]
    assert left == 3


def test_an_alarm_is_a_mark_that_leads_to_it(robot: FakeRobot, signed_in: SignedIn) -> None:
    page = signed_in('carer', '#/data/bob')
    robot.raise_alarm('mark1', subject='bob')
    mark = page.locator('.data-mark')
    expect(mark).to_have_attribute('aria-label', re.compile('Critical: Fall'))
    mark.click()
    expect(page.locator('.view-alarms')).to_be_visible()
    assert '/robot/mark1' in page.url


def test_the_plots_are_moved_by_keys(robot: FakeRobot, signed_in: SignedIn) -> None:
    page = signed_in('viewer', '#/data/anna')
    stack = page.locator('.data-stack')
    stack.focus()
    page.keyboard.press('ArrowLeft')
    expect(page.get_by_role('button', name='Now')).to_have_attribute('aria-pressed', 'false')
    page.keyboard.press('4')
    expect(page.get_by_role('button', name='8 hours')).to_have_attribute('aria-pressed', 'true')
    page.keyboard.press('End')
    expect(page.get_by_role('button', name='Live')).to_have_attribute('aria-pressed', 'true')


def test_who_hides_a_sign_by_keys_stays_where_they_were(
        robot: FakeRobot, signed_in: SignedIn) -> None:
    page = signed_in('viewer', '#/data/anna')
    page.locator('.data-menu summary').first.press('Enter')
    pulse = page.get_by_role('checkbox', name='Pulse')
    pulse.press('Space')
    expect(page.locator('section[data-sign=pulse_per_min]')).to_have_count(0)
    expect(pulse).to_be_focused()
    expect(pulse).not_to_be_checked()


def test_somebody_else_is_not_even_named(robot: FakeRobot, signed_in: SignedIn) -> None:
    page = signed_in('viewer', '#/data/bob', people=('anna',))
    expect(page.locator('.data-problem')).to_contain_text('no such person')
    # What was refused is not asked for again and again.
    page.wait_for_function(f'() => {VIEW}.history.notBefore > performance.now() + 10_000')
    assert page.evaluate(REQUESTS) == page.evaluate(f'() => {VIEW}.rows.size')
