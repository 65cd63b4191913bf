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


"""
How far a robot runs on when the computer that commands it stops.

A motor board executes its last command until it times out; then the robot brakes or
rolls. Both are proportional to the speed, so a speed follows from a distance. Everything here is
safe in the real-time loop.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
import math


@dataclass(frozen=True, slots=True)
class RunOn:
    """
    What a motor board declares about a time-out of commands.

    :ivar silence_s: the longest time from the last command until the board takes the power from
        its motors, at the speed commanded.
    :ivar coast_s: the rest until standstill, as distance over the speed before; for wheels that
        slow down exponentially the time constant.
    """

    silence_s: float = 0.0
    coast_s: float = 0.0

    @property
    def total_s(self) -> float:
        """Return the distance over the speed, from the last command to standstill."""
        return self.silence_s + self.coast_s

    def way_m(self, speed_m_s: float) -> float:
        """Return the run-on distance."""
        return abs(speed_m_s) * self.total_s

    def speed_m_s(self, way_m: float, reaction_s: float = 0.0) -> float:
        """
        Return the largest speed with a run-on distance within a limit; inf: there is no run-on.

        :param reaction_s: time before the last command.
        """
        total_s = self.total_s + reaction_s
        return max(0.0, way_m) / total_s if self.total_s else math.inf


def slowest(declared: Iterable[RunOn]) -> RunOn:
    """Return the one with the longest run-on; none when nothing moves."""
    return max(declared, key=lambda each: each.total_s, default=RunOn())
