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

"""
Every view as the first one that a browser opens: it has its styles, and all of it can be reached.

``RT_ROBOT_OS_BROAD=1`` tries each view in every size, theme, language and state;
``RT_ROBOT_OS_PICTURES=FOLDER`` keeps a picture of each.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
import io
import itertools
import json
import os
from pathlib import Path
import re
from typing import Any
from typing import TYPE_CHECKING
from uuid import uuid4

import pytest

pytest.importorskip('playwright.sync_api')
Image = pytest.importorskip('PIL.Image')

from broad import VARIABLE  # noqa: E402, I100
from fake_robot import FakeRobot  # noqa: E402
from fake_robot import RobotScript  # noqa: E402
from fake_robot import token_of  # noqa: E402
from live_signals import NODES  # noqa: E402
from live_signals import signs  # noqa: E402
from media_peer import MediaPeer  # noqa: E402
from page_layout import misplaced  # noqa: E402
from page_layout import missing_styles  # noqa: E402
from page_layout import names_twice  # noqa: E402
from page_network import Network  # noqa: E402
from playwright.sync_api import expect  # noqa: E402
from rt_robot_os import monitor  # noqa: E402

if TYPE_CHECKING:
    from conftest import Monitor

PAGE = Path(monitor.__file__).parent / 'page'
SHEETS = sorted({each.stem for each in (PAGE / 'style').glob('*.css')} - {'base', 'shell'})
PLACES = dict(re.findall(r"{name: '(\w+)',.* place: '(\w+)'}",
                         (PAGE / 'lib/views.js').read_text()))
KEYS = [key for each in (PAGE / 'messages/en').glob('*.json') for key in json.loads(
    each.read_text())]
ADDRESSES = {'alarms': 'alarms/robot/c1', 'data': 'data/anna', 'drive': 'drive/robot'}
#: With the share of the screen that the view must have; the last is 400 % zoom of 1280 x 1024.
SIZES = {(390, 844): 30, (1440, 900): 50, (320, 256): 60, (844, 390): 35}
STATES = ('well', 'locked', 'offline')
LOOKS = list(itertools.product(('en-GB', 'de-DE'), ('light', 'dark')))
if os.environ.get(VARIABLE):
    CASES = [(view, *look, state) for view, look, state in itertools.product(
        PLACES, LOOKS, STATES)]
else:
    # Each view once; a locked session leaves the same notice of most, and German words are longer.
    CASES = [(view, *LOOKS[number % 4], ('offline', 'well')[number % 3 == 2])
             for number, view in enumerate(PLACES)]
    CASES += [('overview', 'de-DE', 'dark', 'locked'), ('drive', 'de-DE', 'light', 'well')]


@pytest.fixture(scope='module')
def robot(server: Monitor) -> Iterator[FakeRobot]:
    """Connect a robot with a camera, and with open alarms of two people."""
    script = RobotScript('robot', ('anna', 'bob'), cameras=['hall'], capabilities=['snapshot'],
                         limits={'linear_m_s': 0.5, 'angular_rad_s': 1.2})
    with FakeRobot(f'ws://{server.address}', script=script) as found, closing(MediaPeer(
            server.address, '/robot/media',
            {'Authorization': f"Bearer {token_of('robot')}"})) as media:
        media.say('hello', version=1, cameras=['hall'])
        picture = io.BytesIO()
        Image.new('RGB', (640, 480), (90, 120, 60)).save(picture, 'JPEG')
        media.frame('picture', picture.getvalue(), camera='hall', n=1, age_ns=0)
        found.live(wsn__nodes=NODES, battery={'percentage': 0.12}, agent__state='approach anna',
                   health__anna__signs=signs(pulse_per_min=112),
                   pose={'x': 1.0, 'y': 1.0, 'yaw': 0})
        found.raise_alarm('c1')
        for number, person in enumerate(('anna', 'bob')):
            found.raise_alarm(f'c{number + 2}', subject=f'vital signs of {person}',
                              level='technical', kinds=['monitor_silent'],
                              text=f'no vital signs of {person} arrive')
        yield found
        for alarm in list(server.services.hub.robots['robot'].alarms):
            found.raise_alarm(alarm, event='resolved', state='resolved')


def _cookie(server: Monitor, is_locked: bool) -> str:
    from monitor_server import lock_sessions
    from monitor_server import logged_in
    name = f'owner {uuid4().hex}'
    headers = logged_in(server.services, name)
    if is_locked:
        lock_sessions(server.services, server.services.accounts.users.find(name).id)
    return headers['Cookie'].partition('=')[2]


def _cold(server: Monitor, opened: Any, view: str, language: str, theme: str, state: str) -> Any:
    """Open a view in a browser that has seen nothing of the page before."""
    is_alone = PLACES[view] == 'alone'
    page = opened.page('' if is_alone else _cookie(server, state == 'locked'), locale=language,
                       color_scheme=theme, reduced_motion='reduce',
                       viewport={'width': 390, 'height': 844})
    network = Network(page)
    page.goto(f'{server.url}/#/{ADDRESSES.get(view, view)}')
    page.locator('.view, .notice-locked').first.wait_for()
    page.wait_for_load_state('networkidle')
    if is_alone:
        return page
    expect(page.locator('.strip strong')).to_contain_text('anna')
    if state == 'offline':
        network.cut()
        expect(page.locator('.link')).to_have_class('link link-lost')
    return page


@pytest.mark.parametrize(('view', 'language', 'theme', 'state'), CASES)
def test_a_view_that_is_opened_first_is_whole(
        server: Monitor, robot: FakeRobot, opened: Any, view: str, language: str, theme: str,
        state: str) -> None:
    page = _cold(server, opened, view, language, theme, state)
    wrong = {}
    for (width, height), share in SIZES.items():
        page.set_viewport_size({'width': width, 'height': height})
        size = f'{width} x {height}'
        if folder := os.environ.get('RT_ROBOT_OS_PICTURES'):
            page.screenshot(path=f'{folder}/{view}_{language[:2]}_{theme}_{state}_{width}.png')
        if PLACES[view] != 'alone':
            wrong[size] = misplaced(page, KEYS, share)
    wrong['styles'] = missing_styles(page, SHEETS)
    wrong['names'] = names_twice(page)
    if any(wrong.values()):
        pytest.fail('\n'.join(f'{size}: {each}' for size, found in wrong.items()
                              for each in found), pytrace=False)


PHONE = {'viewport': {'width': 390, 'height': 844}, 'is_mobile': True, 'has_touch': True}
FITS = """(selectors) => selectors.filter((selector) => {
  const {left, top, right, bottom, width} = document.querySelector(selector)
    .getBoundingClientRect();
  const main = document.querySelector('.main').getBoundingClientRect();
  return !width || left < -1 || right > innerWidth + 1 || top < main.top - 1
    || bottom > main.bottom + 1;
})"""


@pytest.mark.parametrize('size', [(390, 844), (360, 667), (844, 390)])
def test_on_a_phone_picture_and_stick_are_on_the_screen_together(
        robot: FakeRobot, signed_in: Any, size: tuple[int, int]) -> None:
    page = signed_in('owner', '#/drive/robot', **{**PHONE, 'viewport': dict(
        zip(('width', 'height'), size))})
    page.locator('.picture').wait_for()
    expect(page.locator('.strip')).to_contain_text('anna')
    assert page.evaluate(FITS, ['.picture-frame', '.stick', '.drive-seat .button']) == []
    assert page.locator('.picture-canvas').bounding_box()['height'] >= 100


def test_keys_are_offered_where_there_are_some(robot: FakeRobot, signed_in: Any) -> None:
    for options, is_offered in (({}, True), (PHONE, False)):
        page = signed_in('owner', '#/drive/robot', **options)
        stop = page.get_by_role('banner').get_by_role('button', name='Stop')
        assert ('F8' in stop.inner_text()) is is_offered
        assert ('F8' in stop.get_attribute('title')) is is_offered
        assert ('space bar' in page.locator('.drive-hint').inner_text()) is is_offered
        assert ('space bar' in page.locator('.stick').get_attribute('aria-label')) is is_offered
        page.get_by_role('button', name='Account and settings').click()
        menu = page.get_by_role('dialog')
        assert menu.get_by_text('go to the alarms').is_visible() is is_offered


@pytest.mark.parametrize('width', [390, 700, 1440])
def test_menus_of_data_open_on_the_screen(
        robot: FakeRobot, signed_in: Any, width: int) -> None:
    page = signed_in('owner', '#/data/anna', viewport={'width': width, 'height': 900})
    for menu in page.locator('.data-menu').all():
        menu.locator('summary').click()
        box = menu.locator('.data-layers').bounding_box()
        assert box['x'] >= 0 and box['x'] + box['width'] <= width, box
        page.keyboard.press('Escape')
