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

"""What people order: commands in plain words, carried out on a book."""

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


def execute(book: AlarmTable, text: str, t_ns: int) -> CommandAnswer:
    """Carry out a command; what is wrong with it is in the answer."""
    book.counters['commands'] += 1
    try:
        return CommandAnswer(text[:100], True, *_do(book, parse_command(text), t_ns))
    except ValueError as error:
        book.counters['bad_commands'] += 1
        return CommandAnswer(text[:100], False, str(error))


def _do(book: AlarmTable, command: AlarmCommand, t_ns: int) -> tuple[str, str]:
    if command.verb == commands.TEST:
        return _test(book, command, t_ns)
    if command.verb == commands.SILENCE:
        seconds = book.silence(command.seconds, t_ns)
        return (f'the robot says nothing for {seconds:g} s, or until there is a new alarm' if (
            seconds) else 'the robot speaks again'), ''
    if (command.verb, command.target) == (commands.CANCEL, commands.ALL):
        return _cancel_all(book, command, t_ns), ''
    if command.target == commands.ALL:
        waiting = [each for each in book.in_order() if each.state is not AlarmState.ACKNOWLEDGED]
        for each in waiting:
            book.acknowledge(each, command.by, command.why, t_ns)
        return f'{len(waiting)} acknowledged', ''
    alarm = find_alarm(book, command.target)
    return f'{alarm.id} ({alarm.subject}) {_one(book, alarm, command, t_ns)}', alarm.id


def _cancel_all(book: AlarmTable, command: AlarmCommand, t_ns: int) -> str:
    """Cancel what is suspected; what is raised stays."""
    suspected = [each for each in book.in_order() if each.state is AlarmState.SUSPECTED]
    if not suspected:
        raise ValueError('nothing is suspected: what is raised is acknowledged and resolved')
    for each in suspected:
        book.close(each, AlarmState.CANCELLED, t_ns, by=command.by, why=command.why)
    return f'{", ".join(f"{each.id} ({each.subject})" for each in suspected[:_NAMED])} cancelled'


def _one(book: AlarmTable, alarm: Alarm, command: AlarmCommand, t_ns: int) -> str:
    by, why = command.by, command.why
    suspected = alarm.state is AlarmState.SUSPECTED
    if command.verb == commands.ACKNOWLEDGE:
        if alarm.state is AlarmState.ACKNOWLEDGED:
            return f'was acknowledged by {alarm.by} already; resolve it when all is well'
        book.acknowledge(alarm, by, why, t_ns)
        return 'is acknowledged; it comes again until it is resolved'
    if command.verb == commands.RESOLVE:
        book.close(alarm, AlarmState.RESOLVED, t_ns, by=by, why=why)
        return 'is resolved'
    if command.verb == commands.CANCEL:
        if not suspected:
            raise ValueError(f'alarm {alarm.id} is {alarm.state.value}: only what is suspected '
                             f'can be cancelled; write "resolve {alarm.id} by {by}"')
        book.close(alarm, AlarmState.CANCELLED, t_ns, by=by, why=why)
        return 'is cancelled'
    if command.verb == commands.NOTE:
        if not why:
            raise ValueError(f'there is nothing to note: write "note {alarm.id} by {by} TEXT"')
        book.remark(alarm, by, why, t_ns)
        return 'has a note, which goes with what is told from now on'
    if command.verb == commands.ESCALATE:
        return _escalate(book, alarm, command, t_ns)
    if not suspected:
        raise ValueError(f'alarm {alarm.id} is {alarm.state.value} already')
    book.confirm(alarm, by, why, t_ns)
    return 'is confirmed and raised'


def _escalate(book: AlarmTable, alarm: Alarm, command: AlarmCommand, t_ns: int) -> str:
    if alarm.state is not AlarmState.RAISED:
        hint = 'confirm' if alarm.state is AlarmState.SUSPECTED else 'resolve'
        raise ValueError(f'alarm {alarm.id} is {alarm.state.value}: only what is raised and not '
                         f'acknowledged is told; write "{hint} {alarm.id} by {command.by}"')
    was_top = alarm.top
    book.escalate(alarm, command.by, command.why, t_ns)
    return ('has nobody else to be told; they are told again' if was_top
            else f'is told to step {alarm.step + 1}')


def _test(book: AlarmTable, command: AlarmCommand, t_ns: int) -> tuple[str, str]:
    for each in book.alarms.values():
        if each.is_test and each.subject == TEST and each.level == command.level:
            raise ValueError(f'test {each.id} is not over: acknowledge it first')
    alarm = book.test(command.level, command.by, command.why, t_ns)
    if alarm is None:
        raise ValueError(f'{len(book.alarms)} alarms are open: there is no room for a test')
    return f'test {alarm.id} of level {LEVEL_WORDS[alarm.level]} is on its way', alarm.id


def find_alarm(book: AlarmTable, target: str) -> Alarm:
    """
    Return the open alarm that somebody names, by its id or its subject.

    :raises ValueError: there is none, or more than one.
    """
    if target in book.alarms:
        return book.alarms[target]
    found = [each for each in book.in_order() if each.subject == target]
    if len(found) == 1:
        return found[0]
    names = ', '.join(f'{each.id} ({each.subject})'
                      for each in (found or book.in_order())[:_NAMED])
    if found:
        raise ValueError(f'{target[:60]!r} has {len(found)} alarms: name one of {names}')
    raise ValueError(f'no open alarm is called {target[:60]!r}: ' + (
        f'there are {names}' if names else 'none is open'))
