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

"""What was confirmed is stored, also of a robot whose clock is wrong."""

from __future__ import annotations

import json
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import pytest

pytest.importorskip('sqlalchemy')
pytest.importorskip('alembic')

from rt_robot_os.monitor.store.adding import ReceivedBatch  # noqa: E402
from rt_robot_os.monitor.store.robot_clock import FUTURE_NS  # noqa: E402
from rt_robot_os.monitor.store.robot_clock import PAST_NS  # noqa: E402
from rt_robot_os.monitor.store.robot_clock import RobotClock  # noqa: E402
from rt_robot_os.monitor.store.store import Store  # noqa: E402

NOW_NS = 1_800_000_000_000_000_000
S = 1_000_000_000
DAY = 86400 * S
TIMES = st.integers(-1 << 62, 1 << 62)


def pulse(seq: int, t_ns: int, value: float = 60.0) -> dict[str, Any]:
    return {'seq': seq, 'importance': 3, 'type': 'observation', 'utc_ns': t_ns, 'content': {
        'person': 'anna', 'sign': 'pulse_per_min', 'value': value, 'quality': 'good',
        'source': 'wrist'}}


def hologram(seq: int) -> dict[str, Any]:
    return {'seq': seq, 'importance': 3, 'type': 'hologram', 'utc_ns': NOW_NS, 'content': {}}


@pytest.mark.parametrize('days', [2, -500, 20_000])
def test_records_of_a_clock_that_is_wrong_are_stored_in_order_and_marked(
        store: Store, days: int) -> None:
    error_ns = days * DAY
    said = [NOW_NS + error_ns - age * S for age in (3 * 86400, 86400, 30, 0)]
    added, = store.add_all([ReceivedBatch('r1', 'b1', [pulse(*each) for each in enumerate(said)],
                                          RobotClock(error_ns, True))])
    assert (added.fresh, added.aside, added.refused, added.misdated) == (4, 0, 0, 4)
    found = store.observations('anna')
    assert [each['t_ns'] for each in found] == [t_ns - error_ns for t_ns in said]
    assert {each['quality'] for each in found} == {'suspect'}
    mark, = store.events('r1', 0, NOW_NS + 1, 10)
    assert mark['type'] == 'clock_error'
    assert mark['content'] == {'records': 4, 'first_seq': 0, 'last_seq': 3,
                               'clock_error_s': [error_ns / S, error_ns / S]}
    assert store.counts['misdated'] == 4


def test_an_earlier_start_with_a_good_clock_keeps_its_times(store: Store) -> None:
    clock = RobotClock(2 * DAY, False)
    sent = [pulse(0, NOW_NS - DAY), pulse(1, NOW_NS + 2 * DAY - S)]
    store.add_all([ReceivedBatch('r1', 'b0', sent, clock)])
    assert [(each['t_ns'], each['quality']) for each in store.observations('anna')] == [
        (NOW_NS - DAY, 'good'), (NOW_NS - S, 'suspect')]


@given(TIMES, TIMES, st.booleans())
def test_a_corrected_time_is_always_one_that_can_be(t_ns: int, offset_ns: int, same: bool) -> None:
    found = RobotClock(offset_ns, same).corrected(t_ns, NOW_NS)
    assert NOW_NS - PAST_NS <= found <= NOW_NS + FUTURE_NS


@given(st.integers(NOW_NS - PAST_NS, NOW_NS + FUTURE_NS),
       st.integers(-FUTURE_NS, FUTURE_NS), st.booleans())
def test_a_time_that_can_be_is_stored_as_it_came(t_ns: int, offset_ns: int, same: bool) -> None:
    assert RobotClock(offset_ns, same).corrected(t_ns, NOW_NS) == t_ns


def test_what_there_is_no_room_for_is_refused_and_taken_once_there_is(
        store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('rt_robot_os.monitor.store.adding.ASIDE_MOST', 5)
    batch = [*map(hologram, range(8)), pulse(8, NOW_NS)]
    for refused, fresh, known in ((3, 6, 0), (3, 0, 6)):
        added, = store.add_all([ReceivedBatch('r1', 'b1', batch)])
        assert (added.refused, added.fresh, added.known) == (refused, fresh, known)
    assert len(store.observations('anna')) == 1
    monkeypatch.setattr('rt_robot_os.monitor.store.adding.ASIDE_MOST', 10)
    assert store.add_all([ReceivedBatch('r1', 'b1', batch)])[0][:4] == (3, 6, 3, 0)
    assert sorted(each['seq'] for each in store.unknown()) == list(range(8))


def test_nothing_of_a_confirmed_batch_is_lost(store: Store) -> None:
    clock = RobotClock(2 * DAY, True)
    numbers = range(12_000)
    for begin in range(0, len(numbers), 500):
        part = numbers[begin:begin + 500]
        added, = store.add_all([ReceivedBatch('r1', 'b1', [
            pulse(seq, NOW_NS + 2 * DAY - seq * S) for seq in part], clock)])
        assert added.refused == 0
    found = {each['seq'] for each in store.observations('anna', limit=10_000)} | {
        each['seq'] for each in store.observations('anna', start=NOW_NS - 2000 * S, limit=10_000)}
    assert found == set(numbers)
    assert json.dumps(store.unknown()) == '[]'
