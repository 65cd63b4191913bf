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

"""A journal that stores nothing for long: what is kept for it, what is dropped, who waits."""

from __future__ import annotations

from collections.abc import Iterable
import json

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.alarms.alarm_service import AlarmService
from rt_robot_os.features.alarms.escalation import parse_steps
from rt_robot_os.features.alarms.rules import Rules
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import Level
from rt_robot_os.messages.journal import JournalReply

#: Nobody is told that the journal is faulty: only the cause of a person waits for it.
RULES = Rules({Level.CRITICAL: parse_steps(['operator 30']),
               Level.URGENT: parse_steps(['operator 30'])})
WAIT_S = 2
MOST = 256


def help_of(subject: str, level: Level = Level.CRITICAL) -> Cause:
    return Cause('help', subject, level, True, 'text', 'button')


def new_desk(records: Iterable[str] = ()) -> AlarmService:
    service = AlarmService(RULES, wait_ns=WAIT_S * NS_PER_S)
    service.start(NS_PER_S)
    for each in records:
        service.handle_journal(JournalReply(json.loads(each), 0), NS_PER_S)
    service.handle_journal(JournalReply(restored=0), NS_PER_S)
    return service


def see(service: AlarmService, subject: str, pictures: int) -> None:
    """Make so many records of an alarm: a picture each."""
    (alarm,) = [each.id for each in service.table.in_order() if each.subject == subject]
    for number in range(pictures):
        service.handle_picture(alarm, f'{subject}{number}.jpg', 2 * NS_PER_S)


def about(service: AlarmService) -> list[str]:
    """Return what is not stored: the alarm of each record, by subject."""
    return [json.loads(each)['state']['subject'] for each in service.unstored()]


def told(service: AlarmService, at_s: float) -> list[str]:
    service.advance(round(at_s * NS_PER_S))
    return [each.subject for each in service.pop_notifications()]


def test_the_only_record_of_an_alarm_outlives_many_of_another_one() -> None:
    service = new_desk()
    service.handle_cause(help_of('anna'), 2 * NS_PER_S)
    service.handle_cause(help_of('bert'), 2 * NS_PER_S)
    see(service, 'bert', MOST + 50)
    assert about(service) == ['anna', *['bert'] * (MOST - 1)]
    assert service.statistics()['dropped_records'] == 52
    # The journal is back, it gets what there is, and then the core starts anew.
    after = new_desk(service.unstored())
    assert {each.subject for each in after.table.in_order()} == {'anna', 'bert'}
    assert after.table.in_order()[1].pictures[-1] == f'bert{MOST + 49}.jpg'


def test_of_the_records_that_a_later_one_makes_up_for_the_oldest_goes_first() -> None:
    service = new_desk()
    service.handle_cause(help_of('anna'), 2 * NS_PER_S)
    see(service, 'anna', 1)
    service.handle_cause(help_of('bert'), 2 * NS_PER_S)
    see(service, 'bert', MOST - 3)
    assert about(service)[:3] == ['anna', 'anna', 'bert'] and len(about(service)) == MOST
    see(service, 'bert', 1)
    assert about(service)[:2] == ['anna', 'bert'] and len(about(service)) == MOST
    see(service, 'bert', 1)
    assert about(service)[:2] == ['anna', 'bert'] and len(about(service)) == MOST


def test_a_record_that_is_not_stored_is_sent_again_and_one_that_is_stored_is_not() -> None:
    service = new_desk()
    service.handle_cause(help_of('anna'), 2 * NS_PER_S)
    service.handle_cause(help_of('bert'), 2 * NS_PER_S)
    first, second = service.pop_records()
    service.handle_journal(JournalReply(stored=json.loads(first)['seq']), 2 * NS_PER_S)
    assert service.unstored() == [second]
    service.handle_journal(JournalReply(resend=True), 2 * NS_PER_S)
    assert service.pop_records() == [second]


def test_a_notification_is_let_go_when_its_own_record_is_stored_and_no_later() -> None:
    service = new_desk()
    service.handle_cause(help_of('anna'), 2 * NS_PER_S)
    service.handle_cause(help_of('bert'), 2 * NS_PER_S)
    first, _ = service.pop_records()
    assert told(service, 2.5) == []
    service.handle_journal(JournalReply(stored=json.loads(first)['seq']), round(2.5 * NS_PER_S))
    assert told(service, 2.5) == ['anna']


def test_a_cause_that_comes_during_a_fault_waits_until_the_end_of_the_patience_with_it() -> None:
    service = new_desk()
    service.handle_journal(JournalReply(fault='no such disk'), 2 * NS_PER_S)
    service.handle_cause(help_of('anna'), round(3.5 * NS_PER_S))
    assert told(service, 3.999) == []
    assert service.next_ns == 4 * NS_PER_S  # not 2 s after the cause
    assert told(service, 4) == ['anna']


def test_a_cause_from_before_a_fault_waits_no_longer_than_it_would_have_done_without() -> None:
    service = new_desk()
    service.handle_cause(help_of('anna'), 2 * NS_PER_S)
    service.handle_journal(JournalReply(fault='no such disk'), 3 * NS_PER_S)
    assert told(service, 3.999) == []
    assert told(service, 4) == ['anna']


def test_when_patience_is_over_people_are_told_at_once_until_the_journal_stores_again() -> None:
    service = new_desk()
    service.handle_journal(JournalReply(fault='no such disk'), 2 * NS_PER_S)
    service.handle_cause(help_of('anna'), 4 * NS_PER_S)
    assert told(service, 4) == ['anna']
    last = json.loads(service.unstored()[-1])['seq']
    service.handle_journal(JournalReply(stored=last), 5 * NS_PER_S)
    assert not service.warning
    service.handle_cause(help_of('bert'), 6 * NS_PER_S)
    assert told(service, 7.999) == []
    assert told(service, 8) == ['bert']
    assert 'it has stored nothing for 2 s' in service.warning


def test_who_was_acknowledged_while_the_notification_waited_is_told_of_nothing() -> None:
    service = new_desk()
    service.handle_cause(help_of('anna'), 2 * NS_PER_S)
    service.handle_command('acknowledge anna by mary', 3 * NS_PER_S)
    assert told(service, 10) == []
    assert service.statistics()['withdrawn'] == 1
