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


"""Rates are those of the interval, tables fit every terminal, keys do what they say."""

from __future__ import annotations

from array import array
import html
from pathlib import Path
import re
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.kernel import DeadlineMiss
from rt_robot_os.kernel import Summary
from rt_robot_os.kernel import TaskState
from rt_robot_os.kernel import TaskStatistics
from rt_robot_os.link.core_statistics import CoreStatistics
from rt_robot_os.link.task_records import TaskCounts
from rt_robot_os.tools.top.columns import check_sort
from rt_robot_os.tools.top.columns import microseconds
from rt_robot_os.tools.top.columns import seconds
from rt_robot_os.tools.top.controls import Controls
from rt_robot_os.tools.top.controls import INTERVALS_S
from rt_robot_os.tools.top.controls import split_keys
from rt_robot_os.tools.top.rows import Snapshot
from rt_robot_os.tools.top.screen_layout import body
from rt_robot_os.tools.top.screen_layout import Choices
from rt_robot_os.tools.top.screen_layout import head
from rt_robot_os.tools.top.screen_layout import PARTS
from rt_robot_os.tools.top.screen_layout import plain
from rt_robot_os.tools.top.screen_layout import rows_of
from rt_robot_os.tools.top.snapshot import compare
from rt_robot_os.tools.top.snapshot import Sample

S = 1_000_000_000
AT = '2026-01-02T03:04:05.000+00:00'


def task(name: str, runs: int, busy_ns: int, priority: int = 10, **more: Any) -> TaskStatistics:
    return TaskStatistics(**{**dict(
        name=name, priority=priority, period_ns=10_000_000, releases=runs, runs=runs, missed=0,
        coalesced=0, failures=0, latency=Summary(runs, 50_000, 60_000, 60_000, 900_000),
        execution=Summary(runs, 50_000, 60_000, 60_000, 70_000), jitter=Summary(),
        gap_maximum_ns=0, blocked_maximum_ns=0, execution_total_ns=busy_ns), **more})


def counts(*pairs: tuple[int, int]) -> TaskCounts:
    values = array('Q', [0] * (max(at for at, _ in pairs) + 1))
    for at, count in pairs:
        values[at] = count
    return TaskCounts(values, values)


def core(now_ns: int, tasks: tuple[TaskStatistics, ...], *, pid: int = 1, published: int = 0,
         lost: int = 0, counts: dict[str, TaskCounts] | None = None, **more: Any) -> Sample:
    facts = {'pid': pid, 'now_ns': now_ns, 'elapsed_ns': now_ns, 'wakeups': now_ns // 1_000_000,
             'failures_total': 0, 'refused': 0, 'watchdog': 'off',
             'black_box': {'saved': 0, 'lost': 0, 'held_back': 0},
             'realtime': [{'step': 'SCHED_FIFO', 'ok': False, 'reason': 'no'}], **more}
    topic = {'name': 'imu/data', 'type_name': 'x', 'depth': 8, 'slot_bytes': 64,
             'published': published, 'stamp_ns': now_ns - S // 2 if published else 0,
             'rate_hz': 100.0, 'subscribers': [
                 {'name': 'guard', 'reads': 1, 'lost': lost, 'skipped': 0},
                 {'name': 'link:top', 'reads': 1, 'lost': 77, 'skipped': 0}]}
    known = counts or {each.name: _even(each) for each in tasks}
    return Sample(CoreStatistics(facts, tasks, (topic,), (), (), counts=known), AT)


def _even(each: TaskStatistics) -> TaskCounts:
    return TaskCounts(array('Q', [each.runs]), array('Q', [each.runs]))


def test_rates_and_shares_are_those_between_two_looks() -> None:
    before = core(100 * S, (task('a', 5000, 40 * S),), published=10)
    now = core(102 * S, (task('a', 5190, 40 * S + S // 2),), published=210, lost=3)
    row, = compare('r', now, before).tasks
    assert row.rate_hz == 95.0 and row.declared_hz == 100.0 and row.cpu_percent == 25.0
    snapshot = compare('r', now, before)
    topic, = snapshot.topics
    assert topic.rate_hz == 100.0 and topic.age_s == 0.5
    assert topic.lost == 3 and topic.new == {'lost by guard': 3}
    assert snapshot.kernel.wakeups_hz == 1000.0 and snapshot.kernel.cpu_percent == 25.0
    assert snapshot.interval_s == 2.0


def test_percentiles_are_those_between_two_looks_too() -> None:
    slow_then_fast = ({'a': counts((100, 1000))}, {'a': counts((50, 10), (100, 1000))})
    before = core(S, (task('a', 1000, 0),), counts=slow_then_fast[0])
    now = core(2 * S, (task('a', 1010, 0),), counts=slow_then_fast[1])
    row, = compare('r', now, before).tasks
    assert row.latency_p99_us is not None and row.latency_p99_us < 1.0  # bucket 50, not 100
    assert row.latency_max_us == 900.0


@pytest.mark.parametrize('pid, runs', [(2, 200), (1, 3)])
def test_another_core_or_reset_counters_give_no_rates(pid: int, runs: int) -> None:
    before = core(S, (task('a', 100, S),))
    row, = compare('r', core(2 * S, (task('a', runs, 1),), pid=pid), before).tasks
    assert row.rate_hz is None and row.cpu_percent is None and row.new == {}


def story() -> Snapshot:
    names = [f'module_{n}' for n in range(30)]
    late = DeadlineMiss(5, 0, 3_000_000, ('module_3', 'imu'))
    old = tuple(task(name, 10, 0, n) for n, name in enumerate(names))
    new = tuple(task(name, 10 + n, n * 1000, n, **({
        'deadline_missed': 1, 'last_miss': late, 'state': TaskState.BACKOFF,
        'blocked_maximum_ns': 2_000_000} if n == 4 else {})) for n, name in enumerate(names))
    return compare('r', core(2 * S, new, published=5, lost=2), core(S, old))


@given(width=st.integers(20, 250), height=st.integers(3, 80), part=st.sampled_from(PARTS))
def test_it_fits_every_terminal(width: int, height: int, part: str) -> None:
    snapshot = story()
    choices = Choices(part=part)
    log = [(30, 'imu', 'silent ' * 50)] * 5
    lines = body(snapshot, choices, width, height, log)
    assert len(lines) <= height
    if width >= 60:  # below, what matters most is cut by the terminal
        assert all(sum(len(text) for text, _ in line) <= width for line in lines)


@pytest.mark.parametrize('write', [microseconds, seconds])
@given(values=st.lists(st.floats(0.0, 1e8), min_size=2, max_size=2))
def test_the_figures_of_a_column_can_be_compared_as_they_stand(
        write: Any, values: list[float]) -> None:
    small, large = sorted(values)
    assert float(write(small)) <= float(write(large))
    assert float(write(large)) == pytest.approx(large, abs=0.6)


def test_in_80_columns_what_matters_most_is_there() -> None:
    text = plain([*head(story(), Choices(), 80), *body(story(), Choices(), 80, 20)])
    assert all(title in text for title in ('Hz', 'LAT99', 'LATMAX', 'CPU%', 'LATE', 'STATE'))
    assert 'late now: module_4 by 3000 (module_3, imu)' in text
    assert 'longest native call: module_4 2000' in text
    assert 'refused: SCHED_FIFO' in text
    assert 'more tasks: key 2' in text


def test_rows_are_sorted_and_filtered() -> None:
    snapshot = story()
    names = [row.name for row in rows_of(snapshot, 'tasks', Choices(sort='rate_hz'))]
    assert names[0] == 'module_29' and names[-1] == 'module_0'
    names = [row.name for row in rows_of(
        snapshot, 'tasks', Choices(sort='name', pattern='module_?'))]
    assert names == [f'module_{n}' for n in range(10)]
    first = rows_of(snapshot, 'tasks', Choices(sort='last_late_us', backwards=True))[0]
    assert first.name == 'module_4'
    assert rows_of(snapshot, 'tasks', Choices())[0].name == 'module_29'  # the highest priority
    with pytest.raises(ConfigError, match='no such column; there are name, priority'):
        check_sort('colour')


def test_scrolling_stops_at_the_end() -> None:
    choices = Choices(part='tasks', first=1000)
    text = plain(body(story(), choices, 80, 10))
    assert 'module_0 ' in text and choices.first == 30 - 9


def test_keys() -> None:
    controls = Controls(Choices(), 1.0)
    for key in split_keys('2f/x\x7fy\r+-'):
        assert controls.press(key)
    assert controls.choices.part == 'tasks' and controls.choices.pattern == '/y'
    assert controls.interval_s == 1.0
    for _ in range(20):
        controls.press('-')
    assert controls.interval_s == INTERVALS_S[0]
    assert split_keys('\x1b[A\x1bOBx\x1b') == ['\x1b[A', '\x1b[B', 'x', '\x1b']
    controls.press('\x1b')
    assert controls.choices.pattern == ''
    assert not controls.press('q')


@given(st.text(max_size=40))
def test_no_key_breaks_it(typed: str) -> None:
    controls = Controls(Choices(), 1.0)
    for key in split_keys(typed):
        controls.press(key)
    assert ''.join(split_keys(typed)).replace('\x1b[', '\x1bO') == typed.replace('\x1b[', '\x1bO')
    assert len(controls.help_line()) > 20


def test_the_picture_in_the_documentation_is_of_a_robot_that_is_well() -> None:
    images = Path(__file__).resolve().parents[3] / 'docs' / 'images'
    well, trouble = (html.unescape(re.sub(r'<style>.*?</style>|<[^>]+>', ' ', (
        images / f'{name}.svg').read_text(), flags=re.DOTALL)).replace('\xa0', ' ')
        for name in ('top', 'top_trouble'))
    assert 'late now' not in well and 'late now' in trouble
    for text in (well, trouble):
        assert 'AGE s' in text
        assert not re.search(r'\d(ms|s)\b', text.partition('TASK')[2].partition('TOPIC')[0])
