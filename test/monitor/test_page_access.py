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


"""The page for everybody: axe-core finds nothing serious in any view, in both themes."""

from __future__ import annotations

from collections.abc import Callable
import json
from pathlib import Path
from typing import Any
from typing import TYPE_CHECKING

from live_signals import NODES
import pytest
from rt_robot_os import monitor

pytest.importorskip('playwright.sync_api')
axe = pytest.importorskip('axe_playwright_python.base')

if TYPE_CHECKING:
    from fake_robot import FakeRobot

VIEWS = ('overview', 'alarms', 'alarms/robot/x1', 'data/anna', 'position', 'camera', 'drive',
         'network', 'account', 'admin', 'audit')
SERIOUS = ('serious', 'critical')
# Both themes have the same elements: in the second only their colours are looked at.
RUNS = {'light': {}, 'dark': {'runOnly': ['color-contrast']}}


def _is_there(view: str) -> bool:
    return (Path(monitor.__file__).parent / f'page/views/{view.partition("/")[0]}.js').exists()


def _go(page: Any, view: str) -> None:
    """Open a view; the one that was there before may be of the same kind."""
    page.evaluate("""view => {
        document.querySelector('.view').classList.add('is-left');
        location.hash = `#/${view}`;
    }""", view)
    page.locator(f'.view-{view.partition("/")[0]}:not(.is-left)').wait_for()


def _found(page: Any, options: dict[str, Any]) -> list[str]:
    """Return what is seriously wrong, each with an element that has it."""
    found = page.evaluate('options => axe.run(document, options)', {
        'resultTypes': ['violations'], **options})
    return [f"{each['id']}: {json.dumps(each['nodes'][0]['target'])} {each['help']}: "
            f"{each['nodes'][0]['html'][:160]}"
            for each in found['violations'] if each['impact'] in SERIOUS]


@pytest.mark.parametrize('theme', RUNS)
def test_axe_finds_nothing_serious(robot: FakeRobot, opened: Any, signed_in: Callable[..., Any],
                                   theme: str) -> None:
    # It tries what inline styles do.
    opened.expected.append('Applying inline style')
    robot.raise_alarm('x1')
    robot.raise_alarm('x2', subject='study', level='technical', event='acknowledged',
                      state='acknowledged', by='mary')
    page = signed_in('owner', color_scheme=theme)
    robot.live(wsn__nodes=NODES, battery={'percentage': 0.12}, agent__state='approach anna')
    page.evaluate(axe.AXE_FILE_PATH.read_text())
    wrong = {}
    for view in filter(_is_there, VIEWS):
        _go(page, view)
        if found := _found(page, RUNS[theme]):
            wrong[view] = found
    page.get_by_role('button', name='Account and settings').click()
    if found := _found(page, RUNS[theme]):
        wrong['menu'] = found
    assert not wrong


@pytest.mark.parametrize('size', [(1280, 800), (800, 1280), (390, 844)])
def test_nothing_is_wider_than_the_screen_and_buttons_are_large_enough(
        robot: FakeRobot, signed_in: Callable[..., Any], size: tuple[int, int]) -> None:
    robot.raise_alarm('x3')
    page = signed_in('owner', locale='de-DE', viewport={'width': size[0], 'height': size[1]})
    small = {}
    for view in ('overview', 'alarms', 'network', 'account'):
        _go(page, view)
        assert page.evaluate('document.documentElement.scrollWidth <= innerWidth'), view
        assert page.evaluate('(e => e.scrollWidth <= e.clientWidth)(document.querySelector('
                             '".main"))'), view
        small[view] = page.evaluate("""() => [...document.querySelectorAll('button, nav a')]
            .map((each) => [each.textContent, each.getBoundingClientRect()])
            .filter(([, box]) => box.width && (box.height < 39.5 || box.width < 39.5))
            .map(([text, box]) => `${text} ${box.width} x ${box.height}`)""")
    assert not any(small.values()), small
