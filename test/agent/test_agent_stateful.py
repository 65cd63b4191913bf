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

"""Whatever happens in whatever order: the agent keeps to its table, its bounds and its people."""

from __future__ import annotations

import math

from agent_world import World
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import initialize
from hypothesis.stateful import invariant
from hypothesis.stateful import rule
from hypothesis.stateful import RuleBasedStateMachine
from rt_robot_os.features.agent.edges import EDGES
from rt_robot_os.features.agent.edges import PAUSES
from rt_robot_os.features.agent.inputs import Goal
from rt_robot_os.features.agent.inputs import Spin
from rt_robot_os.messages.agent import AgentState

ALARMS = st.sampled_from(['1', '2', '3'])
PLANNER = st.sampled_from(['', 'done', 'refused: no way', 'waiting: somebody', 'stopped: blocked'])
PLACES = st.sampled_from([(4.0, 4.0), (4.3, 4.0), (-3.0, 1.0), (0.2, 0.1)])


class Days(RuleBasedStateMachine):
    """A robot, three alarms, and everything that may happen to them."""

    world: World

    @initialize(leaves=st.booleans(), gives_up=st.booleans(), retries=st.integers(0, 2),
                home=st.sampled_from([None, (0.5, 0.5, 0.0)]))
    def begin(self, leaves: bool, gives_up: bool, retries: int,
              home: tuple[float, float, float] | None) -> None:
        self.world = World(
            home, when_acknowledged='return' if leaves else 'stay', retries=retries,
            after_operator='give_up' if gives_up else 'resume')
        self.seen = 0

    @rule(alarm=ALARMS, level=st.sampled_from(['technical', 'urgent', 'critical']),
          state=st.sampled_from(['suspected', 'raised', 'acknowledged', 'resolved', 'cancelled']),
          kinds=st.sampled_from([('fall',), ('test',), ('fall', 'help')]),
          subject=st.sampled_from(['anna', 'bob', 'kitchen']))
    def tell(self, alarm: str, level: str, state: str, kinds: tuple[str, ...],
             subject: str) -> None:
        self.world.alarm(state, alarm, level, subject, kinds, node=subject)

    @rule(text=st.sampled_from(['fine', 'help', 'anna fine', 'anna help', 'bob fine', 'what']))
    def say(self, text: str) -> None:
        self.world.agent.answer(text, self.world.t_ns, self.world.t_ns)

    @rule(text=st.sampled_from(['abort', 'stay', 'return', 'go 1', 'go 3', 'go', '']))
    def command(self, text: str) -> None:
        self.world.agent.command(text, self.world.t_ns)

    @rule(kind=st.sampled_from(['picture', 'clip', 'sound', 'x']), alarm=ALARMS)
    def see(self, kind: str, alarm: str) -> None:
        self.world.agent.observed(alarm, kind, 'file')

    @rule(pressed=st.booleans())
    def estop(self, pressed: bool) -> None:
        self.world.inputs.estop = pressed

    @rule(who=st.sampled_from(['teleop', 'nobody', 'agent', 'trajectory', 'nobody: e-stop, x']))
    def steer(self, who: str) -> None:
        self.world.inputs.steering = who

    @rule()
    def send_elsewhere(self) -> None:
        self.world.inputs.other_goal = True

    @rule(planner=PLANNER)
    def plan(self, planner: str) -> None:
        self.world.planner = planner

    @rule(place=PLACES, known=st.booleans())
    def move(self, place: tuple[float, float], known: bool) -> None:
        self.world.move_anna(*place)
        if not known:
            del self.world.inputs.people['anna']

    @rule(charge=st.sampled_from([math.nan, 0.05, 0.9]), known=st.booleans(),
          voice=st.sampled_from([math.nan, -10.0]))
    def live(self, charge: float, known: bool, voice: float) -> None:
        self.world.inputs.battery, self.world.knows_pose = charge, known
        self.world.inputs.voice = voice

    @rule(seconds=st.sampled_from([0.05, 0.3, 1.0, 4.0, 15.0]))
    def wait(self, seconds: float) -> None:
        self.world.run(seconds)

    # ---- what holds at all times ---------------------------------------------------------------

    @invariant()
    def each_step_is_one_of_the_table(self) -> None:
        made = self.world.made
        state, t_ns = (made[self.seen - 1].target, made[self.seen - 1].t_ns) if self.seen else (
            AgentState.IDLE, 0)
        for each in made[self.seen:]:
            assert each.edge in EDGES and each.source is state and each.t_ns >= t_ns
            state, t_ns = each.target, each.t_ns
        self.seen = len(made)
        assert self.world.state is state

    @invariant()
    def whoever_has_the_robot_has_it_alone(self) -> None:
        world = self.world
        world.orders.clear()
        held = world.inputs.estop or world.inputs.steering.startswith('nobody: e-stop')
        world.run(0.1)
        if world.state is not AgentState.IDLE:
            assert (world.state is AgentState.HELD) == held
        if world.state in PAUSES and world.inputs.steering != 'nobody':
            first = 1 + next((place for place, each in enumerate(world.orders)
                              if each == Goal(None)), -1)
            assert not [each for each in world.orders[first:] if isinstance(each, Goal)
                        or isinstance(each, Spin) and each.rate_rad_s]

    @invariant()
    def turns_are_bounded(self) -> None:
        assert all(abs(each.rate_rad_s) <= 0.8 for each in self.world.orders
                   if isinstance(each, Spin))

    def teardown(self) -> None:
        """Whatever there was: nothing hangs. Each state has an end, and all of it does."""
        if not hasattr(self, 'world'):
            return
        world = self.world
        world.inputs.estop, world.inputs.steering = False, 'nobody'
        world.inputs.planner, world.inputs.planner_new = 'done', True
        world.planner = ''
        world.run(400.0, lambda: world.state is AgentState.IDLE)
        assert world.state is AgentState.IDLE, [
            each.message().to_json() for each in world.made[-8:]]


TestDays = Days.TestCase
TestDays.settings = settings(max_examples=40, stateful_step_count=30, deadline=None,
                             derandomize=True)
