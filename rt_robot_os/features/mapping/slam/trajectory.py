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
"""The pose of each scan relative to a keyframe, so that the path moves with the map."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from rt_robot_os.features.mapping.slam.transforms import composed
from rt_robot_os.features.mapping.slam.transforms import Floats

_FIRST_ROOM = 1024


class ScanTrajectory:
    """
    The last poses, each in the frame of a keyframe.

    :param most: maximum number; beyond it the older half is dropped.
    :ivar forgotten: number of dropped poses.
    """

    def __init__(self, most: int) -> None:
        self._most = max(2, most)
        self._count = self.forgotten = 0
        self._at: npt.NDArray[np.int32] = np.zeros(_FIRST_ROOM, np.int32)
        self._relative: Floats = np.zeros((_FIRST_ROOM, 3))

    def __len__(self) -> int:
        return self._count

    def append(self, keyframe: int, relative: Floats) -> None:
        """
        Append a pose.

        :param keyframe: index of a keyframe.
        :param relative: shape (3,): the pose relative to it.
        """
        if self._count == self._most:
            gone = self._most // 2
            self._at[:self._count - gone] = self._at[gone:self._count].copy()
            self._relative[:self._count - gone] = self._relative[gone:self._count].copy()
            self._count -= gone
            self.forgotten += gone
        if self._count == len(self._at):
            room = min(self._most, 2 * self._count)
            self._at = np.resize(self._at, room)
            self._relative = np.resize(self._relative, (room, 3))
        self._at[self._count], self._relative[self._count] = keyframe, relative
        self._count += 1

    def put(self, place: int, keyframe: int, relative: Floats) -> None:
        """
        Correct a pose.

        :param place: index among the stored poses.
        :param keyframe: index of a keyframe; the pose is ``relative`` to it, shape (3,).
        """
        self._at[place], self._relative[place] = keyframe, relative

    def remove_keyframe(self, index: int, successor: int, seen_from_successor: Floats) -> None:
        """
        Adapt to a keyframe that is removed from the list.

        :param successor: index, before the removal, of the keyframe that gets its poses.
        :param seen_from_successor: shape (3,): where the keyframe was.
        """
        at = self._at[:self._count]
        its = at == index
        if its.any():
            relative = self._relative[:self._count][its]
            base = np.broadcast_to(seen_from_successor, relative.shape)
            self._relative[:self._count][its] = composed(base, relative)
            at[its] = successor
        at[at > index] -= 1

    def poses(self, keyframes: Sequence[Floats]) -> Floats:
        """
        Return the poses on the map; shape (n, 3).

        :param keyframes: the poses of all keyframes.
        """
        if not self._count:
            return np.zeros((0, 3))
        bases = np.asarray(keyframes)[self._at[:self._count]]
        return composed(bases, self._relative[:self._count])
