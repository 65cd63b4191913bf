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

"""The path that is driven: its part ahead of the robot, and its pose after a map movement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
import math

from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.poses import composed
from rt_robot_os.motion.route import Route


def rest_of(way: Sequence[Pose], here: Pose) -> Sequence[Pose]:
    """Return a path from the pose nearest to the robot on."""
    near = min(range(len(way)), key=lambda i: math.dist(way[i][:2], here[:2]))
    return way[near:]


def ahead_on(way: Sequence[Pose], here: Pose, from_m: float, to_m: float
             ) -> list[tuple[float, float]]:
    """Return the points of a path within a range of distances ahead of the robot."""
    found: list[tuple[float, float]] = []
    rest, length_m = rest_of(way, here), 0.0
    for a, b in zip(rest, rest[1:]):
        length_m += math.dist(a[:2], b[:2])
        if length_m > to_m:
            break
        if length_m > from_m:
            found.append(b[:2])
    return found


def moved_with(map_moved: Pose, route: Route) -> Route:
    """Return a route moved with its map."""
    return replace(route, poses=tuple(composed(map_moved, pose) for pose in route.poses))


class PathProgress:
    """How long a robot has made no progress, which is half a metre of movement."""

    _ENOUGH_M = 0.5

    def __init__(self) -> None:
        self._since_ns = -1
        self._at: Pose = (0.0, 0.0, 0.0)

    def restart(self) -> None:
        """Start again."""
        self._since_ns = -1

    def held_ns(self, here: Pose, now_ns: int) -> int:
        """Return since when it has been blocked; call it each time that it is."""
        if self._since_ns < 0 or math.dist(here[:2], self._at[:2]) > self._ENOUGH_M:
            self._since_ns, self._at = now_ns, here
        return now_ns - self._since_ns
