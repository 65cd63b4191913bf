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

"""Which answers of a person count: those to the question that the robot asks now."""

from __future__ import annotations

from agent_world import PERIOD_NS
from agent_world import World
import pytest
from rt_robot_os.features.agent.inputs import Say
from rt_robot_os.features.agent.inputs import SendAlarmCommand
from rt_robot_os.messages.agent import AgentState

S = AgentState


def asked() -> World:
    """Return a world in which the robot asks anna how she is; it came to ask at ``t_ns``."""
    world = World(quiet_s=0.1)
    world.alarm('suspected')
    assert world.state is S.CONFIRM
    return world


def said(world: World) -> list[str]:
    return [each.text for each in world.orders if isinstance(each, Say)]


@pytest.mark.parametrize(('age_ns', 'state'), [(1, S.CONFIRM), (0, S.RETURN)])
def test_an_answer_of_before_the_question_does_not_count(age_ns: int, state: AgentState) -> None:
    world = asked()
    asked_ns = world.t_ns
    world.run(1.0)  # it took a second to come
    world.agent.answer('anna fine', asked_ns - age_ns, world.t_ns)
    assert world.state is state
    assert world.agent.refused == (state is S.CONFIRM)


def test_a_call_for_help_of_before_the_question_does_not_count_either() -> None:
    world = asked()
    world.agent.answer('anna help', world.t_ns - 1, world.t_ns)
    assert world.state is S.CONFIRM
    assert not [each for each in world.orders if isinstance(each, SendAlarmCommand)]
    world.agent.answer('anna help', world.t_ns, world.t_ns)
    assert world.state is S.APPROACH


def test_an_answer_to_the_question_counts_although_it_was_asked_again_meanwhile() -> None:
    world = World(confirm_s=20.0, ask_again_s=2.0, quiet_s=0.1)
    world.alarm('suspected')
    answered_ns = world.t_ns + PERIOD_NS
    world.run(3.0)
    assert len(said(world)) == 2 and said(world)[0] == said(world)[1]
    world.agent.answer('anna fine', answered_ns, world.t_ns)
    assert world.state is S.RETURN


def test_an_answer_that_was_given_about_another_emergency_does_not_count() -> None:
    world = asked()
    world.run(1.0)
    answered_ns = world.t_ns
    world.run(1.0)
    world.alarm('suspected', '2', 'critical', 'bob', x=1.0, y=5.0)
    assert world.state is S.CONFIRM
    world.agent.answer('fine', answered_ns, world.t_ns)
    assert world.state is S.CONFIRM and world.agent.refused == 1
    world.agent.answer('fine', world.t_ns, world.t_ns)
    assert [each.text for each in world.orders if isinstance(each, SendAlarmCommand)] == [
        'cancel 2 by bob']


def test_an_answer_counts_while_the_robot_is_held() -> None:
    world = asked()
    world.inputs.estop = True
    world.run(0.2)
    assert world.state is S.HELD
    world.agent.answer('anna fine', world.t_ns, world.t_ns)
    assert world.agent.refused == 0
    world.inputs.estop = False
    world.run(0.1)
    assert (world.made[-2].source, world.made[-2].target) == (S.HELD, S.RETURN)


def test_without_an_answer_in_its_time_help_is_wanted() -> None:
    world = asked()
    began_ns = world.t_ns
    world.run(20.0, lambda: world.state is not S.CONFIRM)
    assert world.t_ns - began_ns == pytest.approx(5.0e9, abs=PERIOD_NS)
    assert world.state is S.APPROACH
