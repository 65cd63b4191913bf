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

"""Poses and covariances of the plane in the messages of ROS; safe in the real-time loop."""

from __future__ import annotations

import math
from typing import Any
from typing import Final

from rt_robot_os.motion.ekf import PoseCovariance

# A robot on wheels does not leave the floor: z, roll, pitch are 0 and as sure as numbers allow.
_FLAT: Final = 1e-6
# Where x, y and yaw are in a covariance of six by six: x, y, z, roll, pitch, yaw.
X_X: Final = 0
X_Y: Final = 1
X_YAW: Final = 5
Y_X: Final = 6
Y_Y: Final = 7
Y_YAW: Final = 11
YAW_X: Final = 30
YAW_Y: Final = 31
YAW_YAW: Final = 35


def flatten(covariance: Any) -> None:
    """Set the variances of what does not move in the plane, once."""
    for index in (14, 21, 28):
        covariance[index] = _FLAT


def set_covariance(covariance: Any, values: PoseCovariance) -> None:
    """Write the covariance of x, y and yaw into an array of 36."""
    covariance[X_X] = values[0]
    covariance[X_Y] = covariance[Y_X] = values[1]
    covariance[X_YAW] = covariance[YAW_X] = values[2]
    covariance[Y_Y] = values[3]
    covariance[Y_YAW] = covariance[YAW_Y] = values[4]
    covariance[YAW_YAW] = values[5]


def planar_covariance(covariance: Any) -> PoseCovariance:
    """Read the covariance of x, y and yaw from an array of 36."""
    return (float(covariance[X_X]), float(covariance[X_Y]), float(covariance[X_YAW]),
            float(covariance[Y_Y]), float(covariance[Y_YAW]), float(covariance[YAW_YAW]))


def half_turn(heading_rad: float) -> tuple[float, float]:
    """Return z and w of the quaternion of a heading."""
    return math.sin(heading_rad / 2), math.cos(heading_rad / 2)
