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

"""Whether the e-stop or an operator holds the robot."""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.agent.inputs import AgentInputs
from rt_robot_os.features.agent.tuning import AgentTuning

# As the multiplexer of velocities says it: "nobody: e-stop, asked for on estop".
_ESTOP: Final = 'nobody: e-stop'
_ENDS: Final = ('done', 'refused: ', 'stopped: ')


class OperatorWatch:
    """
    Detects an operator from the multiplexer and from goals that are not the agent's.

    :param sources: sources of the multiplexer that are people.
    :ivar tuning: how long they hold it, and the time-out of the planner.
    """

    def __init__(self, sources: Collection[str], tuning: AgentTuning) -> None:
        self._sources = frozenset(sources)
        self.tuning = tuning
        self.forget()

    def is_held(self, inputs: AgentInputs) -> bool:
        """Return whether the e-stop is set; it is until it is released."""
        return inputs.estop or inputs.steering.startswith(_ESTOP)

    def why_held(self, inputs: AgentInputs) -> str:
        """Return in words what holds the robot."""
        return (inputs.steering.partition(': ')[2] if inputs.steering.startswith(_ESTOP) else
                'somebody holds it')

    def why_driven(self, inputs: AgentInputs) -> str:
        """Return in words what an operator does."""
        return (f'{inputs.steering} steers' if inputs.steering in self._sources else
                'somebody has sent the robot elsewhere')

    def forget(self) -> None:
        """Reset: a goal of before is no reason to wait."""
        self._until_ns = -1
        self._errand_until_ns = -1

    def drives(self, inputs: AgentInputs, t_ns: int) -> bool:
        """
        Return whether an operator drives, or stopped just now.

        A goal of an operator has ended when the planner reports so, or reports nothing for too
        long.
        """
        t = self.tuning
        if inputs.other_goal:
            self._errand_until_ns = t_ns + round(t.answer_s * NS_PER_S)
        elif inputs.planner_new and self._errand_until_ns >= 0:
            self._errand_until_ns = -1 if inputs.planner.startswith(_ENDS) else (
                t_ns + round(t.approach_s * NS_PER_S))
        if inputs.steering in self._sources or t_ns < self._errand_until_ns:
            self._until_ns = t_ns + round(t.operator_hold_s * NS_PER_S)
        return t_ns < self._until_ns
