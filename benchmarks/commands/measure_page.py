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
Measure the page: how heavy it is, how soon it can be used, how smoothly six plots run, as JSON.

``first_usable_ms`` is from the click to the overview with people in it, on a server of its own on
loopback, with an empty cache; ``layout_shift`` is what the browser counts as moved until then and
in the two seconds after; ``frames_a_second`` is of the data view with six live signs.
"""

from __future__ import annotations

import argparse
import gzip
import json
from statistics import median
from typing import Any

from benchmarks.commands.monitor_scene import browser_path
from benchmarks.commands.monitor_scene import ROOT
from benchmarks.commands.monitor_scene import Scene
from benchmarks.commands.monitor_scene import scene
from playwright.sync_api import sync_playwright

PAGE = ROOT / 'rt_robot_os' / 'monitor' / 'page'
FRAMES = """(seconds) => new Promise((resolve) => {
  const times = [];
  const begin = performance.now();
  const step = (now) => {
    times.push(now);
    if (now - begin < 1000 * seconds) {
      requestAnimationFrame(step);
    } else {
      const gaps = times.slice(1).map((each, index) => each - times[index]).sort((a, b) => a - b);
      resolve({rate: 1000 * (times.length - 1) / (times.at(-1) - times[0]),
        p95_ms: gaps[Math.floor(0.95 * gaps.length)]});
    }
  };
  requestAnimationFrame(step);
})"""
WATCH_SHIFT = """window.shift = 0;
new PerformanceObserver((list) => list.getEntries().forEach((each) => {
  window.shift += each.hadRecentInput ? 0 : each.value;
})).observe({type: 'layout-shift', buffered: true});"""


def main() -> None:
    """Measure, and print it."""
    parser = argparse.ArgumentParser(description='Measure the page.')
    parser.add_argument('--trials', type=int, default=5)
    parser.add_argument('--seconds', type=float, default=5.0, help='of the six plots')
    arguments = parser.parse_args()
    files = [each for each in PAGE.rglob('*.*') if each.is_file()]
    with scene() as found, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_path(), args=['--no-sandbox'])
        loads = [_load(browser, found) for _ in range(arguments.trials)]
        plots = _plots(browser, found, arguments.seconds)
        browser.close()
    print(json.dumps({
        'page_kb_compressed': round(sum(len(gzip.compress(each.read_bytes(), 9))
                                        for each in files) / 1000, 1),
        'page_kb': round(sum(each.stat().st_size for each in files) / 1000, 1),
        'first_view_kb': max(each['kb'] for each in loads),
        'first_view_requests': max(each['requests'] for each in loads),
        'first_usable_ms': round(median(each['usable_ms'] for each in loads)),
        'first_usable_ms_worst': round(max(each['usable_ms'] for each in loads)),
        'layout_shift': round(max(each['shift'] for each in loads), 4),
        **plots}, indent=1))


def _page(browser: Any, found: Scene) -> tuple[Any, Any]:
    context = browser.new_context(viewport={'width': 1280, 'height': 800})
    context.add_cookies([{'name': 'session', 'value': found.cookie, 'url': found.url}])
    return context, context.new_page()


def _load(browser: Any, found: Scene) -> dict[str, float]:
    context, page = _page(browser, found)
    page.add_init_script(WATCH_SHIFT)
    page.goto(found.url, wait_until='commit')
    page.wait_for_function('() => [...document.querySelectorAll(".person .sign-value")]'
                           '.some((each) => /\\d/.test(each.textContent))')
    measured: dict[str, float] = page.evaluate("""() => {
      const all = performance.getEntriesByType('resource');
      return {usable_ms: performance.now(), requests: all.length + 1,
        kb: Math.round(all.reduce((sum, each) => sum + each.transferSize, 0) / 1000)};
    }""")
    page.wait_for_timeout(2000)
    measured['shift'] = page.evaluate('window.shift')
    context.close()
    return measured


def _plots(browser: Any, found: Scene, seconds: float) -> dict[str, float]:
    context, page = _page(browser, found)
    page.goto(f'{found.url}/#/data/anna')
    page.locator('.view-data canvas').first.wait_for()
    page.wait_for_timeout(2000)
    plots = page.locator('.view-data canvas').count()
    frames = page.evaluate(FRAMES, seconds)
    context.close()
    return {'plots': plots, 'frames_a_second': round(frames['rate'], 1),
            'frame_p95_ms': round(frames['p95_ms'], 1)}


if __name__ == '__main__':
    main()
