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

"""Commands of operators, executed on an alarm table."""

from __future__ import annotations

from typing import Final

from rt_robot_os.features.alarms.alarm import Alarm
from rt_robot_os.features.alarms.alarm import TEST
from rt_robot_os.features.alarms.alarm_table import AlarmTable
from rt_robot_os.messages import alarm_commands as commands
from rt_robot_os.messages.alarm_commands import AlarmCommand
from rt_robot_os.messages.alarm_commands import parse_command
from rt_robot_os.messages.alarm_state import AlarmState
from rt_robot_os.messages.cause import LEVEL_WORDS
from rt_robot_os.messages.command_answer import CommandAnswer

_NAMED: Final = 8


def execute(table: AlarmTable, text: str, t_ns: int) -> CommandAnswer:
    """Execute a command; the answer says what is wrong with it."""
    table.counters['commands'] += 1
    try:
        return CommandAnswer(text[:100], True, *_do(table, parse_command(text), t_ns))
    except ValueError as error:
        table.counters['bad_commands'] += 1
        return CommandAnswer(text[:100], False, str(error))


def _do(table: AlarmTable, command: AlarmCommand, t_ns: int) -> tuple[str, str]:
    if command.verb == commands.TEST:
        return _test(table, command, t_ns)
    if command.verb == commands.SILENCE:
        seconds = table.silence(command.seconds, t_ns)
        return (f'the robot says nothing for {seconds:g} s, or until there is a new alarm' if (
            seconds) else 'the robot speaks again'), ''
    if (command.verb, command.target) == (commands.CANCEL, commands.ALL):
        return _cancel_all(table, command, t_ns), ''
    if command.target == commands.ALL:
        waiting = [each for each in table.in_order() if each.state is not AlarmState.ACKNOWLEDGED]
        for each in waiting:
            table.acknowledge(each, command.by, command.why, t_ns)
        return f'{len(waiting)} acknowledged', ''
    alarm = find_alarm(table, command.target)
    return f'{alarm.id} ({alarm.subject}) {_one(table, alarm, command, t_ns)}', alarm.id


def _cancel_all(table: AlarmTable, command: AlarmCommand, t_ns: int) -> str:
    """Cancel all suspected alarms; raised ones stay."""
    suspected = [each for each in table.in_order() if each.state is AlarmState.SUSPECTED]
    if not suspected:
        raise ValueError('nothing is suspected: what is raised is acknowledged and resolved')
    for each in suspected:
        table.close(each, AlarmState.CANCELLED, t_ns, by=command.by, why=command.why)
    return f'{", ".join(f"{each.id} ({each.subject})" for each in suspected[:_NAMED])} cancelled'


def _one(table: AlarmTable, alarm: Alarm, command: AlarmCommand, t_ns: int) -> str:
    by, why = command.by, command.why
    suspected = alarm.state is AlarmState.SUSPECTED
    if command.verb == commands.ACKNOWLEDGE:
        if alarm.state is AlarmState.ACKNOWLEDGED:
            return f'was acknowledged by {alarm.by} already; resolve it when all is well'
        table.acknowledge(alarm, by, why, t_ns)
        return 'is acknowledged; it comes again until it is resolved'
    if command.verb == commands.RESOLVE:
        table.close(alarm, AlarmState.RESOLVED, t_ns, by=by, why=why)
        return 'is resolved'
    if command.verb == commands.CANCEL:
        if not suspected:
            raise ValueError(f'alarm {alarm.id} is {alarm.state.value}: only what is suspected '
                             f'can be cancelled; write "resolve {alarm.id} by {by}"')
        table.close(alarm, AlarmState.CANCELLED, t_ns, by=by, why=why)
        return 'is cancelled'
    if command.verb == commands.NOTE:
        if not why:
            raise ValueError(f'there is nothing to note: write "note {alarm.id} by {by} TEXT"')
        table.remark(alarm, by, why, t_ns)
        return 'has a note, which goes with what is told from now on'
    if command.verb == commands.ESCALATE:
        return _escalate(table, alarm, command, t_ns)
    if not suspected:
        raise ValueError(f'alarm {alarm.id} is {alarm.state.value} already')
    table.confirm(alarm, by, why, t_ns)
    return 'is confirmed and raised'


def _escalate(table: AlarmTable, alarm: Alarm, command: AlarmCommand, t_ns: int) -> str:
    if alarm.state is not AlarmState.RAISED:
        hint = 'confirm' if alarm.state is AlarmState.SUSPECTED else 'resolve'
        raise ValueError(f'alarm {alarm.id} is {alarm.state.value}: only what is raised and not '
                         f'acknowledged is told; write "{hint} {alarm.id} by {command.by}"')
    was_top = alarm.top
    table.escalate(alarm, command.by, command.why, t_ns)
    return ('has nobody else to be told; they are told again' if was_top
            else f'is told to step {alarm.step + 1}')


def _test(table: AlarmTable, command: AlarmCommand, t_ns: int) -> tuple[str, str]:
    for each in table.alarms.values():
        if each.is_test and each.subject == TEST and each.level == command.level:
            raise ValueError(f'test {each.id} is not over: acknowledge it first')
    alarm = table.test(command.level, command.by, command.why, t_ns)
    if alarm is None:
        raise ValueError(f'{len(table.alarms)} alarms are open: there is no room for a test')
    return f'test {alarm.id} of level {LEVEL_WORDS[alarm.level]} is on its way', alarm.id


def find_alarm(table: AlarmTable, target: str) -> Alarm:
    """
    Return an open alarm by its id or its subject.

    :raises ValueError: there is none, or more than one.
    """
    if target in table.alarms:
        return table.alarms[target]
    found = [each for each in table.in_order() if each.subject == target]
    if len(found) == 1:
        return found[0]
    names = ', '.join(f'{each.id} ({each.subject})'
                      for each in (found or table.in_order())[:_NAMED])
    if found:
        raise ValueError(f'{target[:60]!r} has {len(found)} alarms: name one of {names}')
    raise ValueError(f'no open alarm is called {target[:60]!r}: ' + (
        f'there are {names}' if names else 'none is open'))
