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
The differential drive: two wheels on one axle, as formulas; all are safe in the real-time loop.

Wheel speeds are those of the rim on the ground in m/s, left before right.
"""

from __future__ import annotations

import math

Pose = tuple[float, float, float]

# Below it the arc and its chord differ by less than the last digit of a float.
_STRAIGHT_RAD = 1e-6


def wheel_speeds(linear_m_s: float, angular_rad_s: float, separation_m: float
                 ) -> tuple[float, float]:
    """Return the speeds of the left and of the right wheel for a velocity of the robot."""
    half = angular_rad_s * separation_m / 2
    return linear_m_s - half, linear_m_s + half


def body_velocity(left_m_s: float, right_m_s: float, separation_m: float) -> tuple[float, float]:
    """Return the velocity of the robot, in m/s and rad/s, for speeds of its wheels."""
    return (left_m_s + right_m_s) / 2, (right_m_s - left_m_s) / separation_m


def moved(pose: Pose, distance_m: float, turn_rad: float) -> Pose:
    """
    Return the pose after an arc: exact when both speeds were steady meanwhile.

    The heading is not wrapped, so that turns can be counted.

    :param pose: x and y in m, heading in rad.
    :param distance_m: along the arc, negative backwards.
    """
    x, y, heading = pose
    if abs(turn_rad) < _STRAIGHT_RAD:
        middle = heading + turn_rad / 2
        return (x + distance_m * math.cos(middle), y + distance_m * math.sin(middle),
                heading + turn_rad)
    radius = distance_m / turn_rad
    end = heading + turn_rad
    return (x + radius * (math.sin(end) - math.sin(heading)),
            y - radius * (math.cos(end) - math.cos(heading)), end)


def tick_difference(new: int, old: int, bits: int) -> int:
    """
    Return how far a counter went that wraps, the shorter way.

    :param bits: its width; the counts are taken modulo two to that power.
    """
    half = 1 << (bits - 1)
    return ((new - old + half) & ((1 << bits) - 1)) - half
