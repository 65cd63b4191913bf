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
Measure the plots of the data view: frames a second while live, and how soon a year is there.

A server of its own on loopback, a robot that sends six signs 20 times a second, and a year of
values in the database (one a minute, rolled up). Prints JSON::

    ./scripts/bench measure_plots --seconds 10 --trials 5
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
import json
import math
from pathlib import Path
from statistics import median
import sys
from tempfile import TemporaryDirectory
import threading
import time
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / 'test' / 'shared')]

from fake_robot import FakeRobot  # noqa: E402
from monitor_server import logged_in  # noqa: E402
from monitor_server import quick_services  # noqa: E402
from monitor_server import served  # noqa: E402
from playwright.sync_api import sync_playwright  # noqa: E402

NS_PER_S = 1_000_000_000
SIGNS = ('pulse_per_min', 'spo2_percent', 'respiration_per_min', 'systolic_mmhg',
         'diastolic_mmhg', 'body_temperature')
BATCH = 2000
VIEW = "document.querySelector('.view-data').dataView"
FRAMES = f"""(seconds) => new Promise((resolve) => {{
  const view = {VIEW};
  const [times, begin, drawn] = [[], performance.now(), view.stack.drawn];
  const step = (now) => {{
    times.push(now);
    if (now - begin < 1000 * seconds) {{
      requestAnimationFrame(step);
      return;
    }}
    const gaps = times.slice(1).map((each, i) => each - times[i]).sort((a, b) => a - b);
    resolve({{frames_a_second: 1000 * gaps.length / (times.at(-1) - times[0]),
      frame_p95_ms: gaps[Math.floor(0.95 * gaps.length)], frame_worst_ms: gaps.at(-1),
      redrawn_a_second: 1000 * (view.stack.drawn - drawn) / (times.at(-1) - times[0]),
      plots: view.shown.filter((row) => row.isSeen).length,
      values: view.rows.get('pulse_per_min').columns.length}});
  }};
  requestAnimationFrame(step);
}})"""
# From the click until each plot has its buckets and has been painted with them.
ZOOM = f"""(range) => new Promise((resolve) => {{
  const view = {VIEW};
  const before = performance.now();
  const had = new Map([...view.rows].map(([name, row]) => [name, row.columns.bucketMs]));
  document.querySelector(`[data-range="${{range}}"]`).click();
  const look = () => {{
    const rows = [...view.rows].filter(([name]) => {json.dumps(SIGNS)}.includes(name));
    if (rows.every(([name, row]) => row.columns.bucketMs !== had.get(name))) {{
      requestAnimationFrame(() => requestAnimationFrame(() => resolve(
        performance.now() - before)));
    }} else {{
      requestAnimationFrame(look);
    }}
  }};
  look();
}})"""


def main() -> None:
    """Measure, and print it."""
    parser = argparse.ArgumentParser(description='Measure the plots of the data view.')
    parser.add_argument('--browser', default='/usr/bin/chromium')
    parser.add_argument('--seconds', type=float, default=10.0)
    parser.add_argument('--trials', type=int, default=5)
    parser.add_argument('--days', type=int, default=365, help='of values in the database')
    parser.add_argument('--step-s', type=float, default=60.0, help='between two of them')
    arguments = parser.parse_args()
    with TemporaryDirectory() as folder, _scene(Path(folder), arguments) as (url, cookie, rows), \
            sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=arguments.browser,
                                             args=['--no-sandbox'])
        context = browser.new_context(viewport={'width': 1280, 'height': 1000})
        context.add_cookies([{'name': 'session', 'value': cookie, 'url': url}])
        page = context.new_page()
        page.goto(f'{url}/#/data/anna')
        page.locator('.data-row canvas').first.wait_for()
        page.wait_for_function(f"() => {VIEW}.rows.get('pulse_per_min').columns.length > 0")
        found: dict[str, Any] = {'rows': rows}
        for name in ('1min', '10min'):
            page.evaluate(ZOOM, name)
            page.wait_for_timeout(1000)
            found[f'live_{name}'] = _rounded(page.evaluate(FRAMES, arguments.seconds))
        for name in ('1d', '1y'):
            took = []
            for _ in range(arguments.trials):
                page.evaluate(ZOOM, '1h')
                page.wait_for_timeout(200)
                took.append(page.evaluate(ZOOM, name))
            found[f'zoom_to_{name}_ms'] = {
                'median': round(median(took)), 'worst': round(max(took))}
        browser.close()
    print(json.dumps(found, indent=1))


@contextmanager
def _scene(folder: Path, arguments: argparse.Namespace) -> Iterator[tuple[str, str, int]]:
    services = quick_services(folder)
    rows = _fill(services.store, arguments.days, arguments.step_s)
    services.store.roll_up()
    cookie = logged_in(services)['Cookie'].partition('=')[2]
    over = threading.Event()
    with served(services) as address, FakeRobot(f'ws://{address}') as robot:
        thread = threading.Thread(target=_live, args=(robot, over), daemon=True)
        thread.start()
        try:
            yield f'http://{address}', cookie, rows
        finally:
            over.set()
            thread.join(5)


def _fill(store: Any, days: int, step_s: float) -> int:
    now_ns = time.time_ns()
    count = int(days * 86400 / step_s)
    seq = 0
    for begin in range(0, count, BATCH // len(SIGNS)):
        batch = []
        for index in range(begin, min(count, begin + BATCH // len(SIGNS))):
            for number, sign in enumerate(SIGNS):
                batch.append({
                    'seq': seq, 'importance': 3, 'type': 'observation',
                    'utc_ns': now_ns - int((count - index) * step_s * NS_PER_S),
                    'content': {'person': 'anna', 'sign': sign, 'quality': 'good',
                                'value': _value(number, index), 'source': 'wrist'}})
                seq += 1
        store.add('robot', 'year', batch)
    return seq


def _value(number: int, index: int) -> float:
    return 70.0 + 5 * number + 4 * math.sin(index / 97 + number) + index % 3


def _live(robot: FakeRobot, over: threading.Event) -> None:
    index = 0
    while not over.wait(0.05):
        index += 1
        robot.live(**{f'health__anna__{sign}': _value(number, index)
                      for number, sign in enumerate(SIGNS)})


def _rounded(found: dict[str, float]) -> dict[str, float]:
    return {name: round(value, 1) for name, value in found.items()}


if __name__ == '__main__':
    main()
