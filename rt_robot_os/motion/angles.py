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

"""Angles in the plane: kept within a turn, and to and from the quaternions of messages."""

from __future__ import annotations

import math


def wrapped(angle_rad: float) -> float:
    """Return the same direction as an angle from -pi to pi; safe in the real-time loop."""
    return math.remainder(angle_rad, math.tau)


def yaw_of(x: float, y: float, z: float, w: float) -> float:
    """
    Return the heading of an attitude in rad, from -pi to pi; safe in the real-time loop.

    Source: REP 103, rotation about z after those about y and x.

    :param w: the last, as in ``geometry_msgs/msg/Quaternion``; the length does not matter.
    """
    return math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def roll_pitch_yaw_of(x: float, y: float, z: float, w: float) -> tuple[float, float, float]:
    """Return the angles in rad about the fixed axes x, y, z of an attitude of length 1."""
    sine = max(-1.0, min(1.0, 2.0 * (w * y - z * x)))
    return (math.atan2(2.0 * (w * x + y * z), w * w - x * x - y * y + z * z), math.asin(sine),
            yaw_of(x, y, z, w))
