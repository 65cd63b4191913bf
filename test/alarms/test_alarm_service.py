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

"""The service and its journal: what waits, for how long, and how a failing one is reported."""

from __future__ import annotations

from dataclasses import replace
import json
from typing import Any

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.alarms.alarm_service import AlarmService
from rt_robot_os.features.alarms.alarm_service import START_ALARM_NS
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import Level
from rt_robot_os.messages.journal import JournalReply

WAIT_S = 2
HELP = Cause('help', 'anna', Level.CRITICAL, True, 'the button was pressed', 'button')


class Office:
    """A service, and what it has said so far."""

    def __init__(self, *records: str) -> None:
        self.service = AlarmService(wait_ns=WAIT_S * NS_PER_S)
        self.records: list[str] = []
        self.service.start(NS_PER_S)
        for each in records:
            self.says(1.0, {'record': json.loads(each), 'age_ns': NS_PER_S})
        self.says(1.0, {'restored': len(records)})

    def says(self, at_s: float, said: dict[str, Any]) -> None:
        self.service.handle_journal(JournalReply.from_dict(said), round(at_s * NS_PER_S))

    def told(self, at_s: float) -> list[str]:
        """Let time pass; return of whom people are told until then."""
        self.service.advance(round(at_s * NS_PER_S))
        self.records += self.service.pop_records()
        return [each.subject for each in self.service.pop_notifications()
                if each.channel != 'robot']

    def store(self, at_s: float) -> None:
        self.records += self.service.pop_records()
        self.says(at_s, {'stored': json.loads(self.records[-1])['seq']})

    def kinds(self) -> list[str]:
        """Return the causes that last of what is wrong with the journal."""
        return [kind for each in self.service.table.in_order() if each.subject == 'journal'
                for kind, reason in each.reasons.items() if reason.active]


def test_nobody_is_told_while_a_journal_that_ended_may_be_back_in_time() -> None:
    office = Office()
    office.service.handle_cause(HELP, 2 * NS_PER_S)
    office.says(2.1, {'fault': 'its process ended'})
    assert office.told(2.9) == []
    office.says(3.0, {'restored': 0})
    office.store(3.1)
    assert office.told(3.1) == ['anna', 'journal']
    assert office.kinds() == []


def test_people_are_told_without_a_journal_that_does_not_come_back() -> None:
    office = Office()
    office.says(2.0, {'fault': 'no such disk'})
    office.service.handle_cause(HELP, round(3.5 * NS_PER_S))
    assert office.told(3.9) == []
    assert office.told(4.0) == ['journal', 'anna']  # 2 s after the fault, not after the cause
    office.says(4.5, {'fault': 'no such disk'})
    office.service.handle_cause(replace(HELP, subject='bob'), 5 * NS_PER_S)
    assert office.told(5.0) == ['bob']
    assert 'no such disk' in office.service.warning


def test_a_fault_of_the_journal_ends_with_the_core_that_had_it() -> None:
    first = Office()
    first.says(2.0, {'fault': 'No space left on device'})
    first.told(10.0)
    kept = [each for each in first.records if json.loads(each)['state']]
    second = Office(kept[-1])
    assert second.kinds() == []


def test_a_disk_that_is_full_is_told_while_alarms_are_still_stored() -> None:
    office = Office()
    office.says(2.0, {'low': 'No space left on device: 900 KiB were kept'})
    office.store(2.0)
    assert office.told(2.0) == ['journal'] and office.kinds() == ['journal_space']
    office.service.handle_cause(HELP, 3 * NS_PER_S)
    assert office.told(4.9) == []  # it waits for the journal as ever
    office.store(4.9)
    assert office.told(4.9) == ['anna'] and not office.service.warning
    office.says(60.0, {'low': 'No space left on device: 800 KiB were kept'})
    assert office.kinds() == ['journal_space']
    office.says(70.0, {'low': ''})
    assert office.kinds() == []


def test_a_picture_that_comes_before_the_journal_has_given_back_is_kept() -> None:
    before = Office()
    before.service.handle_cause(HELP, 2 * NS_PER_S)
    alarm = before.service.table.in_order()[0].id
    before.told(2.0)
    after = AlarmService(wait_ns=WAIT_S * NS_PER_S)
    after.start(NS_PER_S)
    after.handle_picture(alarm, 'anna.jpg', 2 * NS_PER_S)
    after.handle_journal(JournalReply(json.loads(before.records[-1]), 0), 2 * NS_PER_S)
    after.handle_journal(JournalReply(restored=1), 2 * NS_PER_S)
    assert after.table.alarms[alarm].pictures == ['anna.jpg']
    after.handle_picture('of-another-robot', 'bob.jpg', 3 * NS_PER_S)
    assert after.statistics()['pictures_without_alarm'] == 1


def test_a_slow_start_calls_nobody_and_a_journal_that_stays_away_does() -> None:
    slow, never = AlarmService(wait_ns=WAIT_S * NS_PER_S), AlarmService(wait_ns=WAIT_S * NS_PER_S)
    for service in (slow, never):
        service.start(NS_PER_S)
        service.advance(10 * NS_PER_S)
        assert 'given nothing back in 2 s' in service.warning
        service.handle_cause(HELP, 11 * NS_PER_S)
        service.advance(13 * NS_PER_S)
        assert {each.subject for each in service.pop_notifications()} == {'anna'}
    slow.handle_journal(JournalReply(restored=0), 14 * NS_PER_S)
    for service in (slow, never):
        service.advance(40 * NS_PER_S)
    assert [each.subject for each in slow.pop_notifications() if each.subject == 'journal'] == []
    assert 'journal' in {each.subject for each in never.pop_notifications()}
    assert [reason.since_ns for each in never.table.in_order() if each.subject == 'journal'
            for reason in each.reasons.values()] == [(1 + WAIT_S) * NS_PER_S + START_ALARM_NS]
