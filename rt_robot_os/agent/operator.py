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

from rt_robot_os.agent.senses import Senses
from rt_robot_os.units import NS_PER_S

# As the multiplexer of velocities says it: "nobody: e-stop, asked for on estop".
_ESTOP: Final = 'nobody: e-stop'
_ENDS: Final = ('done', 'refused: ', 'stopped: ')


class Operator:
    """
    Who has the robot, by what the multiplexer says and by goals that are not the agent's.

    :param sources: names of those who steer by hand, as the multiplexer has them.
    """

    def __init__(self, sources: Collection[str], hold_s: float) -> None:
        self._sources = frozenset(sources)
        self.hold_s = hold_s
        self._until_ns = -1
        self._errand = False

    def is_held(self, senses: Senses) -> bool:
        """Return whether the e-stop is set; it is until it is released."""
        return senses.estop or senses.steering.startswith(_ESTOP)

    def forget(self) -> None:
        """Begin anew: what the robot was sent for before is no reason to wait."""
        self._until_ns = -1
        self._errand = False

    def drives(self, senses: Senses, t_ns: int) -> bool:
        """Return whether an operator drives, or has let go just now."""
        if senses.other_goal:
            self._errand = True
        elif senses.planner_new and senses.planner.startswith(_ENDS):
            self._errand = False
        if senses.steering in self._sources or self._errand:
            self._until_ns = t_ns + round(self.hold_s * NS_PER_S)
        return t_ns < self._until_ns
