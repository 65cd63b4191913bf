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
Group the WitMotion frames that belong to one instant.

The device measures once and then sends the frames that its output mask enables, back to back and
by rising ID. No frame contains a number of its instant or marks the last one, so the set is
learned from the stream:

- An *instant* ends where the ID does not rise, or after a pause. Its *members* are those of its
  frames that an Imu sample is made of: 0x51, 0x52, 0x53, 0x59.
- The first complete instant gives the learned set. Only this one is delivered late, when the next
  instant begins. The remainder of an instant after opening is not complete and is skipped.
- From then on a set is complete, and delivered, with the last frame that it *needs*: all of the
  learned set, without 0x53 if there is 0x59 for the orientation. It does not wait for the next
  instant.
- An instant that ends without a needed frame is lost, and counted. So is one in which a byte was
  rejected between its frames: the two sides of the gap may belong to different instants, which are
  never mixed. An instant of which no frame arrived cannot be counted.
- When the output mask is changed while running, the new set is learned after eight consecutive
  equal instants.
"""

from __future__ import annotations

from typing import Final
from typing import NamedTuple

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.devices.witmotion.wire import ACCELERATION
from rt_robot_os.devices.witmotion.wire import ANGLE
from rt_robot_os.devices.witmotion.wire import ANGULAR_VELOCITY
from rt_robot_os.devices.witmotion.wire import MAGNETIC_FIELD
from rt_robot_os.devices.witmotion.wire import QUATERNION
from rt_robot_os.devices.witmotion.wire import WitMotionFrame

# A frame takes 23 ms at the slowest speed, 4800 baud, and the frames of a set follow each other
# without a pause; the shortest pause between two instants that is longer belongs to 10 Hz.
PAUSE_NS: Final = 50 * NS_PER_MS

_RELEARN_AFTER: Final = 8

_BITS: Final = {ACCELERATION: 1, ANGULAR_VELOCITY: 2, ANGLE: 4, QUATERNION: 8}
_ANGLE_BIT: Final = 4
_QUATERNION_BIT: Final = 8

Parts = dict[int, tuple[int, int, int, int]]


class ImuSet(NamedTuple):
    """
    The frames of one instant.

    :ivar stamp_ns: arrival of the first frame of the instant, the nearest to the measurement.
    :ivar parts: ID -> the four int16, for the IDs that an Imu sample is made of.
    """

    stamp_ns: int
    parts: Parts


class ImuSetAssembler:
    """
    Put frames together that belong to one instant; safe in the loop, keeps one instant.

    :ivar lost: sets that were not delivered because one of their frames is missing.
    :ivar stamp_ns: arrival of the first frame of the current instant.
    """

    def __init__(self) -> None:
        self.lost = 0
        self._given = False
        self.restart()

    def restart(self) -> None:
        """Reset the instant and the learned set: the stream restarts."""
        self.stamp_ns = 0
        self._learned = 0
        self._needed = 0
        self._candidate = 0
        self._agreed = 0
        self._last_kind = -1
        self._last_arrival_ns = 0
        self._whole = False
        self._begin(0)

    @property
    def broken(self) -> bool:
        """Return whether bytes were rejected within the current instant."""
        return self._broken

    def add(self, frame: WitMotionFrame, arrival_ns: int, since_ns: int) -> list[ImuSet]:
        """
        Add the next frame.

        :param arrival_ns: when it arrived.
        :param since_ns: a time at which its last byte had not arrived yet, 0 = unknown.
        :return: the sets that it completes; two at most, and only once after the start.
        """
        kind = frame.kind
        given: list[ImuSet] = []
        if self._last_kind < 0:
            self._begin(arrival_ns)
            self._whole = kind <= ACCELERATION and not frame.skipped
        elif kind <= self._last_kind or since_ns - self._last_arrival_ns > PAUSE_NS:
            given = self._end_of_instant()
            self._begin(arrival_ns)
            self._whole = not frame.skipped
        elif frame.skipped:
            self._whole = False
            self._broken = True
        self._last_kind = kind
        self._last_arrival_ns = arrival_ns
        bit = _BITS.get(kind, 0)
        if bit:
            self._parts[kind] = frame.values
            self._members |= bit
            needed = self._needed
            if needed and not self._given and not self._broken \
                    and self._members & needed == needed:
                self._given = True
                given.append(ImuSet(self.stamp_ns, self._parts))
        elif kind == MAGNETIC_FIELD:
            self._used = True
        return given

    def _begin(self, arrival_ns: int) -> None:
        self.stamp_ns = arrival_ns
        self._parts: Parts = {}
        self._members = 0
        self._used = False
        self._broken = False
        self._given = False

    def _end_of_instant(self) -> list[ImuSet]:
        members = self._members
        if not self._learned:
            if not self._whole or not members:
                return []
            self._learn(members)
            return [ImuSet(self.stamp_ns, self._parts)]
        if not self._given and (members or self._used):
            self.lost += 1
        if self._whole and members:
            self._compare(members)
        return []

    def _compare(self, members: int) -> None:
        if members == self._learned:
            self._agreed = 0
            return
        self._agreed = self._agreed + 1 if members == self._candidate else 1
        self._candidate = members
        if self._agreed >= _RELEARN_AFTER:
            self._learn(members)

    def _learn(self, members: int) -> None:
        self._learned = members
        self._needed = members & ~_ANGLE_BIT if members & _QUATERNION_BIT else members
        self._agreed = 0
