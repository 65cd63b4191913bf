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

"""Statistics of the measured poses of a source: how well they fit the estimate."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.motion.angles import wrapped
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.pose_history import PoseFix

# Length of the moving mean of the difference to the estimate, about.
_COUNT: Final = 50
# Sources are compared if both had at least this many poses, and one within this time.
_RECENT_NS: Final = 5 * NS_PER_S
_ENOUGH: Final = 20


class FixStatistics:
    """
    The measured poses of one source; everything is safe in the real-time loop.

    :ivar accepted: used.
    :ivar rejected: too far from the estimate.
    :ivar accepted_ns: moment of the newest that was used; 0 without.
    :ivar fix_ns: moment of the newest; 0 without.
    :ivar offset: mean difference of measured and estimated pose, in m, m, rad along the axes of
        the map; of those that were used and those that were not.
    """

    def __init__(self) -> None:
        self.accepted = self.rejected = 0
        self.accepted_ns = self.fix_ns = 0
        self.offset: Pose = (0.0, 0.0, 0.0)
        self._count = 0

    def add(self, fix: PoseFix) -> None:
        """Add a pose after its first comparison."""
        self.fix_ns = max(self.fix_ns, fix.stamp_ns)
        if fix.accepted:
            self.accepted += 1
            self.accepted_ns = max(self.accepted_ns, fix.stamp_ns)
        else:
            self.rejected += 1
        self._count = min(_COUNT, self._count + 1)
        x, y, heading = self.offset
        dx, dy, turn = fix.innovation
        part = 1 / self._count
        self.offset = (x + part * (dx - x), y + part * (dy - y),
                       wrapped(heading + part * wrapped(turn - heading)))

    def restart(self) -> None:
        """Reset the times, as stamps restart."""
        self.accepted_ns = self.fix_ns = self._count = 0

    def compares(self, now_ns: int) -> bool:
        """Return whether it had enough poses, and a recent one."""
        return self._count >= _ENOUGH and now_ns - self.fix_ns < _RECENT_NS


def disagreement(records: Sequence[FixStatistics], now_ns: int) -> tuple[float, float]:
    """Return the largest difference between recently active sources, in m and rad."""
    heard = [each.offset for each in records if each.compares(now_ns)]
    apart = [(math.hypot(a[0] - b[0], a[1] - b[1]), abs(wrapped(a[2] - b[2])))
             for index, a in enumerate(heard) for b in heard[:index]]
    return max((m for m, _ in apart), default=0.0), max((rad for _, rad in apart), default=0.0)
