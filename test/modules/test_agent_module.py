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

"""The agent on the virtual clock: what a person, an operator and a robot would notice."""

from __future__ import annotations

import json
import math
from pathlib import Path

from agent_rig import AgentRig
from live_maps import put_grid
import numpy as np
import pytest
from rt_robot_os.motion.grid_map import GridMap

pytest.importorskip('geometry_msgs', reason='ROS 2 messages are not installed')

ROOT = Path(__file__).resolve().parents[2]
S, MS = 1_000_000_000, 1_000_000


def rig_of(**settings: object) -> AgentRig:
    """Return a rig in which anna is 4 m to the left of the robot."""
    rig = AgentRig(**settings)
    rig.place(1.0, 5.0)
    return rig


def test_it_turns_to_an_emergency_at_once_and_drives_there() -> None:
    rig = rig_of()
    rig.in_order((1.0, lambda: rig.alarm('raised')))
    rates = []

    def note() -> None:
        while rig.spins.take():
            rates.append((rig.spins.stamp_ns, rig.kernel.now_ns(), rig.spins.msg.angular.z))

    rig.kernel.add_task('note', note, priority=1, rate_hz=1000.0)
    rig.run(9.0)
    # In the chain of releases of the event itself, to the left, and smoothly.
    assert rates[0][:2] == (S, S)
    turned = [0.0, *(rate for _, _, rate in rates)]
    assert turned[1] > 0.0 == turned[-1]
    assert all(abs(after - before) < 0.0751 for before, after in zip(turned, turned[1:]))
    assert max(turned) <= 0.8
    assert rig.path() == ['approach', 'observe']
    (goal,) = rig.goals
    assert math.dist(goal[:2], (1.0, 5.0)) == pytest.approx(1.0)
    assert abs(math.remainder(goal[2] - math.atan2(5.0 - goal[1], 1.0 - goal[0]), math.tau)) < 1e-9


def test_on_a_live_map_it_stands_where_somebody_has_been() -> None:
    rig = rig_of(map_topic='map')
    assert rig.agent.settings['map'] == ''
    cells = np.full((200, 200), -1, np.int8)
    cells[105:] = 0  # beyond anna, seen from the robot
    put_grid(rig.charts, GridMap(cells, 0.05)).info.width = 1
    rig.charts.publish()  # no map: refused
    rig.at(1.0, lambda: rig.alarm('raised'))
    rig.run(5.0)
    assert '40000 cells' in rig.agent.statistics()['warning']
    (goal,) = rig.goals
    assert goal[1] < 5.0
    put_grid(rig.charts, GridMap(cells, 0.05))
    rig.charts.publish()
    rig.at(1.0, lambda: rig.place(3.0, 5.0))
    rig.run(20.0)
    assert rig.goals[-1][1] > 5.4
    assert rig.agent.statistics()['maps'] == 1


def test_it_asks_while_it_drives_and_silence_is_help() -> None:
    rig = rig_of(confirm_s=20.0)
    rig.in_order((1.0, lambda: rig.alarm('suspected')), (21.5, lambda: rig.alarm('raised')),
                 (27.0, rig.observe))
    rig.run(40.0)
    assert rig.path() == ['confirm', 'observe', 'report', 'stay']
    said = rig.told('agent/say')
    assert said[:3] == ['Are you all right, anna? Please answer, or press your button.'] * 3
    confirm, note = rig.told('alarms/command')
    assert confirm == 'confirm 1 by robot silence: after 20 s'
    assert note == (
        'note 1 by robot robot is 1.0 m from anna, picture, clip: no room, sound: -32 dB')
    assert [json.loads(text)['order'] for text in rig.told('agent/observe')] == [
        'picture', 'clip', 'sound']
    first = rig.transitions()[0]
    assert first == {'from': 'idle', 'to': 'confirm', 'cause': 'suspected: anna: fall',
                     'alarm': '1', 't_ns': S}
    assert rig.transitions()[1]['t_ns'] == 21 * S  # its deadline
    assert rig.told('agent/state')[:2] == ['idle', 'confirm anna: fall']


@pytest.mark.parametrize('answer', ['text', 'button'])
def test_who_is_fine_is_left_alone(answer: str) -> None:
    rig = rig_of()
    rig.way_s = 1.0
    rig.in_order((1.0, lambda: rig.alarm('suspected')),
                 (3.0, lambda: rig.say('agent/answer', 'anna fine') if answer == 'text'
                  else rig.press(2.0)),
                 (3.2, lambda: rig.alarm('cancelled')))
    rig.run(12.0)
    assert rig.told('alarms/command') == ['cancel 1 by anna']
    assert rig.path() == ['confirm', 'return', 'idle']
    assert rig.goals[-1][:2] == pytest.approx((1.0, 1.0))  # where it came from
    assert rig.told('agent/state')[-1] == 'idle'


def test_a_call_for_help_ends_the_question() -> None:
    rig = rig_of(home=[3.0, 0.0, 90.0])
    rig.in_order((1.0, lambda: rig.alarm('suspected')), (2.0, lambda: rig.press(0.0)),
                 (2.5, lambda: rig.say('agent/answer', 'bob fine')), (3.0, lambda: rig.press(1.0)),
                 (3.1, lambda: rig.alarm('raised')), (20.0, lambda: rig.alarm('resolved')))
    rig.run(30.0)
    assert rig.path()[:3] == ['confirm', 'approach', 'observe']
    assert len(rig.goals) == 2  # the drive went on, and then home
    assert rig.goals[-1] == pytest.approx((3.0, 0.0, math.pi / 2))
    assert rig.told('alarms/command')[0].startswith('confirm 1 by robot help: anna says so')
    assert rig.path()[-2:] == ['return', 'idle']


def test_an_answer_from_before_the_question_is_none() -> None:
    rig = rig_of()
    rig.in_order((0.9, lambda: rig.press(2.0)), (1.0, lambda: rig.alarm('suspected')))
    rig.run(4.0)
    assert rig.path() == ['confirm']


def test_a_voice_that_nobody_understands_is_asked_again() -> None:
    rig = rig_of(confirm_s=12.0, ask_again_s=9.0)

    def hear(level_db: float) -> None:
        rig.level.msg.data = level_db
        rig.level.publish()

    rig.in_order((1.0, lambda: rig.alarm('suspected')),
                 (2.0, lambda: hear(-10.0)),  # that was the robot itself
                 (5.0, lambda: hear(-60.0)), (6.0, lambda: hear(-10.0)),
                 *((9.5 + 0.1 * each, lambda: hear(-10.0)) for each in range(20)))
    rig.run(11.0)
    assert [text.split(',')[0] for text in rig.told('agent/say')] == [
        'Are you all right', 'I heard you']
    assert rig.path() == ['confirm']


def test_it_follows_who_moves_and_looks_again() -> None:
    rig = rig_of()
    rig.in_order((1.0, lambda: rig.alarm('raised')), (2.0, lambda: rig.place(2.0, 5.0)),
                 (9.0, lambda: rig.place(2.3, 5.0)), (10.0, lambda: rig.place(4.0, 5.0)))
    rig.run(20.0)
    assert rig.path() == ['approach', 'observe', 'approach', 'observe']
    assert len(rig.goals) == 3
    assert math.dist(rig.goals[-1][:2], (4.0, 5.0)) == pytest.approx(1.0, abs=0.21)


def test_it_stays_at_its_distance_until_the_alarm_is_resolved() -> None:
    rig = rig_of(comfort_s=10.0, report_s=1.0)
    rig.in_order((1.0, lambda: rig.alarm('raised')), (8.0, rig.observe),
                 (12.0, lambda: rig.alarm('acknowledged')),
                 (20.0, lambda: rig.place(rig.pose[0] + 0.3, rig.pose[1])),  # comes to the robot
                 (40.0, lambda: rig.alarm('resolved')))
    rig.run(60.0)
    assert rig.path() == ['approach', 'observe', 'report', 'stay', 'return', 'idle']
    assert len(rig.goals) == 3 and rig.told('agent/say').count(
        'I am with you, anna. Help has been called.') >= 3
    # Slowly near anna, and as ever on the way home.
    limits = []
    read = rig.watched['speed_limit']
    read.rewind()
    while read.take():
        limits.append(float(read.msg.data))
    assert limits[0] == 0.3 and limits[-1] == 0.0


def test_whoever_acknowledges_may_send_it_home() -> None:
    rig = rig_of(when_acknowledged='return')
    rig.in_order((1.0, lambda: rig.alarm('raised')), (3.0, lambda: rig.alarm('acknowledged')),
                 (15.0, lambda: rig.alarm('raised')))  # nobody came: it was raised again
    rig.run(16.0)
    assert rig.path() == ['approach', 'return', 'idle', 'approach']


def test_what_is_in_the_way_makes_it_try_another_side_and_then_give_up() -> None:
    rig = rig_of(places=3, retries=1, retry_s=10.0, give_up_s=20.0)
    rig.planner = ['refused: blocked for 30 s']
    rig.way_s = 2.0
    rig.in_order((1.0, lambda: rig.alarm('raised')))
    rig.run(60.0)
    assert rig.path() == ['approach', 'give_up', 'approach', 'give_up', 'return', 'idle']
    assert len(rig.goals) == 6  # at other places; it is home already
    assert all(math.dist(one[:2], other[:2]) > 0.4
               for one, other in zip(rig.goals[:3], rig.goals[1:3]))
    text = 'robot could not reach anna: blocked: blocked for 30 s (3 places tried)'
    causes = [json.loads(each) for each in rig.told('alarms/causes')]
    assert causes[0]['text'] == text
    assert (causes[0]['kind'], causes[0]['level']) == ('robot_blocked', 'technical')
    assert causes[-1]['active'] is False
    assert f'note 1 by robot {text}' in rig.told('alarms/command')
    assert f'give_up anna: fall: {text.partition("anna: ")[2]}' in rig.told('agent/state')


def test_a_planner_that_does_not_answer_is_given_up() -> None:
    rig = rig_of(places=1, answer_s=2.0)
    rig.planner = ['silent']
    rig.in_order((1.0, lambda: rig.alarm('raised')))
    rig.run(5.0)
    assert rig.path() == ['approach', 'give_up']
    assert 'the planner does not answer' in rig.transitions()[-1]['cause']


def test_without_a_place_it_gives_up_and_goes_when_one_is_known() -> None:
    rig = AgentRig(place_s=2.0, retry_s=5.0)
    rig.in_order((1.0, lambda: rig.alarm('raised')), (6.0, lambda: rig.place(4.0, 1.0)))
    rig.run(16.0)
    assert rig.path() == ['approach', 'give_up', 'approach', 'observe']
    assert rig.transitions()[1]['cause'] == 'no_place: nobody knows where it is'


@pytest.mark.parametrize('more, where', [
    ({'subject': 'kitchen', 'node': 'kitchen'}, (8.0, 1.0)),
    ({'subject': 'flat', 'x': 3.0, 'y': 4.0}, (3.0, 4.0)),
    ({'subject': 'bob', 'node': 'wrist', 'x': 3.0, 'y': 4.0}, (1.0, 5.0))],
    ids=['node', 'cause', 'worn node'])
def test_the_place_is_that_of_the_person_the_cause_or_the_node(
        more: dict[str, object], where: tuple[float, float]) -> None:
    rig = rig_of()
    rig.in_order((1.0, lambda: rig.alarm('raised', **more)))
    rig.run(2.0)
    assert math.dist(rig.goals[0][:2], where) == pytest.approx(1.0)


def test_a_position_that_is_lost_ends_the_drive() -> None:
    rig = rig_of(lost_s=2.0)
    rig.way_s = 30.0
    rig.in_order((1.0, lambda: rig.alarm('raised')),
                 (3.0, lambda: setattr(rig, 'is_located', False)))
    rig.run(8.0)
    assert rig.path() == ['approach', 'give_up']
    assert rig.transitions()[-1]['cause'].startswith('lost_position')
    assert rig.cancels.latest()
    assert rig.transitions()[-1]['t_ns'] == pytest.approx(5 * S, abs=60 * MS)


def test_a_low_battery_goes_nowhere_but_home() -> None:
    rig = rig_of()
    rig.in_order((0.5, lambda: rig.charge(0.1)), (1.0, lambda: rig.alarm('raised')))
    rig.run(2.0)
    assert rig.path() == ['approach', 'give_up']
    assert rig.transitions()[-1]['cause'] == 'battery_low: 10 %'
    assert not rig.goals


def test_the_e_stop_holds_it_and_what_happens_meanwhile_counts() -> None:
    rig = rig_of(report_s=1.0)
    rig.in_order((1.0, lambda: rig.alarm('raised')), (2.0, lambda: rig.press_estop(True)),
                 (9.0, lambda: rig.press_estop(False, 'nobody: e-stop, asked for')),
                 (12.0, lambda: rig.press_estop(False)), (30.0, rig.observe),
                 (40.0, lambda: rig.press_estop(True)), (42.0, lambda: rig.alarm('resolved')),
                 (44.0, lambda: rig.press_estop(False)))
    rig.run(60.0)
    assert rig.path() == ['approach', 'held', 'approach', 'observe', 'report', 'stay', 'held',
                          'return', 'idle']
    assert rig.cancels.latest()
    times = [each['t_ns'] / S for each in rig.transitions() if each['to'] == 'approach']
    assert times[1] == pytest.approx(12.0, abs=0.06)


def test_an_alarm_during_the_e_stop_moves_nothing() -> None:
    rig = rig_of()
    rig.in_order((0.5, lambda: rig.press_estop(True)), (1.0, lambda: rig.alarm('raised')))
    rig.run(5.0)
    assert rig.path() == ['approach', 'held']
    assert not rig.spins.latest() and not rig.goals


@pytest.mark.parametrize('after, path', [
    ('resume', ['approach', 'operator', 'approach', 'observe']),
    ('give_up', ['approach', 'operator', 'give_up'])])
def test_an_operator_wins(after: str, path: list[str]) -> None:
    rig = rig_of(after_operator=after)
    rig.in_order((1.0, lambda: rig.alarm('raised')), (2.0, lambda: rig.say('steering', 'teleop')),
                 (5.0, lambda: rig.say('steering', 'nobody')))
    rig.run(15.0)
    assert rig.path() == path
    times = [each['t_ns'] / S for each in rig.transitions()]
    assert times[2] == pytest.approx(8.0, abs=0.1)  # some seconds after they let go


def test_an_operator_may_send_the_robot_elsewhere() -> None:
    rig = rig_of()
    mine = rig.bus.publisher('goal_pose')

    def send() -> None:
        mine.msg.pose.position = 9.0, 9.0, 0.0
        mine.msg.pose.orientation.w = 1.0
        mine.publish()

    # An errand of before is no reason to wait, one that is given now is.
    rig.in_order((0.5, send), (1.0, lambda: rig.alarm('raised')), (3.0, send))
    rig.run(7.5)
    assert rig.path() == ['approach', 'operator']
    assert rig.transitions()[1]['t_ns'] == pytest.approx(3 * S, abs=60 * MS)
    assert len(rig.goals) == 3  # the agent's, and those of the operator
    assert not rig.cancels.latest()  # what the operator wants is driven on


def test_commands_of_an_operator() -> None:
    rig = rig_of()
    rig.in_order((1.0, lambda: rig.alarm('raised')),
                 (2.0, lambda: rig.say('agent/command', 'stay')),
                 (5.0, lambda: rig.say('agent/command', 'dance')),
                 (6.0, lambda: rig.say('agent/command', 'go 1')),
                 (7.0, lambda: rig.say('agent/command', 'return')),
                 (15.0, lambda: rig.say('agent/command', 'go 1')),
                 (16.0, lambda: rig.say('agent/command', 'abort')))
    rig.run(18.0)
    assert rig.path() == ['approach', 'stay', 'return', 'idle', 'approach', 'give_up']
    assert rig.agent.statistics()['words_refused'] == 1


def test_a_worse_emergency_takes_over_and_the_first_is_served_afterwards() -> None:
    rig = rig_of()
    rig.in_order(
        (1.0, lambda: rig.alarm('raised', '1', 'urgent', 'flat', x=4.0, y=0.0)),
        (1.5, lambda: rig.alarm('raised', '2', 'urgent', 'flat2', x=0.0, y=4.0)),  # younger
        (2.0, lambda: rig.alarm('suspected', '3', 'critical', 'anna')),
        (2.5, lambda: rig.alarm('raised', '4', 'technical', 'sink')),
        (4.0, lambda: rig.say('agent/answer', 'anna fine')),
        (4.1, lambda: rig.alarm('cancelled', '3', 'critical', 'anna')))
    rig.run(12.0)
    assert [(each['to'], each['alarm']) for each in rig.transitions()] == [
        ('approach', '1'), ('confirm', '3'), ('return', '3'), ('approach', '1'),
        ('observe', '1')]


def test_two_that_cannot_be_reached_are_each_given_up_once() -> None:
    rig = rig_of(places=1, retries=0, give_up_s=5.0)
    rig.planner = ['refused: no way']
    rig.way_s = 1.0
    rig.in_order((1.0, lambda: rig.alarm('raised', '1', subject='flat', x=4.0, y=0.0)),
                 (1.0, lambda: rig.alarm('raised', '2', subject='flat2', x=0.0, y=4.0)))
    rig.run(60.0)
    assert rig.path() == ['approach', 'give_up', 'approach', 'give_up', 'return', 'idle']


def test_after_a_failure_it_goes_on_with_what_is_open() -> None:
    rig = rig_of()
    task = rig.kernel.task('agent')

    def fail() -> None:
        rig.agent.activate()
        task.coroutine.start()  # type: ignore[union-attr]

    rig.in_order((1.0, lambda: rig.alarm('raised')), (2.0, fail))
    rig.run(9.0)
    assert rig.path() == ['approach', 'approach', 'observe']


@pytest.mark.parametrize('state, path', [
    ('raised', ['approach', 'observe']), ('suspected', ['confirm']), ('acknowledged', [])])
def test_after_a_restart_of_the_core_it_goes_on_with_what_is_open(
        state: str, path: list[str]) -> None:
    rig = rig_of()
    rig.in_order((1.0, lambda: rig.alarm(state, restored=True)))
    rig.run(9.0)
    assert rig.path() == path


@pytest.mark.parametrize('subject', ['\ud800', '\U0001f600' * 40, '"\\\n\x00' * 20])
def test_names_that_are_none_are_carried_along(subject: str) -> None:
    rig = rig_of(question='{person}' * 20, retries=0)
    rig.in_order((1.0, lambda: rig.alarm('suspected', subject * 3, subject=subject, x=1.0, y=5.0,
                                         kinds=[subject] * 5, node=subject)),
                 (2.0, lambda: rig.say('agent/answer', 'help')),
                 (9.0, lambda: rig.say('agent/observed', json.dumps({
                     'alarm': subject * 3, 'kind': 'clip', 'problem': subject}))))
    rig.run(35.0)
    assert rig.path() == ['confirm', 'approach', 'observe', 'report', 'stay']


def test_a_place_that_cannot_be_is_given_up_within_a_job() -> None:
    rig = AgentRig(retries=0, map=str(ROOT / 'config' / 'maps' / 'flat.yaml'))
    rig.in_order((1.0, lambda: rig.alarm('raised', subject='bob', x=9e5, y=-9e5)))
    rig.run(3.0)
    assert rig.path() == ['approach', 'give_up']
    assert rig.transitions()[-1]['cause'] == 'blocked: no place to stand beside it'


def test_what_is_no_event_is_counted() -> None:
    rig = rig_of()
    bad = ['', '{', '[]', '3', '{"alarm": 1}', json.dumps({'alarm': 1, 'state': 'raised'}),
           json.dumps({'alarm': 1, 'state': [], 'level': {}}), '[' * 3000]
    rig.in_order(*((1.0 + 0.1 * place, lambda text=text: rig.say('alarms/events', text))
                   for place, text in enumerate(bad)))
    rig.in_order((3.0, lambda: rig.alarm('raised', kinds=['test'])),
                 (3.1, lambda: rig.alarm('raised', '2', kinds=7, x='far', node=['a'])),
                 (3.2, lambda: rig.say('agent/observed', '{"alarm": []}')))
    rig.run(4.0)
    assert rig.path() == ['approach']
    assert rig.agent.statistics()['events_unreadable'] == len(bad)
    assert rig.agent.statistics()['observed_unreadable'] == 1
