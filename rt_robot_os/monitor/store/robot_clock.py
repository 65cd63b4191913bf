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
When a record happened, where the robot's clock may be wrong.

A record is never thrown away for its time: it is stored at the best time that is known, and how
far the robot's clock was off is stored with it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from rt_robot_os.base.units import NS_PER_S

#: A clock that says more or less than this is wrong: a robot that was away for a year is not.
PAST_NS: Final = 400 * 86400 * NS_PER_S
FUTURE_NS: Final = 86400 * NS_PER_S


@dataclass(frozen=True)
class RobotClock:
    """
    A robot's clock, as the server knows it when records arrive.

    :ivar offset_ns: how far it is ahead of the server's, measured when the robot connected.
    :ivar is_same_start: the records are of the start of the robot at which it was measured.
    """

    offset_ns: int = 0
    is_same_start: bool = False

    def corrected(self, t_ns: int, now_ns: int) -> int:
        """
        Return when a record happened, UTC in ns.

        All records of a start with a wrong clock are moved alike, so that they stay in order.
        Of an earlier start only those are moved whose time cannot be. Where the offset does not
        explain the time either, it is that of arrival.

        :param t_ns: what the robot's clock said.
        :param now_ns: UTC of the server.
        """
        is_wrong = self.is_same_start and abs(self.offset_ns) > FUTURE_NS
        if not is_wrong and _is_plausible(t_ns, now_ns):
            return t_ns
        moved_ns = t_ns - self.offset_ns
        return moved_ns if _is_plausible(moved_ns, now_ns) else now_ns


def _is_plausible(t_ns: int, now_ns: int) -> bool:
    return now_ns - PAST_NS <= t_ns <= now_ns + FUTURE_NS
