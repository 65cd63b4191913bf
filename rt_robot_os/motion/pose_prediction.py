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
The pose at which a command takes effect: the last pose on the map, predicted by odometry.

A pose from a localiser is some 10 ms to 100 ms old when it comes, and a control period may be
300 ms: at 0.5 m/s that is a hand's breadth. Corrections of the localiser are applied at a
limited rate, so that a step in the pose is not a step in the command.
"""

from __future__ import annotations

from collections import deque
import math
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.motion.angles import wrapped
from rt_robot_os.motion.differential import moved
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.poses import composed
from rt_robot_os.motion.poses import transform

_KEPT: Final = 256
# Odometry that moves faster than this between two samples has restarted.
_JUMP_M: Final = 0.5
_JUMP_M_S: Final = 10.0
# Longest prediction by a velocity alone.
_CARRIED_MAXIMUM_NS: Final = NS_PER_S // 2
_STANDSTILL = (0.0, 0.0)


class PosePrediction:
    """
    The present pose, from earlier poses and odometry; safe in the real-time loop.

    :param correction_m_s: how fast a correction of the position is applied.
    :param correction_rad_s: the same of the heading.
    :param jump_m: a larger correction is a new place, and applied immediately.
    :param jump_rad: the same of the heading.
    :ivar velocity: of the last odometry, linear and angular, in m/s and rad/s.
    :ivar jumps: corrections that were applied immediately.
    :ivar resets: how often odometry restarted.
    """

    def __init__(self, correction_m_s: float = 0.1, correction_rad_s: float = 0.3,
                 jump_m: float = 0.5, jump_rad: float = 0.5) -> None:
        self.correction_m_s = correction_m_s
        self.correction_rad_s = correction_rad_s
        self.jump_m = jump_m
        self.jump_rad = jump_rad
        self.velocity = _STANDSTILL
        self.jumps = 0
        self.resets = 0
        self._odometry: deque[tuple[int, Pose]] = deque(maxlen=_KEPT)
        self._map_to_odom: Pose | None = None
        # The part of the corrections that is not applied yet.
        self._left = (0.0, 0.0, 0.0)

    @property
    def known(self) -> bool:
        """Return whether there is a pose."""
        return self._map_to_odom is not None and bool(self._odometry)

    def add_odometry(self, stamp_ns: int, pose: Pose, velocity: tuple[float, float]) -> None:
        """Add a sample of odometry, in order; one that is not newer than the last is dropped."""
        kept = self._odometry
        if kept:
            before_ns, before = kept[-1]
            if stamp_ns <= before_ns:
                return
            limit = _JUMP_M + _JUMP_M_S * (stamp_ns - before_ns) / NS_PER_S
            if math.hypot(pose[0] - before[0], pose[1] - before[1]) > limit:
                kept.clear()
                self._map_to_odom = None
                self.resets += 1
        kept.append((stamp_ns, pose))
        self.velocity = velocity

    def add_pose(self, stamp_ns: int, pose: Pose) -> None:
        """Add a pose on the map; needs a sample of odometry before."""
        if not self._odometry:
            return
        found = transform(pose, self._then(stamp_ns))
        before = self._map_to_odom
        self._map_to_odom = found
        if before is None:
            self._left = (0.0, 0.0, 0.0)
            return
        here = self._odometry[-1][1]
        old, new = composed(before, here), composed(found, here)
        x, y, turn = self._left
        self._left = x, y, turn = (x + old[0] - new[0], y + old[1] - new[1],
                                   wrapped(turn + old[2] - new[2]))
        if math.hypot(x, y) > self.jump_m or abs(turn) > self.jump_rad:
            self._left = (0.0, 0.0, 0.0)
            self.jumps += 1

    def apply_corrections(self) -> None:
        """Apply the rest of the corrections immediately, for a new path that starts there."""
        self._left = (0.0, 0.0, 0.0)

    def at(self, now_ns: int, lead_s: float, period_s: float) -> Pose:
        """
        Return the pose on the map; only when :attr:`known`.

        :param lead_s: how much later than now: motors take the time constant of their speed to
            follow a command, and until then the robot goes on as measured.
        :param period_s: since the last call, for the rate of corrections.
        """
        stamp_ns, pose = self._odometry[-1]
        # A stamp in the future counts as now.
        carried_s = max(0, min(now_ns - stamp_ns, _CARRIED_MAXIMUM_NS)) / NS_PER_S + lead_s
        linear, angular = self.velocity
        pose = moved(pose, linear * carried_s, angular * carried_s)
        if self._map_to_odom is not None:
            pose = composed(self._map_to_odom, pose)
        x, y, turn = self._left
        if x or y or turn:
            distance, most = math.hypot(x, y), self.correction_m_s * period_s
            part = 1.0 - most / distance if distance > most else 0.0
            turn -= max(-self.correction_rad_s * period_s,
                        min(self.correction_rad_s * period_s, turn))
            self._left = x, y, turn = x * part, y * part, turn
        return pose[0] + x, pose[1] + y, pose[2] + turn

    def _then(self, stamp_ns: int) -> Pose:
        """Return the pose of the odometry at a time, interpolated or predicted."""
        kept = self._odometry
        later_ns, later = kept[-1]
        if stamp_ns >= later_ns:
            carried_s = min(stamp_ns - later_ns, _CARRIED_MAXIMUM_NS) / NS_PER_S
            return moved(later, self.velocity[0] * carried_s, self.velocity[1] * carried_s)
        for i in range(len(kept) - 2, -1, -1):
            before_ns, before = kept[i]
            if before_ns <= stamp_ns:
                part = (stamp_ns - before_ns) / (later_ns - before_ns)
                return (before[0] + part * (later[0] - before[0]),
                        before[1] + part * (later[1] - before[1]),
                        before[2] + part * wrapped(later[2] - before[2]))
            later_ns, later = before_ns, before
        return later
