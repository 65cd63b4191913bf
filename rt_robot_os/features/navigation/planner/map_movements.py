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

"""Movements of the map under the robot, which mapping publishes after loop closures."""

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
# A smaller movement is ignored; up to the second limits the robot need not stop.
_NOTHING_M, _NOTHING_RAD = 0.02, 0.01
_LITTLE_M, _LITTLE_RAD = 0.5, 0.5
# Maximum time to wait for a pose, and for a map, after a movement.
_POSE_WAIT_NS: Final = NS_PER_S // 2
_MAP_WAIT_NS: Final = 3 * NS_PER_S


@dataclass(frozen=True)
class MapMovement:
    """
    A movement of the map.

    :ivar moved: what was at ``p`` is at ``composed(moved, p)`` now.
    :ivar by_m: its distance at the robot.
    """

    moved: Pose
    by_m: float

    @property
    def is_little(self) -> bool:
        """Return whether a plan that moves along may still be driven."""
        return self.by_m < _LITTLE_M and abs(self.moved[2]) < _LITTLE_RAD


class MapMovements:
    """
    Movements of the map, held back until poses refer to the moved map.

    The localiser applies a correction with the first odometry after it: poses with stamps later
    than its arrival refer to the moved map.

    :param source: of ``geometry_msgs/msg/PoseWithCovarianceStamped``; None: there are none.
    :param live: the map that moves.
    :ivar count: valid ones.
    :ivar refused: invalid ones.
    """

    def __init__(self, source: Subscription | None, live: LiveMap) -> None:
        self._source = source
        self._live = live
        self.count = self.refused = 0
        self._moved: Pose = _NOT_MOVED
        self._came_ns = -1
        self._stamp_ns = self._map_by_ns = self._maps_before = 0

    def receive(self, now_ns: int) -> None:
        """Receive new ones; safe in the real-time loop."""
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
        """Return whether it is uncertain to which map the newest pose refers."""
        return self._came_ns >= 0

    def settled(self, pose: Pose, pose_ns: int, now_ns: int) -> MapMovement | None:
        """
        Return the movement of the map, once; None without one, or while poses lack it.

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
        """Return whether the map is still older than the last correction."""
        live = self._live
        if now_ns >= self._map_by_ns or (live.seq >= self._maps_before
                                         and live.stamp_ns >= self._stamp_ns):
            self._map_by_ns = 0
        return self._map_by_ns > 0
