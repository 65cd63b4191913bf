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

"""Adding, rolling up and thinning in any order, against a plain model; charts by brute force."""

from __future__ import annotations

from collections import defaultdict
import itertools
import math
from typing import Any

from households import confirm
from hypothesis import given
from hypothesis import HealthCheck
from hypothesis import settings
from hypothesis import strategies as st
import pytest
from rt_robot_os.monitor.store.charts import SignChart
from rt_robot_os.monitor.store.retention import RetentionPolicy
from rt_robot_os.monitor.store.rollups import LEVELS
from rt_robot_os.monitor.store.store import Store
from rt_robot_os.monitor.store.tables import PEOPLE
from rt_robot_os.monitor.store.tables import SERIES
from sqlalchemy import select

NOW_NS = 1_800_000_000_000_000_000
S = 1_000_000_000
DAY = 86400 * S
RAW_DAYS, MINUTES_DAYS = 30.0, 300.0
SPANS = {'raw': 1, **{table.name: span_ns for table, span_ns in LEVELS}}

# Now, an hour ago, hours late, older than rows are kept, and older than minutes are.
TIMES = st.builds(
    lambda base, more: NOW_NS - base - more,
    st.sampled_from((0, 3600 * S, 8 * 3600 * S, 29 * DAY, 31 * DAY, 310 * DAY)),
    st.integers(0, 200) | st.integers(0, 7200).map(lambda s: s * S))
VALUES = st.integers(30, 220).map(float) | st.floats(35, 42) | st.none()
RECORDS = st.tuples(st.sampled_from(('b1', 'b2')), st.integers(0, 3000), TIMES, VALUES,
                    st.sampled_from(('good', 'suspect', 'stale', 'off')))
STEPS = st.lists(st.lists(RECORDS, min_size=1, max_size=12) | st.sampled_from(('roll', 'thin')),
                 min_size=1, max_size=8)
PEOPLE_NAMES = (f'person{number}' for number in itertools.count())


class Model:
    """What the store should hold of one person."""

    def __init__(self) -> None:
        self.taken: set[tuple[str, int]] = set()
        self.rows: list[tuple[int, float | None, str]] = []
        self.values: list[tuple[int, float]] = []

    def add(self, batch: list[Any]) -> int:
        before = len(self.taken)
        for boot, seq, t_ns, value, quality in batch:
            if (boot, seq) in self.taken:
                continue
            self.taken.add((boot, seq))
            if value is None and quality in ('good', 'suspect'):
                continue  # RetentionPolicy aside: good, and no value.
            kept = None if quality == 'off' else value
            self.rows.append((t_ns, kept, quality))
            if quality in ('good', 'suspect') and kept is not None:
                self.values.append((t_ns, kept))
        return len(self.taken) - before

    def thin(self) -> None:
        edge_ns = int(NOW_NS - RAW_DAYS * DAY) // (3600 * S) * 3600 * S
        self.rows = [row for row in self.rows if row[0] >= edge_ns]


def _records(batch: list[Any], person: str) -> dict[str, list[dict[str, Any]]]:
    found = defaultdict(list)
    for boot, seq, t_ns, value, quality in batch:
        found[boot].append({'seq': seq, 'type': 'observation', 'utc_ns': t_ns, 'content': {
            'person': person, 'sign': 'pulse_per_min', 'value': value, 'quality': quality}})
    return found


@pytest.mark.filterwarnings('ignore::hypothesis.errors.NonInteractiveExampleWarning')
@settings(max_examples=25, suppress_health_check=list(HealthCheck))
@given(steps=STEPS, start=TIMES, span_ns=st.integers(1, 400 * DAY) | st.integers(1, 7200 * S),
       pixels=st.integers(1, 2000))
def test_whatever_comes_in_whatever_order_is_counted_once(
        store: Store, steps: list[Any], start: int, span_ns: int, pixels: int) -> None:
    person, model = next(PEOPLE_NAMES), Model()
    for step in steps:
        if step == 'roll':
            store.roll_up()
        elif step == 'thin':
            store.thin(RetentionPolicy(raw_days=RAW_DAYS, minutes_days=MINUTES_DAYS))
            model.thin()
        else:
            added = sum(store.add(f'robot of {person}', boot, records)
                        for boot, records in _records(step, person).items())
            assert added == model.add(step)
    rows = sorted((t_ns, quality) for t_ns, _, quality in model.rows)
    assert [(each['t_ns'], each['quality']) for each in sorted(
        store.observations(person), key=lambda each: (each['t_ns'], each['quality']))] == rows
    for begin, end in ((start, start + span_ns), (NOW_NS - 400 * DAY, NOW_NS + DAY)):
        _check(store.chart(person, 'pulse_per_min', begin, end, pixels), model, pixels)
    while store.roll_up():
        pass
    _check_levels(store, person, model)


def _entries(values: list[tuple[int, float]], begin_ns: int, width_ns: int
             ) -> dict[int, list[float]]:
    found = defaultdict(list)
    for t_ns, value in values:
        found[begin_ns + (t_ns - begin_ns) // width_ns * width_ns].append(value)
    return found


def _check(found: SignChart, model: Model, pixels: int) -> None:
    unit = SPANS[found.level]
    begin_ns = found.start_ns // unit * unit
    end_ns = -(-found.end_ns // unit) * unit
    assert found.width_ns % unit == 0
    expected = _entries([each for each in model.values if begin_ns <= each[0] < end_ns],
                        begin_ns, found.width_ns)
    assert len(found.t_ns) <= pixels
    assert found.t_ns == sorted(expected)
    for t_ns, low, mean, high, count in zip(
            found.t_ns, found.low, found.mean, found.high, found.count, strict=True):
        assert (low, high, count) == (
            min(expected[t_ns]), max(expected[t_ns]), len(expected[t_ns]))
        assert math.isclose(mean, sum(expected[t_ns]) / count, rel_tol=1e-12)


def _check_levels(store: Store, person: str, model: Model) -> None:
    with store.reading() as connection:
        number = connection.execute(select(SERIES.c.id).join(PEOPLE).where(
            PEOPLE.c.person == person)).scalar()
        for table, span_ns in LEVELS[1:]:
            expected = _entries(model.values, 0, span_ns)
            found = {row.t_ns: row for row in connection.execute(select(table).where(
                table.c.series_id == number))}
            assert {t_ns: (row.low, row.high, row.count) for t_ns, row in found.items()} == {
                t_ns: (min(values), max(values), len(values))
                for t_ns, values in expected.items()}


def test_a_chart_has_the_alarms_that_were_open_and_the_limits(store: Store) -> None:
    confirm(store, 'r1', 'anna')
    store.hello('r1', 'b1', details={
        'limits': {'anna': {'pulse_per_min': ['pulse_per_min > 120 level urgent']}}})
    store.add('r1', 'b1', [
        {'seq': seq, 'type': 'alarm_event', 'utc_ns': NOW_NS - ago * S, 'content': {
            'seq': seq, 'alarm': alarm, 'event': state, 'state': state, 'level': 'urgent',
            'subject': subject, 'kinds': ['x'], 'text': '', 'by': '', 'why': ''}}
        for seq, (alarm, state, ago, subject) in enumerate((
            ('1', 'raised', 900, 'anna'), ('1', 'resolved', 800, 'anna'),
            ('2', 'raised', 700, 'anna'), ('2', 'resolved', 500, 'anna'),
            ('3', 'raised', 550, 'anna'), ('4', 'raised', 100, 'anna'),
            ('5', 'raised', 550, 'ben')))])
    found = store.chart('anna', 'pulse_per_min', NOW_NS - 600 * S, NOW_NS - 400 * S, 100)
    assert [each['id'] for each in found.alarms] == ['2', '3']
    assert found.limits == ['pulse_per_min > 120 level urgent']
    assert (found.unit, found.t_ns) == ('1/min', [])
    assert store.chart('nobody', 'x', 0, 1, 1).alarms == []
