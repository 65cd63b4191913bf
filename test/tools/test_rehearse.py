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

"""Rehearsals: the shipped robot's own modules meet stories, and stories are judged."""

import json
from pathlib import Path

import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.agent.edges import EDGES
from rt_robot_os.settings import load
from rt_robot_os.sim.world import World
from rt_robot_os.tools.rehearse.command import run
from rt_robot_os.tools.rehearse.coverage import edges_taken
from rt_robot_os.tools.rehearse.coverage import name_of
from rt_robot_os.tools.rehearse.director import Director
from rt_robot_os.tools.rehearse.director import Record
from rt_robot_os.tools.rehearse.noticed import emergencies_of
from rt_robot_os.tools.rehearse.story import Carer
from rt_robot_os.tools.rehearse.story import draw
from rt_robot_os.tools.rehearse.story import quiet
from rt_robot_os.tools.rehearse.story import Scene
from rt_robot_os.tools.rehearse.story import Story
from rt_robot_os.tools.rehearse.verdict import judge

CONFIG = Path(__file__).resolve().parents[2] / 'config'
PROMPT = Carer(20.0, 30.0)


@pytest.fixture(scope='module', name='flat')
def _flat():
    return load([CONFIG / 'assisted_living.yaml'], node='robot')


def event(alarm, what, state, t_s, level='critical', subject='anna'):
    return {'alarm': alarm, 'event': what, 'state': state, 't_ns': round(t_s * 1e9),
            'level': level, 'subject': subject, 'kinds': ['fall'], 'text': ''}


FALL = Story(1, (Scene(10.0, 'fall', 'anna', 0.0, 'silent'),), PROMPT)
RAISED = event('1', 'raised', 'raised', 12.0)


@pytest.mark.parametrize(('more', 'end', 'problem'), [
    ([event('1', 'resolved', 'resolved', 60.0)], 'resolved', ''),
    ([event('1', 'top', 'raised', 60.0)], 'escalated', ''),
    ([event('1', 'acknowledged', 'acknowledged', 60.0)], 'hangs', 'alarm 1 of anna hangs'),
    ([], 'hangs', 'alarm 1 of anna hangs: raised'),
])
def test_an_alarm_that_comes_to_no_end_is_a_problem(more, end, problem):
    verdict = judge(FALL, Record(events=[RAISED, *more]))
    assert verdict.ends == {'1': end}
    assert (problem in ''.join(verdict.problems)) if problem else not verdict.problems


def test_an_emergency_without_an_alarm_is_a_problem_unless_the_core_was_dead():
    late = event('1', 'raised', 'resolved', 300.0)
    assert 'fall of anna at 10.0 s became no alarm' in judge(
        FALL, Record(events=[late])).problems
    killed = FALL._replace(scenes=(*FALL.scenes, Scene(11.0, 'core_killed', '', 5.0)))
    assert not judge(killed, Record()).problems
    other = FALL._replace(scenes=(*FALL.scenes, Scene(11.0, 'node_dies', 'hall')))
    assert judge(other, Record()).problems


def test_a_message_that_a_person_sees_twice_is_a_problem():
    done = [RAISED, event('1', 'resolved', 'resolved', 60.0)]
    assert not judge(FALL, Record(events=done, shown={'1.1': 1})).problems
    assert judge(FALL, Record(events=done, shown={'1.1': 2})).problems == (
        '1.1 was shown 2 times',)


def step(source, target, cause, alarm='1'):
    return {'from': source, 'to': target, 'cause': cause, 'alarm': alarm, 't_ns': 0}


SERVED = [step('idle', 'approach', 'raised: anna: fall'),
          step('approach', 'return', 'over: alarm 1'), step('return', 'idle', 'arrived')]


@pytest.mark.parametrize(('record', 'problem'), [
    (Record(transitions=SERVED), ''),
    (Record(transitions=SERVED, disobeyed=['a goal at 3.00 s: the operator had the robot']),
     'the agent ordered a goal at 3.00 s: the operator had the robot'),
    (Record(transitions=[*SERVED, step('idle', 'approach', 'raised: anna: fall'),
                         step('approach', 'operator', 'operator: teleop steers')]),
     'the agent ended in operator'),
    (Record(transitions=[*SERVED, step('idle', 'approach', 'raised: anna: fall'),
                         step('approach', 'operator', 'operator: teleop steers')],
            taken=True), ''),
    (Record(transitions=[SERVED[0], step('approach', 'give_up', 'blocked'),
                         step('give_up', 'idle', 'timeout: after 120 s')]),
     'the agent gave up without a reason: blocked'),
    (Record(has_agent=True), 'the agent forgot alarm 1'), (Record(), ''),
], ids=['well', 'disobeyed', 'hangs', 'taken', 'no reason', 'forgot', 'no agent'])
def test_what_the_agent_does_is_judged(record, problem):
    record.events = [RAISED, event('1', 'top', 'raised', 60.0)]
    assert judge(FALL, record).problems == ((problem,) if problem else ())


def test_the_edges_that_were_taken_are_those_of_the_table():
    told = [step('idle', 'confirm', 'suspected: anna: fall'),
            step('confirm', 'operator', 'operator: teleop steers'),
            step('operator', 'operator', 'over: alarm 1; return afterwards'),
            step('operator', 'return', 'released: the operator has let go'),
            step('return', 'held', 'estop: somebody holds it'),
            step('held', 'operator', 'released: nobody holds the e-stop any more')]
    assert [name_of(edge) for edge in edges_taken(told)] == [
        'idle --> confirm: suspected / take', 'confirm --> operator: operator / stop',
        'operator --> before: released', 'return --> held: estop / stop',
        'held --> operator: released [driven]']
    assert len({name_of(edge) for edge in EDGES}) == len(EDGES)


def test_a_story_is_the_same_each_time_it_is_drawn():
    assert draw(7, [('fall', 'anna')], ['hall']) == draw(7, [('fall', 'anna')], ['hall'])
    assert len({draw(number, [('fall', 'anna')], ['hall']) for number in range(20)}) == 20


def test_the_shipped_robot_notices_a_fall_and_the_carer_ends_it(flat):
    assert ('fall', 'anna') in emergencies_of(flat, World(flat.world))
    record = Director(flat, FALL).tell()
    verdict = judge(FALL, record)
    assert not verdict.problems
    assert 'resolved' in verdict.ends.values()
    assert record.moved_m > 0.5
    states = [each['to'] for each in record.transitions]
    assert states[0] == 'confirm' and {'observe', 'report', 'return'} <= set(states)
    again = Director(flat, FALL).tell()
    assert again.transitions == record.transitions and again.events == record.events


def test_who_was_looked_after_gets_up_and_who_lies_cannot_fall(flat):
    story = Story(3, (Scene(20.0, 'fall', 'anna', 0.0, 'help'),
                      Scene(110.0, 'fall', 'anna', 40.0, 'fine')), Carer(5.0, 30.0))
    record = Director(flat, story).tell()
    assert not record.no_falls and judge(story, record).noticed == 2
    again = Scene(45.0, 'fall', 'anna', 40.0, 'fine')
    story = Story(3, (Scene(20.0, 'fall', 'anna', 100.0, 'fine'), again), PROMPT)
    record = Director(flat, story).tell()
    assert record.no_falls == [again] and not judge(story, record).problems


def test_an_operator_who_takes_the_robot_has_it_and_the_camera_answers(flat):
    story = Story(3, (Scene(10.0, 'fall', 'anna', 0.0, 'help'),
                      Scene(13.0, 'operator_drives', '', 6.0),
                      Scene(24.0, 'operator_sends'), Scene(75.0, 'operator_says', 'stay'),
                      Scene(80.0, 'noise', '', 5.0)), Carer(90.0, 20.0))
    record = Director(flat, story).tell()
    assert not judge(story, record).problems
    taken = [name_of(edge) for edge in edges_taken(record.transitions)]
    assert sum('operator: operator' in each for each in taken) == 2
    assert 'observe --> report: observed' in taken


@pytest.mark.parametrize(('caller', 'cause'), [
    ('cellar', 'blocked: no place to stand beside it'),
    ('intercom', 'no_place: nobody knows where it is')])
def test_a_call_from_where_the_robot_cannot_go_is_given_up_with_the_reason(flat, caller, cause):
    story = Story(3, (Scene(10.0, 'call', caller, 30.0),), Carer(20.0, 10.0))
    verdict = judge(story, Director(flat, story).tell())
    assert not verdict.problems and cause in verdict.gave_up


def test_a_killed_core_goes_on_with_its_alarm(flat):
    story = Story(3, (*FALL.scenes, Scene(50.0, 'core_killed', '', 3.0)),
                  Carer(float('inf'), 10.0))
    record = Director(flat, story).tell()
    assert record.crashes == 1
    assert not judge(story, record).problems
    assert 'escalated' in judge(story, record).ends.values()


def test_the_command_says_how_many_became_alarms(capsys):
    assert run(['emergencies', '--stories', '1', '--seed', '6', '--jobs', '2', '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    assert found['stories'] == 1 and found['problems'] == []
    assert found['emergencies'] == found['noticed'] + found['hidden'] == 2


def test_nobody_rests_so_long_in_quiet_hours_that_a_rule_is_right_to_ask():
    for seed in range(30):
        rests = [each.for_s for each in quiet(seed, 24.0, ['anna'], ['wrist']).scenes
                 if each.what in ('sit', 'sleep')]
        assert rests and max(rests) < 7200.0  # still_s of assisted_living.yaml


def test_quiet_minutes_alarm_nobody(capsys):
    assert run(['quiet', '--hours', '0.05', '--json']) == 0
    assert json.loads(capsys.readouterr().out)['false_alarms'] == []


def test_a_robot_that_notices_nothing_is_refused():
    robot = load([CONFIG / 'service_robot.yaml'], node='robot')
    with pytest.raises(ConfigError, match='would notice no emergency'):
        emergencies_of(robot, World(robot.world))
