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

"""A page that is open for weeks: what a view adds to the page is removed with the view."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from typing import TYPE_CHECKING

import pytest

pytest.importorskip('playwright.sync_api')

from live_signals import news2  # noqa: E402, I100
from live_signals import NODES  # noqa: E402
from live_signals import signs  # noqa: E402

if TYPE_CHECKING:
    from fake_robot import FakeRobot

VIEWS = ('alarms', 'data/anna', 'position', 'camera', 'drive', 'network', 'account', 'overview')
#: Opens each view, and leaves it when it is there: at once, while it still loads, or later.
ROUND = """async ([views, stayMs]) => {
  for (const view of views) {
    location.hash = `#/${view}`;
    const name = view.split('/')[0];
    while (!document.querySelector(`.view-${name}`)) {
      await new Promise((done) => setTimeout(done, 10));
    }
    await new Promise((done) => setTimeout(done, stayMs));
  }
}"""
STAYS_MS = (0, 100)
ROUNDS = 3
#: A view that leaves one listener behind adds one a round for each stay.
MOST_MORE = ROUNDS - 1


def test_changes_of_view_leave_no_listeners_behind(
        robot: FakeRobot, signed_in: Callable[..., Any]) -> None:
    page = signed_in('owner')
    robot.live(health__anna__signs=signs(pulse_per_min=72), battery={'percentage': 0.8},
               health__anna__news2_details=news2(0, 'Low'), agent__state='idle',
               pose={'x': 1.0, 'y': 1.0, 'yaw': 0.0}, wsn__nodes=NODES)
    cdp = page.context.new_cdp_session(page)
    cdp.send('Performance.enable')

    def listeners(rounds: int) -> int:
        for _ in range(rounds):
            for stay_ms in STAYS_MS:
                page.evaluate(ROUND, [list(VIEWS), stay_ms])
        cdp.send('HeapProfiler.collectGarbage')
        cdp.send('HeapProfiler.collectGarbage')
        found = {each['name']: each['value'] for each in cdp.send('Performance.getMetrics')[
            'metrics']}
        return int(found['JSEventListeners'])
    before = listeners(1)
    after = listeners(ROUNDS)
    assert after <= before + MOST_MORE, f'{before} listeners became {after}'
