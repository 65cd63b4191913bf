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
Quaternions in plain floats, in the order of ROS: ``x, y, z, w``.

They turn vectors from the sensor's axes to the world's, which are east, north, up.
"""

from __future__ import annotations

import math
from typing import TypeAlias

Vector: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]

IDENTITY: Quaternion = (0.0, 0.0, 0.0, 1.0)


def multiply(p: Quaternion, q: Quaternion) -> Quaternion:
    """Turn by q first, then by p."""
    px, py, pz, pw = p
    qx, qy, qz, qw = q
    return (pw * qx + px * qw + py * qz - pz * qy, pw * qy - px * qz + py * qw + pz * qx,
            pw * qz + px * qy - py * qx + pz * qw, pw * qw - px * qx - py * qy - pz * qz)


def conjugate(q: Quaternion) -> Quaternion:
    """Return the inverse rotation."""
    return -q[0], -q[1], -q[2], q[3]


def rotate(q: Quaternion, v: Vector) -> Vector:
    """Turn a vector: from the sensor's axes to the world's."""
    x, y, z, w = q
    a, b, c = v
    # v + 2 w (u x v) + 2 u x (u x v)
    i, j, k = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return (a + w * i + y * k - z * j, b + w * j + z * i - x * k, c + w * k + x * j - y * i)


def about_up(angle_rad: float) -> Quaternion:
    """Make a turn about the vertical, positive from east to north."""
    return 0.0, 0.0, math.sin(angle_rad / 2), math.cos(angle_rad / 2)


def from_rotation(x: float, y: float, z: float) -> Quaternion:
    """Make a turn about a vector by its length in rad."""
    angle = math.sqrt(x * x + y * y + z * z)
    # The sine of a tiny angle over that angle is 1 to the last digit.
    scale = math.sin(angle / 2) / angle if angle > 1e-9 else 0.5
    return x * scale, y * scale, z * scale, math.cos(angle / 2)


def from_up(up: Vector) -> Quaternion | None:
    """
    Find the shortest turn that makes a vector point up.

    :param up: in the sensor's axes, of any length.
    :return: None when it is too short to have a direction.
    """
    x, y, z = up
    length = math.sqrt(x * x + y * y + z * z)
    if not length > 1e-9:
        return None
    x, y, z = x / length, y / length, z / length
    aside = math.sqrt(x * x + y * y)
    if aside == 0.0 and z < 0.0:
        return 1.0, 0.0, 0.0, 0.0  # upside down: there is no shortest one
    if z < -0.9:  # 1 + z would be a difference of nearly equal numbers
        half = math.atan2(aside, z) / 2
        scale = math.sin(half) / aside
        return y * scale, -x * scale, 0.0, math.cos(half)
    w = math.sqrt((1 + z) / 2)
    return y / (2 * w), -x / (2 * w), 0.0, w


def heading_of_field(q: Quaternion, field: Vector) -> tuple[float, float, float]:
    """
    Look at a magnetic field from the world's axes.

    :param q: its yaw does not matter to the last two numbers.
    :return: the angle in rad from north to its horizontal part, positive towards west; the dip
        below the horizon in rad; the length.
    """
    east, north, up = rotate(q, field)
    horizontal = math.sqrt(east * east + north * north)
    return (math.atan2(-east, north), math.atan2(-up, horizontal),
            math.sqrt(horizontal * horizontal + up * up))
