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

"""The module of the alarms on the virtual clock: topics in, topics out, the journal between."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
import json
from typing import Any

import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.alarms.module import Alarms
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import CAUSES_TOPIC
from rt_robot_os.messages.cause import Level
from rt_robot_os.testing.fakes import settings_of
from rt_robot_os.testing.module_bench import ModuleBench

pytest.importorskip('std_msgs.msg', reason='the ROS 2 messages are not installed')

FALL = Cause('fall', 'anna', Level.CRITICAL, True, 'anna lies on the floor', 'falls', 'wrist')
HELP = Cause('help', 'anna', Level.CRITICAL, True, 'the button was pressed', 'button')
STEPS = ['robot 0', 'operator 30 repeat 10', 'family 60']


class Robot:
    """The module, what it is told and what it says; with a journal in memory."""

    def __init__(self, journal: bool = True, **given: Any) -> None:
        self.bench = ModuleBench()
        text = 'std_msgs/msg/String'
        self.inputs = {}
        for name in (CAUSES_TOPIC, 'alarms/command', 'alarms/report', 'alarms/stored'):
            self.bench.bus.declare(name, text, tail=33_000, depth=64)
            self.inputs[name] = self.bench.bus.publisher(name)
        given = {'critical_steps': STEPS, **given}
        if not journal:
            given['stored_topic'] = ''
        self.module = self.bench.add(Alarms, rate_hz=10.0, priority=41, **given)
        self.outputs = {name: self.bench.watch(name) for name in (
            'alarms/events', 'alarms/notify', 'alarms/answer', 'alarms/list', 'agent/say',
            *(('alarms/journal',) if journal else ()))}
        self.kept: dict[str, list[Any]] = {name: [] for name in self.outputs}
        self.kept_records: list[str] = []
        self.stores = True
        self.delivers = True
        task = self.bench.kernel.add_task('others', self._others, priority=20, rate_hz=100.0)
        assert task
        if journal:
            self.say('alarms/stored', {'restored': 0}, at_s=0.01)

    def _others(self) -> None:
        """Be the journal and the notifier."""
        for name, output in self.outputs.items():
            while output.take():
                self._take(name, str(output.msg.data))

    def _take(self, name: str, text: str) -> None:
        found = text if name == 'agent/say' else json.loads(text)
        self.kept[name].append(found)
        if name == 'alarms/journal' and self.stores:
            self.kept_records.append(text)
            self._publish('alarms/stored', {'stored': found['seq']})
        if name == 'alarms/notify' and self.delivers:
            self._publish('alarms/report', {'key': found['key'], 'ok': True,
                                            'channel': found['channel'], 'text': 'shown'})

    def _publish(self, name: str, found: object) -> None:
        publisher = self.inputs[name]
        publisher.msg.data = found if isinstance(found, str) else json.dumps(found)
        publisher.publish(self.bench.kernel.now_ns())

    def say(self, name: str, found: object, at_s: float) -> None:
        self.bench.at(at_s, lambda: self._publish(name, found))

    def cause(self, cause: Cause, at_s: float) -> None:
        self.say(CAUSES_TOPIC, cause.to_json(), at_s)

    def run(self, seconds: float) -> None:
        self.bench.run(seconds)

    def events(self, *names: str) -> list[tuple[str, float]]:
        return [(each['event'], round(each['t_ns'] / NS_PER_S, 2))
                for each in self.kept['alarms/events'] if not names or each['event'] in names]

    def told(self) -> list[tuple[str, int]]:
        return [(each['channel'], each['step']) for each in self.kept['alarms/notify']]


@pytest.fixture
def robots() -> Iterator[list[Robot]]:
    made: list[Robot] = []
    yield made
    for each in made:
        each.bench.close()


def test_a_fall_is_suspected_then_raised_and_told_step_by_step() -> None:
    robot = Robot()
    robot.cause(FALL, 1.0)
    robot.run(75.0)
    assert robot.events('suspected', 'raised', 'notified', 'escalated', 'top') == [
        ('suspected', 1.0), ('raised', 31.0), ('notified', 31.0), ('escalated', 31.0),
        ('escalated', 61.0), ('top', 61.0)]
    assert robot.told() == [('operator', 1)] * 3 + [('family', 2)]
    assert robot.events('repeated') == [('repeated', 41.0), ('repeated', 51.0)]
    assert robot.kept['agent/say'] == [
        'CRITICAL alarm 1, anna: fall: anna lies on the floor']
    assert len({each['key'] for each in robot.kept['alarms/notify']}) == 4


def test_help_is_raised_at_once_and_an_acknowledgement_ends_the_telling() -> None:
    robot = Robot()
    robot.cause(HELP, 1.0)
    robot.say('alarms/command', 'acknowledge anna by mary', 5.0)
    robot.run(100.0)
    assert robot.events('raised', 'acknowledged', 'escalated') == [
        ('raised', 1.0), ('escalated', 1.0), ('acknowledged', 5.0)]
    assert robot.told() == [('operator', 1)]
    assert robot.kept['alarms/answer'] == [{
        'command': 'acknowledge anna by mary', 'ok': True, 'alarm': '1',
        'text': '1 (anna) is acknowledged; it comes again until it is resolved'}]
    status = robot.kept['alarms/list'][-1]['status'][0]
    assert (status['level'], status['values']['state'], status['values']['by']) == (
        2, 'acknowledged', 'mary')


def test_a_note_goes_with_what_is_told_from_then_on() -> None:
    robot = Robot()
    robot.cause(HELP, 1.0)
    robot.say('alarms/command', 'note anna by robot', 4.0)
    robot.say('alarms/command', 'note anna by robot robot is 1.0 m from anna', 5.0)
    robot.say('alarms/command', 'note anna by robot robot is 1.0 m from anna', 6.0)
    robot.run(35.0)
    assert robot.events('noted') == [('noted', 5.0)]
    texts = [each['text'] for each in robot.kept['alarms/notify']]
    assert [text.endswith('; robot is 1.0 m from anna') for text in texts] == [
        False, True, True, True]
    assert [each['ok'] for each in robot.kept['alarms/answer']] == [False, True, True]
    # It is kept with the alarm.
    assert '"remark":"robot is 1.0 m from anna"' in robot.kept_records[-1]


def test_nothing_is_told_outside_before_the_journal_has_it() -> None:
    robot = Robot(journal_wait_s=3.0)
    robot.stores = False
    robot.cause(HELP, 1.0)
    robot.run(3.5)
    assert robot.told() == [] and len(robot.kept['agent/say']) == 1
    robot.run(2.0)
    assert [(each['subject'], each['channel']) for each in robot.kept['alarms/notify']] == [
        ('anna', 'operator'), ('journal', 'operator')]
    assert any(each['subject'] == 'journal' and each['kinds'] == ['journal_fault']
               for each in robot.kept['alarms/events'])
    assert 'journal' in robot.module.statistics()['warning']


def test_a_restart_goes_on_where_it_was_and_sends_under_the_same_key() -> None:
    first = Robot()
    first.delivers = False
    first.cause(HELP, 1.0)
    first.run(5.0)
    second = Robot()
    for text in first.kept_records:
        second.say('alarms/stored', {'record': json.loads(text), 'age_ns': 20 * NS_PER_S}, 0.004)
    second.run(60.0)
    assert [(each['event'], each['restored']) for each in second.kept['alarms/events']
            if each.get('restored')] == [('raised', True)]
    [sent] = first.kept['alarms/notify']
    assert sent['key'].startswith('1.1.1.0.operator.') and 'again' not in sent
    again = second.kept['alarms/notify'][0]
    assert again['key'] == sent['key'] and again['again'] is True
    # Raised 1 s before the end of the first, which is 20 s old: the time counts.
    assert ('escalated', 10.0) in second.events('escalated')


def test_what_is_suspected_of_anybody_can_be_cancelled_and_what_is_raised_cannot() -> None:
    robot = Robot()
    for name in ('anna', 'bob'):
        robot.cause(replace(FALL, subject=name), 1.0)
    robot.cause(replace(HELP, subject='carl'), 1.0)
    robot.run(2.0)
    for _ in range(2):
        robot.say('alarms/command', 'cancel all by ROS', 2.0)
    robot.run(3.0)
    first, second = robot.kept['alarms/answer']
    assert first['ok'] and first['text'] == '1 (anna), 2 (bob) cancelled'
    assert not second['ok'] and 'nothing is suspected' in second['text']
    assert [each['values']['subject'] for each in robot.kept['alarms/list'][-1]['status']] == [
        'carl']


def test_without_answer_of_the_journal_it_begins_with_numbers_nobody_had() -> None:
    robot = Robot(journal=False)
    robot.cause(HELP, 1.0)
    robot.run(3.0)
    assert robot.kept['alarms/notify'][0]['alarm'].startswith('u')
    assert 'a restart forgets' in robot.module.statistics()['warning']


def test_what_is_wrong_is_refused_and_the_rest_goes_on() -> None:
    robot = Robot()
    robot.say(CAUSES_TOPIC, 'fall!', 0.5)
    robot.say('alarms/report', '[]', 0.5)
    robot.say('alarms/stored', '{"age_ns": 3}', 0.5)
    robot.say('alarms/command', 'acknowledge', 0.5)
    robot.cause(HELP, 1.0)
    robot.run(2.0)
    assert robot.events('raised') == [('raised', 1.0)]
    assert robot.module.statistics()['refused'] == 3
    assert robot.kept['alarms/answer'][0]['ok'] is False


def test_a_flood_of_causes_is_bounded_and_the_worst_gets_through() -> None:
    robot = Robot(alarms=4)
    for number in range(40):
        robot.cause(Cause('sensor_off', f'node{number}', Level.TECHNICAL), 1.0)
    robot.cause(HELP, 1.5)
    robot.run(5.0)
    assert len(robot.kept['alarms/list'][-1]['status']) == 5  # with that of the overflow
    statistics = robot.module.statistics()
    assert statistics['overflowed'] + 4 == 41
    assert ('help' in robot.kept['alarms/list'][-1]['status'][0]['message'])


@pytest.mark.parametrize(('given', 'problem'), [
    ({'critical_steps': []}, 'no one would be notified'),
    ({'urgent_steps': ['operator']}, 'is not a step'),
    ({'warning_steps': ['Operator 3']}, 'small letters'),
    ({'technical_steps': ['operator 0']}, 'at least 1 second'),
    ({'confirm_kinds': ['A fall']}, 'is not a kind of cause')])
def test_settings_that_would_tell_nobody_are_refused(given: dict[str, Any], problem: str) -> None:
    with pytest.raises(ConfigError, match=problem):
        Alarms('alarms', settings_of(Alarms, **given))


def test_a_test_says_so_goes_the_whole_way_and_ends_at_its_top() -> None:
    robot = Robot()
    robot.say('alarms/command', 'test critical by mary', 1.0)
    robot.run(120.0)
    assert robot.told() == [('operator', 1)] * 3 + [('family', 2)]
    assert all(each['text'].startswith('TEST') for each in robot.kept['alarms/notify'])
    assert robot.events('resolved') == [('resolved', 91.0)]


def test_a_channel_that_fails_is_skipped_and_tried_again_at_the_top() -> None:
    robot = Robot(critical_steps=['operator 30', 'family 60'])
    robot.delivers = False
    robot.cause(HELP, 1.0)
    robot.run(80.0)
    # Nobody reports: after 10 s the next; and at the top again after a minute, both.
    assert robot.events('failed', 'escalated', 'repeated') == [
        ('failed', 11.0), ('escalated', 11.0), ('failed', 21.0), ('repeated', 71.0)]
    assert robot.told() == [('operator', 0), ('family', 1), ('family', 1), ('operator', 1)]


def test_what_is_acknowledged_comes_again_and_what_is_over_does_not() -> None:
    robot = Robot(remind_s=60.0)
    robot.cause(HELP, 1.0)
    robot.say('alarms/command', 'acknowledge 1 by mary', 10.0)
    robot.say('alarms/command', 'acknowledge 1 by mary', 100.0)
    robot.cause(replace(HELP, active=False), 110.0)
    robot.run(400.0)
    assert robot.events('raised', 'unacknowledged', 'acknowledged', 'resolved') == [
        ('raised', 1.0), ('acknowledged', 10.0), ('unacknowledged', 70.0),
        ('acknowledged', 100.0), ('unacknowledged', 160.0)]


def test_a_person_who_publishes_the_same_again_after_it_was_resolved_means_it() -> None:
    robot = Robot()
    by_hand = replace(HELP, source='')
    for at_s, cause in ((1.0, by_hand), (20.0, by_hand), (60.0, HELP), (80.0, HELP)):
        robot.cause(cause, at_s)
        robot.say('alarms/command', 'resolve anna by mary', at_s + 5)
    robot.run(90.0)
    # The module's report at 80 s is that of a cause that lasts, and is held back.
    assert robot.events('raised') == [('raised', 1.0), ('raised', 20.0), ('raised', 60.0)]


def test_the_robot_is_silent_for_a_while_and_speaks_when_there_is_a_new_alarm() -> None:
    robot = Robot(critical_steps=['robot 10 repeat 10'])
    robot.cause(HELP, 1.0)
    robot.say('alarms/command', 'silence 60 by mary', 5.0)
    robot.cause(replace(HELP, subject='bert'), 35.0)
    robot.run(45.0)
    assert [text.split(':')[0] for text in robot.kept['agent/say']] == [
        'CRITICAL alarm 1, anna', 'CRITICAL alarm 2, bert', 'CRITICAL alarm 1, anna']
