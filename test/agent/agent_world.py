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

"""The agent without a kernel: time, a planner and people do as a test says."""

from __future__ import annotations

from collections.abc import Callable
import json
import math
from typing import Any

from rt_robot_os.features.agent.agent import Agent
from rt_robot_os.features.agent.agent import AgentContext
from rt_robot_os.features.agent.inputs import AgentOrder
from rt_robot_os.features.agent.inputs import Goal
from rt_robot_os.features.agent.inputs import Location
from rt_robot_os.features.agent.inputs import Spin
from rt_robot_os.features.agent.machine import StateTransition
from rt_robot_os.features.agent.standoff import StandoffPlanner
from rt_robot_os.features.agent.tuning import AgentTuning
from rt_robot_os.messages.agent import AgentState
from rt_robot_os.motion.differential import Pose

PERIOD_NS = 50_000_000
SHORT: dict[str, Any] = {
    'confirm_s': 5.0, 'approach_s': 20.0, 'answer_s': 30.0, 'places': 2, 'place_s': 1.0,
    'look_s': 1.0, 'observe_s': 3.0, 'report_s': 0.5, 'stay_s': 10.0, 'company_s': 4.0,
    'retries': 0, 'retry_s': 2.0, 'give_up_s': 3.0, 'return_s': 20.0, 'lost_s': 1.0,
    'waiting_s': 3.0, 'operator_hold_s': 1.0, 'pause_s': 0.2}


class World:
    """
    An agent, and all that it needs.

    :ivar t_ns: now.
    :ivar planner: what becomes of a goal after a second; empty for nothing.
    :ivar made: the transitions.
    :ivar orders: all others.
    """

    def __init__(self, home: Pose | None = None, **tuning: Any) -> None:
        self.t_ns = 10**10
        self.planner = ''
        self.knows_pose = True
        self.made: list[StateTransition] = []
        self.orders: list[AgentOrder] = []
        self._due: list[tuple[int, str]] = []
        self._goal: Pose | None = None
        self.agent = Agent(
            AgentTuning(**{**SHORT, **tuning}),
            AgentContext(StandoffPlanner(None, 1.0, 0.2),
                         {'kitchen': Location(8.0, 1.0, 'kitchen')}, {'wrist': 'anna'}, home),
            self._take, PERIOD_NS)
        self.inputs = self.agent.inputs
        self.inputs.people['anna'] = Location(4.0, 4.0, 'anna')
        self.inputs.steering = 'nobody'
        self.pose: Pose | None = (0.0, 0.0, 0.0)
        self._sense()

    def _take(self, order: AgentOrder | StateTransition) -> None:
        if isinstance(order, StateTransition):
            self.made.append(order)
            return
        self.orders.append(order)
        if isinstance(order, Goal):
            self._due.clear()
            self._goal = order.pose
            if order.pose is not None and self.planner:
                self._due = [(self.t_ns + 200_000_000, 'planned: 3.00 m'),
                             (self.t_ns + 10**9, self.planner)]
        elif isinstance(order, Spin) and self.pose is not None:
            self.pose = (*self.pose[:2], self.pose[2] + order.rate_rad_s * PERIOD_NS / 1e9)

    def _sense(self) -> None:
        inputs = self.inputs
        while self._due and self._due[0][0] <= self.t_ns:
            _, text = self._due.pop(0)
            if text == 'done' and self._goal is not None:
                self.pose = self._goal
            inputs.planner, inputs.planner_new = text, True
        inputs.pose = self.pose
        if self.pose is not None and self.knows_pose:
            inputs.pose_ns = inputs.pose_good_ns = self.t_ns

    @property
    def state(self) -> AgentState:
        return self.agent.state

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> None:
        """Let time pass, at most until something is so."""
        end_ns = self.t_ns + round(seconds * 1e9)
        while self.t_ns < end_ns and not until():
            self.t_ns += PERIOD_NS
            self._sense()
            self.agent.tick(self.t_ns)

    def until(self, state: AgentState, seconds: float = 30.0) -> None:
        """Run until a state is there."""
        self.run(seconds, lambda: self.state is state)
        assert self.state is state, (self.state, [each.message().to_json() for each in self.made])

    def alarm(self, state: str, alarm: str = '1', level: str = 'urgent', subject: str = 'anna',
              kinds: tuple[str, ...] = ('fall',), **more: Any) -> None:
        """Tell an event of an alarm."""
        self.agent.alarm(json.dumps({
            'alarm': alarm, 'state': state, 'level': level, 'subject': subject,
            'kinds': list(kinds), **more}), self.t_ns)

    def move_anna(self, x: float, y: float) -> None:
        """Let anna be elsewhere."""
        self.inputs.people['anna'] = Location(x, y, 'anna')

    def away_m(self) -> float:
        """Return how far anna is from the robot."""
        assert self.pose is not None
        return math.dist(self.pose[:2], self.inputs.people['anna'].point)
