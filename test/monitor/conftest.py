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
What the tests of the page share: one server, one browser, and a robot that is a script.

``signed_in('carer')`` opens a page of somebody with that role in a context of its own, and fails
the test when the page reported an error that it does not expect.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from collections.abc import Iterator
import io
import json
import os
from pathlib import Path
import shutil
import sys
from typing import Any
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from fake_robot import FakeRobot
    from playwright.sync_api import Browser
    from playwright.sync_api import BrowserContext
    from playwright.sync_api import Page

PASSWORD = 'seven wet umbrellas'
# What a page may take on a machine that is busy with other tests; it says nothing of the page.
_PATIENCE_MS = 120_000
#: Of an account that the command line made; the others are made in the database.
MARY = 'mary'
_BROWSERS = ('chromium', 'chromium-browser', 'google-chrome', 'google-chrome-stable')
#: Fake devices for what needs camera and microphone; no question is ever asked.
_FLAGS = ('--no-sandbox', '--use-fake-ui-for-media-stream', '--use-fake-device-for-media-stream',
          '--autoplay-policy=user-gesture-required')


class Monitor:
    """
    A server that runs.

    :ivar name: of the carer whose account the command line made; so is the password.
    """

    name = MARY
    password = PASSWORD

    def __init__(self, address: str, services: Any) -> None:
        self.address = address
        self.services = services
        self._cookies: dict[tuple[str, tuple[str, ...]], str] = {}

    @property
    def url(self) -> str:
        """Return what is typed into a browser."""
        return f'http://{self.address}'

    def cookie(self, role: str, people: tuple[str, ...]) -> str:
        """Return the session of somebody with that role who may see these people."""
        from monitor_server import logged_in
        from rt_robot_os.monitor.security.roles import role_of
        key = role, people
        if key not in self._cookies:
            name = '-'.join((role, *people)).replace('*', 'all')
            headers = logged_in(self.services, name, role_of(role), people)
            self._cookies[key] = headers['Cookie'].partition('=')[2]
        return self._cookies[key]


@pytest.fixture(scope='session', autouse=True)
def _models_change_nothing() -> Iterator[None]:
    """Fail where an answer is not, key by key, what its function returned."""
    try:
        from fastapi import routing
        from fastapi.encoders import jsonable_encoder
    except ImportError:
        yield
        return
    original, odd = routing.serialize_response, []

    async def checked(**options: Any) -> Any:
        found = await original(**options)
        shown = json.loads(found) if isinstance(found, bytes) else found
        made = jsonable_encoder(options.get('response_content'),
                                exclude_unset=bool(options.get('exclude_unset')))
        if json.dumps(made, sort_keys=True) != json.dumps(shown, sort_keys=True):
            odd.append((made, shown))
        return found

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(routing, 'serialize_response', checked)
        yield
    assert odd[:3] == []


def _chromium() -> str:
    found = os.environ.get('RT_ROBOT_OS_BROWSER') or next(
        filter(None, map(shutil.which, _BROWSERS)), '')
    if not found:
        pytest.skip('no browser: install chromium, or say where it is in RT_ROBOT_OS_BROWSER')
    return found


@pytest.fixture(scope='session')
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Monitor]:
    """Serve, on a free port, with a robot that is let in and a carer called mary."""
    for each in ('fastapi', 'uvicorn', 'sqlalchemy', 'alembic', 'argon2'):
        pytest.importorskip(each)
    from monitor_server import quick_services
    from monitor_server import served
    folder = tmp_path_factory.mktemp('monitor')
    # A robot that is a script sends no heart-beats.
    services = quick_services(folder, heartbeat_s=60.0)
    _make_mary(folder)
    with served(services) as address:
        yield Monitor(address, services)


def _make_mary(folder: Path) -> None:
    from rt_robot_os.monitor.command import run
    typed, sys.stdin = sys.stdin, io.StringIO(f'{PASSWORD}\n')
    try:
        assert run(['user', 'add', MARY, '--role', 'carer', '--people', '*', '--folder',
                    str(folder)]) == 0
    finally:
        sys.stdin = typed


@pytest.fixture
def robot(server: Monitor) -> Iterator[FakeRobot]:
    """Connect a robot that looks after anna and bob; in the end its alarms are resolved."""
    from fake_robot import FakeRobot
    from fake_robot import RobotScript
    script = RobotScript('robot', ('anna', 'bob'))
    with FakeRobot(f'ws://{server.address}', script=script) as found:
        yield found
        for alarm in list(server.services.hub.robots['robot'].alarms):
            found.raise_alarm(alarm, event='resolved', state='resolved')


@pytest.fixture(scope='session')
def launched() -> Iterator[tuple[Browser, asyncio.AbstractEventLoop]]:
    """Start the one browser of a run, and the loop that its library has in this thread."""
    sync_api = pytest.importorskip('playwright.sync_api')
    path = _chromium()
    sync_api.expect.set_options(timeout=_PATIENCE_MS)
    playwright = sync_api.sync_playwright().start()
    loop = asyncio.get_running_loop()
    browser = playwright.chromium.launch(executable_path=path, args=_FLAGS)
    asyncio._set_running_loop(None)
    yield browser, loop
    asyncio._set_running_loop(loop)
    browser.close()
    playwright.stop()


@pytest.fixture
def browser(launched: tuple[Browser, asyncio.AbstractEventLoop]) -> Iterator[Browser]:
    """
    Give the browser to one test.

    Between tests its library leaves a running loop behind, with which no other test could begin
    one of its own.
    """
    found, loop = launched
    asyncio._set_running_loop(loop)
    yield found
    asyncio._set_running_loop(None)


class Opened:
    """Pages of a test, and what they complained of."""

    def __init__(self, server: Monitor, browser: Browser) -> None:
        self.complaints: list[str] = []
        #: Beginnings of complaints that a test brings about itself.
        self.expected: list[str] = ['Failed to load resource', 'WebSocket connection to']
        self._server = server
        self._browser = browser
        self._contexts: list[BrowserContext] = []

    def page(self, cookie: str = '', **options: Any) -> Page:
        """Open a page at nothing yet; ``cookie`` is of a session."""
        context = self._browser.new_context(**{
            'locale': 'en-GB', 'viewport': {'width': 1280, 'height': 800}, **options})
        context.set_default_timeout(_PATIENCE_MS)
        self._contexts.append(context)
        if cookie:
            context.add_cookies([{'name': 'session', 'value': cookie, 'url': self._server.url}])
        page = context.new_page()
        page.on('pageerror', lambda error: self.complaints.append(str(error)))
        page.on('console', lambda message: message.type == 'error' and self.complaints.append(
            message.text))
        return page

    def close(self) -> None:
        """Close them; fail when there were complaints."""
        for each in self._contexts:
            each.close()
        unexpected = [each for each in self.complaints
                      if not any(each.startswith(start) for start in self.expected)]
        assert not unexpected, f'the page complained: {unexpected}'


@pytest.fixture
def opened(server: Monitor, browser: Browser) -> Iterator[Opened]:
    """Open pages, and close them in the end."""
    found = Opened(server, browser)
    yield found
    found.close()


@pytest.fixture
def signed_in(server: Monitor, opened: Opened) -> Callable[..., Page]:
    """Give a function of a role and a view, such as ``'#/alarms'``, that opens the page."""
    def open_page(role: str, view: str = '', people: tuple[str, ...] = ('*',),
                  **options: Any) -> Page:
        page = opened.page(server.cookie(role, people), **options)
        page.goto(f'{server.url}/{view}')
        page.locator('.view').wait_for()
        return page
    return open_page
