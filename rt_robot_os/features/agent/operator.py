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

"""Whether the e-stop or an operator has the robot."""

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
    Who has the robot, by what the multiplexer says and by goals that are not the agent's.

    :param sources: names of those who steer by hand, as the multiplexer has them.
    :ivar tuning: how long they keep it, and how long a planner may take.
    """

    def __init__(self, sources: Collection[str], tuning: AgentTuning) -> None:
        self._sources = frozenset(sources)
        self.tuning = tuning
        self.forget()

    def is_held(self, senses: AgentInputs) -> bool:
        """Return whether the e-stop is set; it is until it is released."""
        return senses.estop or senses.steering.startswith(_ESTOP)

    def why_held(self, senses: AgentInputs) -> str:
        """Return in words what holds the robot."""
        return (senses.steering.partition(': ')[2] if senses.steering.startswith(_ESTOP) else
                'somebody holds it')

    def why_driven(self, senses: AgentInputs) -> str:
        """Return in words what an operator does."""
        return (f'{senses.steering} steers' if senses.steering in self._sources else
                'somebody has sent the robot elsewhere')

    def forget(self) -> None:
        """Begin anew: what the robot was sent for before is no reason to wait."""
        self._until_ns = -1
        self._errand_until_ns = -1

    def drives(self, senses: AgentInputs, t_ns: int) -> bool:
        """
        Return whether an operator drives, or has let go just now.

        An errand is over when the planner says so, or has said nothing of it for too long.
        """
        t = self.tuning
        if senses.other_goal:
            self._errand_until_ns = t_ns + round(t.answer_s * NS_PER_S)
        elif senses.planner_new and self._errand_until_ns >= 0:
            self._errand_until_ns = -1 if senses.planner.startswith(_ENDS) else (
                t_ns + round(t.approach_s * NS_PER_S))
        if senses.steering in self._sources or t_ns < self._errand_until_ns:
            self._until_ns = t_ns + round(t.operator_hold_s * NS_PER_S)
        return t_ns < self._until_ns
