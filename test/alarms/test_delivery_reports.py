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

"""What channels report of notifications, and which of them counts for what happens next."""

from __future__ import annotations

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.alarms.alarm import Delivery
from rt_robot_os.features.alarms.alarm_table import AlarmTable
from rt_robot_os.features.alarms.escalation import parse_steps
from rt_robot_os.features.alarms.rules import Rules
from rt_robot_os.messages.alarm_event import AlarmEvent
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import Level

TOLD = ('notified', 'escalated', 'repeated')


class Ward:
    """A critical alarm at 1 s, and what was told of it."""

    def __init__(self, *steps: str) -> None:
        self.table = AlarmTable(Rules({Level.CRITICAL: parse_steps(steps)},
                                      delivery_timeout_ns=10 * NS_PER_S))
        self.sent: list[Delivery] = []
        self.events: list[AlarmEvent] = []
        self.table.handle_cause(
            Cause('help', 'anna', Level.CRITICAL, True, 'text', 'button'), NS_PER_S)
        self._hear()

    def _hear(self) -> None:
        for change in self.table.pop_changes():
            self.sent += change.sends
            self.events += change.events

    def report(self, at_s: float, channel: str, *, ok: bool, nth: int = -1) -> list[str]:
        """Report of the newest notification of a channel, or of another; return who is told."""
        before = len(self.events)
        delivery = [each for each in self.sent if each.channel == channel][nth]
        self.table.handle_report(delivery.key, ok, '', round(at_s * NS_PER_S))
        self._hear()
        return [each.why for each in self.events[before:] if each.event in TOLD]

    def told(self, at_s: float) -> list[tuple[float, str]]:
        """Let time pass; return who is told meanwhile, and when."""
        before = len(self.events)
        self.table.advance(round(at_s * NS_PER_S))
        self._hear()
        return [(each.t_ns / NS_PER_S, each.why) for each in self.events[before:]
                if each.event in TOLD]

    def count(self, event: str) -> int:
        return sum(each.event == event for each in self.events)


def test_when_nobody_of_a_step_can_be_reached_the_next_is_told_at_once() -> None:
    ward = Ward('operator+screen 60', 'family 60')
    assert ward.report(2, 'operator', ok=False) == []
    assert ward.report(3, 'screen', ok=False) == ['family']


def test_who_was_reached_in_an_earlier_step_does_not_stand_for_the_present_one() -> None:
    ward = Ward('robot 0', 'operator 60', 'family 60')
    assert ward.report(2, 'robot', ok=True) == []
    assert ward.report(3, 'operator', ok=False) == ['family']


def test_who_was_not_reached_in_an_earlier_step_does_not_hurry_the_present_one() -> None:
    ward = Ward('operator 5', 'family 60', 'emergency 60')
    assert ward.told(6) == [(6, 'family')]
    assert ward.report(7, 'operator', ok=False) == []
    assert ward.report(8, 'family', ok=True) == []
    assert ward.told(65.999) == []
    assert ward.told(66) == [(66, 'emergency')]


def test_a_step_of_which_one_was_reached_keeps_its_time() -> None:
    ward = Ward('operator+screen 60', 'family 60')
    ward.report(2, 'operator', ok=True)
    assert ward.report(3, 'screen', ok=False) == []
    assert ward.told(60.999) == []
    assert ward.told(61) == [(61, 'family')]


def test_a_step_of_which_one_has_not_reported_yet_keeps_its_time() -> None:
    ward = Ward('operator+screen 60', 'family 60')
    assert ward.report(2, 'screen', ok=False) == []
    # The operator's notification has 10 s; then it has failed as well.
    assert ward.told(10.999) == []
    assert ward.told(11) == [(11, 'family')]


def test_a_notification_fails_once_however_often_it_is_said() -> None:
    ward = Ward('operator+screen 60', 'family 60')
    ward.report(2, 'operator', ok=False)
    ward.report(3, 'operator', ok=False)
    assert ward.count('failed') == 1
    ward.told(11)
    assert ward.count('failed') == 2  # the screen said nothing in time
    ward.report(12, 'screen', ok=False)
    assert ward.count('failed') == 2


def test_a_notification_is_delivered_once_and_stays_so() -> None:
    ward = Ward('operator 60', 'family 60')
    ward.report(2, 'operator', ok=True)
    ward.report(3, 'operator', ok=True)
    assert ward.report(4, 'operator', ok=False) == []
    assert (ward.count('delivered'), ward.count('failed')) == (1, 0)
    assert ward.told(60.999) == []


def test_a_late_word_that_it_was_delivered_counts() -> None:
    ward = Ward('operator+screen 60', 'family 60')
    ward.report(2, 'operator', ok=False)
    ward.report(3, 'operator', ok=True)
    assert ward.count('delivered') == 1
    assert ward.report(4, 'screen', ok=False) == []


def test_who_is_told_again_gets_no_more_time_to_report() -> None:
    ward = Ward('operator 60 repeat 4', 'family 60')
    assert ward.told(11) == [(5, 'operator'), (9, 'operator'), (11, 'family')]


def test_a_report_of_what_was_replaced_by_a_newer_word_is_counted_and_nothing_more() -> None:
    ward = Ward('operator 60 repeat 4', 'family 60')
    ward.told(5)
    assert ward.report(6, 'operator', ok=False, nth=0) == []
    assert ward.table.counters['late_reports'] == 1 and ward.count('failed') == 0
    assert ward.report(7, 'operator', ok=False) == ['family']


def test_at_the_top_those_are_told_again_whom_nothing_has_reached() -> None:
    ward = Ward('operator 5', 'family 5', 'emergency 30')
    ward.report(2, 'operator', ok=False)
    ward.report(3, 'family', ok=True)
    assert ward.told(7) == [(7, 'emergency')]
    assert ward.told(37) == [(37, 'emergency, operator')]


def test_at_the_top_nobody_is_told_again_who_may_report_yet_or_was_reached_before() -> None:
    ward = Ward('operator 2', 'family+screen 2', 'operator 2', 'emergency 5')
    ward.report(2, 'operator', ok=False)
    assert ward.told(4) == [(4, 'operator')]
    ward.report(5, 'operator', ok=True)
    # Those of the second step have until 12 s, and the emergency call is repeated at 11 s.
    assert ward.told(11) == [(6, 'emergency'), (11, 'emergency')]
    assert ward.told(16) == [(16, 'emergency, family, screen')]
