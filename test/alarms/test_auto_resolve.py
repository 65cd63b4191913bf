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

"""When an alarm resolves itself, and when somebody is reminded of one that does not."""

from __future__ import annotations

from dataclasses import replace

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.alarms.alarm_table import AlarmTable
from rt_robot_os.features.alarms.command_handler import execute
from rt_robot_os.features.alarms.rules import Rules
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import Level

RULES = Rules(resolve_after_ns=120 * NS_PER_S, remind_ns=900 * NS_PER_S)
HELP = Cause('help', 'anna', Level.CRITICAL, True, 'the button was pressed', 'button')
BROKEN = Cause('sensor_off', 'wrist', Level.TECHNICAL, True, 'it does not answer', 'pulse')


class Ward:
    """An alarm table; times are in seconds."""

    def __init__(self) -> None:
        self.table = AlarmTable(RULES)

    def cause(self, at_s: float, cause: Cause) -> None:
        self.table.handle_cause(cause, round(at_s * NS_PER_S))

    def over(self, at_s: float, cause: Cause) -> None:
        self.cause(at_s, replace(cause, active=False))

    def order(self, at_s: float, text: str) -> None:
        answer = execute(self.table, text, round(at_s * NS_PER_S))
        assert answer.ok, answer

    def state(self, at_s: float) -> str:
        """Return the state of the only alarm at a time; '' when it is resolved."""
        self.table.advance(round(at_s * NS_PER_S))
        return ''.join(each.state.value for each in self.table.in_order())

    def next_s(self) -> float:
        return self.table.next_ns() / NS_PER_S


def test_an_alarm_acknowledged_after_its_cause_was_over_stays_from_that_moment_on() -> None:
    ward = Ward()
    ward.cause(1, HELP)
    ward.over(10, HELP)
    ward.order(100, 'acknowledge anna by mary')
    assert ward.next_s() == 220
    assert ward.state(219.999) == 'acknowledged'  # not at 130 s, 120 s after the cause
    assert ward.state(220) == ''


def test_an_alarm_acknowledged_while_its_cause_lasts_stays_from_the_end_of_the_cause_on() -> None:
    ward = Ward()
    ward.cause(1, HELP)
    ward.order(2, 'acknowledge anna by mary')
    assert ward.state(500) == 'acknowledged'
    ward.over(500, HELP)
    assert ward.state(619.999) == 'acknowledged'
    assert ward.state(620) == ''


def test_only_when_the_last_of_several_causes_is_over_does_the_time_begin() -> None:
    ward = Ward()
    ward.cause(1, HELP)
    ward.cause(2, replace(HELP, kind='pulse_low'))
    ward.order(3, 'acknowledge anna by mary')
    ward.over(10, HELP)
    assert ward.state(500) == 'acknowledged'
    ward.over(500, replace(HELP, kind='pulse_low'))
    ward.over(540, HELP)  # told once more that it is over, which it was
    assert ward.state(619.999) == 'acknowledged'
    assert ward.state(620) == ''


def test_a_cause_that_comes_back_begins_the_time_anew() -> None:
    ward = Ward()
    ward.cause(1, HELP)
    ward.order(2, 'acknowledge anna by mary')
    ward.over(10, HELP)
    ward.cause(15, HELP)  # within 20 s: it flaps, and nobody is told
    assert ward.state(500) == 'acknowledged'
    ward.over(501, HELP)
    assert ward.state(620.999) == 'acknowledged'
    assert ward.state(621) == ''


def test_an_emergency_that_nobody_has_seen_never_resolves_itself() -> None:
    ward = Ward()
    ward.cause(1, HELP)
    ward.over(10, HELP)
    assert ward.state(100_000) == 'raised'


def test_a_fault_resolves_itself_although_nobody_has_seen_it() -> None:
    ward = Ward()
    ward.cause(1, BROKEN)
    ward.over(10, BROKEN)
    assert ward.state(129.999) == 'raised'
    assert ward.state(130) == ''


def test_what_is_acknowledged_and_lasts_is_raised_again_after_the_time_to_remind() -> None:
    ward = Ward()
    ward.cause(1, HELP)
    ward.order(100, 'acknowledge anna by mary')
    assert ward.state(999.999) == 'acknowledged'
    assert ward.state(1000) == 'raised'
    (event,) = [each for change in ward.table.pop_changes() for each in change.events
                if each.event == 'unacknowledged']
    assert event.why == 'mary acknowledged it 15 min ago, and it is not resolved'


def test_who_acknowledges_again_does_not_put_off_the_reminder() -> None:
    ward = Ward()
    ward.cause(1, HELP)
    ward.order(100, 'acknowledge anna by mary')
    ward.order(800, 'acknowledge anna by bob')
    assert ward.state(999.999) == 'acknowledged'
    assert ward.state(1000) == 'raised'
    assert ward.table.in_order()[0].by == 'mary'


def test_what_ends_in_the_moment_of_its_reminder_is_resolved_and_wakes_nobody() -> None:
    ward = Ward()
    ward.cause(1, HELP)
    ward.order(100, 'acknowledge anna by mary')
    ward.over(880, HELP)
    assert ward.state(1000) == ''
    assert ward.table.counters['unacknowledged'] == 0


def test_an_alarm_raised_again_is_not_reminded_of_or_resolved_by_its_old_acknowledgement() -> None:
    ward = Ward()
    ward.cause(1, HELP)
    ward.order(2, 'acknowledge anna by mary')
    ward.cause(10, replace(HELP, kind='fall'))
    assert ward.state(10) == 'raised'
    ward.over(11, HELP)
    ward.over(11, replace(HELP, kind='fall'))
    assert ward.state(2000) == 'raised'
    assert ward.table.counters['unacknowledged'] == 1


def test_a_new_alarm_and_one_that_comes_again_end_the_silence_of_the_robot() -> None:
    ward = Ward()
    ward.cause(1, HELP)
    ward.order(2, 'silence 60 by mary')
    assert ward.table.silent_until_ns == 62 * NS_PER_S
    ward.cause(3, HELP)  # it lasts
    assert ward.table.silent_until_ns == 62 * NS_PER_S
    ward.cause(4, BROKEN)
    assert ward.table.silent_until_ns == 0
    ward.order(5, 'acknowledge anna by mary')
    ward.order(890, 'silence 600 by mary')
    assert ward.table.silent_until_ns == 1010 * NS_PER_S  # 120 s at most
    ward.table.advance(905 * NS_PER_S)
    assert ward.table.silent_until_ns == 0


def test_a_suspicion_does_not_end_the_silence_and_what_becomes_of_it_does() -> None:
    ward = Ward()
    ward.order(1, 'silence 60 by mary')
    ward.cause(2, replace(HELP, kind='fall'))
    assert ward.state(31.999) == 'suspected'
    assert ward.table.silent_until_ns == 61 * NS_PER_S
    assert ward.state(32) == 'raised'
    assert ward.table.silent_until_ns == 0
    ward.order(33, 'silence 60 by mary')
    ward.order(34, 'silence 0 by mary')
    assert ward.table.silent_until_ns == 0
