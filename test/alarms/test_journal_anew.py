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

"""A journal that is written anew: which records it takes over, and which it leaves behind."""

from __future__ import annotations

from typing import Any

from rt_robot_os.features.alarms.journal_lines import retained
from rt_robot_os.features.alarms.journal_lines import StoredRecord

OPEN: dict[str, Any] = {'state': {'id': '1'}}
OVER: dict[str, Any] = {'state': None}
#: It is over, and its cause is told on.
HELD_BACK: dict[str, Any] = {'state': None, 'lasting': [{'kind': 'help'}]}


def journal(*records: tuple[str, dict[str, Any]]) -> list[StoredRecord]:
    return [StoredRecord(seq, alarm, seq, record)
            for seq, (alarm, record) in enumerate(records, 1)]


def kept(records: list[StoredRecord], history_bytes: int = 0) -> list[int]:
    return [each.seq for each in retained(records, history_bytes)]


def test_open_alarms_are_taken_over_however_little_room_there_is() -> None:
    assert kept(journal(('anna', OPEN), ('bert', OPEN), ('carl', OVER))) == [1, 2, 3]


def test_of_an_open_alarm_the_newest_record_is_taken_over() -> None:
    assert kept(journal(('anna', OPEN), ('anna', OPEN), ('bert', OVER), ('carl', OVER))) == [2, 4]


def test_an_alarm_that_was_open_and_is_over_is_left_behind() -> None:
    assert kept(journal(('anna', OPEN), ('anna', OVER), ('bert', OPEN))) == [3]


def test_an_alarm_that_is_over_is_taken_over_while_its_cause_is_held_back() -> None:
    assert kept(journal(('anna', HELD_BACK), ('bert', OVER), ('carl', OVER))) == [1, 3]


def test_the_last_record_is_taken_over_so_that_no_number_is_given_twice() -> None:
    assert kept(journal(('anna', OVER), ('bert', OVER))) == [2]


def test_of_what_is_over_the_newest_is_taken_over_as_far_as_there_is_room() -> None:
    records = journal(*[('anna', OVER)] * 10, ('bert', OPEN))
    size = len('{"state": null}')
    assert kept(records) == [11]
    assert kept(records, size) == [11]
    assert kept(records, size + 1) == [10, 11]
    assert kept(records, 3 * size + 1) == [8, 9, 10, 11]
    assert kept(records, 1000) == list(range(1, 12))


def test_records_are_taken_over_in_the_order_of_their_numbers_and_once() -> None:
    first, second, third = journal(('anna', OPEN), ('bert', OPEN), ('carl', OPEN))
    assert kept([third, first, second, first]) == [1, 2, 3]
