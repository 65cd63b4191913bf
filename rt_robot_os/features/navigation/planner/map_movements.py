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

"""Movements of the map under the robot: what mapping says when it has closed a loop."""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.mapping.live_map import LiveMap
from rt_robot_os.features.navigation.trajectory.pose_input import planar
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.poses import composed
from rt_robot_os.topics.subscription import Subscription

_NOT_MOVED: Final = (0.0, 0.0, 0.0)
# A map that moves by less has not moved; up to the next ones nobody has to stop for it.
_NOTHING_M, _NOTHING_RAD = 0.02, 0.01
_LITTLE_M, _LITTLE_RAD = 0.5, 0.5
# Poses that do not come at all are not waited for; nor is a map, so long.
_POSE_WAIT_NS: Final = NS_PER_S // 2
_MAP_WAIT_NS: Final = 3 * NS_PER_S


@dataclass(frozen=True)
class MapMovement:
    """
    How a map moved.

    :ivar moved: what was at ``p`` is at ``composed(moved, p)`` now.
    :ivar by_m: how far, where the robot is.
    """

    moved: Pose
    by_m: float

    @property
    def is_little(self) -> bool:
        """Return whether a plan may be driven on that moves along."""
        return self.by_m < _LITTLE_M and abs(self.moved[2]) < _LITTLE_RAD


class MapMovements:
    """
    Corrections of the map, held back until poses are of the map after them.

    The localiser takes a correction with the first odometry that comes after it: poses with later
    stamps than its arrival are of the map as it is then.

    :param source: of ``geometry_msgs/msg/PoseWithCovarianceStamped``; None: there are none.
    :param live: the map that they are of.
    :ivar count: those that were taken.
    :ivar refused: those that are no movement.
    """

    def __init__(self, source: Subscription | None, live: LiveMap) -> None:
        self._source = source
        self._live = live
        self.count = self.refused = 0
        self._moved: Pose = _NOT_MOVED
        self._came_ns = -1
        self._stamp_ns = self._map_by_ns = self._maps_before = 0

    def receive(self, now_ns: int) -> None:
        """Take what has come; safe in the real-time loop."""
        source = self._source
        while source is not None and source.take():
            moved = planar(source.msg.pose.pose)
            if moved is None:
                self.refused += 1
                continue
            self.count += 1
            self._moved = composed(moved, self._moved)
            self._stamp_ns, self._came_ns = source.stamp_ns, now_ns

    @property
    def pending(self) -> bool:
        """Return whether the newest pose may be of the map before, or of that after it."""
        return self._came_ns >= 0

    def settled(self, pose: Pose, pose_ns: int, now_ns: int) -> MapMovement | None:
        """
        Return how the map has moved, once; None when it has not, or poses do not know yet.

        :param pose: the newest.
        :param pose_ns: its stamp.
        """
        if not self.pending or (pose_ns <= self._came_ns
                                and now_ns - self._came_ns < _POSE_WAIT_NS):
            return None
        moved, self._moved, self._came_ns = self._moved, _NOT_MOVED, -1
        by_m = math.dist(composed(moved, pose)[:2], pose[:2])
        if by_m < _NOTHING_M and abs(moved[2]) < _NOTHING_RAD:
            return None
        if self._live.is_live:
            self._map_by_ns, self._maps_before = now_ns + _MAP_WAIT_NS, self._live.published
        return MapMovement(moved, by_m)

    def awaits_map(self, now_ns: int) -> bool:
        """Return whether the map is still the one before the last correction."""
        live = self._live
        if now_ns >= self._map_by_ns or (live.seq >= self._maps_before
                                         and live.stamp_ns >= self._stamp_ns):
            self._map_by_ns = 0
        return self._map_by_ns > 0
