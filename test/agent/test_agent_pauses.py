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

"""What is resumed after a pause: the e-stop, an operator, and one in the other."""

from __future__ import annotations

from collections.abc import Callable

from agent_world import World
import pytest
from rt_robot_os.messages.agent import AgentState

S = AgentState
Change = Callable[[World], None]


def press(world: World) -> None:
    world.inputs.estop = True


def release(world: World) -> None:
    world.inputs.estop = False


def drive(world: World) -> None:
    world.inputs.steering = 'teleop'


def let_go(world: World) -> None:
    world.inputs.steering = 'nobody'


def approaching(**tuning: str) -> World:
    world = World(operator_hold_s=0.2, approach_s=60.0, **tuning)
    world.planner = 'driving'
    world.alarm('raised')
    world.run(0.5)
    assert world.state is S.APPROACH
    return world


def after(world: World, *changes: Change) -> list[AgentState]:
    """Let something happen each second, and return the state after each."""
    found = []
    for each in changes:
        each(world)
        world.run(1.0)
        found.append(world.state)
    return found


@pytest.mark.parametrize(('changes', 'states'), [
    ((press, release), [S.HELD, S.APPROACH]),
    ((drive, let_go), [S.OPERATOR, S.APPROACH]),
    # One in the other: what was done before both is resumed, and not the other pause.
    ((press, drive, release, let_go), [S.HELD, S.HELD, S.OPERATOR, S.APPROACH]),
    ((drive, press, release, let_go), [S.OPERATOR, S.HELD, S.OPERATOR, S.APPROACH]),
    ((drive, press, let_go, release), [S.OPERATOR, S.HELD, S.HELD, S.APPROACH]),
    ((drive, press, release, press, release, let_go),
     [S.OPERATOR, S.HELD, S.OPERATOR, S.HELD, S.OPERATOR, S.APPROACH]),
])
def test_after_all_pauses_it_goes_on_with_what_it_did_before_the_first(
        changes: tuple[Change, ...], states: list[AgentState]) -> None:
    world = approaching()
    assert after(world, *changes) == states


def test_who_drives_it_while_it_waits_to_be_released_may_have_it_give_up() -> None:
    world = approaching(after_operator='give_up')
    assert after(world, press, drive, release) == [S.HELD, S.HELD, S.OPERATOR]
    let_go(world)
    world.until(S.GIVE_UP, 1.0)


def test_an_emergency_that_ends_during_both_pauses_is_not_gone_on_with() -> None:
    world = approaching()
    assert after(world, press, drive, release) == [S.HELD, S.HELD, S.OPERATOR]
    world.alarm('resolved')
    assert world.state is S.OPERATOR
    assert after(world, let_go) == [S.IDLE]
    assert [each.target for each in world.made[-2:]] == [S.RETURN, S.IDLE]


def test_a_worse_emergency_during_both_pauses_is_served_after_them() -> None:
    world = approaching()
    assert after(world, drive, press) == [S.OPERATOR, S.HELD]
    world.alarm('raised', '2', 'critical', 'bob', x=1.0, y=5.0)
    assert after(world, release, let_go) == [S.OPERATOR, S.APPROACH]
    assert world.made[-1].alarm == '2'


def test_the_cause_of_a_resumption_is_the_end_of_the_pause() -> None:
    world = approaching()
    after(world, press, release)
    assert [(each.source, each.target) for each in world.made[-2:]] == [
        (S.APPROACH, S.HELD), (S.HELD, S.APPROACH)]
    assert world.made[-1].edge.event == 'released'
