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

"""The mounting of a sensor on the robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
import math
from typing import Any
from typing import Final

from rt_robot_os.motion.angles import roll_pitch_yaw_of
from rt_robot_os.motion.quaternion import multiply
from rt_robot_os.motion.quaternion import Quaternion
from rt_robot_os.motion.quaternion import rotate
from rt_robot_os.motion.quaternion import Vector

BASE_FRAME: Final = 'base_link'


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
    parent: str = BASE_FRAME

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

    def seen_from(self, parent: Mounting) -> Mounting:
        """
        Return the pose in the parent's parent.

        :param parent: where the parent frame itself is.
        """
        turned = multiply(parent.quaternion(), self.quaternion())
        return Mounting(
            parent.in_parent(self.position_m), roll_pitch_yaw_of(*turned), parent.parent)


# From the axes of a body (x ahead, y to the left, z up) to those of a picture (z ahead, x to the
# right, y down): REP 103.
OPTICAL: Final = Mounting(rotation_rad=(-math.pi / 2, 0.0, -math.pi / 2))


def mounting_of(settings: Mapping[str, Any], index: int = 0) -> Mounting:
    """
    Read the mounting from the settings of a device, for its driver and its simulation.

    :param index: of the frame, for a device with several; three numbers alone are for all.
    """
    def numbers(key: str) -> Vector:
        given = settings.get(key, (0.0, 0.0, 0.0))
        first = 3 * index if len(given) > 3 else 0
        x, y, z = map(float, given[first:first + 3])
        return x, y, z

    return Mounting(numbers('mounting_m'), numbers('mounting_rad'),
                    settings.get('parent_frame_id', BASE_FRAME))


def mounted_on_base(settings: Mapping[str, Any], mountings: Mapping[str, Mounting]
                    ) -> dict[str, Any]:
    """
    Return the settings of a device with its mounting as seen from the robot's base.

    :param mountings: of all frames; if none of them carries the device nothing changes.
    """
    parent = settings.get('parent_frame_id', BASE_FRAME)
    if parent not in mountings:
        return dict(settings)
    carrier = in_base(mountings, parent)
    count = max(len(settings[key]) for key in ('mounting_m', 'mounting_rad')) // 3
    found = [mounting_of(settings, index).seen_from(carrier) for index in range(count)]
    return {**settings, 'parent_frame_id': carrier.parent,
            'mounting_m': [each for one in found for each in one.position_m],
            'mounting_rad': [each for one in found for each in one.rotation_rad]}


def in_base(mountings: Mapping[str, Mounting], frame_id: str) -> Mounting:
    """
    Return the mounting of a frame on the robot, through all the frames that carry it.

    :param mountings: by frame, without a cycle.
    :return: its ``parent`` is the first frame without a mounting, usually ``base_link``; such a
        frame itself is at its own origin.
    """
    found = mountings.get(frame_id, Mounting(parent=frame_id))
    while found.parent in mountings:
        found = found.seen_from(mountings[found.parent])
    return found
