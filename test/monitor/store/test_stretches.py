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


"""Check what is said of the times without a good value."""

from __future__ import annotations

from itertools import groupby
from typing import Any

from hypothesis import given
from hypothesis import HealthCheck
from hypothesis import settings
from hypothesis import strategies as st
import pytest

pytest.importorskip('sqlalchemy')
pytest.importorskip('alembic')

from rt_robot_os.monitor.store.records import QUALITIES  # noqa: E402
from rt_robot_os.monitor.store.store import Store  # noqa: E402
from rt_robot_os.monitor.store.stretches import LONGEST_NS  # noqa: E402
from rt_robot_os.monitor.store.stretches import stretches  # noqa: E402

NOW_NS = 1_800_000_000_000_000_000
S = 1_000_000_000
BEGIN_NS = NOW_NS - 3600 * S


def add(store: Store, person: str, qualities: list[str]) -> None:
    """Keep an observation each second from the beginning on, with these qualities."""
    store.add('r1', person, [
        {'seq': seq, 'importance': 3, 'type': 'observation', 'utc_ns': BEGIN_NS + seq * S,
         'content': {'person': person, 'sign': 'pulse_per_min', 'quality': quality,
                     'value': 70.0 if quality in ('good', 'suspect', 'stale') else None,
                     'source': 'wrist'}} for seq, quality in enumerate(qualities)])


def found(store: Store, person: str, start_s: int, end_s: int) -> list[tuple[Any, ...]]:
    """Ask, in seconds from the beginning on."""
    with store.reading() as connection:
        return [((each['from_ns'] - BEGIN_NS) // S,
                 None if each['to_ns'] is None else (each['to_ns'] - BEGIN_NS) // S,
                 each['quality'])
                for each in stretches(connection, person, 'pulse_per_min',
                                      BEGIN_NS + start_s * S, BEGIN_NS + end_s * S)]


def test_each_stretch_has_its_beginning_its_end_and_its_quality(store: Store) -> None:
    add(store, 'anna', ['good', 'off', 'off', 'suspect', 'good', 'good', 'missing', 'missing'])
    assert found(store, 'anna', 0, 100) == [
        (1, 3, 'off'), (3, 4, 'suspect'), (6, None, 'missing')]
    assert found(store, 'anna', 2, 4) == [(2, 3, 'off'), (3, None, 'suspect')]
    assert found(store, 'anna', 4, 6) == []
    assert found(store, 'anna', 50, 60) == [(50, None, 'missing')]
    assert found(store, 'bob', 0, 100) == []
    with store.reading() as connection:
        assert stretches(connection, 'anna', 'pulse_per_min', BEGIN_NS,
                         BEGIN_NS + LONGEST_NS + 1) == []


COUNT = iter(range(1_000_000))


@settings(max_examples=25, deadline=None,
          suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.sampled_from(QUALITIES), min_size=1, max_size=30), st.integers(0, 30))
def test_they_are_those_of_the_rows(store: Store, qualities: list[str], start_s: int) -> None:
    person = f'p{next(COUNT)}'
    add(store, person, qualities)
    expected = []
    for quality, group in groupby(enumerate(qualities), key=lambda each: each[1]):
        numbers = [number for number, _ in group]
        end_s = numbers[-1] + 1
        last = end_s == len(qualities)
        if quality != 'good' and (last or end_s > start_s):
            expected.append((max(start_s, numbers[0]), None if last else end_s, quality))
    assert found(store, person, start_s, 1000) == expected
