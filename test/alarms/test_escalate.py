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

"""Somebody has the next step told without waiting for its time."""

from __future__ import annotations

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.alarms.alarm_table import AlarmTable
from rt_robot_os.features.alarms.command_handler import execute
from rt_robot_os.features.alarms.escalation import parse_steps
from rt_robot_os.features.alarms.rules import Rules
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import Level

RULES = Rules({Level.CRITICAL: parse_steps(['operator 30 repeat 10', 'family 60'])},
              frozenset({'fall'}))


def _book(kind: str) -> AlarmTable:
    table = AlarmTable(RULES)
    table.handle_cause(Cause(kind, 'anna', Level.CRITICAL, True, 'text', 'module'), NS_PER_S)
    return table


def _told(table: AlarmTable) -> list[str]:
    return [event.why for change in table.pop_changes() for event in change.events
            if event.event in ('notified', 'escalated', 'repeated')]


def test_the_next_step_is_told_at_once_and_the_last_one_once_more() -> None:
    table = _book('help')
    assert _told(table) == ['operator']
    assert execute(table, 'escalate anna by mary nobody is near', 2 * NS_PER_S).ok
    assert _told(table) == ['family']
    answer = execute(table, 'escalate anna by mary', 3 * NS_PER_S)
    assert answer.ok and 'nobody else' in answer.text
    assert _told(table) == ['family']
    table.advance(62 * NS_PER_S)
    assert _told(table) == []  # told anew at 3 s: the repetition counts from there
    table.advance(63 * NS_PER_S)
    assert len(_told(table)) == 1


def test_who_hurried_it_is_in_its_events() -> None:
    table = _book('help')
    execute(table, 'escalate anna by mary nobody is near', 2 * NS_PER_S)
    found = [(event.by, event.why) for change in table.pop_changes() for event in change.events
             if event.event == 'hurried']
    assert found == [('mary', 'nobody is near')]


def test_what_is_only_suspected_or_taken_on_is_not_escalated() -> None:
    table = _book('fall')
    answer = execute(table, 'escalate anna by mary', 2 * NS_PER_S)
    assert not answer.ok and '"confirm ' in answer.text
    table = _book('help')
    execute(table, 'acknowledge anna by mary', 2 * NS_PER_S)
    answer = execute(table, 'escalate anna by mary', 3 * NS_PER_S)
    assert not answer.ok and '"resolve ' in answer.text
