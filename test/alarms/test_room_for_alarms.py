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

"""A full alarm table: which alarm replaces which, and how that is reported."""

from __future__ import annotations

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.alarms.alarm_table import AlarmTable
from rt_robot_os.features.alarms.command_handler import execute
from rt_robot_os.features.alarms.rules import Rules
from rt_robot_os.messages.alarm_event import AlarmEvent
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import Level


def cause(subject: str, level: Level, *, active: bool = True) -> Cause:
    return Cause('help', subject, level, active, 'text', 'button')


class FullBook:
    """A table with room for two alarms; each call comes a second after the one before."""

    def __init__(self) -> None:
        self.table = AlarmTable(Rules(alarms_most=2))
        self.at_s = 0
        self.events: list[AlarmEvent] = []

    def take(self, found: Cause) -> list[str]:
        """Take a cause, and return the subjects of the open alarms, the worst first."""
        self.at_s += 1
        self.table.handle_cause(found, self.at_s * NS_PER_S)
        self.events += [event for change in self.table.pop_changes() for event in change.events]
        return [each.subject for each in self.table.in_order()]


def test_an_alarm_does_not_give_way_to_one_of_its_own_level() -> None:
    full = FullBook()
    full.take(cause('anna', Level.URGENT))
    full.take(cause('bert', Level.URGENT))
    assert full.take(cause('carl', Level.URGENT)) == ['anna', 'bert', 'alarms']
    assert full.table.counters['displaced'] == 0 and full.table.counters['overflowed'] == 1


def test_a_lesser_alarm_is_turned_away_and_counted() -> None:
    full = FullBook()
    full.take(cause('anna', Level.URGENT))
    full.take(cause('bert', Level.URGENT))
    assert full.take(cause('carl', Level.WARNING)) == ['anna', 'bert', 'alarms']
    assert full.take(cause('dora', Level.WARNING)) == ['anna', 'bert', 'alarms']
    assert full.table.counters['overflowed'] == 2


def test_of_the_least_alarms_the_newest_gives_way_to_a_worse_one() -> None:
    full = FullBook()
    full.take(cause('anna', Level.WARNING))
    full.take(cause('bert', Level.WARNING))
    assert full.take(cause('carl', Level.CRITICAL)) == ['carl', 'anna', 'alarms']
    (event,) = [each for each in full.events if each.event == 'resolved']
    assert (event.subject, event.why) == ('bert', 'displaced by a worse one')


def test_the_least_gives_way_although_it_is_the_oldest() -> None:
    full = FullBook()
    full.take(cause('anna', Level.WARNING))
    full.take(cause('bert', Level.URGENT))
    assert full.take(cause('carl', Level.CRITICAL)) == ['carl', 'bert', 'alarms']


def test_what_gave_way_and_lasts_is_an_alarm_again_as_soon_as_there_is_room() -> None:
    full = FullBook()
    full.take(cause('anna', Level.WARNING))
    full.take(cause('bert', Level.WARNING))
    full.take(cause('carl', Level.CRITICAL))
    assert full.take(cause('bert', Level.WARNING)) == ['carl', 'anna', 'alarms']
    execute(full.table, 'resolve carl by mary', full.at_s * NS_PER_S)
    assert full.take(cause('bert', Level.WARNING)) == ['anna', 'bert', 'alarms']


def test_the_alarm_of_the_book_itself_takes_no_room_and_ends_when_there_is_room() -> None:
    full = FullBook()
    full.take(cause('anna', Level.URGENT))
    full.take(cause('bert', Level.URGENT))
    full.take(cause('carl', Level.URGENT))
    (itself,) = [each for each in full.table.in_order() if each.subject == 'alarms']
    assert not itself.over_ns
    execute(full.table, 'resolve anna by mary', full.at_s * NS_PER_S)
    assert itself.over_ns == full.at_s * NS_PER_S
    # It is open still, and the second place is free all the same.
    assert full.take(cause('dora', Level.WARNING)) == ['bert', 'dora', 'alarms']
    assert full.table.counters['overflowed'] == 1


def test_a_test_takes_no_place_of_an_alarm_that_is_as_bad() -> None:
    full = FullBook()
    full.take(cause('anna', Level.URGENT))
    full.take(cause('bert', Level.URGENT))
    answer = execute(full.table, 'test urgent by mary', 5 * NS_PER_S)
    assert not answer.ok and 'no room for a test' in answer.text
    assert full.take(cause('anna', Level.URGENT)) == ['anna', 'bert', 'alarms']


def test_more_alarms_of_before_a_restart_than_there_is_room_for_leave_no_room() -> None:
    before = AlarmTable(Rules(alarms_most=3))
    for at_s, subject in enumerate(['anna', 'bert', 'carl'], 1):
        before.handle_cause(cause(subject, Level.URGENT), at_s * NS_PER_S)
    full = FullBook()
    full.table.number = before.number
    full.table.restore(before.in_order(), 10 * NS_PER_S)
    full.at_s = 10
    assert full.take(cause('dora', Level.URGENT)) == ['anna', 'bert', 'carl', 'alarms']
    itself = full.table.in_order()[-1]
    execute(full.table, 'resolve anna by mary', 12 * NS_PER_S)
    assert not itself.over_ns  # two are open, and there is room for two
    execute(full.table, 'resolve bert by mary', 13 * NS_PER_S)
    assert itself.over_ns == 13 * NS_PER_S
