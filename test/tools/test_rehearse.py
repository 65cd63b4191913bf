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

"""Scenarios with the shipped robot's own modules, and the checks of what happened."""

import json
from pathlib import Path

import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.agent.edges import EDGES
from rt_robot_os.settings import load
from rt_robot_os.sim.world import World
from rt_robot_os.tools.rehearse.checks import check
from rt_robot_os.tools.rehearse.command import run
from rt_robot_os.tools.rehearse.coverage import edges_taken
from rt_robot_os.tools.rehearse.coverage import name_of
from rt_robot_os.tools.rehearse.detectable import detectable_emergencies
from rt_robot_os.tools.rehearse.scenario import CaregiverProfile
from rt_robot_os.tools.rehearse.scenario import CareScenario
from rt_robot_os.tools.rehearse.scenario import Occurrence
from rt_robot_os.tools.rehearse.scenario import quiet_scenario
from rt_robot_os.tools.rehearse.scenario import random_scenario
from rt_robot_os.tools.rehearse.scenario_run import RunRecord
from rt_robot_os.tools.rehearse.scenario_run import ScenarioRun

CONFIG = Path(__file__).resolve().parents[2] / 'config'
PROMPT = CaregiverProfile(20.0, 30.0)


@pytest.fixture(scope='module', name='flat')
def _flat():
    return load([CONFIG / 'assisted_living.yaml'], node='robot')


def event(alarm, what, state, t_s, level='critical', subject='anna'):
    return {'alarm': alarm, 'event': what, 'state': state, 't_ns': round(t_s * 1e9),
            'level': level, 'subject': subject, 'kinds': ['fall'], 'text': ''}


FALL = CareScenario(1, (Occurrence(10.0, 'fall', 'anna', 0.0, 'silent'),), PROMPT)
RAISED = event('1', 'raised', 'raised', 12.0)


@pytest.mark.parametrize(('more', 'end', 'problem'), [
    ([event('1', 'resolved', 'resolved', 60.0)], 'resolved', ''),
    ([event('1', 'top', 'raised', 60.0)], 'escalated', ''),
    ([event('1', 'acknowledged', 'acknowledged', 60.0)], 'hangs', 'alarm 1 of anna hangs'),
    ([], 'hangs', 'alarm 1 of anna hangs: raised'),
])
def test_an_alarm_that_comes_to_no_end_is_a_problem(more, end, problem):
    verdict = check(FALL, RunRecord(events=[RAISED, *more]))
    assert verdict.ends == {'1': end}
    assert (problem in ''.join(verdict.problems)) if problem else not verdict.problems


def test_an_emergency_without_an_alarm_is_a_problem_unless_the_core_was_dead():
    late = event('1', 'raised', 'resolved', 300.0)
    assert 'fall of anna at 10.0 s did not become an alarm' in check(
        FALL, RunRecord(events=[late])).problems
    killed = FALL._replace(occurrences=(
        *FALL.occurrences, Occurrence(11.0, 'core_killed', '', 5.0)))
    assert not check(killed, RunRecord()).problems
    other = FALL._replace(occurrences=(*FALL.occurrences, Occurrence(11.0, 'node_dies', 'hall')))
    assert check(other, RunRecord()).problems


def test_a_message_that_a_person_sees_twice_is_a_problem():
    done = [RAISED, event('1', 'resolved', 'resolved', 60.0)]
    assert not check(FALL, RunRecord(events=done, shown={'1.1': 1})).problems
    assert check(FALL, RunRecord(events=done, shown={'1.1': 2})).problems == (
        '1.1 was shown 2 times',)


def step(source, target, cause, alarm='1'):
    return {'from': source, 'to': target, 'cause': cause, 'alarm': alarm, 't_ns': 0}


SERVED = [step('idle', 'approach', 'raised: anna: fall'),
          step('approach', 'return', 'over: alarm 1'), step('return', 'idle', 'arrived')]


@pytest.mark.parametrize(('record', 'problem'), [
    (RunRecord(transitions=SERVED), ''),
    (RunRecord(transitions=SERVED, violations=['a goal at 3.00 s: the operator had the robot']),
     'the agent ordered a goal at 3.00 s: the operator had the robot'),
    (RunRecord(transitions=[*SERVED, step('idle', 'approach', 'raised: anna: fall'),
                            step('approach', 'operator', 'operator: teleop steers')]),
     'the agent ended in operator'),
    (RunRecord(transitions=[*SERVED, step('idle', 'approach', 'raised: anna: fall'),
                            step('approach', 'operator', 'operator: teleop steers')],
               overridden=True), ''),
    (RunRecord(transitions=[SERVED[0], step('approach', 'give_up', 'blocked'),
                            step('give_up', 'idle', 'timeout: after 120 s')]),
     'the agent gave up without a reason: blocked'),
    (RunRecord(has_agent=True), 'the agent forgot alarm 1'), (RunRecord(), ''),
], ids=['well', 'disobeyed', 'hangs', 'taken', 'no reason', 'forgot', 'no agent'])
def test_what_the_agent_does_is_judged(record, problem):
    record.events = [RAISED, event('1', 'top', 'raised', 60.0)]
    assert check(FALL, record).problems == ((problem,) if problem else ())


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


def test_a_scenario_is_the_same_each_time_it_is_drawn():
    first, again = (random_scenario(7, [('fall', 'anna')], ['hall']) for _ in range(2))
    assert first == again
    assert len({random_scenario(seed, [('fall', 'anna')], ['hall']) for seed in range(20)}) == 20


def test_the_shipped_robot_notices_a_fall_and_the_carer_ends_it(flat):
    assert ('fall', 'anna') in detectable_emergencies(flat, World(flat.world))
    record = ScenarioRun(flat, FALL).run()
    verdict = check(FALL, record)
    assert not verdict.problems
    assert 'resolved' in verdict.ends.values()
    assert record.moved_m > 0.5
    states = [each['to'] for each in record.transitions]
    assert states[0] == 'confirm' and {'observe', 'report', 'return'} <= set(states)
    again = ScenarioRun(flat, FALL).run()
    assert again.transitions == record.transitions and again.events == record.events


def test_who_was_looked_after_gets_up_and_who_lies_cannot_fall(flat):
    scenario = CareScenario(3, (
        Occurrence(20.0, 'fall', 'anna', 0.0, 'help'),
        Occurrence(110.0, 'fall', 'anna', 40.0, 'fine')), CaregiverProfile(5.0, 30.0))
    record = ScenarioRun(flat, scenario).run()
    assert not record.no_falls and check(scenario, record).noticed == 2
    again = Occurrence(45.0, 'fall', 'anna', 40.0, 'fine')
    scenario = CareScenario(3, (Occurrence(20.0, 'fall', 'anna', 100.0, 'fine'), again), PROMPT)
    record = ScenarioRun(flat, scenario).run()
    assert record.no_falls == [again] and not check(scenario, record).problems


def test_an_operator_who_takes_the_robot_has_it_and_the_camera_answers(flat):
    scenario = CareScenario(3, (
        Occurrence(10.0, 'fall', 'anna', 0.0, 'help'),
        Occurrence(13.0, 'operator_drives', '', 6.0), Occurrence(24.0, 'operator_sends'),
        Occurrence(75.0, 'operator_says', 'stay'), Occurrence(80.0, 'noise', '', 5.0)),
        CaregiverProfile(90.0, 20.0))
    record = ScenarioRun(flat, scenario).run()
    assert not check(scenario, record).problems
    taken = [name_of(edge) for edge in edges_taken(record.transitions)]
    assert sum('operator: operator' in each for each in taken) == 2
    assert 'observe --> report: observed' in taken


@pytest.mark.parametrize(('caller', 'cause'), [
    ('cellar', 'blocked: no place to stand beside it'),
    ('intercom', 'no_place: nobody knows where it is')])
def test_a_call_from_where_the_robot_cannot_go_is_given_up_with_the_reason(flat, caller, cause):
    scenario = CareScenario(
        3, (Occurrence(10.0, 'call', caller, 30.0),), CaregiverProfile(20.0, 10.0))
    verdict = check(scenario, ScenarioRun(flat, scenario).run())
    assert not verdict.problems and cause in verdict.gave_up


def test_a_killed_core_goes_on_with_its_alarm(flat):
    scenario = CareScenario(3, (*FALL.occurrences, Occurrence(50.0, 'core_killed', '', 3.0)),
                            CaregiverProfile(float('inf'), 10.0))
    record = ScenarioRun(flat, scenario).run()
    assert record.crashes == 1
    assert not check(scenario, record).problems
    assert 'escalated' in check(scenario, record).ends.values()


def test_the_command_says_how_many_became_alarms(capsys):
    assert run(['emergencies', '--stories', '1', '--seed', '6', '--jobs', '2', '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    assert found['stories'] == 1 and found['problems'] == []
    assert found['emergencies'] == found['noticed'] + found['hidden'] == 2


def test_nobody_rests_so_long_in_quiet_hours_that_a_rule_is_right_to_ask():
    for seed in range(30):
        rests = [each.for_s for each in quiet_scenario(seed, 24.0, ['anna'], ['wrist']).occurrences
                 if each.what in ('sit', 'sleep')]
        assert rests and max(rests) < 7200.0  # still_s of assisted_living.yaml


def test_quiet_minutes_alarm_nobody(capsys):
    assert run(['quiet', '--hours', '0.05', '--json']) == 0
    assert json.loads(capsys.readouterr().out)['false_alarms'] == []


def test_a_robot_that_notices_nothing_is_refused():
    robot = load([CONFIG / 'service_robot.yaml'], node='robot')
    with pytest.raises(ConfigError, match='detects no emergencies'):
        detectable_emergencies(robot, World(robot.world))
