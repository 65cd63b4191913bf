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

"""What robots send comes into the database once, and out of it as it was."""

from __future__ import annotations

from pathlib import Path
import stat
import time
from typing import Any

import pytest

pytest.importorskip('sqlalchemy')
pytest.importorskip('alembic')

from households import confirm  # noqa: E402, I100
from rt_robot_os.monitor.store.store import Store  # noqa: E402

NOW_NS = 1_800_000_000_000_000_000
S = 1_000_000_000


def record(seq: int, kind: str, t_ns: int = NOW_NS, /, **content: Any) -> dict[str, Any]:
    return {'seq': seq, 'importance': 3, 'type': kind, 'utc_ns': t_ns, 'content': content}


def pulse(seq: int, value: float | None, t_ns: int = NOW_NS, person: str = 'anna',
          quality: str = 'good') -> dict[str, Any]:
    return record(seq, 'observation', t_ns, person=person, sign='pulse_per_min', value=value,
                  quality=quality, source='wrist')


def alarm(seq: int, number: int, event: str, state: str, t_ns: int = NOW_NS, **more: Any
          ) -> dict[str, Any]:
    return record(seq, 'alarm_event', t_ns, **{
        'seq': number, 'alarm': '7', 'event': event, 'state': state, 'level': 'critical',
        'subject': 'anna', 'kinds': ['fall'], 'text': 'anna lies in the hall', 'by': '', 'why': '',
        **more})


def test_a_record_is_there_once_however_often_it_comes(store: Store) -> None:
    records = [pulse(seq, 60.0 + seq, NOW_NS - seq * S) for seq in range(10)]
    assert store.add('r1', 'b1', records) == 10
    assert store.add('r1', 'b1', records + [pulse(10, 70.0), pulse(10, 71.0)]) == 1
    assert store.add('r1', 'b2', records[:2]) == 2
    assert store.add('r2', 'b1', records[:2]) == 2
    found = store.observations('anna')
    assert len(found) == 15
    assert [each['t_ns'] for each in found] == sorted(each['t_ns'] for each in found)
    assert found[0] == {
        'id': found[0]['id'], 'robot': 'r1', 'boot': 'b1', 'seq': 9, 'person': 'anna',
        'code': 'pulse_per_min', 'value': 69.0, 'unit': '1/min', 'quality': 'good',
        'source': 'wrist', 't_ns': NOW_NS - 9 * S, 'arrived_ns': NOW_NS}


def test_the_file_is_for_its_owner_alone(tmp_path: Path) -> None:
    store = Store.open(str(tmp_path / 'monitor.db'), lambda: NOW_NS)
    store.add('r1', 'b1', [pulse(0, 60.0)])
    modes = {path.name: stat.S_IMODE(path.stat().st_mode) for path in tmp_path.iterdir()}
    assert 'monitor.db-wal' in modes
    assert set(modes.values()) == {0o600}
    store.close()


def test_it_is_all_there_when_opened_again(url: str) -> None:
    store = Store.open(url)
    store.add('r1', 'b1', [pulse(0, 60.0, time.time_ns())])
    store.close()
    store = Store.open(url)
    assert [each['value'] for each in store.observations('anna')] == [60.0]
    assert store.add('r1', 'b1', [pulse(0, 60.0, time.time_ns())]) == 0
    store.close()


def test_the_newest_of_each_sign_is_the_newest_by_time(store: Store) -> None:
    store.add('r1', 'b1', [pulse(0, 60.0), pulse(1, 50.0, NOW_NS - S), pulse(
        2, None, person='ben', quality='off')])
    assert [(each['person'], each['value'], each['quality']) for each in store.latest(None)] == [
        ('anna', 60.0, 'good'), ('ben', None, 'off')]
    assert [each['person'] for each in store.latest(frozenset({'ben'}))] == ['ben']


@pytest.mark.parametrize('order', [(0, 1, 2, 3), (3, 2, 1, 0), (2, 0, 3, 1)])
def test_an_alarm_is_what_its_newest_event_says_in_whatever_order_they_come(
        store: Store, order: tuple[int, ...]) -> None:
    events = [
        alarm(0, 10, 'suspected', 'suspected', NOW_NS - 9 * S, x=1.0, y=2.0),
        alarm(1, 11, 'raised', 'raised', NOW_NS - 5 * S),
        alarm(2, 14, 'acknowledged', 'acknowledged', NOW_NS - 2 * S, by='mary', text='I go'),
        alarm(3, 19, 'resolved', 'resolved', NOW_NS - S, by='mary', why='in her chair')]
    for number in order:
        store.add('r1', 'b1', [events[number]])
    found = store.alarm('r1', '7')
    assert found is not None
    assert [each['event'] for each in found['events']] == [
        'suspected', 'raised', 'acknowledged', 'resolved']
    assert {name: found[name] for name in (
        'state', 'is_open', 'opened_ns', 'raised_ns', 'acknowledged_ns', 'acknowledged_by', 'why',
        'x', 'y', 't_ns')} == {
            'state': 'resolved', 'is_open': False, 'opened_ns': NOW_NS - 9 * S,
            'raised_ns': NOW_NS - 5 * S, 'acknowledged_ns': NOW_NS - 2 * S,
            'acknowledged_by': 'mary', 'why': 'in her chair', 'x': 1.0, 'y': 2.0,
            't_ns': NOW_NS - S}
    assert store.alarms(people=None, is_open=True) == []


def test_a_name_that_is_given_again_after_the_journal_was_lost_is_another_alarm(
        store: Store) -> None:
    store.add('r1', 'b1', [
        alarm(0, 10, 'raised', 'raised', NOW_NS - 900 * S),
        alarm(1, 11, 'resolved', 'resolved', NOW_NS - 800 * S),
        record(2, 'media', NOW_NS - 850 * S, id='m', alarm='7', kind='picture', size=1)])
    # Late, and no other.
    store.add('r1', 'b1', [alarm(3, 9, 'suspected', 'suspected', NOW_NS - 901 * S)])
    store.add('r1', 'b2', [alarm(0, 1, 'raised', 'raised', NOW_NS - 100 * S),
                           alarm(1, 2, 'acknowledged', 'acknowledged', NOW_NS - 90 * S)])
    newer, older = store.alarms(people=None)
    assert (newer['id'], newer['state'], newer['is_open']) == ('7', 'acknowledged', True)
    assert (older['id'].partition('~')[0], older['state'], older['is_open']) == (
        '7', 'resolved', False)
    assert [len(found['events']) for each in (newer, older)
            if (found := store.alarm('r1', each['id']))] == [2, 3]
    assert [len(store.media_of('r1', each['id'])) for each in (newer, older)] == [0, 1]


def test_a_name_that_a_later_start_gives_again_within_a_minute_is_another_alarm(
        store: Store) -> None:
    store.add('r1', 'b1', [alarm(0, 10, 'raised', 'raised', NOW_NS - 20 * S),
                           alarm(1, 11, 'resolved', 'resolved', NOW_NS - 15 * S)])
    # Recorded again by a later start, which did not know that it was stored.
    store.add('r1', 'b2', [alarm(0, 11, 'raised', 'raised', NOW_NS - 15 * S + S // 10)])
    assert [each['is_open'] for each in store.alarms(people=None)] == [False]
    store.add('r1', 'b3', [alarm(0, 1, 'raised', 'raised', NOW_NS - 5 * S)])
    newer, older = store.alarms(people=None)
    assert (newer['id'], newer['is_open'], older['is_open']) == ('7', True, False)


def test_alarms_of_people_who_are_not_granted_are_not_there(store: Store) -> None:
    confirm(store, 'r1', 'anna', 'ben')
    store.hello('r1', 'b1', name='robbie')
    confirm(store, 'r2', 'cleo')
    store.hello('r2', 'b1')
    store.add('r1', 'b1', [alarm(0, 1, 'raised', 'raised'),
                           alarm(1, 2, 'raised', 'raised', alarm='8', subject='ben'),
                           alarm(2, 3, 'raised', 'raised', alarm='9', subject='kitchen')])
    store.add('r2', 'b1', [alarm(0, 1, 'raised', 'raised', subject='hall')])

    def seen(*people: str) -> set[tuple[str, str]]:
        return {(each['robot'], each['subject']) for each in store.alarms(
            people=frozenset(people))}
    assert seen('anna') == {('r1', 'anna'), ('r1', 'kitchen')}
    assert seen('cleo') == {('r2', 'hall')}
    assert seen() == set()
    assert len(store.alarms(people=None)) == 4


ODD: tuple[dict[str, Any], ...] = (
    {'utc_ns': 'now'}, {'utc_ns': 1e300}, {'utc_ns': None}, {'type': 'hologram'}, {'type': None},
    {'type': ['observation']}, {'content': None}, {'content': []}, {'content': {}},
    {'seq': None}, {'seq': -1}, {'seq': 1 << 70}, {'seq': True}, {'seq': '5'},
    *({'content': {'person': 'anna', 'sign': 'pulse_per_min', 'value': 60.0, **more}} for more in (
        {'value': float('nan')}, {'value': float('inf')}, {'value': 10 ** 400}, {'value': '60'},
        {'value': True}, {'value': None}, {'person': 'an\0na'}, {'person': 'an\ud800na'},
        {'person': ''}, {'person': 'x' * 1_000_000}, {'person': {}}, {'sign': 'Pulse 1'},
        {'sign': '../x'}, {'quality': 'splendid'}, {'quality': ['good']}, {'source': 'a\0'},
        {'source': 'x' * 1_000_000})))


def test_records_that_make_no_sense_are_kept_aside_and_harm_no_others(store: Store) -> None:
    batch = [one for number, odd in enumerate(ODD) for one in (
        pulse(2 * number, 60.0), {**pulse(2 * number + 1, 61.0), **odd})]
    assert store.add('r1', 'b1', [*batch, 'no record', None]) == len(batch) + 2
    assert [each['value'] for each in store.observations('anna')] == [60.0] * len(ODD)
    assert (store.counts['aside'], store.counts['refused']) == (len(ODD) + 2, 0)
    aside = store.unknown()
    assert len(aside) == len(ODD) + 2
    assert all(each['why'] and len(each['content']) <= 2000 for each in aside)
    assert any(each['type'] == 'hologram' and '"value": 61.0' in each['content']
               for each in aside)
    # What has no number comes again with the batch, and is kept again; the rest is known.
    assert store.add('r1', 'b1', batch) == sum(
        'seq' in each and each['seq'] in (None, -1, 1 << 70, True, '5') for each in ODD)


def test_no_alarm_is_lost_for_odd_texts_or_a_wrong_clock(store: Store) -> None:
    texts = ('a\0b', 'a\ud800b', 'a\u202eb', 'ok \U0001f600')
    store.add('r1', 'b1', [
        alarm(seq, 1, 'raised', 'raised', 5, alarm=str(seq), text=text, subject=text)
        for seq, text in enumerate(texts)])
    found = store.alarms(people=None)
    assert len(found) == len(texts)
    assert {each['t_ns'] for each in found} == {NOW_NS}
    assert 'ok \U0001f600' in [each['text'] for each in found]
    assert ''.join(each['text'] + each['subject'] for each in found).encode().isascii() is False
