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

"""Diagnostics: trouble shows for a while after it came, with words that say what it is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest

pytest.importorskip('diagnostic_msgs', reason='ROS 2 messages are not installed')

from rt_robot_os.kernel import Kernel  # noqa: E402, I100
from rt_robot_os.kernel import TaskStatistics  # noqa: E402
from rt_robot_os.kernel import VirtualClock  # noqa: E402
from rt_robot_os.link.core_statistics import CoreStatistics  # noqa: E402
from rt_robot_os.link.stamp_mapper import StampMapper  # noqa: E402
from rt_robot_os.ros.diagnostics import Diagnostics  # noqa: E402
from rt_robot_os.ros.diagnostics import Recent  # noqa: E402

S = 1_000_000_000
OK, WARN = b'\x00', b'\x01'


def task(missed: int) -> TaskStatistics:
    kernel = Kernel(VirtualClock())
    made = kernel.add_task('imu', lambda: None, priority=1, rate_hz=1.0)
    made.missed = missed
    return made.statistics()


def statistics(at_s: float, lost: int = 0, missed: int = 0, full: int = 0, pid: int = 1
               ) -> CoreStatistics:
    return CoreStatistics(
        core={'pid': pid, 'now_ns': round(at_s * S), 'elapsed_ns': round(at_s * S),
              'realtime': [], 'watchdog': 'off', 'wakeups': 0, 'failures_total': 0,
              'accepted': 1, 'refused': 0, 'black_box': {}},
        tasks=(task(missed),),
        topics=({'name': 'imu/data', 'type_name': 'x', 'published': round(at_s * 100),
                 'rate_hz': 100.0, 'depth': 8,
                 'subscribers': [{'name': 'guard', 'lost': lost}, {'name': 'link:x', 'lost': 9}]},
                ),
        devices=(), clients=({
            'name': 'top', 'pid': 7, 'received': 0, 'large': 0, 'refused': 0,
            'outbox_dropped': 0,
            'mirrors': [{'topic': 'imu/data', 'sent': 1, 'full': full, 'lost': 0, 'skipped': 0,
                         'limited': 0}]},))


class Judge:
    def __init__(self) -> None:
        self.diagnostics = Diagnostics('robot')
        self.mapper = StampMapper()

    def __call__(self, now: CoreStatistics, log: dict[str, Any] | None = None,
                 starved: str = '') -> dict[str, tuple[bytes, str]]:
        statuses = self.diagnostics.judge(now, self.mapper, [], log or {'lost': 0}, starved)
        return {s.name.partition(': ')[2]: (s.level, s.message) for s in statuses}


@pytest.fixture
def judge() -> Iterator[Judge]:
    yield Judge()


def test_a_lost_sample_is_a_warning_that_says_so_and_ends(judge: Judge) -> None:
    judge(statistics(100))
    lost = judge(statistics(101, lost=3))['topic imu/data']
    assert lost == (WARN, 'samples lost within the last 10 s: 3 by guard')
    assert judge(statistics(110, lost=3))['topic imu/data'][0] == WARN
    assert judge(statistics(112, lost=3))['topic imu/data'] == (OK, '100.0 Hz')
    assert judge(statistics(113, lost=4))['topic imu/data'][1].endswith('1 by guard')


def test_missed_releases_dropped_samples_and_lost_lines_end_as_well(judge: Judge) -> None:
    judge(statistics(100), {'lost': 5})
    bad = judge(statistics(101, missed=2, full=4), {'lost': 6, 'untold': 2})
    assert bad['task imu'] == (WARN, '2 releases missed within the last 10 s')
    assert bad['client top'] == (WARN, '4 samples or answers dropped within the last 10 s')
    assert bad['log'][0] == WARN and '1 lines are not in the file' in bad['log'][1]
    good = judge(statistics(112, missed=2, full=4), {'lost': 6, 'untold': 2})
    assert good['task imu'] == (OK, 'on time') and good['client top'] == (OK, 'keeps up')
    assert good['log'] == (OK, 'complete')


def test_why_the_core_refused_what_a_client_published_is_told(judge: Judge) -> None:
    now = statistics(100)
    judge(now)
    client = {**now.clients[0], 'refused': 1, 'last_refusal': "frame_id is 'odom'"}
    assert judge(replace(statistics(101), clients=(client,)))['client top'][1].endswith(
        "last refusal: frame_id is 'odom'")


def test_what_an_old_core_lost_long_ago_is_no_news_and_what_a_new_one_loses_is(
        judge: Judge) -> None:
    assert judge(statistics(1000, lost=50))['topic imu/data'][0] == OK
    assert judge(statistics(3, lost=2, pid=2))['topic imu/data'][0] == WARN


def test_a_link_that_starves_is_told_with_the_statistics_of_before(judge: Judge) -> None:
    now = statistics(100)
    assert judge(now)['core'] == (OK, 'running')
    told = judge(now, starved="the core is alive, but 'planner' runs")
    assert told['core'] == (WARN, "the core is alive, but 'planner' runs")
    assert 'task imu' in told
    assert judge(now)['core'] == (OK, 'running')


def test_a_counter_that_grows_all_the_time_counts_what_is_recent() -> None:
    recent = Recent(hold_s=10.0)
    for at_s in range(100, 160):
        recent.begin(float(at_s), 1000.0)
        gained = recent.gained('a', (at_s - 100) * 5)
    assert gained == 50
    recent.begin(160.0, 1000.0)
    recent.begin(161.0, 1000.0)  # nobody asked for it any more
    assert recent.gained('a', 10_000) == 0
