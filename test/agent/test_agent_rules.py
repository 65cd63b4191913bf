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

"""Whom first, how often, how long, and what moves nothing: the rules of the agent, one by one."""

from __future__ import annotations

import math

from agent_world import World
import pytest
from rt_robot_os.features.agent.inputs import Goal
from rt_robot_os.features.agent.inputs import Location
from rt_robot_os.features.agent.inputs import Observe
from rt_robot_os.features.agent.inputs import ReportBlocked
from rt_robot_os.features.agent.inputs import Say
from rt_robot_os.features.agent.inputs import Spin
from rt_robot_os.messages.agent import AgentState

S = AgentState


def path(world: World) -> list[str]:
    return [each.target.value for each in world.made if each.source is not each.target]


def served(world: World) -> list[tuple[str, str]]:
    return [(each.target.value, each.alarm) for each in world.made]


def goals(world: World) -> list[Goal]:
    return [each for each in world.orders if isinstance(each, Goal)]


# ---- whom first --------------------------------------------------------------------------------

def test_whom_an_operator_wants_first_comes_first_and_is_left_for_nothing_worse() -> None:
    world = World()
    world.alarm('raised', '1')
    world.alarm('raised', '0', subject='zoe', x=5.0, y=5.0)
    world.run(0.1)
    world.alarm('raised', '2', subject='bob', x=1.0, y=5.0)
    world.agent.command('go 2', world.t_ns)
    world.alarm('raised', '3', 'critical', 'eve', x=5.0, y=1.0)
    world.run(1.0)
    assert served(world) == [('approach', '1'), ('approach', '2')]


@pytest.mark.parametrize(('kinds', 'state'), [
    (('test',), S.IDLE), (('test', 'fall'), S.APPROACH)])
def test_a_test_is_no_emergency_but_hides_none(kinds: tuple[str, ...], state: AgentState) -> None:
    world = World()
    world.alarm('raised', kinds=kinds)
    assert world.state is state


@pytest.mark.parametrize(('news', 'state'), [
    ({}, S.IDLE), ({'level': 'critical'}, S.APPROACH),
    ({'kinds': ('fall', 'smoke')}, S.APPROACH)])
def test_who_was_left_is_served_again_only_when_it_is_worse_or_something_is_new(
        news: dict[str, object], state: AgentState) -> None:
    world = World()
    world.alarm('raised')
    world.agent.command('return', world.t_ns)
    world.run(0.2)
    world.until(S.IDLE)
    world.alarm('raised', **news)  # type: ignore[arg-type]
    assert world.state is state


def test_of_too_many_emergencies_the_least_are_dropped() -> None:
    world = World()
    world.alarm('raised', 'worst', 'critical')
    for number in range(70):
        world.alarm('raised', str(number))
    assert 'worst' in world.agent.emergencies and len(world.agent.emergencies) == 64
    assert world.agent.emergencies.dropped == 7


def test_who_became_worse_later_waits_behind_who_was_as_bad_before() -> None:
    world = World()
    world.inputs.estop = True
    for alarm, level in (('1', 'urgent'), ('2', 'critical'), ('1', 'critical')):
        world.run(0.5)
        world.alarm('raised', alarm, level, alarm)
    assert world.agent.emergencies.best().alarm == '2'  # type: ignore[union-attr]


def test_who_is_acknowledged_is_left_at_once_for_who_waits() -> None:
    world = World(company_s=100.0)
    world.planner = 'done'
    world.alarm('raised')
    world.until(S.OBSERVE)
    world.until(S.STAY)
    world.alarm('raised', '2', subject='bob', x=1.0, y=5.0)
    world.run(1.0)
    assert world.state is S.STAY
    world.alarm('acknowledged')
    assert served(world)[-1] == ('approach', '2')


def test_it_keeps_somebody_company_for_a_while_before_it_goes_to_who_waits() -> None:
    world = World(company_s=4.0, stay_s=100.0)
    world.planner = 'done'
    world.alarm('raised')
    world.alarm('raised', '2', subject='bob', x=1.0, y=5.0)
    world.until(S.STAY)
    began_ns = world.t_ns
    world.run(20.0, lambda: world.state is not S.STAY)
    assert 3.9 < (world.t_ns - began_ns) / 1e9 < 4.2
    assert served(world)[-1] == ('approach', '2')


def test_only_the_answer_of_who_was_asked_counts_and_only_while_it_asks() -> None:
    world = World()
    world.alarm('suspected')
    world.agent.answer('bob fine', world.t_ns, world.t_ns)
    assert world.state is S.CONFIRM
    world.until(S.APPROACH)
    world.agent.answer('anna help', world.t_ns, world.t_ns)
    assert world.state is S.APPROACH and world.agent.refused == 2


# ---- who has the robot -------------------------------------------------------------------------

def test_where_an_operator_has_sent_the_robot_it_is_left_until_it_is_there() -> None:
    world = World(operator_hold_s=1.0)
    world.planner = 'driving'
    world.alarm('raised')
    world.run(1.0)
    world.orders.clear()
    world.inputs.other_goal = True
    world.run(0.2)
    world.inputs.planner, world.inputs.planner_new = 'planned: 2.00 m', True
    world.run(10.0)
    assert world.state is S.OPERATOR and not goals(world)
    world.inputs.planner, world.inputs.planner_new = 'done', True
    world.run(1.5)
    assert world.state is S.APPROACH
    assert [each.message().cause for each in world.made[1:]] == [
        'operator: somebody has sent the robot elsewhere',
        'released: the operator has let go']


@pytest.mark.parametrize(('told', 'lasts_s'), [('', 3.0), ('planned: 2.00 m', 21.0)])
def test_an_errand_of_which_nothing_is_heard_ends(told: str, lasts_s: float) -> None:
    world = World(answer_s=2.0, approach_s=20.0, operator_hold_s=1.0)
    world.alarm('raised')
    world.run(0.2)
    world.inputs.other_goal = True
    world.run(0.1)
    if told:
        world.inputs.planner, world.inputs.planner_new = told, True
    world.run(lasts_s - 0.5)
    assert world.state is S.OPERATOR
    world.run(1.0)
    assert world.state is S.APPROACH


def test_the_cause_of_a_pause_says_who_has_the_robot() -> None:
    world = World()
    world.alarm('raised')
    world.inputs.estop = True
    world.run(0.1)
    world.inputs.estop, world.inputs.steering = False, 'nobody: e-stop, a bumper'
    world.run(0.1)
    assert world.state is S.HELD
    world.inputs.steering = 'teleop'
    world.run(0.1)
    assert [each.why for each in world.made[1:]] == [
        'somebody holds it', 'nobody holds the e-stop any more']
    assert world.state is S.OPERATOR


# ---- moving ------------------------------------------------------------------------------------

def test_a_goal_that_waits_for_a_way_is_taken_back_when_it_gives_up() -> None:
    world = World(places=1, waiting_s=2.0)
    world.planner = 'waiting: somebody stands there'
    world.alarm('raised')
    world.until(S.GIVE_UP)
    assert goals(world)[-1] == Goal(None)


def test_a_goal_is_taken_back_though_nobody_knows_where_the_next_emergency_is() -> None:
    world = World()
    world.planner = 'driving'
    world.alarm('raised')
    world.run(1.0)
    world.alarm('raised', '2', 'critical', 'nobody')
    assert goals(world)[-1] == Goal(None)


def test_what_is_done_or_refused_is_not_taken_back() -> None:
    for planner, state in (('done', S.OBSERVE), ('refused: no way', S.GIVE_UP)):
        world = World(places=1)
        world.planner = planner
        world.alarm('raised')
        world.until(state)
        world.agent.command('abort', world.t_ns)
        assert Goal(None) not in world.orders


def test_it_does_not_turn_by_a_pose_that_is_old() -> None:
    world = World()
    world.inputs.pose_ns, world.knows_pose = world.t_ns - 2 * 10**9, False
    world.alarm('raised')
    world.run(0.5)
    assert not [each for each in world.orders if isinstance(each, Spin) and each.rate_rad_s]


def test_a_position_that_was_unknown_before_is_waited_for() -> None:
    world = World(lost_s=1.0)
    world.inputs.pose_good_ns, world.knows_pose = 0, False
    world.alarm('raised')
    world.run(0.8)
    assert world.state is S.APPROACH
    world.run(0.5)
    assert world.state is S.GIVE_UP


def test_small_steps_of_somebody_are_not_followed() -> None:
    world = World(follow_m=0.5)
    world.planner = 'driving'
    world.alarm('raised')
    world.run(1.0)
    world.move_anna(4.15, 4.0)
    world.run(1.0)
    assert len(goals(world)) == 1
    world.move_anna(4.6, 4.0)
    world.run(1.0)
    assert len(goals(world)) == 2


def test_it_turns_to_who_moves_while_it_stays() -> None:
    world = World()
    world.planner = 'done'
    world.alarm('raised')
    world.until(S.STAY)
    assert world.pose is not None
    x, y, yaw = world.pose
    world.move_anna(x + math.cos(yaw + 1.5), y + math.sin(yaw + 1.5))
    world.run(4.0)
    assert abs(math.remainder(world.pose[2] - yaw - 1.5, math.tau)) < 0.15
    assert world.state is S.STAY


# ---- batteries and tries -----------------------------------------------------------------------

@pytest.mark.parametrize('charging', [False, True])
def test_with_a_low_battery_it_goes_to_nobody_unless_it_is_charged(charging: bool) -> None:
    world = World(retries=2, retry_s=1.0, give_up_s=1.0)
    world.inputs.battery, world.inputs.charging = 0.05, charging
    world.alarm('suspected')
    world.run(10.0)
    assert (S.GIVE_UP.value in path(world)) != charging
    assert bool(goals(world)) == charging
    assert path(world).count('approach') == 1  # it does not try again with an empty battery


def test_it_tries_as_often_as_it_may_and_an_abort_ends_that() -> None:
    for order, most in ((None, 3), ('abort', 1)):
        world = World(places=1, retries=2, retry_s=2.0, give_up_s=5.0)
        world.planner = 'refused: no way'
        world.alarm('raised')
        world.until(S.GIVE_UP)
        if order:
            world.agent.command(order, world.t_ns)
        began_ns = world.t_ns
        world.run(60.0, lambda: world.state not in (S.GIVE_UP, S.APPROACH))
        assert path(world).count('approach') == most
        if order:
            assert (world.t_ns - began_ns) / 1e9 == pytest.approx(5.0, abs=0.1)
        # The next emergency has all its tries.
        world.alarm('raised', '2', subject='kitchen', node='kitchen')
        world.until(S.GIVE_UP)
        world.until(S.APPROACH)


def test_when_it_gets_there_at_last_the_trouble_is_over() -> None:
    world = World(places=1, retries=1, retry_s=1.0)
    world.planner = 'refused: no way'
    world.alarm('raised')
    world.until(S.GIVE_UP)
    world.planner = 'done'
    world.until(S.OBSERVE)
    reports = [each for each in world.orders if isinstance(each, ReportBlocked)]
    assert [each.active for each in reports] == [True, False]
    said = [each.text for each in world.orders if isinstance(each, Say)]
    assert 'I cannot get to you, anna. Help has been called.' in said


# ---- being there -------------------------------------------------------------------------------

def test_pictures_are_taken_once_it_looks_there_but_not_for_ever_waited_for() -> None:
    world = World(look_s=6.0, observe_s=20.0)
    world.pose = (4.0, 3.0, -math.pi / 2)  # beside anna, with its back to her
    world.alarm('raised')
    world.until(S.OBSERVE)
    world.run(0.5)
    assert not [each for each in world.orders if isinstance(each, Observe)]
    world.run(4.0)
    ordered = [each.kind.value for each in world.orders if isinstance(each, Observe)]
    assert ordered == ['picture', 'clip', 'sound']
    world.agent.observed('2', 'picture', '')  # of another alarm
    for kind in ('clip', 'sound'):
        world.agent.observed('1', kind, '')
    world.run(1.0)
    assert world.state is S.OBSERVE
    lost = World(look_s=2.0)
    lost.pose = (4.0, 3.0, -math.pi / 2)
    lost.alarm('raised')
    lost.until(S.OBSERVE)
    lost.knows_pose = False
    lost.run(2.5)
    assert [each for each in lost.orders if isinstance(each, Observe)]


def test_it_speaks_again_and_again_while_it_stays() -> None:
    world = World(comfort_s=5.0, stay_s=60.0)
    world.planner = 'done'
    world.alarm('raised')
    world.until(S.STAY)
    world.orders.clear()
    world.run(16.0)
    assert [each for each in world.orders if isinstance(each, Say)] == [
        Say('I am with you, anna. Help has been called.')] * 3


def test_it_asks_again_until_there_is_an_answer() -> None:
    world = World(confirm_s=20.0, ask_again_s=5.0)
    world.inputs.people['anna'] = Location(0.0, 1.0, 'anna')
    world.alarm('suspected')
    world.run(16.0)
    assert len([each for each in world.orders if isinstance(each, Say)]) == 4


def test_home_is_where_it_is_set_and_not_three_metres_away() -> None:
    world = World(home=(2.0, 0.0, 0.0))
    world.planner = 'done'
    world.alarm('raised')
    world.run(0.2)
    world.agent.command('return', world.t_ns)
    world.until(S.IDLE)
    assert world.pose == (2.0, 0.0, 0.0)


def test_a_node_that_somebody_wears_is_not_said_to_be_where_they_are() -> None:
    world = World()
    world.alarm('raised', node='wrist')
    world.until(AgentState.APPROACH)
    assert world.agent.text == 'approach anna: fall'
    world.alarm('raised', '2', 'critical', 'kitchen', ('smoke',), node='kitchen')
    world.run(1.0)
    assert world.agent.text == 'approach kitchen: smoke, at kitchen'
