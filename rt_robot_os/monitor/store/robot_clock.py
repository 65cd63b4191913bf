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
The time of a record when the robot's clock may be wrong.

A record is never discarded because of its time: it is stored with the best known time and with the
error of the robot's clock.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from rt_robot_os.base.units import NS_PER_S

#: Times outside of this range are wrong; a record may be a year old after a long disconnection.
PAST_NS: Final = 400 * 86400 * NS_PER_S
FUTURE_NS: Final = 86400 * NS_PER_S


@dataclass(frozen=True)
class RobotClock:
    """
    A robot's clock as known to the server when records arrive.

    :ivar offset_ns: how far it is ahead of the server's clock, measured when the robot connected.
    :ivar is_same_start: the records are of the same start of the robot as the measurement.
    """

    offset_ns: int = 0
    is_same_start: bool = False

    def corrected(self, t_ns: int, now_ns: int) -> int:
        """
        Return the time of a record, UTC in ns.

        All records of a start with a wrong clock are shifted by the same offset, so that they stay
        in order. Of an earlier start only records with an impossible time are shifted. If the
        shifted time is impossible too, the time of arrival is used.

        :param t_ns: time by the robot's clock.
        :param now_ns: UTC of the server.
        """
        is_wrong = self.is_same_start and abs(self.offset_ns) > FUTURE_NS
        if not is_wrong and _is_plausible(t_ns, now_ns):
            return t_ns
        moved_ns = t_ns - self.offset_ns
        return moved_ns if _is_plausible(moved_ns, now_ns) else now_ns


def _is_plausible(t_ns: int, now_ns: int) -> bool:
    return now_ns - PAST_NS <= t_ns <= now_ns + FUTURE_NS
