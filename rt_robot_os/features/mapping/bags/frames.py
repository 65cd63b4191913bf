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

"""The frames of a robot, from the transforms of a bag."""

from __future__ import annotations

from typing import Final
from typing import NamedTuple

from rt_robot_os.messages.cdr import CdrReader
from rt_robot_os.motion.angles import roll_pitch_yaw_of
from rt_robot_os.motion.mounting import in_base
from rt_robot_os.motion.mounting import Mounting

_FRAMES_MOST: Final = 1000
_TRANSFORMS_MOST: Final = 1000
_ODOM: Final = 'odom'


class Transform(NamedTuple):
    """A transform of ``tf2_msgs/msg/TFMessage``."""

    stamp_ns: int
    child: str
    mounting: Mounting


def transforms_in(cdr: bytes) -> list[Transform]:
    """
    Read a ``tf2_msgs/msg/TFMessage``.

    :raises ValueError: it is malformed.
    """
    reader = CdrReader(cdr)
    count = reader.count()
    if count > _TRANSFORMS_MOST:
        raise ValueError(f'{count} transforms in one message')
    found = []
    for _ in range(count):
        stamp_ns = reader.stamp_ns()
        parent, child = reader.text().lstrip('/'), reader.text().lstrip('/')
        x, y, z, qx, qy, qz, qw = reader.doubles(7)
        length = (qx * qx + qy * qy + qz * qz + qw * qw) ** 0.5
        if not (0.5 < length < 2.0 and abs(x) + abs(y) + abs(z) < 1e9):
            raise ValueError(f'{parent} -> {child} is not a transform')
        turn = roll_pitch_yaw_of(qx / length, qy / length, qz / length, qw / length)
        found.append(Transform(stamp_ns, child, Mounting((x, y, z), turn, parent)))
    return found


class Frames:
    """
    The known frames, each with its parent.

    :ivar links: by the name of the frame.
    """

    def __init__(self) -> None:
        self.links: dict[str, Mounting] = {}
        self._moving: set[str] = set()

    def add(self, transform: Transform, is_fixed: bool) -> None:
        """Add a transform, unless it would close a cycle or exceed the limit."""
        child, parent = transform.child, transform.mounting.parent
        if child not in self.links:
            if len(self.links) >= _FRAMES_MOST or child in self.chain(parent):
                return
        elif self.links[child].parent != parent and child in self.chain(parent):
            return
        self.links[child] = transform.mounting
        if not is_fixed:
            self._moving.add(child)

    def chain(self, frame: str) -> list[str]:
        """Return a frame and all its ancestors, in order."""
        found = [frame]
        while found[-1] in self.links:
            found.append(self.links[found[-1]].parent)
        return found

    def seen_from(self, frame: str, base: str) -> Mounting | None:
        """Return the pose of a frame in an ancestor; None when it is not one."""
        chain = self.chain(frame)
        if base not in chain:
            return None
        carried = chain[:chain.index(base)]
        return in_base({each: self.links[each] for each in carried}, frame)

    def odometry_link(self, laser: str) -> str:
        """
        Return the moving frame in the frame of odometry that carries the laser; '' without one.

        It is the child of ``odom``, or else the last moving one that is not a child of ``map``.
        """
        carrying = [each for each in self.chain(laser)[:-1] if each in self._moving]
        for frame in carrying:
            if self.links[frame].parent.rpartition('/')[2] == _ODOM:
                return frame
        moving = [each for each in carrying
                  if self.links[each].parent.rpartition('/')[2] not in ('map', 'world')]
        return moving[-1] if moving else ''

    def odometry_link_of_any(self) -> str:
        """Return any moving child of ``odom``; '' without one."""
        return next((each for each in self.links if each in self._moving
                     and self.links[each].parent.rpartition('/')[2] == _ODOM), '')
