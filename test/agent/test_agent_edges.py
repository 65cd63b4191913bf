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

"""Every edge of the table is taken, each by what it says leads along it."""

from __future__ import annotations

from typing import Any

from agent_world import World
import pytest
from rt_robot_os.features.agent.edges import EDGES
from rt_robot_os.features.agent.edges import StateEdge
from rt_robot_os.messages.agent import AgentState

S = AgentState


def settings_for(edge: StateEdge) -> dict[str, Any]:
    found: dict[str, Any] = {}
    if edge.guard == 'leaves':
        found['when_acknowledged'] = 'return'
    if edge.guard == 'gives up':
        found['after_operator'] = 'give_up'
    if edge.event == 'retry':
        found['retries'] = 1
    return found


def reach(world: World, edge: StateEdge) -> None:
    """Bring the agent to where an edge begins."""
    state = edge.source
    if (edge.source, edge.event) == (S.APPROACH, 'no_place'):
        world.inputs.people.clear()
    if (edge.source, edge.event) == (S.RETURN, 'no_place'):
        world.pose = world.inputs.pose = None
    if state is S.IDLE:
        return
    if state is S.CONFIRM:
        if edge.guard == 'there':
            world.planner = 'done'
        world.alarm('suspected')
        world.run(2.0)
    else:
        world.alarm('raised')
    if state in (S.OBSERVE, S.REPORT, S.STAY):
        world.planner = 'done'
        world.until(S.OBSERVE)
        world.planner = ''
    if state in (S.REPORT, S.STAY):
        world.run(2.0)
        for kind in ('picture', 'clip', 'sound'):
            world.agent.observed('1', kind, '')
        world.until(state)
    if state is S.GIVE_UP:
        world.planner = 'refused: no way'
        world.until(state)
        if edge.guard == 'aborted':
            world.agent.command('abort', world.t_ns)
    if state is S.RETURN:
        if world.pose is not None:
            world.pose = (2.0, 2.0, 0.0)  # it had driven a while
        world.run(0.1)
        world.agent.command('return', world.t_ns)
    if state is S.HELD:
        world.inputs.estop = True
        world.run(0.1)
    if state is S.OPERATOR:
        world.inputs.steering = 'teleop'
        world.run(0.1)
    assert world.state is state, (state, [each.message().to_json() for each in world.made])


def cause(world: World, edge: StateEdge) -> None:
    """Let the event of an edge happen."""
    event, inputs = edge.event, world.inputs
    if event in ('suspected', 'raised'):
        world.alarm(event, '2', 'critical')
    elif event in ('abort', 'stay', 'return'):
        world.agent.command(event, world.t_ns)
    elif event in ('fine', 'help'):
        world.agent.answer(f'anna {event}', world.t_ns, world.t_ns)
    elif event in ('over', 'confirmed', 'acknowledged'):
        world.alarm({'over': 'resolved', 'confirmed': 'raised'}.get(event, event))
    elif event == 'estop':
        inputs.estop = True
    elif event == 'operator':
        inputs.steering = 'teleop'
    elif event == 'released':
        inputs.estop = False
        inputs.steering = 'teleop' if edge.guard == 'driven' else 'nobody'
    elif event in ('arrived', 'blocked'):
        world.planner = {'arrived': 'done', 'blocked': 'stopped: blocked'}[event]
    elif event == 'battery_low':
        inputs.battery = 0.05
    elif event == 'lost_position':
        world.knows_pose = False
    elif event == 'moved':
        world.move_anna(7.0, 4.0)
    elif event == 'observed':
        world.run(2.0)
        for kind in ('picture', 'clip', 'sound'):
            world.agent.observed('1', kind, '')
    else:
        assert event in ('silence', 'timeout', 'retry', 'no_place'), event


@pytest.mark.parametrize('edge', EDGES, ids=lambda edge: (
    f'{edge.source.value} {edge.event} [{edge.guard}]'))
def test_each_edge_is_taken(edge: StateEdge) -> None:
    world = World(**settings_for(edge))
    reach(world, edge)
    before = len(world.made)
    if edge.source is S.RETURN and edge.event in ('arrived', 'blocked'):
        # The goal is given at the first tick.
        cause(world, edge)
    elif edge.source is S.APPROACH and edge.event in ('arrived', 'blocked'):
        cause(world, edge)
    else:
        world.run(0.1) if edge.source is not S.IDLE and edge.event != 'no_place' else None
        cause(world, edge)
    world.run(40.0, lambda: len(world.made) > before)
    made = world.made[before]
    assert made.edge == edge, made.message().to_json()
    wanted = edge.target or S.APPROACH
    assert (made.source, made.target) == (edge.source, wanted)
    assert world.state is wanted
