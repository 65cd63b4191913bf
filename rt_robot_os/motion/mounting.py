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

"""Where a sensor sits on the robot."""

from __future__ import annotations

from dataclasses import dataclass
import math

from rt_robot_os.motion.quaternion import Quaternion
from rt_robot_os.motion.quaternion import rotate
from rt_robot_os.motion.quaternion import Vector


@dataclass(frozen=True)
class Mounting:
    """
    The pose of a frame in its parent frame, as URDF gives it: turned about x, y, z, then moved.

    :ivar position_m: of its origin, three numbers.
    :ivar rotation_rad: roll, pitch and yaw about the fixed axes of the parent.
    :ivar parent: name of the parent frame.
    """

    position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)
    parent: str = 'base_link'

    @property
    def yaw_rad(self) -> float:
        """Return the direction in the plane, for what is mounted upright."""
        return self.rotation_rad[2]

    def quaternion(self) -> Quaternion:
        """Return the rotation as x, y, z, w."""
        (cr, sr), (cp, sp), (cy, sy) = (
            (math.cos(angle / 2), math.sin(angle / 2)) for angle in self.rotation_rad)
        return (sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy,
                cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy)

    def in_parent(self, point_m: Vector) -> Vector:
        """Return where a point of the frame is in the parent frame."""
        x, y, z = rotate(self.quaternion(), point_m)
        a, b, c = self.position_m
        return x + a, y + b, z + c
