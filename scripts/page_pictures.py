#!/usr/bin/env python3
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
Take the pictures of the page that docs/ show, light and dark.

::

    export PYTHONPATH=.
    scripts/page_pictures.py                                  # of a scene of its own
    scripts/page_pictures.py --url http://127.0.0.1:8080 --name mary < password   # of what runs

Each is a PNG of 1280 x 800 with at most 128 colours, and so below 150 KB.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
import io
from pathlib import Path
import sys
from typing import Any

from benchmarks.commands.monitor_scene import browser_path
from benchmarks.commands.monitor_scene import ROOT
from benchmarks.commands.monitor_scene import scene
from PIL import Image
from playwright.sync_api import sync_playwright

#: What stands behind #/.
VIEWS = {'overview': 'overview', 'alarms': 'alarms/flat/7', 'data': 'data/anna',
         'position': 'position/flat', 'camera': 'camera/flat', 'drive': 'drive/flat',
         'network': 'network/flat', 'account': 'account', 'admin': 'admin', 'audit': 'audit'}
SIZES = {'': (1280, 800), '_tablet': (800, 1280), '_phone': (390, 844)}
#: Taken in other sizes as well.
ALSO = {'overview': ('_phone', '_tablet')}
SETTLE_MS = 1500
COLOURS = 128


def main() -> None:
    """Take them."""
    parser = argparse.ArgumentParser(description='Take the pictures of the page.')
    parser.add_argument('--url', help='of a monitor that runs (default: a scene of its own)')
    parser.add_argument('--name', default='mary', help='of the account; its password is read')
    parser.add_argument('--views', default=','.join(VIEWS), help='which of them')
    parser.add_argument('--themes', default='light,dark')
    parser.add_argument('--language', default='en-GB')
    parser.add_argument('--folder', type=Path, default=ROOT / 'docs' / 'images' / 'monitor')
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    with _monitor(arguments) as (url, sign_in), sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_path(), args=['--no-sandbox'])
        for theme in arguments.themes.split(','):
            for size in SIZES:
                context = browser.new_context(
                    color_scheme=theme, locale=arguments.language,
                    viewport=dict(zip(('width', 'height'), SIZES[size])))
                page = context.new_page()
                sign_in(context, page)
                for view in arguments.views.split(','):
                    if not size or size in ALSO.get(view, ()):
                        _take(page, url, view, arguments.folder / f'{view}{size}_{theme}.png')
                context.close()
        browser.close()


@contextmanager
def _monitor(arguments: argparse.Namespace) -> Iterator[Any]:
    """Give the address, and how somebody signs in there."""
    if arguments.url is None:
        with scene() as found:
            found.fall()
            yield found.url, lambda context, page: context.add_cookies(
                [{'name': 'session', 'value': found.cookie, 'url': found.url}])
        return
    password = sys.stdin.readline().rstrip('\n')

    def sign_in(context: Any, page: Any) -> None:
        page.goto(arguments.url)
        page.locator('[autocomplete=username]').fill(arguments.name)
        page.locator('[autocomplete=current-password]').fill(password)
        page.keyboard.press('Enter')
        page.locator('.head').wait_for()

    yield arguments.url, sign_in


def _take(page: Any, url: str, view: str, path: Path) -> None:
    page.goto(f'{url}/#/{VIEWS[view]}')
    page.locator(f'.view-{view}').wait_for(timeout=10_000)
    page.wait_for_timeout(SETTLE_MS)
    image = Image.open(io.BytesIO(page.screenshot())).convert('RGB')
    image.quantize(COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)
    print(f'{path.name}: {path.stat().st_size / 1000:.0f} KB')


if __name__ == '__main__':
    main()
